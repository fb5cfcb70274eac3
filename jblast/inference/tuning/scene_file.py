"""Scene files with tuned numbers, which retain the user's comments."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit

import jblast
from jblast.inference.tuning.unknowns import row_named
from jblast.parameters import CLOCK_OFFSET
from jblast.scene.keys import keys_of

NEUTRAL = {"filter_hz": "none", "threshold": 0.2}
"""Other entries of a list in the scene file, if only one of them is tuned."""


def tuned_scene(
    scene: str, out: str, change: Callable[[Any], None], comments: Sequence[str]
) -> str:
    """Return a scene file with changed numbers, which retains the user's comments.

    Args:
        scene: The scene's file, which is read again.
        out: Folder of the new file, from which other files are named.
        change: Function that changes the tables.
        comments: Comments at the beginning; the first names what was tuned.
    """
    tables = tomlkit.parse(Path(scene).read_text("utf-8"))
    change(tables)
    ambient = tables.get("ambient", {})
    if "file" in ambient:
        file = Path(scene).parent / ambient["file"]
        ambient["file"] = Path(os.path.relpath(file, out)).as_posix()
    comments = [f"tuned by jblast {jblast.__version__}: {comments[0]}", *comments[1:]]
    return "".join(f"# {line}\n" for line in comments) + tomlkit.dumps(tables)


def put_values(tables: Any, values: Mapping[str, float], sensor: str | None) -> Any:
    """Replace numbers in the tables of a scene, and return the tables.

    Args:
        tables: The tables, of `tomllib` or of `tomlkit`.
        values: New values, by names as in `--free`.
        sensor: Name of the recording sensor.
    """
    for name, value in values.items():
        key, label = row_named(name).key, name.partition(".")[2]
        written = key.name
        if name.startswith(CLOCK_OFFSET):
            is_sensor = any(one["name"] == label for one in tables.get("sensor", []))
            # the clock of a single sensor is an entry of the sensor; a clock that
            # several share has a table of its own
            entry = _named(tables, "sensor" if is_sensor else "clock", label)
            written = "clock_offset_s" if is_sensor else "offset_s"
        elif key.table == "sensor":
            entry = _named(tables, "sensor", sensor or "")
        elif isinstance(tables.get(key.table), list):
            # several [[charge]]; without a name the first is meant
            entry = _named(tables, key.table, label) if label else tables[key.table][0]
        else:
            tables.setdefault(key.table, {})
            entry = tables[key.table]
        if key.index is not None:
            old = entry.get(written, NEUTRAL.get(written, 0.0))
            # a scene may have one number for both entries of a list
            count = keys_of(key.table)[written].value.form.count(",") + 1
            parts = list(old) if isinstance(old, list) else [old] * count
            entry[written] = [*parts[: key.index], value, *parts[key.index + 1 :]]
        else:
            entry[written] = value
    return tables


def _named(tables: Any, table: str, name: str) -> Any:
    """Return the entry of a list of tables with a name, which is added if missing."""
    entries = tables.get(table, [])
    for entry in entries:
        if entry["name"].strip() == name:
            return entry
    if entries:
        entries.append({"name": name})
    else:
        tables[table] = [{"name": name}]
    return tables[table][-1]
