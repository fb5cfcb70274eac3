"""Results as documents: JSON and JSON Schema from one immutable type.

A result is a frozen dataclass or a named tuple.

The list of attributes in a result's docstring describes its fields. `described` reads
it, so that the schema, the tables of keys in the manual and the pages of the API have
the same text.

A `Note` is a fact beside an answer, as numbers without words: `report.messages` has one
sentence for each kind. A table of `jblast.report` maps such types to the function that
makes their JSON. `plain` takes the values from that function, and `schema_of` takes the
schema from its return type.
"""

import json
import math
import re
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from inspect import cleandoc
from types import MappingProxyType
from typing import (
    Any,
    ClassVar,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

ABSENT = MappingProxyType({"absent": True})
"""Metadata of a field without an entry where it is None."""
HIDDEN = MappingProxyType({"hidden": True})
"""Metadata of a field without an entry."""
AMONG = MappingProxyType({"among": ()})
"""Metadata of a field whose entries are merged into the object; None adds none."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"
NUMBER = {"type": ["number", "null"]}
"""An infinite or unknown number is null."""
NULL = {"type": "null"}
SIMPLE: dict[Any, dict[str, Any]] = {
    float: NUMBER,
    int: {"type": "integer"},
    bool: {"type": "boolean"},
    str: {"type": "string"},
    type(None): NULL,
    Any: {},
}
Schema = dict[str, Any]
Words = Mapping[type, Callable[[Any], Any]]
"""Function that returns the document's entry for a value, by type."""
NO_WORDS: Words = MappingProxyType({})

T = TypeVar("T")
Level = Literal["problem", "warning", "assumption", "conversion"]


@dataclass(frozen=True)
class Note:
    """A fact beside an answer.

    Attributes:
        kind: Name of its sentence.
        level: "problem" for an answer that must not be used as it is (exit code 4), a
            "warning", an "assumption", or a "conversion" of the input.
        numbers: Numbers and names of the sentence, by name.
    """

    kind: str
    level: Level
    numbers: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.numbers[name]


def problem(kind: str, **numbers: Any) -> Note:
    """Return a note on an answer that must not be used as it is."""
    return Note(kind, "problem", numbers)


def warning(kind: str, **numbers: Any) -> Note:
    """Return a note on a possible fault."""
    return Note(kind, "warning", numbers)


def assumption(kind: str, **numbers: Any) -> Note:
    """Return a note on what an answer takes as given."""
    return Note(kind, "assumption", numbers)


def conversion(kind: str, **numbers: Any) -> Note:
    """Return a note on how an input was read."""
    return Note(kind, "conversion", numbers)


def among(*names: str) -> Mapping[str, tuple[str, ...]]:
    """Return metadata of a field of which only these entries are merged."""
    return {"among": names}


@dataclass(frozen=True)
class Document:
    """The answer of a command as a document, with the version of its schema.

    Attributes:
        schema: 1, the version of its schema.
    """

    words: ClassVar[Words] = NO_WORDS
    """Types that the document contains as text."""
    schema: Literal[1] = field(default=1, init=False)

    def to_dict(self) -> dict[str, Any]:
        """Return it as values for JSON, with null for numbers that are not finite."""
        return entries(self, self.words)

    def to_json(self) -> str:
        """Return it as the text of a JSON document."""
        return to_json(self.to_dict())


def filled(cls: type[T], *sources: Any, **given: Any) -> T:
    """Return a result with each field from a value, or from the first source with it.

    Args:
        cls: Type of the result, a dataclass or named tuple.
        *sources: Objects or mappings, searched in order for the name of a field.
        **given: Values of fields, before those of all sources.

    Raises:
        TypeError: A field without a default is in no source, or a value has no field.
    """
    values = dict(given)
    for name in _own_fields(cls):
        for source in sources if name not in values else ():
            if isinstance(source, Mapping) and name in source:
                values[name] = source[name]
                break
            if not isinstance(source, Mapping) and hasattr(source, name):
                values[name] = getattr(source, name)
                break
    return cls(**values)


def plain(value: Any, words: Words = NO_WORDS) -> Any:
    """Return values for JSON: results as objects, NaN and infinities as None."""
    if worded := _wording(type(value), words):
        return plain(worded(value), words)
    if hasattr(value, "to_dict"):
        return plain(value.to_dict(), words)
    if _is_result(type(value)):
        return entries(value, words)
    if isinstance(value, Mapping):
        return {str(key): plain(entry, words) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry, words) for entry in value]
    if isinstance(value, (str, bool, int)) or value is None:
        return value
    if isinstance(value, float):
        # `float`, as NumPy numbers are subclasses of it with another repr.
        return float(value) if math.isfinite(value) else None
    return plain(np.asarray(value).tolist(), words)


def entries(result: Any, words: Words = NO_WORDS) -> dict[str, Any]:
    """Return the fields of a result by name, as values for JSON."""
    found: dict[str, Any] = {}
    for name, meta in _fields(type(result)).items():
        value = getattr(result, name)
        if "among" in meta:
            is_result = _is_result(type(value))
            own = entries(value, words) if is_result else plain(value) or {}
            found |= {key: own[key] for key in meta["among"] or own if own}
        elif not meta.get("hidden") and (value is not None or not meta.get("absent")):
            found[meta.get("key", name)] = plain(value, words)
    return found


def restored(hint: Any, value: Any) -> Any:
    """Return the result of a type with these entries: the inverse of `entries`.

    Args:
        hint: The type, a result or a field of one.
        value: Values as read from JSON; a number that is null becomes NaN.
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in inner:
            return None
        kinds = [one for one in inner if one is not type(None)]
        return restored(next(one for one in kinds if _fits(one, value)), value)
    if _is_result(hint):
        hints, metas, given = get_type_hints(hint), _fields(hint), {}
        own = {meta.get("key", name) for name, meta in metas.items()}
        rest = {key: one for key, one in value.items() if key not in own}
        for name in _own_fields(hint):
            among = metas[name].get("among")
            if among:  # a document has these entries of the result only
                given[name] = {key: rest[key] for key in among if key in rest}
                continue
            key = metas[name].get("key", name)
            given[name] = restored(hints[name], rest if among == () else value.get(key))
        if not is_dataclass(hint):
            return hint(**given)
        cls: Any = hint
        made = object.__new__(cls)  # a constructor may check the types
        for name, one in given.items():
            object.__setattr__(made, name, one)
        return made
    if origin is Mapping:
        return {key: restored(inner[1], one) for key, one in value.items()}
    if origin in (tuple, Sequence):
        of = inner if len(inner) == len(value) and ... not in inner else inner[:1]
        return tuple(restored(of[n % len(of)], one) for n, one in enumerate(value))
    return math.nan if hint is float and value is None else value


def _fits(hint: Any, value: Any) -> bool:
    """Return whether a type of a union may have a value."""
    if not _is_result(hint):
        return isinstance(value, Mapping) == (get_origin(hint) is Mapping)
    return isinstance(value, Mapping) and all(
        name in value or "among" in meta or meta.get("absent")
        for name, meta in _fields(hint).items()
    )


def to_json(document: Mapping[str, Any]) -> str:
    """Return the text of a document.

    Raises:
        ValueError: A number is not finite.
    """
    # NaN and infinity are no JSON; `plain` has replaced them by null.
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def described(cls: type) -> dict[str, str]:
    """Return the description of each field of a result."""
    found: dict[str, str] = {}
    # Fields of base classes first, as in the dataclass itself.
    for base in reversed(cls.__mro__[:-1]):
        _, _, listed = cleandoc(base.__doc__ or "").partition("\nAttributes:\n")
        listed = re.split(r"\n(?=\S)", listed)[0]  # up to the next section
        for name, text in re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", listed, re.M):
            found[name] = " ".join(text.split()).rstrip(".")
    return found


def schema_of(
    hint: Any,
    words: Words = NO_WORDS,
    names: Mapping[str, Any] | None = None,
) -> Schema:
    """Return the JSON Schema of a type: of a result, or of a field of a result.

    Args:
        hint: The type.
        words: Functions that word some types; their annotations give the schema.
        names: Types that classes import for type checkers only, by name.

    Raises:
        TypeError: JSON has no form of the type.
    """
    if hint in SIMPLE:
        return SIMPLE[hint]
    origin, inner = get_origin(hint), get_args(hint)
    if isinstance(hint, type) and (worded := _wording(hint, words)):
        return schema_of(get_type_hints(worded, localns=names)["return"], words, names)
    if _is_result(hint):
        return _schema_of_class(hint, words, names)
    if origin in (Union, types.UnionType):
        return {"anyOf": [schema_of(one, words, names) for one in inner]}
    if origin is Literal:
        return {"const": inner[0]} if inner == (1,) else {"enum": list(inner)}
    if origin is Mapping:
        values = schema_of(inner[1], words, names)
        return {"type": "object", "additionalProperties": values}
    if origin in (tuple, Sequence):
        items = {"type": "array", "items": schema_of(inner[0], words, names)}
        if origin is Sequence or inner[1] is ...:
            return items
        return items | {"minItems": len(inner), "maxItems": len(inner)}
    if not hasattr(hint, "array_type"):  # of jaxtyping's annotations
        raise TypeError(f"{hint}: expected a type with a form in JSON")
    values: Schema = NUMBER
    for _ in hint.dims:
        values = {"type": "array", "items": values}
    return values


def _schema_of_class(
    cls: type, words: Words, names: Mapping[str, Any] | None
) -> Schema:
    """Return the schema of a result as returned by `entries`."""
    words = {**words, **cls.words} if issubclass(cls, Document) else words
    hints, texts = get_type_hints(cls, localns=names), described(cls)
    properties: dict[str, Schema] = {}
    required: list[str] = []
    others: Any = False
    for name, meta in _fields(cls).items():
        hint = hints[name]
        if meta.get("hidden"):
            continue
        kinds = [kind for kind in get_args(hint) if kind is not type(None)]
        is_optional = type(None) in get_args(hint)
        value: Any = Union[*kinds] if is_optional else hint  # type: ignore
        if "among" not in meta:
            is_absent, key = meta.get("absent"), meta.get("key", name)
            schema = schema_of(value if is_absent else hint, words, names)
            properties[key] = schema | {"description": texts[name]}
            required += [] if is_absent else [key]
        elif _is_result(value):
            own = _schema_of_class(value, words, names)
            picked = meta["among"] or own["properties"]
            properties |= {key: own["properties"][key] for key in picked}
            required += [k for k in own["required"] if k in picked and not is_optional]
        else:
            others = schema_of(value, words, names)["additionalProperties"]
    return {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": others,
    }


def _is_result(cls: Any) -> bool:
    """Return whether a type has fields: a dataclass or a named tuple."""
    return isinstance(cls, type) and (is_dataclass(cls) or hasattr(cls, "_fields"))


def _fields(cls: Any) -> dict[str, Mapping[str, Any]]:
    """Return the metadata of each field."""
    if is_dataclass(cls):
        return {one.name: one.metadata for one in fields(cls)}
    return {name: {} for name in cls._fields}


def _own_fields(cls: Any) -> list[str]:
    """Return the names of the fields that a constructor takes."""
    if is_dataclass(cls):
        return [one.name for one in fields(cls) if one.init]
    return list(cls._fields)


def _wording(cls: type, words: Words) -> Callable[[Any], Any] | None:
    """Return the wording of a type, or of its nearest base class."""
    return next((words[base] for base in cls.__mro__ if base in words), None)
