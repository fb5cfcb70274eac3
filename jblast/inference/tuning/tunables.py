"""Numbers of sensors and media that a record can tell, described once.

Those of the table `PARAMETERS` (charge, air, ground, clocks) are tuned beside them,
under the names that they have there.
"""

import math
from dataclasses import dataclass

from jblast.parameters import Key


@dataclass(frozen=True, kw_only=True)
class Tunable:
    """A number of a sensor or a medium.

    Attributes:
        name: As after `--free` and in answers.
        unit: SI unit, "1" if there is none.
        words: What a sentence calls it.
        attribute: Where it lives in a scene; `sensor` is the one that recorded.
        key: Where it stands in a scene file.
        told_by: Which records can tell it: "sound", "frames", "events".
        above: It is larger than this, where it is looked for.
        below: It is smaller; infinite: of any size.
        in_ln: Whether it is looked for by factors.
        step: What is a large change of it: that of its logarithm, where it is looked
            for by factors. A record that does not feel two of it tells nothing.
        start: Where a search begins if the scene says nothing; NaN: by the record.
    """

    name: str
    unit: str
    words: str
    attribute: str
    key: Key
    told_by: tuple[str, ...]
    above: float = 0.0
    below: float = math.inf
    in_ln: bool = True
    step: float = math.log(2.0)
    start: float = math.nan


SOUND, FRAMES, EVENTS = "sound", "frames", "events"
SIGHT = (FRAMES, EVENTS)

_ROWS = (
    Tunable(
        name="absorption_scale",
        unit="1",
        words="absorption of the air over that of ISO 9613-1",
        attribute="air.absorption_scale",
        key=Key("air", "absorption_scale"),
        told_by=(SOUND,),
        start=1.0,
    ),
    Tunable(
        name="ambient_level_pa",
        unit="Pa",
        words="level of the ambient sound on the ground",
        attribute="ambient.level",
        key=Key("ambient", "level_pa"),
        told_by=(SOUND,),
    ),
    Tunable(
        name="ambient_slope_db_octave",
        unit="dB/octave",
        words="slope of the ambient sound",
        attribute="ambient.slope",
        key=Key("ambient", "slope_db_octave"),
        told_by=(SOUND,),
        above=-12.0,
        below=12.0,
        in_ln=False,
        step=3.0,
        start=0.0,
    ),
    Tunable(
        name="ambient_height_m",
        unit="m",
        words="height over which the ambient sound falls",
        attribute="ambient.height",
        key=Key("ambient", "height_m"),
        told_by=(SOUND,),
    ),
    Tunable(
        name="high_pass_hz",
        unit="Hz",
        words="high-pass corner of the sensor",
        attribute="sensor.instrument.high_pass",
        key=Key("sensor", "filter_hz", 0),
        told_by=(SOUND,),
        start=20.0,
    ),
    Tunable(
        name="low_pass_hz",
        unit="Hz",
        words="low-pass corner of the sensor",
        attribute="sensor.instrument.low_pass",
        key=Key("sensor", "filter_hz", 1),
        told_by=(SOUND,),
    ),
    Tunable(
        name="noise_pa",
        unit="Pa",
        words="noise of the sensor",
        attribute="sensor.instrument.noise",
        key=Key("sensor", "noise_pa"),
        told_by=(SOUND,),
    ),
    Tunable(
        name="full_scale_pa",
        unit="Pa",
        words="full scale of the sensor",
        attribute="sensor.instrument.full_scale",
        key=Key("sensor", "full_scale_pa"),
        told_by=(SOUND,),
    ),
    Tunable(
        name="camera_threshold_brighter",
        unit="1",
        words="threshold of brighter events",
        attribute="camera.threshold",
        key=Key("camera", "threshold", 0),
        told_by=(EVENTS,),
        start=0.2,
    ),
    Tunable(
        name="camera_threshold_darker",
        unit="1",
        words="threshold of darker events",
        attribute="camera.threshold",
        key=Key("camera", "threshold", 1),
        told_by=(EVENTS,),
        start=0.2,
    ),
    Tunable(
        name="camera_daylight_lux",
        unit="lx",
        words="light of day that the picture is exposed for",
        attribute="camera.daylight",
        key=Key("camera", "daylight_lux"),
        told_by=SIGHT,
        start=math.pi * 3e4,
    ),
    Tunable(
        name="camera_focal_x_px",
        unit="px",
        words="focal length along rows",
        attribute="camera.focal",
        key=Key("camera", "focal_px", 0),
        told_by=SIGHT,
    ),
    Tunable(
        name="camera_focal_y_px",
        unit="px",
        words="focal length along columns",
        attribute="camera.focal",
        key=Key("camera", "focal_px", 1),
        told_by=SIGHT,
    ),
)

TUNABLES: dict[str, Tunable] = {row.name: row for row in _ROWS}
"""By name."""
