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

from jblast.detect.flash.brightening import REMEMBERED
from jblast.detect.flash.cusum import stays_for
from jblast.detect.flash.growth import Growth, growth
from jblast.detect.flash.silhouette import Silhouette
from jblast.detect.flash.verdict import (
    GROWS_ON,
    SAME,
    SPARKLE,
    grows_on,
    sparkles,
)
from jblast.detect.flash.watch import FAINT, Seen, Watch
from jblast.detect.flash.window import joined, seed_of, silhouettes

RATE_HZ = 1000.0
"""Frames a second that the test was set for [Hz]."""
SLOW_HZ = 500.0
"""Below this a fireball has grown between two frames; the test was not set for it."""
WIDEST = 320
"""Columns or rows that are looked at [px]."""
LEAD, AFTER = 60, 40
"""Frames that are kept before an alarm, and measured after it."""
DECIDED = 60
"""Frames after an alarm with which it is checked (`verdict`): by then growth by the
cube root of time has 1.5 times the slope of the slowest fireball."""
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


class Rejected(NamedTuple):
    """An alarm that was no blast by the frames that follow it.

    Attributes:
        time_s: Time of the alarm [s].
        reason: Of the rejection, one of those of `verdict`.
    """

    time_s: float
    reason: str


class FlashDetections(NamedTuple):
    """What was seen in a film.

    Attributes:
        flashes: Blasts in order of time.
        times: Of the frames that the test saw [s].
        statistic: What it said after each.
        threshold: From which on it is a blast.
        latency_s: From first light to its being told, at least [s].
        binned: Pixels a side that were averaged.
        rejected: Alarms that were no blasts, in order of time.
    """

    flashes: tuple[Flash, ...]
    times: Float[np.ndarray, " frame"]
    statistic: Float[np.ndarray, " frame"]
    threshold: float
    latency_s: float
    binned: int
    rejected: tuple[Rejected, ...] = ()


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
    kept: deque[_Kept] = deque(maxlen=LEAD + DECIDED)
    alarm: int | None = None
    pending: deque[tuple[int, Seen]] = deque()
    decided = _Decided(group, changes)
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
            alarm = number
            pending.append((number, seen))
        if alarm is not None and number - alarm >= AFTER:
            alarm = None
            watch.forget()
        if pending and number - pending[0][0] >= DECIDED:
            decided.add(kept, *pending.popleft(), binned)
    for one in pending:
        decided.add(kept, *one, binned)
    wait = (stays_for(rate) - 1) / rate
    return FlashDetections(
        tuple(decided.flashes),
        np.array(times),
        np.array(statistics),
        threshold,
        wait,
        binned,
        tuple(decided.rejected),
    )


class _Decided:
    """Alarms that were decided: flashes, and what was none.

    Attributes:
        flashes: In order of time.
        rejected: Likewise.
    """

    def __init__(self, group: int, changes: bool):
        """Begin with none; see `detect_flashes`."""
        self._group, self._changes = group, changes
        self.flashes: list[Flash] = []
        self.rejected: list[Rejected] = []
        self._spurned: tuple[int, tuple[int, int, int, int]] | None = None

    def add(self, kept: "deque[_Kept]", number: int, seen: Seen, binned: int) -> None:
        """Decide an alarm by all frames that are kept; measure it if it is a blast."""
        frames = [one for one in kept if one.number > number - LEAD]
        numbers = np.array([one.number for one in frames])
        at = int(np.searchsorted(numbers, number))
        begun = max(at - seen.frames + 1, 0)
        reason = self._objection(frames, begun, at, seen)
        if reason is not None:
            self.rejected.append(Rejected(frames[at].time, reason))
            self._spurned = number, seen.box
            return
        frames = [one for one in frames if one.number <= number + AFTER]
        self.flashes += _measured(
            frames, number, seen, self._group, binned, self._changes
        )

    def _objection(
        self, frames: "list[_Kept]", begun: int, at: int, seen: Seen
    ) -> str | None:
        """Return why an alarm is no blast; None if it is one."""
        number = frames[at].number
        if self._spurned is not None:
            last, box = self._spurned
            # what lit pixels of it is remembered for so long
            if number - last <= AFTER + REMEMBERED and _overlap(box, seen.box):
                return SAME
        left, top, right, bottom = seen.box
        images = np.stack([one.image for one in frames])
        part = images[:, top:bottom, left:right]
        changes = part
        if not self._changes:
            logs = np.log(np.maximum(part, 0.0) + FAINT)
            changes = np.diff(logs, axis=0, prepend=logs[:1])
        if sparkles(changes, begun, at):
            return SPARKLE
        spots, earliest = _spots(frames, images, begun, at, seen, self._changes)
        return GROWS_ON if grows_on(spots, earliest) else None


def _overlap(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    across = min(one[2], other[2]) > max(one[0], other[0])
    return across and min(one[3], other[3]) > max(one[1], other[1])


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


def _spots(
    frames: "list[_Kept]",
    images: Float[np.ndarray, "frame row column"],
    begun: int,
    at: int,
    seen: Seen,
    events: bool,
) -> tuple[list[Silhouette], float]:
    """Return the silhouettes about an alarm, and the last instant without them [s]."""
    times = np.array([one.time for one in frames])
    seed = seed_of([one.lit for one in frames[begun : at + 1]], seen.box)
    if not events:
        return silhouettes(times, images, begun, seed)
    first = max(begun - 2, 0)
    shares = (np.cumsum(images[first:], axis=0) > LIT).astype(np.float32)
    before = times[first - 1] if first else times[0] - (times[1] - times[0])
    return joined(times[first:], shares, seed, float(before))


def _measured(
    frames: "list[_Kept]",
    number: int,
    seen: Seen,
    group: int,
    binned: int,
    events: bool,
) -> list[Flash]:
    """Return the flash about an alarm; none where no spot is left to be measured."""
    numbers = np.array([one.number for one in frames])
    times = np.array([one.time for one in frames])
    at = int(np.searchsorted(numbers, number))
    begun = max(at - seen.frames + 1, 0)
    images = np.stack([one.image for one in frames])
    spots, earliest = _spots(frames, images, begun, at, seen, events)
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
