"""Results as documents: JSON, JSON Schema and data frames from one immutable type.

A result is a frozen dataclass or a named tuple.

The list of attributes in a result's docstring describes its fields, and gives the unit
of those whose names do not end with one. `described` reads it, so that the schema, the
tables of keys in the manual and the pages of the API have the same words.

Findings are typed where they are found and worded in `jblast.report`: there a table
gives by type the function that makes its JSON. `plain` takes the values from that
function, and `schema_of` the schema from the type that it returns.
"""

import json
import math
import re
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from inspect import cleandoc
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

ABSENT = MappingProxyType({"absent": True})
"""Metadata of a field without an entry where it is None."""
HIDDEN = MappingProxyType({"hidden": True})
"""Metadata of a field without an entry."""
AMONG = MappingProxyType({"among": ()})
"""Metadata of a field whose own entries are merged into the object; None has none."""
UNITS = {
    "_pa_s": "Pa s",
    "_m_s2": "m/s2",
    "_m_s": "m/s",
    "_rad": "rad",
    "_deg": "degree",
    "_kg": "kg",
    "_pa": "Pa",
    "_px": "px",
    "_m": "m",
    "_s": "s",
    "_j": "J",
    "_k": "K",
}
"""Units at the end of names, longest first: `_m_s` must be tried before `_s`."""
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
"""By type, the function that returns the document's entry for a value."""
NO_WORDS: Words = MappingProxyType({})


def among(*names: str) -> Mapping[str, tuple[str, ...]]:
    """Return metadata of a field of which these entries alone are merged."""
    return {"among": names}


@dataclass(frozen=True)
class Answer:
    """The answer of a command, as a document."""

    words: ClassVar[Words] = NO_WORDS
    """Types that it has in words."""

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it; null is what is not a finite number."""
        return entries(self, self.words)

    def to_json(self) -> str:
        """Return it as the text of a document."""
        return to_json(self.to_dict())


@dataclass(frozen=True)
class Document(Answer):
    """An answer with the version of its schema.

    Attributes:
        schema: 1, the version of its schema.
    """

    schema: Literal[1] = field(default=1, init=False)


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


def to_json(document: Mapping[str, Any]) -> str:
    """Return the text of a document; a number that is not finite raises ValueError."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def to_frame(results: Iterable[Any], words: Words = NO_WORDS) -> Any:
    """Return results of one type as a `pandas.DataFrame`, a row each.

    Entries of an entry have columns of their own, `air_arrival_s.value`. Units stand in
    `frame.attrs["units"]`, by the name of the field.
    """
    import pandas

    rows = list(results)
    frame = pandas.json_normalize([entries(row, words) for row in rows])
    said = described(type(rows[0])) if rows else {}
    frame.attrs["units"] = {name: unit for name, (_, unit) in said.items() if unit}
    return frame


def described(cls: type) -> dict[str, tuple[str, str]]:
    """Return description and unit of each field of a result."""
    found: dict[str, tuple[str, str]] = {}
    for base in reversed(cls.__mro__[:-1]):
        _, _, listed = cleandoc(base.__doc__ or "").partition("\nAttributes:\n")
        listed = re.split(r"\n(?=\S)", listed)[0]  # up to the next section
        for name, text in re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", listed, re.M):
            said = " ".join(text.split()).rstrip(".")
            unit = re.search(r"\[([^]]+)\]$", said)
            ends = (unit for end, unit in UNITS.items() if name.endswith(end))
            found[name] = (said, unit[1] if unit else next(ends, ""))
    return found


def schema_of(
    hint: Any,
    words: Words = NO_WORDS,
    names: Mapping[str, Any] | None = None,
) -> Schema:
    """Return the JSON Schema of a type: of a result, or of what a field of one holds.

    Args:
        hint: The type.
        words: Functions that word some types; their annotations give the schema.
        names: Types that classes import for type checkers alone, by name.
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
        held = schema_of(inner[1], words, names)
        return {"type": "object", "additionalProperties": held}
    if origin in (tuple, Sequence):
        items = {"type": "array", "items": schema_of(inner[0], words, names)}
        if origin is Sequence or inner[1] is ...:
            return items
        return items | {"minItems": len(inner), "maxItems": len(inner)}
    return {"type": "array", "items": NUMBER}  # an array, by its shape


def _schema_of_class(
    cls: type, words: Words, names: Mapping[str, Any] | None
) -> Schema:
    """Return the schema of what `entries` makes of a result."""
    words = {**words, **cls.words} if issubclass(cls, Answer) else words
    hints, said = get_type_hints(cls, localns=names), described(cls)
    properties: dict[str, Schema] = {}
    required: list[str] = []
    others: Any = False
    for name, meta in _fields(cls).items():
        hint = hints[name]
        if meta.get("hidden"):
            continue
        kinds = [kind for kind in get_args(hint) if kind is not type(None)]
        is_optional = type(None) in get_args(hint)
        held = Union[*kinds] if is_optional else hint
        if "among" not in meta:
            is_absent, key = meta.get("absent"), meta.get("key", name)
            schema = schema_of(held if is_absent else hint, words, names)
            properties[key] = schema | {"description": said[name][0]}
            required += [] if is_absent else [key]
        elif _is_result(held):
            own = _schema_of_class(held, words, names)
            picked = meta["among"] or own["properties"]
            properties |= {key: own["properties"][key] for key in picked}
            required += [k for k in own["required"] if k in picked and not is_optional]
        else:
            others = schema_of(held, words, names)["additionalProperties"]
    return object_schema(properties) | {
        "additionalProperties": others,
        "required": required,
    }


def object_schema(properties: Mapping[str, Schema]) -> Schema:
    """Return the schema of an object with these entries, all of them required."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(properties),
        "additionalProperties": False,
    }


def _is_result(cls: Any) -> bool:
    """Return whether values of a type have fields: a dataclass, or a named tuple."""
    return isinstance(cls, type) and (is_dataclass(cls) or hasattr(cls, "_fields"))


def _fields(cls: Any) -> dict[str, Mapping[str, Any]]:
    """Return the metadata of each field."""
    if is_dataclass(cls):
        return {one.name: one.metadata for one in fields(cls)}
    return {name: {} for name in cls._fields}


def _wording(cls: type, words: Words) -> Callable[[Any], Any] | None:
    """Return the wording of a type, or of the nearest type that it extends."""
    return next((words[base] for base in cls.__mro__ if base in words), None)
