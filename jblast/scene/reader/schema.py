"""Every key a scene file may have: the one table its reader goes by."""

from jblast.quantity_table import QUANTITIES

INSTRUMENT_KEYS = (
    "rate_hz",
    "full_scale_pa",
    "full_scale_m_s",
    "noise_pa",
    "noise_m_s",
    "bits",
    "filter_hz",
    "saturation",
)
"""Keys of a sensor that say what its instrument does."""

IMU_KEYS = (
    "rate_hz",
    "full_scale_m_s2",
    "full_scale_rad_s",
    "noise_m_s2_sqrt_hz",
    "noise_rad_s_sqrt_hz",
    "bias_m_s2",
    "bias_rad_s",
    "bias_walk_m_s2_sqrt_s",
    "bias_walk_rad_s_sqrt_s",
    "bits",
)
"""Those of an imu."""

KEYS: dict[str, tuple[str, ...]] = {
    "": (
        "schema",
        "charge",
        "air",
        "ground",
        "sensor",
        "clock",
        "place",
        "ambient",
        "camera",
        "vehicle",
        "world",
        "law",
    ),
    "charge": (
        "name",
        "mass_kg",
        "explosive",
        "tnt_factor",
        "position_m",
        "range_m",
        "time_s",
        "burst",
    ),
    "air": (
        "temperature_k",
        "pressure_pa",
        "relative_humidity",
        "altitude_m",
        "sound_speed_m_s",
        "wind_m_s",
        "absorption",
        "absorption_scale",
    ),
    "ground": ("p_speed_m_s", "path"),
    "sensor": (
        "name",
        "kind",
        "position_m",
        "clock_offset_s",
        "records",
        "times_s",
        "mount",
        "offset_m",
        "quaternion_xyzw",
        *dict.fromkeys((*INSTRUMENT_KEYS, *IMU_KEYS)),
    ),
    "clock": ("name", "offset_s"),
    "place": ("lat_deg", "lon_deg", "alt_m"),
    "ambient": ("file", "full_scale_pa", "level_pa", "slope_db_octave", "height_m"),
    "camera": (
        "position_m",
        "look_at_m",
        "quaternion_xyzw",
        "mount",
        "offset_m",
        "width",
        "height",
        "focal_px",
        "center_px",
        "distortion",
        "frames_hz",
        "exposure_s",
        "threshold",
        "daylight_lux",
    ),
    "vehicle": ("model", "position_m", "velocity_m_s", "control", "mission"),
    "world": (
        "count",
        "rate_hz",
        "probability",
        "tick_s",
        "region_m",
        "about",
        "mass_kg",
        "time_s",
        "gap_s",
    ),
    "region": ("box", "ring", "about"),
    "control": (
        "integral",
        "target_m",
        "yaw_rad",
        "kp_pos",
        "kd_pos",
        "ki_pos",
        "kp_att",
        "kd_att",
        "integral_limit",
        "motor_lead",
    ),
    "law": (*QUANTITIES, "scatter", "sedov_gamma", "fireball_growth_s"),
}
"""Keys by table; "" is the file itself, "control" stands in [vehicle], "region" in
[world]."""

LATER: dict[str, tuple[str, ...]] = {}
"""Keys of the contract that nothing uses yet."""

SENSOR_KINDS = ("pressure", "microphone", "anemometer", "geophone", "flash", "imu")
INSTRUMENT_KINDS = ("pressure", "microphone", "anemometer", "geophone")
"""Sensors that write samples, one after another."""
VELOCITY_KINDS = ("anemometer", "geophone")
"""Those that measure m/s; the others measure Pa."""
SATURATIONS = ("clip", "compress")
VEHICLE_MODELS = ("crazyflie", "hummingbird", "iris")
GROUND_PATHS = ("head", "thesis")

LAW_NAMES_LATER = ("euler", "emulator")
"""Laws of the contract that nobody built yet; the others are in the registry."""
