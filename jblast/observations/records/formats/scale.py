"""What a sample stands for: its unit, and what the user says of the recorder."""

import re
from typing import NamedTuple

from jblast.errors import InputError, argument, nearest, shown
from jblast.units import si_factor, unit_spelt

VOLTS = {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6}
PRESSURES = {"pascal": 1.0, "pascals": 1.0}
TIMES = {
    "second": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9,
    "seconds": 1.0, "minutes": 60.0, "hours": 3600.0,
}  # fmt: skip
UNSAID = {"", "1", "count", "counts", "none", "unknown", "dimensionless", "fs"}
"""What files write where they name no unit, or one that nobody can convert."""


class Scaling(NamedTuple):
    """What the user says of the recorders.

    Attributes:
        full_scale_pa: What a sample of 1 in a sound file stands for [Pa].
        sensitivity: Pascals a volt, or a count of formats that hold counts.
    """

    full_scale_pa: float | None = None
    sensitivity: float | None = None


class Scale(NamedTuple):
    """What to multiply samples by, and whether that makes them pascals."""

    factor: float
    calibrated: bool


def plain_unit(text: str) -> str:
    """Return a unit as the tables have it: `m/s` is m_s."""
    text = text.strip().replace("µ", "u").replace("μ", "u")
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def pressure_factor(unit: str) -> float | None:
    """Return pascals a unit; None if it is none of pressure, or mpa in lower case."""
    return PRESSURES.get(plain_unit(unit)) or _factor(unit, "pressure")


def volts_factor(unit: str) -> float | None:
    """Return volts a unit; None if it is none of voltage."""
    return VOLTS.get(plain_unit(unit))


def time_factor(unit: str) -> float | None:
    """Return seconds a unit; None if it is none of time."""
    return TIMES.get(plain_unit(unit)) or _factor(unit, "time")


def _factor(unit: str, dimension: str) -> float | None:
    """Return what a unit is in ours; None if it is of another dimension, or of two."""
    meant = [of for of in unit_spelt(unit) if of.dimension == dimension]
    return si_factor(meant[0].suffix) if len(meant) == 1 else None


def holds_pressure(unit: str) -> bool:
    """Return whether samples of a unit can be pressure: pascals, volts, or unsaid."""
    return (
        pressure_factor(unit) is not None
        or volts_factor(unit) is not None
        or plain_unit(unit) in UNSAID
    )


def scale_of(unit: str, scaling: Scaling, where: str) -> Scale:
    """Return what samples of a unit are to be multiplied by.

    Args:
        unit: As the file has it; "" where it has none.
        scaling: What the user says.
        where: The file, and the channel or column, for messages.

    Raises:
        InputError: They are volts and nobody said how many pascals each is, or the
            unit is none of pressure.
    """
    pascals = pressure_factor(unit)
    if pascals is not None:
        return Scale(pascals, calibrated=True)
    volts = volts_factor(unit)
    if volts is not None:
        if scaling.sensitivity is None:
            raise InputError(
                f"{where}: expected pressure, got {unit}; how many pascals a volt "
                f"stands for is told by {argument('sensitivity')}"
            )
        return Scale(volts * scaling.sensitivity, calibrated=True)
    if plain_unit(unit) in UNSAID:
        if scaling.sensitivity is None:
            return Scale(1.0, calibrated=False)
        return Scale(scaling.sensitivity, calibrated=True)
    known = ("Pa", "kPa", "MPa", "mbar", "bar", "psi", "V", "mV")
    raise InputError(
        f"{where}: expected a unit of pressure or volts, "
        f"got {shown(unit)}{nearest(unit, known)}"
    )
