"""A scene file with what was tuned in it: as it was, but for those numbers."""

import copy
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jblast.parameter_table import CLOCK_OFFSET
from jblast.report.tune.words import key_of
from jblast.scene.reader.priors import LISTS

NEUTRAL = {"filter_hz": "none", "threshold": 0.2}
"""What stands in a list beside a number that is written alone."""


def tuned_document(
    document: Mapping[str, Any], values: Mapping[str, float], sensor: str | None
) -> dict[str, Any]:
    """Return a scene's tables with some numbers replaced.

    Args:
        document: The tables.
        values: By name, as after `--free`.
        sensor: Name of the sensor that recorded.
    """
    tuned = copy.deepcopy(dict(document))
    for name, value in values.items():
        key, label = key_of(name), name.partition(".")[2]
        written = key.name
        if name.startswith(CLOCK_OFFSET):
            named = [one for one in tuned.get("sensor", []) if one["name"] == label]
            entry = named[0] if named else _named(tuned, "clock", label)
            written = "clock_offset_s" if named else "offset_s"
        elif key.table == "sensor":
            entry = _named(tuned, "sensor", sensor or "")
        elif key.table == "charge":
            entry = _charge(tuned, label)
        else:
            entry = tuned.setdefault(key.table, {})
        if key.index is None:
            entry[written] = value
            continue
        count = LISTS[written].count(",") + 1
        held = entry.get(written, NEUTRAL.get(written, 0.0))
        held = list(held) if isinstance(held, list) else [held] * count
        held[key.index] = value
        entry[written] = held
    return tuned


def scene_text(document: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
    """Return a scene's tables as TOML."""
    lines = [f"# {line}" for line in comments]
    tables, arrays = [], []
    for key, value in document.items():
        if isinstance(value, Mapping):
            tables.append((key, value))
        elif isinstance(value, list):
            arrays.append((key, value))
        else:
            lines.append(f"{_word(key)} = {_value(value)}")
    for key, entry in tables:
        lines += ["", f"[{_word(key)}]", *_entries(entry)]
    for key, entries in arrays:
        for entry in entries:
            lines += ["", f"[[{_word(key)}]]", *_entries(entry)]
    return "\n".join(lines) + "\n"


def moved(document: Mapping[str, Any], source: str, directory: Path) -> dict[str, Any]:
    """Return a scene's tables, files in them named as from another folder."""
    tuned = copy.deepcopy(dict(document))
    ambient = tuned.get("ambient", {})
    if "file" in ambient:
        file = Path(source).parent / ambient["file"]
        ambient["file"] = Path(os.path.relpath(file, directory)).as_posix()
    return tuned


def _named(document: dict[str, Any], table: str, name: str) -> dict[str, Any]:
    entries = document.setdefault(table, [])
    for entry in entries:
        if entry["name"].strip() == name:
            return entry
    entries.append({"name": name})
    return entries[-1]


def _charge(document: dict[str, Any], name: str) -> dict[str, Any]:
    charges = document.setdefault("charge", {})
    if isinstance(charges, dict):
        return charges
    if not name:
        return charges[0]
    return next(one for one in charges if one["name"].strip() == name)


def _entries(entry: Mapping[str, Any]) -> list[str]:
    return [f"{_word(key)} = {_value(value)}" for key, value in entry.items()]


def _word(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    return key if plain.isascii() and plain.isalnum() else _quoted(key)


def _value(value: Any) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_word(k)} = {_value(v)}" for k, v in value.items())
        return f"{{ {inner} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return repr(float(f"{value:.10g}")) if isinstance(value, float) else str(value)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    shown = "".join(
        char if char >= " " and char != "\x7f" else f"\\u{ord(char):04x}"
        for char in escaped
    )
    return f'"{shown}"'
