"""The reader of what a scene's sensor does to the signal that reaches it."""

from typing import Any

import numpy as np

from jblast.errors import InputError, shown
from jblast.scene.instrument import FEWEST_BITS, MOST_BITS, RATE_HZ, Instrument
from jblast.scene.reader.priors import LISTS, fixed_number
from jblast.scene.reader.schema import (
    INSTRUMENT_KEYS,
    INSTRUMENT_KINDS,
    SATURATIONS,
    VELOCITY_KINDS,
)
from jblast.scene.reader.tables import choice, number_list


def read_instrument(
    entry: dict[str, Any], kind: str, position: np.ndarray, where: str
) -> Instrument | None:
    """Read the instrument of a sensor; None where the file says nothing of one.

    Args:
        entry: The sensor's keys and values.
        kind: Kind of the sensor, "" if unsaid.
        position: East, north, up [m].
        where: File, table and sensor, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    if kind == "microphone" and position[2] < 0:
        raise InputError(
            f"{where} position_m[2]: expected a microphone on the ground or above it, "
            f"got {position[2]:g} m"
        )
    given = [key for key in INSTRUMENT_KEYS if key in entry]
    if not given:
        return None
    if kind and kind not in INSTRUMENT_KINDS:
        raise InputError(
            f"{where} {given[0]}: expected a sensor that writes samples "
            f"({', '.join(INSTRUMENT_KINDS)}), got kind {shown(kind)}"
        )
    unit = "m_s" if kind in VELOCITY_KINDS else "pa"
    other = "pa" if unit == "m_s" else "m_s"
    for key in (f"full_scale_{other}", f"noise_{other}"):
        if key in entry:
            raise InputError(
                f"{where} {key}: expected {key.removesuffix(other)}{unit}, the unit "
                f"that a sensor of kind {shown(kind)} measures in, got {key}"
            )
    rate = RATE_HZ
    if "rate_hz" in entry:
        rate = _positive(entry["rate_hz"], f"{where} rate_hz")
    full_scale, noise = None, None
    if (key := f"full_scale_{unit}") in entry:
        full_scale = _positive(entry[key], f"{where} {key}")
    if (key := f"noise_{unit}") in entry:
        noise = fixed_number(entry[key], f"{where} {key}")
        if noise < 0:
            raise InputError(
                f"{where} {key}: expected a number that is not negative, "
                f"got {shown(entry[key])}"
            )
    bits = _bits(entry.get("bits", "float"), f"{where} bits")
    if bits is not None and full_scale is None:
        raise InputError(
            f"{where} bits: expected full_scale_{unit} with bits, the range that they "
            f"divide, got {bits} bits alone"
        )
    if "saturation" in entry:
        choice(entry["saturation"], SATURATIONS, f"{where} saturation")
    corners = entry.get("filter_hz", ["none", "none"])
    high_pass, low_pass = _corners(corners, rate, f"{where} filter_hz")
    return Instrument(
        rate=rate,
        full_scale=full_scale,
        noise=noise,
        bits=bits,
        high_pass=high_pass,
        low_pass=low_pass,
        saturation=entry.get("saturation", "clip"),
    )


def _positive(value: Any, where: str) -> float:
    number = fixed_number(value, where)
    if number <= 0:
        raise InputError(
            f"{where}: expected a number that is positive, got {shown(value)}"
        )
    return number


def _bits(value: Any, where: str) -> int | None:
    if value == "float":
        return None
    if type(value) is not int or not FEWEST_BITS <= value <= MOST_BITS:
        raise InputError(
            f"{where}: expected a whole number, {FEWEST_BITS} to {MOST_BITS}, or "
            f'"float", got {shown(value)}'
        )
    return value


def _corners(value: Any, rate: float, where: str) -> tuple[float | None, float | None]:
    """Return the corners of high- and low-pass; None for one that there is not."""
    high_pass, low_pass = (
        None if corner == "none" else _positive(corner, f"{where}[{index}]")
        for index, corner in enumerate(number_list(value, where, LISTS["filter_hz"]))
    )
    for index, corner in enumerate((high_pass, low_pass)):
        if corner is not None and corner >= rate / 2:
            raise InputError(
                f"{where}[{index}]: expected a corner below {rate / 2:g}, half of "
                f"rate_hz, got {shown(value[index])}"
            )
    if high_pass is not None and low_pass is not None and high_pass >= low_pass:
        raise InputError(
            f"{where}: expected the high-pass corner below the low-pass one, as in "
            f"[20, 20000], got {shown(value)}"
        )
    return high_pass, low_pass
