"""Every key a scene file may have: the one table its reader goes by."""

import math
from dataclasses import dataclass

from jblast.quantities import QUANTITIES

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


@dataclass(frozen=True)
class Number:
    """A number of the file that may be fixed, free or a prior.

    Attributes:
        parameter: Its name in `scene.PARAMETERS`.
        table: Where it stands.
        key: How it is called there.
        index: Its place in a list, None where it stands alone.
        above: It is larger than this.
        lo: It is at least this.
        hi: It is at most this.
    """

    parameter: str
    table: str
    key: str
    index: int | None = None
    above: float = -math.inf
    lo: float = -math.inf
    hi: float = math.inf

    def allows(self, value: float) -> bool:
        """Return whether a number lies within the bounds."""
        return self.above < value and self.lo <= value <= self.hi

    def bounds(self) -> str:
        """Return the bounds in words."""
        if math.isfinite(self.lo):
            return f"between {self.lo:g} and {self.hi:g}"
        if self.above == 0:
            return "positive"
        return f"above {self.above:g}"


NUMBERS = (
    Number("charge_mass_kg", "charge", "mass_kg", above=0.0),
    Number("tnt_factor", "charge", "tnt_factor", above=0.0),
    Number("charge_east_m", "charge", "position_m", index=0),
    Number("charge_north_m", "charge", "position_m", index=1),
    Number("charge_up_m", "charge", "position_m", index=2),
    Number("charge_range_m", "charge", "range_m", above=0.0),
    Number("origin_time_s", "charge", "time_s"),
    Number("air_temperature_k", "air", "temperature_k", lo=150.0, hi=400.0),
    Number("air_pressure_pa", "air", "pressure_pa", above=0.0),
    Number("air_relative_humidity", "air", "relative_humidity", lo=0.0, hi=1.0),
    Number("air_altitude_m", "air", "altitude_m", lo=-500.0, hi=11_000.0),
    Number("air_sound_speed_m_s", "air", "sound_speed_m_s", above=0.0),
    Number("wind_east_m_s", "air", "wind_m_s", index=0, lo=-100.0, hi=100.0),
    Number("wind_north_m_s", "air", "wind_m_s", index=1, lo=-100.0, hi=100.0),
    Number("ground_p_speed_m_s", "ground", "p_speed_m_s", above=0.0),
    Number("sedov_gamma", "law", "sedov_gamma", above=1.0),
    Number("fireball_growth_s", "law", "fireball_growth_s", above=0.0),
)
"""Air temperatures are those of Earth's troposphere, with room to spare; the standard
atmosphere's lowest layer ends at 11 km. No wind on the ground reaches 100 m/s."""
