"""Every quantity that a sensor may record or a law gives, described once.

Pure data, read without JAX; what follows for groups of them stands in `quantities`.
"""

import math

from jblast.quantity import Quantity

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
"""Every quantity that a row of a log may hold, by name."""

DERIVED_QUANTITIES: dict[str, Quantity] = {row.name: row for row in _DERIVED}
"""What laws give and no row of a log holds."""


def quantity_named(name: str) -> Quantity | None:
    """Return what the tables say of a quantity; None of one they do not know."""
    return QUANTITIES.get(name) or DERIVED_QUANTITIES.get(name)
