"""Keys, tables and numbers of a scene file.

One table lists every key of a scene file (`KEYS`; `keys_of` adds those of kinds of
sensors). A number of a file is fixed, free, or has a prior (`PRIORS`). A key accepts
one unit only, so that the value read is the value written; a key in another unit is
rejected with the conversion factor. Logs, in contrast, are written by instruments and
are converted.
"""

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, nearest, shown
from jblast.parameters import PARAMETERS, Parameter
from jblast.quantities import QUANTITIES
from jblast.scene.sensor_kinds import all_instrument_keys, own_keys
from jblast.scene.uncertain import Free, LogNormal, LogUniform, Normal, Prior, Uniform

Uncertain = tuple[float, Prior | Free | None]
"""Start of a fit of a number, and its prior or freedom; None: fixed."""
PRIORS = {
    "lognormal": "[median, factor]",
    "normal": "[mean, sd]",
    "uniform": "[lo, hi]",
    "loguniform": "[lo, hi]",
}
"""Kinds of prior and their two numbers."""
LISTS = {
    "position_m": "[east, north, up]",
    "wind_m_s": "[east, north]",
    "look_at_m": "[east, north, up]",
    "offset_m": "[forward, left, up]",
    "quaternion_xyzw": "[x, y, z, w]",
    "focal_px": "[x, y]",
    "center_px": "[x, y]",
    "distortion": "[k1, k2, p1, p2, k3]",
    "threshold": "[brighter, darker]",
    "filter_hz": "[high-pass, low-pass]",
    "velocity_m_s": "[east, north, up]",
    "target_m": "[east, north, up]",
    "kp_pos": "[east, north, up]",
    "kd_pos": "[east, north, up]",
    "ki_pos": "[east, north, up]",
    "box": "[[east, north, up], [east, north, up]]",
    "ring": "[inner, outer]",
}
"""Keys with a list of numbers, and its form."""
MIN_MEAN_SDS = 3.0
"""Minimum mean of a normal prior of a positive number, in standard deviations.

At most 0.13 % of the probability is then below zero; a wider prior should be lognormal.
"""
KEYS: dict[str, tuple[str, ...]] = {
    "": (
        "schema",
        "charge",
        "air",
        "ground",
        "sensor",
        "clock",
        "place",
        "ambient",
        "camera",
        "vehicle",
        "world",
        "law",
    ),
    "charge": (
        "name",
        "mass_kg",
        "explosive",
        "tnt_factor",
        "position_m",
        "range_m",
        "time_s",
        "burst",
    ),
    "air": (
        "temperature_k",
        "pressure_pa",
        "relative_humidity",
        "altitude_m",
        "sound_speed_m_s",
        "wind_m_s",
        "absorption",
        "absorption_scale",
    ),
    "ground": ("p_speed_m_s", "path"),
    "sensor": (
        "name",
        "kind",
        "position_m",
        "clock_offset_s",
        "records",
        "times_s",
        "mount",
        "offset_m",
        "quaternion_xyzw",
    ),
    "clock": ("name", "offset_s"),
    "place": ("lat_deg", "lon_deg", "alt_m"),
    "ambient": ("file", "full_scale_pa", "level_pa", "slope_db_octave", "height_m"),
    "camera": (
        "position_m",
        "look_at_m",
        "quaternion_xyzw",
        "mount",
        "offset_m",
        "width",
        "height",
        "focal_px",
        "center_px",
        "distortion",
        "frames_hz",
        "exposure_s",
        "threshold",
        "daylight_lux",
    ),
    "vehicle": ("model", "position_m", "velocity_m_s", "control", "mission"),
    "world": (
        "count",
        "rate_hz",
        "probability",
        "tick_s",
        "region_m",
        "about",
        "mass_kg",
        "time_s",
        "gap_s",
    ),
    "region": ("box", "ring", "about"),
    "control": (
        "integral",
        "target_m",
        "yaw_rad",
        "kp_pos",
        "kd_pos",
        "ki_pos",
        "kp_att",
        "kd_att",
        "integral_limit",
        "motor_lead",
    ),
    "law": (*QUANTITIES, "scatter", "sedov_gamma", "fireball_growth_s"),
}
"""Keys by table; "" is the file itself, "control" is in [vehicle], "region" in [world].
`keys_of` adds those of a sensor's kind."""
LATER: dict[str, tuple[str, ...]] = {}
"""Reserved keys that are not supported yet."""
SATURATIONS = ("clip", "compress")
VEHICLE_MODELS = ("crazyflie", "hummingbird", "iris")
GROUND_PATHS = ("head", "thesis")
CELSIUS = "add 273.15"
FAHRENHEIT = "subtract 32, multiply by 5/9 and add 273.15"
TEMPERATURES = {
    "c": CELSIUS, "celsius": CELSIUS, "degc": CELSIUS, "deg_c": CELSIUS,
    "f": FAHRENHEIT, "fahrenheit": FAHRENHEIT, "degf": FAHRENHEIT, "deg_f": FAHRENHEIT,
}  # fmt: skip
"""Suffixes of temperatures and their conversion to kelvins, which needs an offset."""
PER_CENT = ("percent", "pct")
MAX_ENDING_WORDS = 3
"""Number of words of the longest unit suffix: km_per_h."""


def keys_of(table: str) -> tuple[str, ...]:
    """Return the keys of a table; for sensors including those of all kinds."""
    if table != "sensor":
        return KEYS[table]
    return tuple(dict.fromkeys((*KEYS[table], *all_instrument_keys(), *own_keys())))


def finite(value: Any, where: str, expected: str = "a finite number") -> float:
    """Return a TOML value as a float.

    Raises:
        InputError: It is not a number, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return number


def fixed_number(value: Any, where: str) -> float:
    """Return a fixed number.

    Raises:
        InputError: It is not a finite number, is free or has a prior.
    """
    if value == "free" or isinstance(value, dict):
        raise not_yet(where, "a number that is free or has a prior")
    return finite(value, where)


def fixed_list(value: Any, where: str, form: str) -> Float[np.ndarray, " number"]:
    """Return a list of fixed numbers.

    Raises:
        InputError: The form differs, or a number is not finite, is free or has a prior.
    """
    numbers = number_list(value, where, form)
    if any(number == "free" or isinstance(number, dict) for number in numbers):
        raise not_yet(where, "a number that is free or has a prior")
    return np.array(
        [finite(number, f"{where}[{index}]") for index, number in enumerate(numbers)]
    )


def read_numbers(entry: dict[str, Any], table: str, where: str) -> dict[str, Uncertain]:
    """Read every number of a table of the file, by parameter name.

    Raises:
        InputError: As in `read_number`.
    """
    numbers = {}
    for parameter in PARAMETERS.values():
        key = parameter.key
        if key.table != table or key.name not in entry:
            continue
        value, at = entry[key.name], f"{where} {key.name}"
        if key.index is not None:
            value = number_list(value, at, LISTS[key.name])[key.index]
            at += f"[{key.index}]"
        numbers[parameter.name] = read_number(value, parameter, at)
    return numbers


def read_number(value: Any, parameter: Parameter, where: str) -> Uncertain:
    """Return the start of a fit of a number, and its prior.

    Args:
        value: Value in the file.
        parameter: Description of the number.
        where: File, table and key, for messages.

    Returns:
        A fixed value and None; a prior's median and the prior; or a default and `Free`.

    Raises:
        InputError: The value has none of these forms, or is out of bounds.
    """
    if value == "free":
        # The default is only the start of the fit.
        return parameter.default, Free(parameter.positive)
    if isinstance(value, dict):
        return _prior(value, parameter, where)
    expected = 'a number, "free" or a prior such as { normal = [mean, sd] }'
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    fixed = finite(value, where)
    _check(fixed, parameter, where, "a number")
    return fixed, None


def _prior(value: dict[str, Any], parameter: Parameter, where: str) -> Uncertain:
    """Return the median of a prior and the prior."""
    kinds = list(value)
    for kind in kinds:
        if kind not in PRIORS:
            raise InputError(
                f"{where}: unknown prior {shown(kind)}{nearest(kind, PRIORS)}; "
                f"expected one of {', '.join(PRIORS)}"
            )
    if len(kinds) != 1:
        raise InputError(
            f"{where}: expected one of {', '.join(PRIORS)}, "
            f"got {' and '.join(kinds) or 'an empty table'}"
        )
    kind, form = kinds[0], PRIORS[kinds[0]]
    pair = value[kind]
    if not isinstance(pair, list) or len(pair) != 2:
        raise InputError(f"{where}: expected {kind} = {form}, got {shown(pair)}")
    expected = f"two finite numbers in {kind} = {form}"
    a, b = (finite(item, where, expected) for item in pair)
    if kind == "normal":
        _check(a, parameter, where, "a mean")
        _require(b > 0, where, f"a positive sd in normal = {form}", pair)
        _require(
            not parameter.positive or a >= MIN_MEAN_SDS * b,
            where,
            f"a mean at least {MIN_MEAN_SDS:g} sd above zero in normal = {form}; "
            "lognormal suits a positive number",
            pair,
        )
        return a, Normal(a, b)
    if kind == "lognormal":
        _require(a > 0, where, f"a positive median in lognormal = {form}", pair)
        _require(b > 1, where, f"a factor above 1 in lognormal = {form}", pair)
        _check(a, parameter, where, "a median")
        return a, LogNormal(a, b)
    _require(a < b, where, f"lo < hi in {kind} = {form}", pair)
    if kind == "loguniform":
        _require(a > 0, where, f"a positive lo in loguniform = {form}", pair)
    # Bounds of the prior must respect those of the parameter, so that every sample
    # does.
    for end in (a, b):
        _check(end, parameter, where, "a bound")
    if kind == "uniform":
        # Halved first, because the sum of the bounds can overflow.
        return 0.5 * a + 0.5 * b, Uniform(a, b)
    # Two roots, because the product of the bounds can overflow.
    return math.sqrt(a) * math.sqrt(b), LogUniform(a, b)


def _check(value: float, parameter: Parameter, where: str, what: str) -> None:
    bounds = parameter.bounds
    if not bounds.allows(value):
        raise InputError(
            f"{where}: expected {what} that is {bounds.words()}, got {shown(value)}"
            f"{bounds.hint(value)}"
        )


def _require(condition: bool, where: str, expected: str, got: Any) -> None:
    if not condition:
        raise InputError(f"{where}: expected {expected}, got {shown(got)}")


def not_yet(where: str, what: str) -> InputError:
    """Return the error for a reserved feature that is not supported yet."""
    return InputError(f"{where}: {what} is not supported yet")


def table(document: dict[str, Any], name: str, where: str) -> dict[str, Any]:
    """Return a table of the file with checked keys; empty if it is absent."""
    value = document.get(name, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{where}: [{name}]: expected one table written [{name}], "
            f"got {shown(value)}"
        )
    known_keys(value, name, f"{where}: [{name}]")
    return value


def tables(document: dict[str, Any], name: str, where: str) -> list[dict[str, Any]]:
    """Return the entries of an array of tables with checked keys."""
    entries = document.get(name, [])
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise InputError(
            f"{where}: [[{name}]]: expected tables written [[{name}]], "
            f"got {shown(entries)}"
        )
    for entry in entries:
        known_keys(entry, name, f"{where}: [[{name}]]")
    return entries


def known_keys(entry: dict[str, Any], name: str, where: str) -> None:
    """Reject unknown and reserved keys of a table."""
    # Unknown keys are rejected: an ignored one would silently leave a default.
    known, later = keys_of(name), LATER.get(name, ())
    for key in entry:
        if key in later:
            raise not_yet(f"{where} {key}" if name else f"{where}: [{key}]", "this")
        if key not in known:
            place = (
                f"{where} {shown_key(key)}" if name else f"{where}: {shown_key(key)}"
            )
            other = in_other_unit(key, known)
            advice = other or nearest(key, (*known, *later))
            kind = "table" if isinstance(entry[key], dict) else "key"
            raise InputError(
                f"{place}: unknown {kind}{advice}; expected one of {', '.join(known)}"
            )


def choice(
    value: Any, known: Sequence[str], where: str, later: Sequence[str] = ()
) -> str:
    """Return a value after checking that it is one of the known words."""
    if isinstance(value, str) and value in later:
        raise not_yet(where, f'"{value}"')
    if not isinstance(value, str) or value not in known:
        advice = nearest(value, known) if isinstance(value, str) else ""
        raise InputError(
            f"{where}: expected one of {', '.join(known)}, got {shown(value)}{advice}"
        )
    return value


def true_or_false(value: Any, where: str) -> bool:
    """Return a boolean after checking its type."""
    if not isinstance(value, bool):
        raise InputError(f"{where}: expected true or false, got {shown(value)}")
    return value


def name_of(value: Any, where: str) -> str:
    """Return a name: non-empty text."""
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{where}: expected a name in quotes, got {shown(value)}")
    return value.strip()


def number_list(value: Any, where: str, expected: str) -> list[Any]:
    """Return a list with the length of the expected form, such as "[east, north]"."""
    if not isinstance(value, list) or len(value) != expected.count(",") + 1:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return value


def shown_key(key: str) -> str:
    """Return a key as it is written, or quoted if it would garble a message."""
    # TOML allows any text as a quoted key.
    return key if key.isidentifier() and len(key) <= 60 else shown(key)


def in_other_unit(key: str, known: Collection[str]) -> str:
    """Return "; ours is mass_kg: multiply by ..." for a key in another known unit.

    Args:
        key: Unknown key of a table.
        known: Known keys of the table.

    Returns:
        The replacement; "" without a known unit or a key with the same stem.
    """
    # Only needed for an error message, and it imports pint.
    from jblast.units import SI, si_factor, unit_spelt

    words = key.split("_")
    # Longest suffix first: "speed_km_per_h" must not be read as a stem with the suffix
    # "h".
    for length in range(min(MAX_ENDING_WORDS, len(words) - 1), 0, -1):
        stem, suffix = "_".join(words[:-length]).lower(), "_".join(words[-length:])
        if suffix.lower() in TEMPERATURES and f"{stem}_k" in known:
            return f"; ours is {stem}_k: {TEMPERATURES[suffix.lower()]}"
        if suffix.lower() in PER_CENT and stem in known:
            return f"; ours is {stem}, a share: multiply by 0.01"
        meant = unit_spelt(suffix)
        # Only units of the dimension of the known key: mass_s is no mass.
        either = [unit for unit in meant if f"{stem}_{SI.get(unit.dimension)}" in known]
        if len(meant) > 1 and either:
            names = " or ".join(unit.pint for unit in either)
            ours = f"{stem}_{SI[either[0].dimension]}"
            return f"; ours is {ours}, and {suffix!r} may be {names}"
        if either:
            ours = f"{stem}_{SI[either[0].dimension]}"
            return f"; ours is {ours}: multiply by {si_factor(suffix):.9g}"
    return ""
