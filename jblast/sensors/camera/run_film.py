"""Camera events of a run, packet by packet, in bounded memory.

They are those of the film: blocks of instants have one length, whatever the packets.
"""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from jaxtyping import Float, PRNGKeyArray

from jblast.sensors.camera.film import RUN_ERROR, Film
from jblast.sensors.camera.pixel import Events, NoiseModel
from jblast.sensors.camera.scene_events import film_events

ROUNDING_S = 1e-9
"""Times that are closer together are equal [s]."""
Columns = tuple[np.ndarray, ...]


def filmed_packets(
    film: Film,
    bounds: Float[np.ndarray, " bound"],
    *,
    noise: NoiseModel | None = None,
    key: PRNGKeyArray | None = None,
) -> Iterator[tuple[Float[np.ndarray, " frame"], Events]]:
    """Yield times of the frames and camera events of consecutive packets.

    Args:
        film: Camera, and times of all frames, of which the first is the reference of
            the events.
        bounds: Beginning of each packet, and end of the last [s].
        noise: Imperfections of the event camera; None for an ideal one.
        key: Random key of the noise.

    Raises:
        InputError: As in `render`, or there is noise without a key.
    """

    def events() -> Iterator[tuple[float, Columns]]:
        ends: list[float] = []
        options = {"noise": noise, "key": key, "bound_s": RUN_ERROR}
        for found in film_events(film, **options, seen=ends.append):
            columns = found.time, found.x, found.y, found.polarity
            yield ends[-1], tuple(map(np.asarray, columns))

    part, begin = Parts(events()), 0
    for _, end in pairwise(np.asarray(bounds) - ROUNDING_S):
        time, x, y, sign = part.until(end)
        count = np.asarray(len(time)), np.asarray(0)
        stop = int(np.searchsorted(film.times, end))
        yield film.times[begin:stop], Events(x, y, time, sign, *count)
        begin = stop


class Parts:
    """Rows from blocks of columns, of which the first is their time."""

    def __init__(self, blocks: Iterator[tuple[float, Columns]]):
        """Store the blocks, each with the time up to which it is complete."""
        self._blocks, self._known = blocks, -math.inf
        self._left: Columns | None = None

    def until(self, end: float) -> Columns:
        """Remove and return the rows before a time."""
        parts = [] if self._left is None else [self._left]
        while self._known < end and (block := next(self._blocks, None)) is not None:
            self._known, columns = block
            parts.append(columns)
        whole = [np.concatenate(columns) for columns in zip(*parts, strict=True)]
        count = int(np.searchsorted(whole[0], end))
        self._left = tuple(column[count:] for column in whole)
        return tuple(column[:count] for column in whole)
