"""What a sensor can measure: the names used in observation and scene files alike."""

import math

QUANTITIES: dict[str, str] = {
    "flash_time_s": "light of the explosion seen, clock time",
    "air_arrival_s": "air shock or sound arrives, clock time",
    "ground_arrival_s": "ground wave arrives, clock time",
    "arrival_difference_s": "air minus ground arrival at one sensor",
    "peak_overpressure_pa": "incident peak overpressure",
    "positive_impulse_pa_s": "incident impulse of the positive phase",
    "positive_duration_s": "duration of the positive phase",
    "reflected_pressure_pa": "normally reflected peak overpressure",
    "reflected_impulse_pa_s": "normally reflected impulse",
    "shock_radius_m": "radius of the shock front at time_s",
    "fireball_radius_m": "radius of the fireball at time_s",
    "fireball_radius_px": "the same in pixels of the scene's camera",
    "bearing_rad": "direction of the charge, clockwise from north",
    "elevation_rad": "direction of the charge, above the horizon",
    "ground_peak_velocity_m_s": "peak particle velocity of the ground",
    "ground_displacement_m": "peak displacement of the ground",
}
"""Every quantity a row may hold, and what it means."""

DERIVED_QUANTITIES: dict[str, str] = {
    "shock_speed_m_s": "speed of the shock front",
    "blast_wind_m_s": "speed of the air behind the front",
    "dynamic_pressure_pa": "dynamic pressure of the blast wind behind the front",
    "friedlander_decay": "decay of the Friedlander pulse of a law's other numbers",
    "negative_pressure_pa": "incident peak underpressure of the negative phase",
    "negative_impulse_pa_s": "incident impulse of the negative phase",
    "negative_duration_s": "duration of the negative phase",
    "reflected_negative_pressure_pa": "normally reflected peak underpressure",
    "reflected_negative_impulse_pa_s": "normally reflected impulse, negative phase",
}
"""What laws give and no row of a log holds; suffixes name the units likewise."""

CLOCK_TIMES = ("flash_time_s", "air_arrival_s", "ground_arrival_s")
"""Quantities that are readings of a clock."""

TIMES = (*CLOCK_TIMES, "arrival_difference_s")
"""Quantities in seconds: their laws' scatter is a share of the travel time."""

FIREBALL_RADII = ("fireball_radius_m", "fireball_radius_px")

TIMED = ("shock_radius_m", *FIREBALL_RADII)
"""Quantities taken at a time: their rows have a `time_s`."""

PLACELESS = ("shock_radius_m", "fireball_radius_m")
"""Quantities that are the same wherever their sensor stands."""

DIRECTIONS: dict[str, float] = {
    "bearing_rad": 2 * math.pi,
    "elevation_rad": math.pi / 2,
}
"""Angles seen from a sensor's position, and the largest value either way [rad]."""

CIRCULAR = ("bearing_rad",)
"""Quantities that are the same after a full circle."""

ADDITIVE = (*TIMES, *DIRECTIONS)
"""Quantities that err in their own unit; all others err in ln, so are positive."""

COMPONENTS: dict[str, tuple[tuple[str, float], ...]] = {
    "arrival_difference_s": (("air_arrival_s", 1.0), ("ground_arrival_s", -1.0)),
}
"""Quantities that are signed sums of others; the rest have a law of their own."""


def components(quantity: str) -> tuple[tuple[str, float], ...]:
    """Return the quantities with a law, and their signs, that make up a quantity."""
    return COMPONENTS.get(quantity, ((quantity, 1.0),))
