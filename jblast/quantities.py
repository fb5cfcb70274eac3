"""Table of all quantities that sensors record or laws predict.

`quantities.csv` has a row for each. The groups below (clock times, directions,
quantities with errors in their own unit) follow from the kinds. The tables are pure
data and are read without JAX.
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

UNITS = {
    "": "",
    "_m": "m",
    "_m_kg13": "m/kg^(1/3)",
    "_s": "s",
    "_kg": "kg",
    "_pa": "Pa",
    "_pa_s": "Pa s",
    "_m_s": "m/s",
    "_m_s2": "m/s²",
    "_m_s2_sqrt_hz": "m/s²/√Hz",
    "_m_s2_sqrt_s": "m/s²/√s",
    "_rad": "rad",
    "_rad_s": "rad/s",
    "_rad_s_sqrt_hz": "rad/s/√Hz",
    "_rad_s_sqrt_s": "rad/s/√s",
    "_deg": "degrees",
    "_n": "N",
    "_n_m": "N m",
    "_j": "J",
    "_k": "K",
    "_px": "px",
    "_hz": "Hz",
    "_db": "dB",
    "_db_octave": "dB/octave",
    "_lux": "lx",
}
"""Units by the end of a name."""
Kind = Literal[
    "flash",
    "arrival",
    "time difference",
    "pressure",
    "impulse",
    "duration",
    "shock radius",
    "fireball radius",
    "direction",
    "speed",
    "displacement",
    "shape",
]
# Readings of a clock include its offset; a time difference does not.
CLOCK_KINDS = ("flash", "arrival")
TIME_KINDS = (*CLOCK_KINDS, "time difference")
PULSE_KINDS = ("impulse", "duration")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A quantity that can be measured or predicted.

    Attributes:
        name: Name in observation files, scene files and results; its suffix is the
            unit.
        words: Name in sentences.
        meaning: Definition.
        kind: Kind; flashes and arrivals are readings of a clock.
        traits: "circular" for an angle that is periodic in a full circle; "placeless"
            if it does not depend on the sensor's position; "camera" if it is measured
            in images of the scene's camera; "vehicle" for a response of the scene's
            vehicle; "derived" if laws predict it but logs cannot contain it.
        largest: Largest magnitude, in its unit.
        default_sigma: Error of a proposed additional reading if no sensor has one, in
            seconds or relative; None if such readings are not proposed.
        parts: Pairs of a quantity with a law and a sign, whose sum it is.
        other_names: Names in other programs with this one meaning, without a unit.
    """

    name: str
    words: str
    meaning: str
    kind: Kind
    traits: tuple[str, ...] = ()
    largest: float = math.inf
    default_sigma: float | None = None
    parts: tuple[tuple[str, float], ...] = ()
    other_names: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """SI unit, "1" if there is none."""
        return UNITS[unit_suffix(self.name)] or "1"

    def with_article(self) -> str:
        """Return the name with an indefinite article: "an air arrival"."""
        return f"{'an' if self.words[0] in 'aeiou' else 'a'} {self.words}"

    @property
    def tnt_factor(self) -> Literal["pressure", "impulse", "energy"]:
        """Name of the TNT equivalence factor that applies to the quantity."""
        # An arrival has the factor for pressure, because pressure determines the speed
        # of the shock; a duration has the factor for impulse, its integral over time.
        if self.kind in PULSE_KINDS:
            return "impulse"
        return "energy" if self.kind == "shock radius" else "pressure"


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table of the package by the names of its columns."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def unit_suffix(name: str) -> str:
    """Return the end of a name that is its unit, a key of `UNITS`."""
    # The longest: a name in _n_m ends in _m as well.
    return max((end for end in UNITS if name.endswith(end)), key=len)


def _quantity(row: dict[str, str]) -> Quantity:
    kind: Any = row["kind"]
    return Quantity(
        name=row["name"],
        words=row["words"],
        meaning=row["meaning"],
        kind=kind,
        traits=tuple(row["traits"].split()),
        largest=float(row["largest"] or math.inf),
        default_sigma=float(row["default_sigma"]) if row["default_sigma"] else None,
        parts=tuple((part[1:], float(f"{part[0]}1")) for part in row["parts"].split()),
        other_names=tuple(filter(None, row["other_names"].split("; "))),
    )


_TABLE = [_quantity(row) for row in rows_of(Path(__file__).with_suffix(".csv"))]
QUANTITIES = {q.name: q for q in _TABLE if "derived" not in q.traits}
"""Quantities of the rows of logs, by name."""
DERIVED_QUANTITIES = {q.name: q for q in _TABLE if "derived" in q.traits}
"""Quantities that laws predict but logs cannot contain, by name."""


def _of_kind(*kinds: Kind) -> tuple[str, ...]:
    return tuple(q.name for q in QUANTITIES.values() if q.kind in kinds)


def _with_trait(trait: str) -> tuple[str, ...]:
    return tuple(q.name for q in QUANTITIES.values() if trait in q.traits)


CLOCK_TIMES = _of_kind(*CLOCK_KINDS)
"""Quantities that are readings of a clock."""
ARRIVALS = _of_kind("arrival")
"""Clock times of the arrival of a wave."""
TIMES = _of_kind(*TIME_KINDS)
"""Quantities in seconds; the scatter of their laws is a share of the travel time."""
FIREBALL_RADII = _of_kind("fireball radius")
TIMED = (*_of_kind("shock radius"), *FIREBALL_RADII)
"""Quantities measured at a time: their rows have a `time_s`."""
PLACELESS = _with_trait("placeless")
"""Quantities that do not depend on the sensor's position."""
BY_CAMERA = _with_trait("camera")
"""Quantities measured in images of the scene's camera."""
BY_VEHICLE = _with_trait("vehicle")
"""Responses of the scene's vehicle: they depend on its model and position."""
DIRECTIONS = {name: QUANTITIES[name].largest for name in _of_kind("direction")}
"""Angles at a sensor's position, with their largest magnitude [rad]."""
CIRCULAR = _with_trait("circular")
"""Angles that are periodic in a full circle."""
ADDITIVE = (*TIMES, *DIRECTIONS)
"""Quantities with errors in their own unit; errors of others are in ln (positive)."""
FEEL_WIND = _of_kind(*TIME_KINDS, *PULSE_KINDS)
"""Quantities that depend on the speed of sound, and therefore on the wind."""
ADDABLE = {q.name: q.default_sigma for q in _TABLE if q.default_sigma is not None}
"""Quantities of proposed additional readings, with their error: seconds or relative."""


def quantity_named(name: str) -> Quantity | None:
    """Return a quantity; None if the name is unknown."""
    return QUANTITIES.get(name) or DERIVED_QUANTITIES.get(name)


def components(quantity: str) -> tuple[tuple[str, float], ...]:
    """Return pairs of a quantity with a law and a sign, whose sum is the quantity."""
    known = QUANTITIES.get(quantity)
    # A plain quantity is its own only part, so that callers need no special case.
    return (known.parts if known else ()) or ((quantity, 1.0),)


def made_with(part: str) -> tuple[str, ...]:
    """Return the quantities that have a quantity as a part, including itself."""
    return tuple(name for name in QUANTITIES if part in dict(components(name)))
