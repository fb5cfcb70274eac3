"""Numbers of a scene file: fixed, free, or a prior."""

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, nearest, shown
from jblast.parameter import Parameter
from jblast.parameter_table import PARAMETERS
from jblast.scene.priors import Free, LogNormal, LogUniform, Normal, Prior, Uniform
from jblast.scene.reader.tables import not_yet, number_list

Uncertain = tuple[float, Prior | Free | None]
"""Where a fit of a number starts, and what is believed of it; None: it is fixed."""

PRIORS = {
    "lognormal": "[median, factor]",
    "normal": "[mean, sd]",
    "uniform": "[lo, hi]",
    "loguniform": "[lo, hi]",
}
"""Kinds of prior, and the two numbers each is written with."""


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
"""Keys that hold a list of numbers, and how it is written."""

CLEAR_OF_ZERO = 3.0
"""A normal prior of a positive number keeps this many sds clear of zero."""


def finite(value: Any, where: str, expected: str = "a finite number") -> float:
    """Return a TOML value as a float.

    Raises:
        InputError: It is no number, or infinite, or not a number.
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
    """Return a number that may not be free yet.

    Raises:
        InputError: It is no finite number.
    """
    if value == "free" or isinstance(value, dict):
        raise not_yet(where, "a number that is free or has a prior")
    return finite(value, where)


def fixed_list(value: Any, where: str, form: str) -> Float[np.ndarray, " number"]:
    """Return a list of numbers that may not be free yet.

    Raises:
        InputError: It is no list of the form, or one of its numbers is not finite.
    """
    numbers = number_list(value, where, form)
    if any(number == "free" or isinstance(number, dict) for number in numbers):
        raise not_yet(where, "a number that is free or has a prior")
    return np.array(
        [finite(number, f"{where}[{index}]") for index, number in enumerate(numbers)]
    )


def read_numbers(entry: dict[str, Any], table: str, where: str) -> dict[str, Uncertain]:
    """Read every number that stands in a table of the file, by parameter name.

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
    """Return where a fit of a number starts, and what is believed of it.

    Args:
        value: What stands in the file.
        parameter: What the number is.
        where: File, table and key, for the messages.

    Returns:
        The value, with None where it is fixed; the prior's median and the prior; or a
        default and `Free`.

    Raises:
        InputError: It is none of the three, or out of bounds.
    """
    if value == "free":
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
            not parameter.positive or a >= CLEAR_OF_ZERO * b,
            where,
            f"a mean at least {CLEAR_OF_ZERO:g} sd above zero in normal = {form}; "
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
    for end in (a, b):
        _check(end, parameter, where, "an end")
    if kind == "uniform":
        return 0.5 * a + 0.5 * b, Uniform(a, b)
    return math.sqrt(a) * math.sqrt(b), LogUniform(a, b)


def _check(value: float, parameter: Parameter, where: str, what: str) -> None:
    bounds = parameter.bounds
    _require(bounds.allows(value), where, f"{what} that is {bounds.words()}", value)


def _require(condition: bool, where: str, expected: str, got: Any) -> None:
    if not condition:
        raise InputError(f"{where}: expected {expected}, got {shown(got)}")
