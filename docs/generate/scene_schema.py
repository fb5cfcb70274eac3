"""A JSON Schema of the scene file, for editors and programs, from its table of keys.

It is wider than the reader: keys that exclude one another, unique names and the names
of laws are checked by the reader only.
"""

from functools import singledispatch
from typing import Any

from jblast.parameters import Bounds
from jblast.results import DIALECT
from jblast.scene import values
from jblast.scene.keys import KEYS, SEVERAL, WITHIN, keys_of
from jblast.scene.uncertain import PRIORS

Schema = dict[str, Any]
NUMBER: Schema = {"type": "number"}
TEXT: Schema = {"type": "string"}
PERCENT = TEXT | {"pattern": r"^\s*[0-9.]+([eE][+-]?[0-9]+)?\s*%\s*$"}


def scene_schema() -> Schema:
    """Return the schema of a scene file."""
    tables = {name: table(name) for name in KEYS if name not in WITHIN}
    several = {name: {"type": "array", "items": tables[name]} for name in SEVERAL}
    either = {"charge": {"anyOf": [tables["charge"], several["charge"]]}}
    head = {"$schema": DIALECT, "title": "A scene of jblast"}
    return head | closed({"schema": {"const": 1}} | tables | several | either)


def table(name: str) -> Schema:
    """Return the schema of a table."""
    return closed({name: schema_of(key.value) for name, key in keys_of(name).items()})


def closed(properties: dict[str, Schema], **more: Any) -> Schema:
    """Return the schema of a table without further keys."""
    whole = {"type": "object", "properties": properties, "additionalProperties": False}
    return whole | more


def listed(items: Schema, count: int) -> Schema:
    """Return the schema of a list of `count` items."""
    return {"type": "array", "items": items, "minItems": count, "maxItems": count}


def limited(bounds: Bounds) -> Schema:
    """Return the schema of a number with bounds."""
    limits = {
        "exclusiveMinimum": bounds.above,
        "minimum": bounds.at_least,
        "maximum": bounds.at_most,
    }
    finite = {word: at for word, at in limits.items() if abs(at) != float("inf")}
    return NUMBER | finite


def prior() -> Schema:
    """Return the schema of a prior."""
    pairs = dict.fromkeys(PRIORS, listed(NUMBER, 2))
    return closed(pairs, minProperties=1, maxProperties=1)


@singledispatch
def schema_of(value: Any) -> Schema:
    """Return the schema of a kind of value: text, if no other is registered."""
    return TEXT


@schema_of.register
def _(value: values.Number) -> Schema:
    one = limited(value.bounds)
    if value.free:
        return {"anyOf": [one, {"const": "free"}, prior()]}
    return {"anyOf": [one, listed(NUMBER, 2), prior()]} if value.sampled else one


@schema_of.register
def _(value: values.Numbers) -> Schema:
    one = schema_of(value.of)
    item = {"anyOf": [one, {"const": value.word}]} if value.word else one
    if "[" not in value.form:
        return {"type": "array", "items": item, "minItems": 1}
    several = listed(item, value.form.count(",") + 1)
    return {"anyOf": [one, several]} if value.repeated else several


@schema_of.register
def _(value: values.Whole) -> Schema:
    whole = {"type": "integer", "minimum": value.low, "maximum": value.high}
    return {"anyOf": [whole, {"const": value.word}]} if value.word else whole


@schema_of.register
def _(value: values.Word) -> Schema:
    # words that are read in other spellings, too, are any text
    return TEXT if value.spelt else {"enum": [*value.words]}


@schema_of.register
def _(value: values.Truth) -> Schema:
    return {"type": "boolean"}


@schema_of.register
def _(value: values.Table) -> Schema:
    return closed({key.name: schema_of(key.value) for key in value.keys})


@schema_of.register
def _(value: values.Share) -> Schema:
    return PERCENT
