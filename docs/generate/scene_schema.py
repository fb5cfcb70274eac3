"""A JSON Schema of the scene file, for editors and programs, from the reader's tables.

It is wider than the reader in what only the reader can know: which keys exclude one
another, whether names are unique, whether a law of that name exists.
"""

from typing import Any

from jblast.parameters import CLOCK, PARAMETERS, PLACE_LIMITS, Bounds
from jblast.quantities import ADDITIVE, QUANTITIES
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

NUMBER = {"type": "number"}
POSITIVE = {"type": "number", "exclusiveMinimum": 0}
NOT_NEGATIVE = {"type": "number", "minimum": 0}
TEXT = {"type": "string"}
PERCENT = {"type": "string", "pattern": r"^\s*[0-9.]+([eE][+-]?[0-9]+)?\s*%\s*$"}
TRUTH = {"type": "boolean"}
SEVERAL = ("charge", "sensor", "clock")
"""Tables of which a file may have several."""
ONE_FOR_BOTH = ("focal_px", "threshold")
"""Lists of two for which one number may stand."""
KNOWN: dict[tuple[str, str], dict[str, Any]] = {
    ("", "schema"): {"const": 1},
    ("charge", "burst"): {"enum": list(BURSTS)},
    ("ground", "path"): {"enum": list(GROUND_PATHS)},
    ("sensor", "kind"): {"enum": list(SENSOR_KINDS)},
    ("sensor", "times_s"): {"type": "array", "items": NUMBER, "minItems": 1},
    ("sensor", "records"): {
        "type": "object",
        "properties": {
            quantity: POSITIVE if quantity in ADDITIVE else PERCENT
            for quantity in QUANTITIES
        },
        "additionalProperties": False,
    },
    **{
        ("sensor", key): POSITIVE
        for key in (*all_instrument_keys(), *own_keys())
        if key.startswith(("rate", "full_scale"))
    },
    **{
        ("sensor", key): NOT_NEGATIVE
        for key in (*all_instrument_keys(), *own_keys())
        if key.startswith(("noise", "bias"))
    },
    ("sensor", "bits"): {
        "anyOf": [
            {"type": "integer", "minimum": FEWEST_BITS, "maximum": MOST_BITS},
            {"const": "float"},
        ]
    },
    ("sensor", "filter_hz"): {
        "type": "array",
        "items": {"anyOf": [POSITIVE, {"const": "none"}]},
        "minItems": 2,
        "maxItems": 2,
    },
    ("sensor", "saturation"): {"enum": list(SATURATIONS)},
    ("ambient", "file"): TEXT,
    ("ambient", "level_pa"): NOT_NEGATIVE,
    ("ambient", "slope_db_octave"): {
        "type": "number",
        "minimum": -MAX_SLOPE_DB_OCTAVE,
        "maximum": MAX_SLOPE_DB_OCTAVE,
    },
    **{("ambient", key): POSITIVE for key in ("full_scale_pa", "height_m")},
    ("air", "absorption"): TRUTH,
    ("air", "absorption_scale"): NOT_NEGATIVE,
    ("vehicle", "model"): {"enum": list(VEHICLE_MODELS)},
    ("vehicle", "mission"): TEXT,
    ("control", "integral"): TRUTH,
    ("law", "scatter"): TRUTH,
    ("camera", "mount"): {"enum": list(MOUNTS)},
    ("sensor", "mount"): {"enum": list(MOUNTS)},
    ("world", "count"): {"type": "integer", "minimum": 1, "maximum": MAX_BLASTS},
    ("world", "probability"): {
        "type": "number",
        "exclusiveMinimum": 0,
        "maximum": 1,
    },
    ("world", "tick_s"): POSITIVE,
    ("region", "box"): {
        "type": "array",
        "items": {"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3},
        "minItems": 2,
        "maxItems": 2,
    },
    **{(table, "about"): {"enum": list(ABOUT)} for table in ("world", "region")},
    ("camera", "daylight_lux"): POSITIVE,
    ("camera", "width"): {"type": "integer", "minimum": 1},
    ("camera", "height"): {"type": "integer", "minimum": 1},
    **{("law", quantity): TEXT for quantity in QUANTITIES},
    **{(table, "name"): TEXT for table in SEVERAL},
    ("charge", "explosive"): TEXT,
}
"""What the keys hold that are neither numbers nor lists of them."""


def scene_schema() -> dict[str, Any]:
    """Return the schema of a scene file."""
    properties = {key: _table(key) for key in KEYS[""] if key != "schema"}
    properties["schema"] = KNOWN["", "schema"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A scene of jblast",
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
    }


def _table(name: str) -> dict[str, Any]:
    """Return the schema of a table, or of a list of them where there may be several."""
    keys = {key: _key(name, key) for key in keys_of(name)}
    one = {"type": "object", "properties": keys, "additionalProperties": False}
    if name not in SEVERAL:
        return one
    many = {"type": "array", "items": one}
    return many if name != "charge" else {"anyOf": [one, many]}


def _key(table: str, key: str) -> dict[str, Any]:
    if (table, key) in KNOWN:
        return KNOWN[table, key]
    if key in KEYS:
        return _table(key)
    if key == "region_m":
        return _table("region")
    if table == "world":
        pair = {"type": "array", "items": NUMBER, **_length(2)}
        one, _, prior = _uncertain(WORLD_NUMBERS[key].bounds)["anyOf"]
        return {"anyOf": [one, pair, prior]}
    if (table, key) == ("clock", "offset_s"):
        return _uncertain(CLOCK.bounds)
    if table == "place":
        return NUMBER | _limits(PLACE_LIMITS[key])
    parameters = [
        one
        for one in (*PARAMETERS.values(), CLOCK)
        if (one.key.table, one.key.name) == (table, key)
    ]
    if parameters and parameters[0].key.index is None:
        return _uncertain(parameters[0].bounds)
    if parameters:
        items = [_uncertain(one.bounds) for one in parameters]
        return {"type": "array", "prefixItems": items, **_length(len(items))}
    if key in LISTS:
        numbers = LISTS[key].count(",") + 1
        several = {"type": "array", "items": NUMBER, **_length(numbers)}
        return {"anyOf": [NUMBER, several]} if key in ONE_FOR_BOTH else several
    return NUMBER


def _uncertain(bounds: Bounds) -> dict[str, Any]:
    """Return what a number may be: fixed, free, or a prior."""
    fixed = NUMBER | _limits(bounds)
    pair = {"type": "array", "items": NUMBER, **_length(2)}
    prior = {
        "type": "object",
        "properties": {kind: pair for kind in PRIORS},
        "additionalProperties": False,
        "minProperties": 1,
        "maxProperties": 1,
    }
    return {"anyOf": [fixed, {"const": "free"}, prior]}


def _limits(bounds: Bounds) -> dict[str, float]:
    """Return how a schema writes bounds."""
    limits = {}
    for word, bound in (
        ("exclusiveMinimum", bounds.above),
        ("minimum", bounds.at_least),
        ("maximum", bounds.at_most),
    ):
        if abs(bound) != float("inf"):
            limits[word] = bound
    return limits


def _length(numbers: int) -> dict[str, int]:
    return {"minItems": numbers, "maxItems": numbers}
