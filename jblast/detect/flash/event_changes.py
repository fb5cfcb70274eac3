"""Events as changes of the logarithm of light, millisecond by millisecond."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from jblast.sensors.camera.files.recorded_events import RecordedEvents

STEP_S = 1e-3
"""Events of so long are one change [s]."""
BLOCK = 32

Block = tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ height width"]]


def event_changes(
    events: RecordedEvents, threshold: tuple[float, float] = (0.2, 0.2)
) -> Iterator[Block]:
    """Return the ends of steps [s], and what events changed in each.

    Args:
        events: In order of time.
        threshold: Changes of the logarithm that one stands for, brighter and darker.
    """
    step_us = round(1e6 * STEP_S)
    steps = int(events.t[-1]) // step_us + 1 if len(events.t) else 0
    edges = np.searchsorted(events.t, step_us * np.arange(steps + 1))
    size = events.height * events.width
    pixel = events.y.astype(np.int64) * events.width + events.x
    amount = np.where(events.p > 0, threshold[0], -threshold[1])
    for first in range(0, steps, BLOCK):
        last = min(first + BLOCK, steps)
        which = slice(edges[first], edges[last])
        step = events.t[which] // step_us - first
        changes = np.bincount(
            step * size + pixel[which],
            weights=amount[which],
            minlength=(last - first) * size,
        )
        image = changes.reshape(last - first, events.height, events.width)
        yield STEP_S * np.arange(first + 1, last + 1), image.astype(np.float32)
