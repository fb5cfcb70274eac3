"""The keys of answers as tables, from their schemas."""

from collections.abc import Mapping
from typing import Any

from docs.generate import answer_schemas


def fit() -> str:
    """Write the keys of a fit's answer."""
    return keys_of(answer_schemas.fit())


def pick() -> str:
    """Write the keys of what was picked."""
    return keys_of(answer_schemas.pick())


def one_pick() -> str:
    """Write the keys of one pick."""
    return keys_of(answer_schemas.pick()["properties"]["picks"]["items"])


def bound() -> str:
    """Write the keys of a bound's answer."""
    return keys_of(answer_schemas.bound())


def choose() -> str:
    """Write the keys of a choice."""
    return keys_of(answer_schemas.choose())


def calc() -> str:
    """Write the keys of a calculation."""
    return keys_of(answer_schemas.calc())


def calc_inputs() -> str:
    """Write the keys of what a calculation was made with."""
    return keys_of(answer_schemas.calc()["properties"]["inputs"])


def render() -> str:
    """Write the keys of a film."""
    return keys_of(answer_schemas.render())


def events() -> str:
    """Write the keys of the events of frames."""
    return keys_of(answer_schemas.events())


def discover() -> str:
    """Write the keys of a discovery."""
    return keys_of(answer_schemas.discover())


def fly() -> str:
    """Write the keys of flights."""
    return keys_of(answer_schemas.fly())


def check() -> str:
    """Write the keys of a check's answer."""
    return keys_of(answer_schemas.check())


def stability() -> str:
    """Write the keys of each failure mode."""
    areas = answer_schemas.stability()["properties"]["areas"]
    return keys_of(areas["additionalProperties"]["items"])


def keys_of(schema: Mapping[str, Any]) -> str:
    """Write a row for each key: what it holds, and the keys of what it holds."""
    rows = []
    for key, value in schema["properties"].items():
        if key == "schema":
            rows.append("| `schema` | 1 |")
            continue
        told = value.get("description", "").rstrip(".")
        rows.append(f"| `{key}` | {'; '.join(filter(None, [told, _within(value)]))} |")
    return "\n".join(["| key | what it holds |", "|---|---|", *rows])


def _within(schema: Mapping[str, Any]) -> str:
    """Name the keys of entries: of one, of each of a list, or of each by its name."""
    if "properties" in schema:
        return ", ".join(f"`{key}`" for key in schema["properties"])
    for word, how in (("items", "each with "), ("additionalProperties", "by name ")):
        inner = schema.get(word)
        if isinstance(inner, Mapping) and (keys := _within(inner)):
            return keys if keys.startswith(how) else how + keys
    return next(filter(None, map(_within, schema.get("anyOf", ()))), "")
