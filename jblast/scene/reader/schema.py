"""Every key a scene file may have: the one table its reader goes by."""

from jblast.quantity_table import QUANTITIES

KEYS: dict[str, tuple[str, ...]] = {
    "": ("schema", "charge", "air", "ground", "sensor", "camera", "vehicle", "law"),
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
    ),
    "ground": ("p_speed_m_s", "path"),
    "sensor": ("name", "kind", "position_m", "clock_offset_s", "records", "times_s"),
    "camera": (
        "position_m",
        "look_at_m",
        "quaternion_xyzw",
        "width",
        "height",
        "focal_px",
        "center_px",
        "distortion",
        "frames_hz",
        "exposure_s",
        "threshold",
    ),
    "vehicle": ("model", "position_m", "velocity_m_s", "control"),
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
    ),
    "law": (*QUANTITIES, "scatter", "sedov_gamma", "fireball_growth_s"),
}
"""Keys by table; "" is the file itself, "control" stands in [vehicle]."""

LATER: dict[str, tuple[str, ...]] = {
    "": ("world",),
    "sensor": ("rate_hz", "sensitivity", "noise_pa", "filter_hz"),
    "vehicle": ("mission",),
}
"""Keys of the contract that nothing uses yet."""

SENSOR_KINDS = ("pressure", "microphone", "anemometer", "geophone", "flash", "imu")
VEHICLE_MODELS = ("crazyflie", "hummingbird", "iris")
GROUND_PATHS = ("head", "thesis")

LAW_NAMES_LATER = ("euler", "emulator")
"""Laws of the contract that nobody built yet; the others are in the registry."""
