"""What our columns and quantities are called elsewhere, before the unit.

`CALLED` says what means one thing alone, and is converted. `NEAR` says what could mean
more than one (an impulse may be reflected, a radius be that of a fireball): it is
refused, and the answer names ours.
"""

CALLED: dict[str, dict[str, str]] = {
    "pressure": {
        "overpressure": "peak_overpressure_pa",
        "incident_overpressure": "peak_overpressure_pa",
        "side_on_overpressure": "peak_overpressure_pa",
        "peak_incident_overpressure": "peak_overpressure_pa",
        "peak_side_on_overpressure": "peak_overpressure_pa",
        "reflected_overpressure": "reflected_pressure_pa",
        "peak_reflected_pressure": "reflected_pressure_pa",
        "peak_reflected_overpressure": "reflected_pressure_pa",
    },
    "impulse": {
        "incident_impulse": "positive_impulse_pa_s",
        "side_on_impulse": "positive_impulse_pa_s",
        "positive_phase_impulse": "positive_impulse_pa_s",
    },
    "time": {
        "arrival": "air_arrival_s",
        "arrival_time": "air_arrival_s",
        "time_of_arrival": "air_arrival_s",
        "toa": "air_arrival_s",
        "positive_phase_duration": "positive_duration_s",
        "flash": "flash_time_s",
    },
    "length": {"slant_range": "range_m", "shock_front_radius": "shock_radius_m"},
    "speed": {
        "peak_ground_velocity": "ground_peak_velocity_m_s",
        "pgv": "ground_peak_velocity_m_s",
    },
    "level": {
        "peak_level": "peak_overpressure_pa",
        "peak_spl": "peak_overpressure_pa",
        "peak_sound_pressure_level": "peak_overpressure_pa",
    },
}

NEAR: dict[str, tuple[tuple[str, str], ...]] = {
    "pressure": (("refl", "reflected_pressure_pa"), ("", "peak_overpressure_pa")),
    "impulse": (("refl", "reflected_impulse_pa_s"), ("", "positive_impulse_pa_s")),
    "time": (
        ("duration", "positive_duration_s"),
        ("diff", "arrival_difference_s"),
        ("flash", "flash_time_s"),
        ("ground", "ground_arrival_s"),
        ("seismic", "ground_arrival_s"),
        ("arriv", "air_arrival_s"),
        ("toa", "air_arrival_s"),
        ("time", "time_s"),
    ),
    "length": (
        ("fireball", "fireball_radius_m"),
        ("radius", "shock_radius_m"),
        ("displ", "ground_displacement_m"),
        ("range", "range_m"),
        ("dist", "range_m"),
        ("slant", "range_m"),
        ("east", "east_m"),
        ("north", "north_m"),
        ("alt", "alt_m"),
        ("height", "up_m"),
        ("up", "up_m"),
    ),
    "speed": (("", "ground_peak_velocity_m_s"),),
    "angle": (
        ("bearing", "bearing_rad"),
        ("azimuth", "bearing_rad"),
        ("elev", "elevation_rad"),
        ("lat", "lat_deg"),
        ("lon", "lon_deg"),
    ),
    "level": (("", "peak_level_db"),),
}
"""By dimension: what a foreign name contains, and which of ours may be meant."""

COLUMNS: dict[str, tuple[str, ...]] = {
    "length": ("east_m", "north_m", "up_m", "range_m", "alt_m"),
    "time": ("time_s",),
}
"""Our columns that have a unit, by dimension; latitudes have no other."""
