"""A JSON Schema of the scene file, for editors and programs, from the reader's tables.

It is wider than the reader: keys that exclude one another, unique names and the names
of laws are checked by the reader only.
"""

from collections.abc import Iterable
from typing import Any

from jblast.parameters import CLOCK, PARAMETERS, PLACE_LIMITS, Bounds
from jblast.quantities import ADDITIVE, QUANTITIES
from jblast.results import DIALECT
from jblast.scene.camera import MOUNTS
from jblast.scene.charge import BURSTS
from jblast.scene.random_blasts import ABOUT, WORLD_NUMBERS
from jblast.scene.reader.random_blasts import MAX_BLASTS
from jblast.scene.reader.scene import MAX_SLOPE_DB_OCTAVE
from jblast.scene.reader.tables import (
    GROUND_PATHS,
    KEYS,
    LISTS,
    PRIORS,
    SATURATIONS,
    VEHICLE_MODELS,
    keys_of,
)
from jblast.scene.sensor import FEWEST_BITS, MOST_BITS
from jblast.scene.sensor_kinds import SENSOR_KINDS, all_instrument_keys, own_keys

Schema = dict[str, Any]
NUMBER: Schema = {"type": "number"}
INTEGER: Schema = {"type": "integer", "minimum": 1}
POSITIVE = NUMBER | {"exclusiveMinimum": 0}
NOT_NEGATIVE = NUMBER | {"minimum": 0}
TEXT: Schema = {"type": "string"}
PERCENT = TEXT | {"pattern": r"^\s*[0-9.]+([eE][+-]?[0-9]+)?\s*%\s*$"}
TRUTH: Schema = {"type": "boolean"}
SEVERAL = ("charge", "sensor", "clock")
"""Tables of which a file may have several."""
ONE_FOR_BOTH = ("focal_px", "threshold")
"""Lists of two for which one number may stand."""


def listed(items: Schema, count: int) -> Schema:
    """Return the schema of a list of `count` items."""
    return {"type": "array", "items": items, "minItems": count, "maxItems": count}


def table(properties: dict[str, Schema], **more: Any) -> Schema:
    """Return the schema of a table without further keys."""
    whole = {"type": "object", "properties": properties, "additionalProperties": False}
    return whole | more


def words(values: Iterable[str]) -> Schema:
    """Return the schema of one of a few words."""
    return {"enum": [*values]}


RECORDS = {name: POSITIVE if name in ADDITIVE else PERCENT for name in QUANTITIES}
SLOPE = NUMBER | {"minimum": -MAX_SLOPE_DB_OCTAVE, "maximum": MAX_SLOPE_DB_OCTAVE}
BITS = {"type": "integer", "minimum": FEWEST_BITS, "maximum": MOST_BITS}
OF_SENSORS = (*all_instrument_keys(), *own_keys())
KNOWN: dict[tuple[str, str], Schema] = {
    ("", "schema"): {"const": 1},
    ("sensor", "records"): table(RECORDS),
    ("sensor", "times_s"): {"type": "array", "items": NUMBER, "minItems": 1},
    ("sensor", "bits"): {"anyOf": [BITS, {"const": "float"}]},
    ("sensor", "filter_hz"): listed({"anyOf": [POSITIVE, {"const": "none"}]}, 2),
    ("ambient", "slope_db_octave"): SLOPE,
    ("world", "count"): INTEGER | {"maximum": MAX_BLASTS},
    ("world", "probability"): POSITIVE | {"maximum": 1},
    ("region", "box"): listed(listed(NUMBER, 3), 2),
} | {
    (table, key): schema
    for schema, table, keys in (
        (words(BURSTS), "charge", ("burst",)),
        (words(GROUND_PATHS), "ground", ("path",)),
        (words(SENSOR_KINDS), "sensor", ("kind",)),
        (words(SATURATIONS), "sensor", ("saturation",)),
        (words(MOUNTS), "sensor", ("mount",)),
        (words(MOUNTS), "camera", ("mount",)),
        (words(VEHICLE_MODELS), "vehicle", ("model",)),
        (words(ABOUT), "world", ("about",)),
        (words(ABOUT), "region", ("about",)),
        (TEXT, "charge", ("name", "explosive")),
        (TEXT, "sensor", ("name",)),
        (TEXT, "clock", ("name",)),
        (TEXT, "ambient", ("file",)),
        (TEXT, "vehicle", ("mission",)),
        (TEXT, "law", QUANTITIES),
        (TRUTH, "air", ("absorption",)),
        (TRUTH, "control", ("integral",)),
        (TRUTH, "law", ("scatter",)),
        (INTEGER, "camera", ("width", "height")),
        (NOT_NEGATIVE, "air", ("absorption_scale",)),
        (NOT_NEGATIVE, "ambient", ("level_pa",)),
        (POSITIVE, "ambient", ("full_scale_pa", "height_m")),
        (POSITIVE, "camera", ("daylight_lux",)),
        (POSITIVE, "world", ("tick_s",)),
        (POSITIVE, "sensor", (k for k in OF_SENSORS if k.startswith(("rate", "full")))),
        (NOT_NEGATIVE, "sensor", (k for k in OF_SENSORS if k[:4] in ("nois", "bias"))),
    )
    for key in keys
}
"""Schemas of the keys that hold neither a number nor a list of numbers."""


def scene_schema() -> Schema:
    """Return the schema of a scene file."""
    tables = {key: _table(key) for key in KEYS[""] if key != "schema"}
    head = {"$schema": DIALECT, "title": "A scene of jblast"}
    return head | table(tables | {"schema": KNOWN["", "schema"]})


def _table(name: str) -> Schema:
    """Return the schema of a table, or of a list of them if there may be several."""
    one = table({key: _key(name, key) for key in keys_of(name)})
    if name not in SEVERAL:
        return one
    many = {"type": "array", "items": one}
    return many if name != "charge" else {"anyOf": [one, many]}


def _key(table: str, key: str) -> Schema:
    """Return the schema of a key."""
    if (table, key) in KNOWN:
        return KNOWN[table, key]
    if key in KEYS or key == "region_m":
        return _table(key.removesuffix("_m"))
    if table == "world":
        one, _, prior = _uncertain(WORLD_NUMBERS[key].bounds)["anyOf"]
        return {"anyOf": [one, listed(NUMBER, 2), prior]}
    if (table, key) == ("clock", "offset_s"):
        return _uncertain(CLOCK.bounds)
    if table == "place":
        return NUMBER | _limits(PLACE_LIMITS[key])
    numbers = [
        one
        for one in (*PARAMETERS.values(), CLOCK)
        if (one.key.table, one.key.name) == (table, key)
    ]
    items = [_uncertain(one.bounds) for one in numbers]
    if numbers and numbers[0].key.index is None:
        return items[0]
    if numbers:
        length = {"minItems": len(items), "maxItems": len(items)}
        return {"type": "array", "prefixItems": items, **length}
    if key in LISTS:
        several = listed(NUMBER, LISTS[key].count(",") + 1)
        return {"anyOf": [NUMBER, several]} if key in ONE_FOR_BOTH else several
    return NUMBER


def _uncertain(bounds: Bounds) -> Schema:
    """Return the schema of a number that is fixed, free, or has a prior."""
    pair = listed(NUMBER, 2)
    prior = table(dict.fromkeys(PRIORS, pair), minProperties=1, maxProperties=1)
    return {"anyOf": [NUMBER | _limits(bounds), {"const": "free"}, prior]}


def _limits(bounds: Bounds) -> dict[str, float]:
    """Return bounds as keywords of a schema."""
    limits = {
        "exclusiveMinimum": bounds.above,
        "minimum": bounds.at_least,
        "maximum": bounds.at_most,
    }
    return {word: bound for word, bound in limits.items() if abs(bound) != float("inf")}
