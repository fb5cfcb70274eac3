"""Table of all quantities that sensors record or laws predict.

A row has the name, the SI unit, the meaning and the kind of a quantity. The groups
below the table (clock times, directions, quantities with errors in their own unit)
follow from the kinds. The tables are pure data and are read without JAX.
"""

import math
from dataclasses import dataclass
from typing import Literal

UNITS = {
    "": "",
    "_m": "m",
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
    "_lux": "lux",
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
        unit: SI unit, "1" if there is none.
        words: Name in sentences.
        meaning: Definition.
        kind: Kind; flashes and arrivals are readings of a clock.
        largest: Largest magnitude, in its unit.
        circular: True for an angle that is periodic in a full circle.
        placeless: True if it does not depend on the sensor's position.
        by_camera: True if it is measured in images of the scene's camera.
        by_vehicle: True if it is a response of the scene's vehicle.
        default_sigma: Error of a proposed additional reading if no sensor has one, in
            seconds or relative; None if such readings are not proposed.
        parts: Pairs of a quantity with a law and a sign, whose sum it is.
    """

    name: str
    unit: str
    words: str
    meaning: str
    kind: Kind
    largest: float = math.inf
    circular: bool = False
    placeless: bool = False
    by_camera: bool = False
    by_vehicle: bool = False
    default_sigma: float | None = None
    parts: tuple[tuple[str, float], ...] = ()

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

    @property
    def feels_wind(self) -> bool:
        """True if it depends on the speed of sound, and therefore on the wind."""
        return self.kind in (*TIME_KINDS, *PULSE_KINDS)


_RECORDED = (
    Quantity(
        name="flash_time_s",
        unit="s",
        words="flash time",
        meaning="light of the explosion seen, clock time",
        kind="flash",
        default_sigma=1e-3,
    ),
    Quantity(
        name="air_arrival_s",
        unit="s",
        words="air arrival",
        meaning="air shock or sound arrives, clock time",
        kind="arrival",
        default_sigma=1e-3,
    ),
    Quantity(
        name="ground_arrival_s",
        unit="s",
        words="ground arrival",
        meaning="ground wave arrives, clock time",
        kind="arrival",
        default_sigma=1e-3,
    ),
    Quantity(
        name="arrival_difference_s",
        unit="s",
        words="air minus ground arrival",
        meaning="air minus ground arrival at one sensor",
        kind="time difference",
        parts=(("air_arrival_s", 1.0), ("ground_arrival_s", -1.0)),
    ),
    Quantity(
        name="peak_overpressure_pa",
        unit="Pa",
        words="peak overpressure",
        meaning="incident peak overpressure",
        kind="pressure",
        default_sigma=0.05,
    ),
    Quantity(
        name="positive_impulse_pa_s",
        unit="Pa s",
        words="positive impulse",
        meaning="incident impulse of the positive phase",
        kind="impulse",
        default_sigma=0.05,
    ),
    Quantity(
        name="positive_duration_s",
        unit="s",
        words="positive duration",
        meaning="duration of the positive phase",
        kind="duration",
    ),
    Quantity(
        name="reflected_pressure_pa",
        unit="Pa",
        words="reflected pressure",
        meaning="normally reflected peak overpressure",
        kind="pressure",
    ),
    Quantity(
        name="reflected_impulse_pa_s",
        unit="Pa s",
        words="reflected impulse",
        meaning="normally reflected impulse",
        kind="impulse",
    ),
    Quantity(
        name="shock_radius_m",
        unit="m",
        words="shock radius",
        meaning="radius of the shock front at time_s",
        kind="shock radius",
        placeless=True,
    ),
    Quantity(
        name="fireball_radius_m",
        unit="m",
        words="fireball radius",
        meaning="radius of the fireball at time_s",
        kind="fireball radius",
        placeless=True,
    ),
    Quantity(
        name="fireball_radius_px",
        unit="px",
        words="fireball radius in the image",
        meaning="the same in pixels of the scene's camera",
        kind="fireball radius",
        by_camera=True,
    ),
    Quantity(
        name="bearing_rad",
        unit="rad",
        words="bearing of the charge",
        meaning="direction of the charge, clockwise from north",
        kind="direction",
        largest=2 * math.pi,
        circular=True,
    ),
    Quantity(
        name="elevation_rad",
        unit="rad",
        words="elevation of the charge",
        meaning="direction of the charge, above the horizon",
        kind="direction",
        largest=math.pi / 2,
    ),
    Quantity(
        name="ground_peak_velocity_m_s",
        unit="m/s",
        words="peak ground velocity",
        meaning="peak particle velocity of the ground",
        kind="speed",
    ),
    Quantity(
        name="ground_displacement_m",
        unit="m",
        words="peak ground displacement",
        meaning="peak displacement of the ground",
        kind="displacement",
    ),
    Quantity(
        name="jolt_velocity_m_s",
        unit="m/s",
        words="jolt",
        meaning="change of velocity that the blast gives the scene's vehicle",
        kind="speed",
        by_vehicle=True,
    ),
    Quantity(
        name="jolt_bearing_rad",
        unit="rad",
        words="bearing of the jolt",
        meaning="direction in which the vehicle is thrown, clockwise from north",
        kind="direction",
        largest=2 * math.pi,
        circular=True,
        by_vehicle=True,
    ),
    Quantity(
        name="jolt_elevation_rad",
        unit="rad",
        words="elevation of the jolt",
        meaning="direction in which the vehicle is thrown, above the horizon",
        kind="direction",
        largest=math.pi / 2,
        by_vehicle=True,
    ),
)
_DERIVED = (
    Quantity(
        name="shock_speed_m_s",
        unit="m/s",
        words="shock speed",
        meaning="speed of the shock front",
        kind="speed",
    ),
    Quantity(
        name="blast_wind_m_s",
        unit="m/s",
        words="blast wind",
        meaning="speed of the air behind the front",
        kind="speed",
    ),
    Quantity(
        name="dynamic_pressure_pa",
        unit="Pa",
        words="dynamic pressure",
        meaning="dynamic pressure of the blast wind behind the front",
        kind="pressure",
    ),
    Quantity(
        name="friedlander_decay",
        unit="1",
        words="Friedlander decay b",
        meaning="decay of the Friedlander pulse of a law's other numbers",
        kind="shape",
    ),
    Quantity(
        name="negative_pressure_pa",
        unit="Pa",
        words="negative-phase pressure",
        meaning="incident peak underpressure of the negative phase",
        kind="pressure",
    ),
    Quantity(
        name="negative_impulse_pa_s",
        unit="Pa s",
        words="negative-phase impulse",
        meaning="incident impulse of the negative phase",
        kind="impulse",
    ),
    Quantity(
        name="negative_duration_s",
        unit="s",
        words="negative-phase duration",
        meaning="duration of the negative phase",
        kind="duration",
    ),
    Quantity(
        name="reflected_negative_pressure_pa",
        unit="Pa",
        words="reflected negative-phase pressure",
        meaning="normally reflected peak underpressure",
        kind="pressure",
    ),
    Quantity(
        name="reflected_negative_impulse_pa_s",
        unit="Pa s",
        words="reflected negative-phase impulse",
        meaning="normally reflected impulse, negative phase",
        kind="impulse",
    ),
)
QUANTITIES: dict[str, Quantity] = {row.name: row for row in _RECORDED}
"""Quantities of the rows of logs, by name."""
DERIVED_QUANTITIES: dict[str, Quantity] = {row.name: row for row in _DERIVED}
"""Quantities that laws predict but logs cannot contain, by name."""


def quantity_named(name: str) -> Quantity | None:
    """Return a quantity; None if the name is unknown."""
    return QUANTITIES.get(name) or DERIVED_QUANTITIES.get(name)


CLOCK_TIMES = tuple(q.name for q in _RECORDED if q.kind in CLOCK_KINDS)
"""Quantities that are readings of a clock."""
ARRIVALS = tuple(q.name for q in _RECORDED if q.kind == "arrival")
"""Clock times of the arrival of a wave."""
TIMES = tuple(q.name for q in _RECORDED if q.kind in TIME_KINDS)
"""Quantities in seconds; the scatter of their laws is a share of the travel time."""
FIREBALL_RADII = tuple(q.name for q in _RECORDED if q.kind == "fireball radius")
TIMED = (*(q.name for q in _RECORDED if q.kind == "shock radius"), *FIREBALL_RADII)
"""Quantities measured at a time: their rows have a `time_s`."""
PLACELESS = tuple(q.name for q in _RECORDED if q.placeless)
"""Quantities that do not depend on the sensor's position."""
BY_CAMERA = tuple(q.name for q in _RECORDED if q.by_camera)
"""Quantities measured in images of the scene's camera."""
BY_VEHICLE = tuple(q.name for q in _RECORDED if q.by_vehicle)
"""Responses of the scene's vehicle: they depend on its model and position."""
DIRECTIONS = {q.name: q.largest for q in _RECORDED if q.kind == "direction"}
"""Angles at a sensor's position, with their largest magnitude [rad]."""
CIRCULAR = tuple(q.name for q in _RECORDED if q.circular)
"""Angles that are periodic in a full circle."""
ADDITIVE = (*TIMES, *DIRECTIONS)
"""Quantities with errors in their own unit; errors of others are in ln (positive)."""
FEEL_WIND = tuple(q.name for q in _RECORDED if q.feels_wind)
"""Quantities that depend on the wind."""
ADDABLE = {q.name: q.default_sigma for q in _RECORDED if q.default_sigma is not None}
"""Quantities of proposed additional readings, with their error: seconds or relative."""


def unit_suffix(name: str) -> str:
    """Return the end of a name that is its unit, a key of `UNITS`."""
    # The longest: a name in _n_m ends in _m as well.
    return max((end for end in UNITS if name.endswith(end)), key=len)


def components(quantity: str) -> tuple[tuple[str, float], ...]:
    """Return pairs of a quantity with a law and a sign, whose sum is the quantity."""
    known = QUANTITIES.get(quantity)
    # A plain quantity is its own only part, so that callers need no special case.
    return (known.parts if known else ()) or ((quantity, 1.0),)


def made_with(part: str) -> tuple[str, ...]:
    """Return the quantities that have a quantity as a part, including itself."""
    return tuple(name for name in QUANTITIES if part in dict(components(name)))
