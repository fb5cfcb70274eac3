"""The reader of what a scene's sensor does to the signal that reaches it."""

from typing import Any

import numpy as np

from jblast.errors import InputError, shown
from jblast.scene.instrument import FEWEST_BITS, MOST_BITS, RATE_HZ, Imu, Instrument
from jblast.scene.reader.priors import LISTS, fixed_number
from jblast.scene.reader.schema import (
    IMU_KEYS,
    INSTRUMENT_KEYS,
    INSTRUMENT_KINDS,
    SATURATIONS,
    VELOCITY_KINDS,
)
from jblast.scene.reader.tables import choice, number_list

MOST_HZ = 1e5
FIELDS = {
    "full_scale_m_s2": "accelerometer_range",
    "full_scale_rad_s": "gyroscope_range",
    "noise_m_s2_sqrt_hz": "accelerometer_noise",
    "noise_rad_s_sqrt_hz": "gyroscope_noise",
    "bias_m_s2": "accelerometer_bias",
    "bias_rad_s": "gyroscope_bias",
    "bias_walk_m_s2_sqrt_s": "accelerometer_walk",
    "bias_walk_rad_s_sqrt_s": "gyroscope_walk",
}
"""Keys of the file, and what `Imu` calls them."""


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
    if kind == "imu":  # has a reader of its own
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


def read_imu(entry: dict[str, Any], kind: str, mount: str, where: str) -> Imu | None:
    """Read the IMU of a sensor; None where the file says nothing of its samples.

    Args:
        entry: The sensor's keys and values.
        kind: Kind of the sensor, "" if unsaid.
        mount: What carries it, "" if nothing.
        where: File, table and sensor, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    own = [key for key in IMU_KEYS if key in entry]
    if kind != "imu":
        for key in own:
            if key not in INSTRUMENT_KEYS:
                raise InputError(
                    f'{where} {key}: expected kind = "imu" with it, got '
                    f"{shown(kind) if kind else 'no kind'}"
                )
        return None
    for key in INSTRUMENT_KEYS:
        if key in entry and key not in IMU_KEYS:
            raise InputError(
                f"{where} {key}: expected one of {', '.join(IMU_KEYS)}, which an imu "
                f"has, got {key}"
            )
    if not own:
        return None
    if not mount:
        raise InputError(
            f'{where} {own[0]}: expected mount = "vehicle", which moves it, with the '
            "samples of an imu; got no mount"
        )
    found: dict[str, Any] = {}
    for key, field in FIELDS.items():
        if key in entry:
            found[field] = _number(entry[key], key.startswith("full"), f"{where} {key}")
    if "rate_hz" in entry:
        found["rate"] = _number(entry["rate_hz"], True, f"{where} rate_hz")
        if found["rate"] > MOST_HZ:
            raise InputError(
                f"{where} rate_hz: expected at most {MOST_HZ:g} of an imu, got "
                f"{shown(entry['rate_hz'])}"
            )
    if "bits" in entry:
        found["bits"] = _bits(entry["bits"], f"{where} bits")
    return Imu(**found)


def _number(value: Any, positive: bool, where: str) -> float:
    number = fixed_number(value, where)
    if number < 0 or (positive and number == 0):
        expected = "is positive" if positive else "is not negative"
        raise InputError(
            f"{where}: expected a number that {expected}, got {shown(value)}"
        )
    return number


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
