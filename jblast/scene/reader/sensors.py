"""Reader of a scene's sensors: positions, records with their errors, instruments.

A relative error has a % sign. Clocks of recorders, named in the column `clock` of a
log, are also read here.
"""

import re
from collections.abc import Collection, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from jblast.errors import InputError, nearest, shown
from jblast.parameters import CLOCK, CLOCK_OFFSET
from jblast.quantities import (
    ADDITIVE,
    BY_CAMERA,
    DIRECTIONS,
    QUANTITIES,
    TIMED,
    components,
)
from jblast.scene.camera import MOUNTS
from jblast.scene.reader.tables import (
    LISTS,
    SATURATIONS,
    Uncertain,
    choice,
    finite,
    fixed_list,
    fixed_number,
    in_other_unit,
    name_of,
    not_yet,
    number_list,
    read_number,
    tables,
)
from jblast.scene.sensor import (
    FEWEST_BITS,
    MOST_BITS,
    RATE_HZ,
    Clock,
    Imu,
    Instrument,
    Sensor,
)
from jblast.scene.sensor_kinds import (
    IMU_KEYS,
    SENSOR_KINDS,
    SensorKind,
    all_instrument_keys,
    kind_of,
    own_keys,
    sampling_kinds,
)

QUATERNION = "quaternion_xyzw"
MAX_IMU_RATE_HZ = 1e5
"""Maximum sampling rate of an IMU [Hz]; declared: MEMS units reach some 10 kHz."""
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
"""Keys of the file and the fields of `Imu`."""
SHARE = re.compile(r"\s*(\d+\.?\d*(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?)\s*%\s*", re.I)
"""A sigma as a share of the value: "5%"."""


def read_sensors(
    document: dict[str, Any], source: str
) -> tuple[tuple[Sensor, ...], dict[str, Uncertain]]:
    """Read the sensors of a scene file, and the offsets of their clocks.

    Raises:
        InputError: As in `read_scene`.
    """
    sensors: dict[str, Sensor] = {}
    offsets: dict[str, Uncertain] = {}
    for index, entry in enumerate(tables(document, "sensor", source), start=1):
        where = f"{source}: [[sensor]] name"
        if "name" not in entry:
            raise InputError(
                f"{where}: expected a name for sensor {index}, got nothing"
            )
        name = name_of(entry["name"], where)
        if name in sensors:
            raise InputError(
                f"{where}: expected each name once, got {shown(name)} twice"
            )
        where = f"{source}: [[sensor]] {shown(name)}"
        sensors[name] = _sensor(name, entry, document, where)
        if (key := CLOCK.key.name) in entry:
            offset = read_number(entry[key], CLOCK, f"{where} {key}")
            offsets[f"{CLOCK_OFFSET}.{name}"] = offset
    return tuple(sensors.values()), offsets


def _sensor(
    name: str, entry: dict[str, Any], document: dict[str, Any], where: str
) -> Sensor:
    """Read one sensor; a missing position is NaN until a log gives it."""
    kind = ""
    if "kind" in entry:
        kind = choice(entry["kind"], tuple(SENSOR_KINDS), f"{where} kind")
    records = read_records(entry.get("records", {}), f"{where} records")
    times = _times(entry["times_s"], f"{where} times_s") if "times_s" in entry else ()
    if times and not any(quantity in TIMED for quantity, _ in records):
        raise InputError(
            f"{where} times_s: expected one of {', '.join(TIMED)} in records (only "
            "these have times), got none"
        )
    mount = _mount(entry, document, where)
    carried = {}
    if mount:
        _check_mountable(kind_of(kind), records, where)
        # A sensor without an offset is at the centre of the vehicle.
        carried = {"offset_m": np.zeros(3)} | {
            name: fixed_list(entry[key], f"{where} {key}", LISTS[key])
            for name, key in (("offset_m", "offset_m"), ("quaternion", QUATERNION))
            if key in entry
        }
        if not carried.get("quaternion", np.ones(4)).any():
            raise InputError(
                f"{where} {QUATERNION}: expected {LISTS[QUATERNION]} that is not zero, "
                f"got {shown(entry[QUATERNION])}"
            )
    position = _position(entry, f"{where} position_m")
    return Sensor(
        name=name,
        position_m=position,
        kind=kind,
        records=records,
        times_s=times,
        instrument=read_instrument(entry, kind, position, where),
        imu=read_imu(entry, kind, mount, where),
        settings=read_settings(entry, kind, where),
        mount=mount,
        **carried,
    )


def _position(entry: dict[str, Any], where: str) -> np.ndarray:
    if "position_m" not in entry:
        return np.full(3, np.nan)
    return fixed_list(entry["position_m"], where, LISTS["position_m"])


def _times(value: Any, where: str) -> tuple[float, ...]:
    expected = "a list of increasing times in seconds"
    if not isinstance(value, list) or not value:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    times = [finite(time, f"{where}[{i}]") for i, time in enumerate(value)]
    # Rows of one sensor are distinguished by their times.
    if any(late <= early for early, late in pairwise(times)):
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return tuple(times)


def _mount(entry: dict[str, Any], document: dict[str, Any], where: str) -> str:
    """Return the mount of a sensor; "" without one.

    Args:
        entry: Keys and values of the sensor.
        document: The whole file.
        where: File, table and sensor, for messages.

    Raises:
        InputError: It has a position and a mount, an offset without a mount, or the
            mount is missing.
    """
    if "mount" not in entry:
        for key in ("offset_m", QUATERNION):
            if key in entry:
                raise InputError(
                    f'{where} {key}: expected mount = "vehicle" with it, got no mount'
                )
        return ""
    mount = choice(entry["mount"], MOUNTS, f"{where} mount")
    if "position_m" in entry:
        raise InputError(
            f"{where} position_m: expected offset_m, in the axes of the vehicle's "
            f"body, for a sensor on a vehicle, got {shown(entry['position_m'])}"
        )
    if "vehicle" not in document:
        raise InputError(
            f'{where} mount: expected a [vehicle] as mount, got "{mount}" without that '
            "table"
        )
    return mount


def _check_mountable(
    kind: SensorKind | None, records: Sequence[tuple[str, float]], where: str
) -> None:
    """Reject a sensor that a vehicle cannot carry.

    Args:
        kind: Kind of the sensor; None without one.
        records: Recorded quantities with their sigmas.
        where: File, table and sensor, for messages.

    Raises:
        InputError: It belongs in the ground, or its motion is not supported.
    """
    if kind is not None and kind.unmounted:
        raise InputError(
            f"{where} mount: expected a sensor that a vehicle can carry, got "
            f"{kind.unmounted}"
        )
    for quantity, _ in records:
        of_ground = quantity.startswith("ground_") and quantity != "ground_arrival_s"
        # A sum of arrivals, a timed radius and an image have no single position of a
        # moving sensor.
        apart = len(components(quantity)) > 1 or quantity in (*TIMED, *BY_CAMERA)
        if apart or of_ground:
            raise not_yet(f"{where} records {quantity}", "a sensor in motion")


def read_instrument(
    entry: dict[str, Any], kind: str, position: np.ndarray, where: str
) -> Instrument | None:
    """Read the instrument of a sensor; None without one in the file.

    Args:
        entry: The sensor's keys and values.
        kind: Kind of the sensor; "" without one.
        position: East, north, up [m].
        where: File, table and sensor, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    # Sound in the ground has no law; a geophone records its motion.
    if kind == "microphone" and position[2] < 0:
        raise InputError(
            f"{where} position_m[2]: expected a microphone on the ground or above it, "
            f"got {position[2]:g} m"
        )
    given = [key for key in all_instrument_keys() if key in entry]
    if not given:
        return None
    if kind == "imu":  # read by `read_imu`
        return None
    known = kind_of(kind)
    if known is not None and not known.has_samples:
        raise InputError(
            f"{where} {given[0]}: expected a sensor that writes samples "
            f"({', '.join(sampling_kinds())}), got kind {shown(kind)}"
        )
    # A sensor without a kind records pressure.
    unit = "pa" if known is None else known.unit
    for key in given:
        stem = next((s for s in ("full_scale", "noise") if key.startswith(s)), None)
        if stem is not None and key != f"{stem}_{unit}":
            raise InputError(
                f"{where} {key}: expected {stem}_{unit}, the unit of a sensor of kind "
                f"{shown(kind)}, got {key}"
            )
    rate = RATE_HZ
    if "rate_hz" in entry:
        rate = _number(entry["rate_hz"], True, f"{where} rate_hz")
    full_scale, noise = None, None
    if (key := f"full_scale_{unit}") in entry:
        full_scale = _number(entry[key], True, f"{where} {key}")
    if (key := f"noise_{unit}") in entry:
        noise = _number(entry[key], False, f"{where} {key}")
    bits = _bits(entry.get("bits", "float"), f"{where} bits")
    # The quantization step is the range over 2**bits.
    if bits is not None and full_scale is None:
        raise InputError(
            f"{where} bits: expected full_scale_{unit} (the range of the bits) with "
            f"them, got {bits} bits alone"
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
    """Read the IMU of a sensor; None without sampling options in the file.

    Args:
        entry: The sensor's keys and values.
        kind: Kind of the sensor; "" without one.
        mount: Mount of the sensor; "" without one.
        where: File, table and sensor, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    keys = tuple(key.name for key in IMU_KEYS)
    own = [key for key in keys if key in entry]
    if kind != "imu":
        return None
    for key in all_instrument_keys():
        if key in entry and key not in keys:
            raise InputError(
                f"{where} {key}: expected one of {', '.join(keys)} for an imu, got "
                f"{key}"
            )
    if not own:
        return None
    if not mount:
        raise InputError(
            f'{where} {own[0]}: expected mount = "vehicle" for the samples of an imu, '
            "got no mount"
        )
    found: dict[str, Any] = {}
    for key, field in FIELDS.items():
        if key in entry:
            found[field] = _number(entry[key], key.startswith("full"), f"{where} {key}")
    if "rate_hz" in entry:
        found["rate"] = _number(entry["rate_hz"], True, f"{where} rate_hz")
        if found["rate"] > MAX_IMU_RATE_HZ:
            raise InputError(
                f"{where} rate_hz: expected at most {MAX_IMU_RATE_HZ:g} for an imu, "
                f"got {shown(entry['rate_hz'])}"
            )
    if "bits" in entry:
        found["bits"] = _bits(entry["bits"], f"{where} bits")
    return Imu(**found)


def read_settings(entry: dict[str, Any], kind: str, where: str) -> dict[str, float]:
    """Read the numbers specific to a sensor's kind, with defaults for missing ones.

    Args:
        entry: The sensor's keys and values.
        kind: Kind of the sensor; "" without one.
        where: File, table and sensor, for messages.

    Raises:
        InputError: A key belongs to another kind, or its number is out of bounds.
    """
    known = kind_of(kind)
    keys = () if known is None else known.keys
    shared = (*all_instrument_keys(), *(key.name for key in keys))
    for key in own_keys():
        if key in entry and key not in shared:
            whose = next(
                name
                for name, one in SENSOR_KINDS.items()
                if key in [its.name for its in one.keys]
            )
            raise InputError(
                f'{where} {key}: expected kind = "{whose}" with it, got '
                f"{shown(kind) if kind else 'no kind'}"
            )
    if kind == "imu":  # `read_imu`
        return {}
    found = {}
    for key in keys:
        if key.name not in entry and key.default is None:
            continue
        value = fixed_number(entry.get(key.name, key.default), f"{where} {key.name}")
        if not key.bounds.allows(value):
            raise InputError(
                f"{where} {key.name}: expected a number that is {key.bounds.words()}, "
                f"got {shown(value)}"
            )
        found[key.name] = value
    return found


def _number(value: Any, positive: bool, where: str) -> float:
    number = fixed_number(value, where)
    if number < 0 or (positive and number == 0):
        expected = "is positive" if positive else "is not negative"
        raise InputError(
            f"{where}: expected a number that {expected}, got {shown(value)}"
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
    """Return the corner frequencies of high- and low-pass; None without a filter."""
    high_pass, low_pass = (
        None if corner == "none" else _number(corner, True, f"{where}[{index}]")
        for index, corner in enumerate(number_list(value, where, LISTS["filter_hz"]))
    )
    for index, corner in enumerate((high_pass, low_pass)):
        # Above the Nyquist frequency a digital filter is not defined.
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


def read_records(records: Any, where: str) -> tuple[tuple[str, float], ...]:
    """Read the recorded quantities of a sensor and their sigmas.

    A sigma is a plain number in seconds for times and in radians for directions. For
    other quantities it is a share of the value, "5%". A plain number there could also
    be an error in the unit of the quantity, as in a log, so it is rejected.

    Args:
        records: Value in the file.
        where: File, table and key, for messages.

    Returns:
        Pairs of quantity and sigma: seconds, radians, or relative.

    Raises:
        InputError: It is not a table, a quantity is unknown, or a sigma has another
            form.
    """
    if not isinstance(records, dict):
        raise InputError(
            f"{where}: expected {{ QUANTITY = sigma }}, got {shown(records)}"
        )
    pairs = []
    for quantity, sigma in records.items():
        if quantity not in QUANTITIES:
            other = in_other_unit(quantity, QUANTITIES)
            raise InputError(
                f"{where}: unknown quantity {shown(quantity)}"
                f"{other or nearest(quantity, QUANTITIES)}; "
                f"expected one of {', '.join(QUANTITIES)}"
            )
        # Times may be zero or negative, so that they have no relative error.
        read = _additive if quantity in ADDITIVE else _share
        pairs.append((quantity, read(sigma, quantity, f"{where} {quantity}")))
    return tuple(pairs)


def share_text(share: float) -> str:
    """Return a share in the form of a scene file: 0.05 is "5%"."""
    return f'"{100 * share:.3g}%"'


def _additive(sigma: Any, quantity: str, where: str) -> float:
    unit = "radians" if quantity in DIRECTIONS else "seconds"
    expected = f"a positive sigma in {unit}"
    number = finite(sigma, where, f"{expected}, without a sign")
    if number <= 0:
        raise InputError(f"{where}: expected {expected}, got {shown(sigma)}")
    return number


def _share(sigma: Any, quantity: str, where: str) -> float:
    expected = 'a positive share of the value with its % sign, as "5%"'
    share_match = SHARE.fullmatch(sigma) if isinstance(sigma, str) else None
    if share_match is not None and (share := float(share_match.group(1)) / 100) > 0:
        return finite(share, where, expected)
    # A share and an error in the unit look the same, hence both readings.
    advice = ""
    if isinstance(sigma, int | float) and not isinstance(sigma, bool) and sigma > 0:
        unit = QUANTITIES[quantity].unit
        advice = (
            f"; if this is a share, multiply by 100 and write {share_text(sigma)}, "
            f"if it is in {unit}, divide by the value first"
        )
    raise InputError(f"{where}: expected {expected}, got {shown(sigma)}{advice}")


def read_clocks(
    document: dict[str, Any], source: str, sensors: Collection[str]
) -> tuple[tuple[Clock, ...], dict[str, Uncertain]]:
    """Read the tables [[clock]] of a scene file, and their offsets.

    Args:
        document: The tables of the file.
        source: Its name, for the messages.
        sensors: Names of sensors with their own clock offset.

    Raises:
        InputError: As in `read_scene`.
    """
    clocks: dict[str, Clock] = {}
    offsets: dict[str, Uncertain] = {}
    for index, entry in enumerate(tables(document, "clock", source), start=1):
        where = f"{source}: [[clock]]"
        if "name" not in entry:
            raise InputError(
                f"{where} name: expected a name for clock {index}, got nothing"
            )
        name = name_of(entry["name"], f"{where} name")
        if name in clocks:
            raise InputError(
                f"{where} name: expected each name once, got {shown(name)} twice"
            )
        where = f"{where} {shown(name)}"
        if name in sensors:
            raise InputError(
                f"{where}: the [[sensor]] of that name has a clock_offset_s; expected "
                "one of the two"
            )
        clocks[name] = Clock(name)
        if "offset_s" in entry:
            offset = read_number(entry["offset_s"], CLOCK, f"{where} offset_s")
            offsets[f"{CLOCK_OFFSET}.{name}"] = offset
    return tuple(clocks.values()), offsets
