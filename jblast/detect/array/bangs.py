"""Which arrivals at several microphones are of one bang."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jblast.detect.peaks import Detection

SLOWEST = 300.0
"""A front is never slower [m/s]: sound at -50 degrees Celsius."""
UNSURE = 0.01
"""Added to what it takes from one microphone to another [s]."""


class Bangs(NamedTuple):
    """Arrivals by bang.

    Attributes:
        heard: For each bang, in order of time, the arrival at each sensor.
        left_out: Weaker arrivals at a sensor, within one bang: echoes, or another bang
            before the first had come everywhere.
    """

    heard: tuple[dict[str, Detection], ...]
    left_out: tuple[tuple[str, Detection], ...]


def bangs(
    detections: Mapping[str, Sequence[Detection]],
    positions: Mapping[str, Sequence[float]],
    *,
    one: bool = False,
) -> Bangs:
    """Return which arrivals are of one bang.

    A front takes no longer from the first microphone to the last than sound does;
    arrivals within that time are of one bang. Of several at one sensor the loudest is.

    Args:
        detections: By sensor.
        positions: East, north, up of each [m].
        one: Whether all are of one bang: recorders' clocks do not agree.
    """
    where = np.array([positions[name] for name in detections]).reshape(-1, 3)
    apart = np.linalg.norm(where[:, None] - where[None], axis=-1).max(initial=0.0)
    longest = np.inf if one else apart / SLOWEST + UNSURE
    every = [(name, found) for name, of in detections.items() for found in of]
    every.sort(key=lambda heard: heard[1].time_s)
    heard: list[dict[str, Detection]] = []
    left_out: list[tuple[str, Detection]] = []
    first = -np.inf
    for name, found in every:
        if not heard or found.time_s - first > longest:
            heard.append({})
            first = found.time_s
        other = heard[-1].get(name)
        if other is None or found.statistic > other.statistic:
            heard[-1][name] = found
            found = other
        if found is not None:
            left_out.append((name, found))
    return Bangs(tuple(heard), tuple(left_out))
