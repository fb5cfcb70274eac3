"""Events as Parab's thesis makes them: differences of frames of 8-bit grey.

Where the grey value of a pixel changes by more than a threshold from one frame to the
next there is one event, at the time of the second, whatever the change. That brighter
is 0 there, and darker 1, becomes -1 and +1 here. Wrong, and kept to compare: an event
camera answers to the logarithm of light, each pixel in its own time, several times a
frame.

References:
    Facts of the camera plugin of gazebo_blast3d (July 2025), which is GPL. Its scene
    sets the threshold; that of its detector stands here.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from jaxtyping import Float, UInt8

from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.image.compositing import linear_to_srgb

WEIGHTS = (0.299, 0.587, 0.114)
"""Of red, green and blue in the grey of 8 bits (ITU-R BT.601)."""
STEP = 15
"""Change of the grey value past which there is an event, of 255."""

Grey = UInt8[np.ndarray, "height width"]


def frame_differences(
    frames: Iterable[tuple[float, Grey]], step: int = STEP
) -> Iterator[Events]:
    """Yield the events of each frame but the first.

    Args:
        frames: Time [s] and grey values of each, in order of time.
        step: Change past which there is an event, of 255.
    """
    before: np.ndarray | None = None
    for time, grey in frames:
        light = grey.astype(np.int16)
        if before is not None:
            change = light - before
            y, x = np.nonzero(np.abs(change) > step)
            count = np.array(x.size)
            yield Events(
                x=x.astype(np.int32),
                y=y.astype(np.int32),
                time=np.full(x.size, float(time)),
                polarity=np.where(change[y, x] > 0, -1, 1).astype(np.int8),
                count=count,
                lost=np.array(0),
            )
        before = light


def grey_bytes(frame: Float[np.ndarray, "height width 3"]) -> Grey:
    """Return the grey values of 8 bits of a frame of linear light."""
    shown = linear_to_srgb(np.clip(frame, 0.0, 1.0))
    return np.rint(255.0 * (shown @ np.asarray(WEIGHTS))).astype(np.uint8)
