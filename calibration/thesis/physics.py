"""Physics of the thesis; importing this module registers its laws."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from calibration.thesis import laws as laws
from calibration.thesis.loads import coded_load, printed_load
from jblast.sensors.camera.image import linear_to_srgb

WEIGHTS = (0.299, 0.587, 0.114)
"""Weights of red, green and blue in the grey of 8 bits (ITU-R BT.601)."""
STEP = 15
"""Change of the grey value, of 255, above which there is an event: the default of the
detector of gazebo_blast3d."""
SOUND = ("peak_overpressure_pa", "positive_duration_s", "positive_impulse_pa_s")


class Physics(NamedTuple):
    """Physics of a blast in place of jblast's.

    Attributes:
        tables: Tables of a scene file.
        load: Function from a scene to the load of its blasts on the vehicle.
        pressure_speed_m_s: Speed of pressure and force; None: that of sound.
    """

    tables: dict[str, dict[str, Any]]
    load: Callable[..., Any]
    pressure_speed_m_s: float | None = None

    @property
    def toml(self) -> str:
        """The tables as text, which follows that of a scene without them."""
        lines = []
        for name, keys in self.tables.items():
            lines.append(f"\n[{name}]")
            for key, value in keys.items():
                text = str(value).lower() if isinstance(value, bool) else repr(value)
                lines.append(f"{key} = {text}")
        return "\n".join(lines) + "\n"


def _physics(name: str, path: str, **others: Any) -> Physics:
    arrivals = dict.fromkeys(("air_arrival_s", "ground_arrival_s"), "wu_hao")
    tables = {
        # the thesis's speed of sound "in dry air at 20 C"; its laws have absorption
        "air": {"sound_speed_m_s": 340.0, "absorption": False},
        "ground": {"p_speed_m_s": 6000.0, "path": path},
        "law": {**arrivals, **dict.fromkeys(SOUND, name), "scatter": False},
    }
    return Physics(tables, **others)


PRINTED = _physics("thesis_as_printed", "head", load=printed_load)
CODED = _physics("thesis_as_coded", "thesis", load=coded_load, pressure_speed_m_s=300.0)


def frame_differences(
    frames: Iterable[tuple[float, UInt8[np.ndarray, "height width"]]],
) -> Iterator[tuple[float, np.ndarray]]:
    """Yield time and polarities of the thesis's events of each frame but the first.

    There is one event if the grey value of a pixel changes by more than `STEP` from one
    frame to the next, whatever the change. Its polarity is inverted: -1 brighter and +1
    darker.

    Args:
        frames: Time [s] and grey values of each frame, in order of time.
    """
    before: np.ndarray | None = None
    for time, grey in frames:
        # differences of unsigned bytes would wrap
        light = grey.astype(np.int16)
        if before is not None:
            change = light - before
            yield time, -np.sign(change[np.abs(change) > STEP])
        before = light


def grey_bytes(
    frame: Float[np.ndarray, "height width 3"],
) -> UInt8[np.ndarray, "height width"]:
    """Return the grey values of 8 bits of a frame of linear light."""
    shown = linear_to_srgb(np.clip(frame, 0.0, 1.0))
    return np.rint(255.0 * (shown @ np.asarray(WEIGHTS))).astype(np.uint8)
