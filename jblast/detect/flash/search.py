"""A film or a stream of events searched for blasts, from its beginning to its end.

Frames that come faster than a thousand a second are averaged to about that rate, and
images wider than `WIDEST` to at most that width: the test was set for such films.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.detect.flash.cusum import stays_for
from jblast.detect.flash.growth import Growth, growth
from jblast.detect.flash.silhouette import Silhouette
from jblast.detect.flash.watch import Seen, Watch
from jblast.detect.flash.window import joined, seed_of, silhouettes

RATE_HZ = 1000.0
"""Frames a second that the test was set for [Hz]."""
SLOW_HZ = 500.0
"""Below this a fireball has grown between two frames; the test was not set for it."""
WIDEST = 320
"""Columns or rows that are looked at [px]."""
LEAD, AFTER = 60, 40
"""Frames that are kept before an alarm, and waited for after it."""
LAG_S = 0.5e-3
"""What the low-pass of an event pixel may delay it by: that of 300 Hz does [s]."""
LIT = 0.3
"""Sum of the changes of the logarithm, by events, from which on a pixel shines."""

Image = Float[np.ndarray, "height width"]


class Flash(NamedTuple):
    """A blast that was seen.

    Attributes:
        statistic: Of the test, when it was told.
        told_s: When it was told [s].
        frame: Number of the first frame that shows it, or for events of the
            millisecond.
        growth: First light, place and growth.
        silhouettes: Of each frame, from the first on.
        picture: A frame that shows it grown; None of events.
    """

    statistic: float
    told_s: float
    frame: int
    growth: Growth
    silhouettes: tuple[Silhouette, ...]
    picture: Image | None


class FlashDetections(NamedTuple):
    """What was seen in a film.

    Attributes:
        flashes: Blasts in order of time.
        times: Of the frames that the test saw [s].
        statistic: What it said after each.
        threshold: From which on it is a blast.
        latency_s: From first light to its being told, at least [s].
        binned: Pixels a side that were averaged.
    """

    flashes: tuple[Flash, ...]
    times: Float[np.ndarray, " frame"]
    statistic: Float[np.ndarray, " frame"]
    threshold: float
    latency_s: float
    binned: int


class _Kept(NamedTuple):
    """A frame as the test saw it."""

    number: int
    time: float
    image: Image
    lit: Bool[np.ndarray, "height width"]


def detect_flashes(
    blocks: Iterable[tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ _ _"]]],
    rate_hz: float,
    threshold: float,
    *,
    changes: bool = False,
) -> FlashDetections:
    """Search frames for blasts.

    Args:
        blocks: Times [s] and linear light, full scale 1; or with `changes` what events
            say of its logarithm.
        rate_hz: Frames a second [Hz].
        threshold: Of the statistic.
        changes: Whether they are changes.
    """
    group = 1 if changes else max(1, round(rate_hz / RATE_HZ))
    rate = rate_hz / group
    watch: Watch | None = None
    kept: deque[_Kept] = deque(maxlen=LEAD + AFTER)
    alarm: tuple[int, Seen] | None = None
    flashes: list[Flash] = []
    times, statistics, binned = [], [], 1
    number = -1
    for number, (time, image) in enumerate(_grouped(blocks, group)):
        if watch is None:
            binned = max(1, math.ceil(max(image.shape) / WIDEST))
            watch = Watch(_binned(image, binned).shape, stays=stays_for(rate))
        image = _binned(image, binned)
        seen = watch.change(image) if changes else watch.frame(image)
        none = np.zeros(image.shape, bool)
        kept.append(_Kept(number, time, image, watch.last.lit if watch.last else none))
        times.append(time)
        statistics.append(seen.statistic)
        if alarm is None and seen.statistic > threshold:
            alarm = number, seen
        if alarm is not None and number - alarm[0] >= AFTER:
            flashes += _measured(kept, *alarm, group, binned, changes)
            alarm = None
            watch.forget()
    if alarm is not None:
        flashes += _measured(kept, *alarm, group, binned, changes)
    wait = (stays_for(rate) - 1) / rate
    return FlashDetections(
        tuple(flashes), np.array(times), np.array(statistics), threshold, wait, binned
    )


def _grouped(blocks, group: int) -> Iterator[tuple[float, Image]]:
    """Return frames one by one, or the means of several."""
    times: list[float] = []
    total: np.ndarray | None = None
    for block_times, images in blocks:
        for time, image in zip(block_times, images, strict=True):
            if group == 1:
                yield float(time), image
                continue
            total = image.astype(np.float32) if total is None else total + image
            times.append(float(time))
            if len(times) == group:
                assert total is not None
                yield float(np.mean(times)), total / np.float32(group)
                times, total = [], None


def _binned(image: Image, side: int) -> Float[np.ndarray, "row column"]:
    """Return the means of squares of pixels; what is left over at the edges is lost."""
    if side == 1:
        return image
    height, width = (size // side * side for size in image.shape)
    blocks = image[:height, :width].reshape(height // side, side, width // side, side)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def _measured(
    kept: "deque[_Kept]", number: int, seen: Seen, group: int, binned: int, events: bool
) -> list[Flash]:
    """Return the flash about an alarm; none where no spot is left to be measured."""
    frames = list(kept)
    numbers = np.array([one.number for one in frames])
    times = np.array([one.time for one in frames])
    at = int(np.searchsorted(numbers, number))
    begun = max(at - seen.frames + 1, 0)
    seed = seed_of([one.lit for one in frames[begun : at + 1]], seen.box)
    images = np.stack([one.image for one in frames])
    if events:
        first = max(begun - 2, 0)
        shares = (np.cumsum(images[first:], axis=0) > LIT).astype(np.float32)
        before = times[first - 1] if first else times[0] - (times[1] - times[0])
        spots, earliest = joined(times[first:], shares, seed, float(before))
    else:
        spots, earliest = silhouettes(times, images, begun, seed)
    if not spots:
        return []
    spots = [_unbinned(one, binned) for one in spots]
    fitted = growth(spots, earliest)
    if events:
        sigma = float(np.hypot(fitted.sigma_s, LAG_S))
        fitted = fitted._replace(sigma_s=sigma)
    first_time = spots[0].time_s
    shown = int(np.searchsorted(times, first_time))
    picture = None if events else images[min(shown + 15, len(images) - 1)]
    return [
        Flash(
            seen.statistic,
            float(times[at]),
            int(numbers[shown]) * group,
            fitted,
            tuple(spots),
            picture,
        )
    ]


def _unbinned(one: Silhouette, side: int) -> Silhouette:
    """Return a silhouette in pixels of the whole image."""
    offset = 0.5 * (side - 1)
    return one._replace(
        radius_px=side * one.radius_px,
        x_px=side * one.x_px + offset,
        y_px=side * one.y_px + offset,
        area_px=side**2 * one.area_px,
        sigma_px=side * one.sigma_px,
    )
