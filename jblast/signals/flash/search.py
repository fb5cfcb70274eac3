r"""Flashes in a film or in camera events: search, checks, threshold, rows of a log.

The sequential test of `watch` is tuned for 1,000 frames a second and images up to
`MAX_WIDTH` pixels wide. Faster frames are averaged to about that rate, larger images to
at most that width. Events are summed to a change of the logarithm of light in each
millisecond.

The test raises an alarm within milliseconds. The frames that follow reject two other
causes. The first is sparkle, as of the sun on waves: pixels that light up as often
after an alarm as before it are no onset. The second is growth that does not slow down.
A radius that grows by a power law of time, as that of a balloon, has a constant
logarithmic slope $d\ln R / d\ln t = p$: 1/3 for a constant flow, 1 for a constant
speed. A fireball, $R = R_\infty (1 - e^{-t/\tau})$, has

$$\frac{d\ln R}{d\ln t} = \frac{t/\tau}{e^{t/\tau} - 1}.$$

The slope of the later half of the radii is compared with that of the slowest fireball.

The threshold follows from the largest statistic of each of many sequences without a
blast. Above a level $u$ the rate per hour is assumed to fall exponentially, as for a
sum of evidence over many frames (a generalised Pareto tail of shape 0; Pickands 1975),

$$\nu(h) = \nu_u\, e^{-(h - u)/\sigma}$$

with $\sigma$ the mean excess. If the fitted shape is above 0 the tail is heavier, and
its quantile is used. Rare scenes may have other tails: the largest observed value is
therefore assumed to be exceeded once in the whole film, with the same scale beyond it.
The larger of both thresholds is used.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Integer

from jblast.observations import Observations, observed
from jblast.scene import Camera
from jblast.sensors.camera.files.recorded_events import RecordedEvents
from jblast.signals.flash.fireball import (
    MAX_RELATIVE_ERROR,
    Growth,
    Silhouette,
    direction_of,
    growing,
    growth,
    joined,
    radius_in_middle,
    seed_of,
    silhouettes,
)
from jblast.signals.flash.watch import (
    LIGHT_OFFSET,
    LIT_LOG_CHANGE,
    MIN_PIXELS,
    PIXEL_NOISES,
    REMEMBERED,
    Seen,
    Watch,
    stays_for,
)
from jblast.signals.matched_filter import HOUR_S
from jblast.signals.noise import checked_positive

TUNED_RATE_HZ = 1000.0
"""Frame rate for which the test is tuned [Hz]."""
SLOW_HZ = 500.0
"""Frame rate below which a warning is given [Hz]: a fireball may grow fully between two
frames, and the test is not tuned for that."""
MAX_WIDTH = 320
"""Largest number of columns or rows of the tested image [px]: the tuned sizes of tiles
then cover fireballs of up to a third of it, and larger images cost no more time."""
FRAMES_BEFORE, FRAMES_AFTER = 60, 40
"""Frames before an alarm that are stored, for the background and the start of growth,
and frames after it that are measured: four time constants of 1 t at 1,000 frames a
second."""
DECISION_FRAMES = 60
"""Frames after an alarm by which it is checked: at their end, growth by the cube root
of time has 1.5 times the slope of the slowest fireball."""
LAG_S = 0.5e-3
"""Delay by the low-pass of an event pixel of 300 Hz [s], added to the error."""
LIT_SUM = 0.3
"""Sum of the changes of the logarithm by events from which on a pixel belongs to a
fireball: one or two events of the usual threshold, 0.2."""
Image = Float[np.ndarray, "height width"]
SETTLED_FRAMES = 20
"""Frames after an alarm from which on a fireball lights few more pixels: two time
constants of 1 t at 1,000 frames a second."""
MIN_FITTED = 10
"""Smallest number of frames for a rate, or of radii for a slope."""
SPARKLE_RATIO = 0.5
"""Rate of lit pixels after an alarm, over that before it, from which on it is sparkle:
half way between stationary sparkle, 1, and a growth that has ended, 0."""
NORMAL = 1.4826
"""Standard deviation of normal noise over the median of its absolute value."""
SLOWEST_S = 0.02
"""Time constant of the slowest fireball [s]: twice that of 1 t by the law, which is
known to a factor of two (`waves.fireball`). The test is tuned for up to 1 t."""
SPARKLE = "pixels went on lighting up as before it, as on glittering water"
GROWS_ON = "its growth did not slow down as a fireball's of up to 1 t does"
SAME_AS_REJECTED = "it belongs to what had been rejected there before"
STEP_S = 1e-3
"""Time over which events are summed to one change [s]: the tuned frame interval."""
STEP_US = round(1e6 * STEP_S)
"""The same [us]."""
BLOCK_STEPS = 32
"""Steps whose images are in memory together: 80 MB at 640 x 480 pixels."""
Block = tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ height width"]]
SENSOR = "camera"
MAX_RADII = 8
"""Largest number of rows with a radius of one flash: errors of neighbouring radii are
shared, and more rows would not add information."""
MIN_RADIUS = 3.0
"""Smallest reported radius [px]: the error of a third of a pixel is a tenth of it."""


class Flash(NamedTuple):
    """A detected blast.

    Attributes:
        statistic: Statistic of the test at the alarm.
        told_s: Time of the alarm [s].
        frame: Number of the first frame that shows it; of the millisecond for events.
        growth: First light, position and growth.
        silhouettes: Silhouette in each frame, from the first on.
        picture: A frame that shows it grown; None for events.
    """

    statistic: float
    told_s: float
    frame: int
    growth: Growth
    silhouettes: tuple[Silhouette, ...]
    picture: Image | None


class Rejected(NamedTuple):
    """An alarm that the frames after it do not confirm as a blast.

    Attributes:
        time_s: Time of the alarm [s].
        reason: Reason of the rejection: `SPARKLE`, `GROWS_ON` or `SAME_AS_REJECTED`.
    """

    time_s: float
    reason: str


class FlashDetections(NamedTuple):
    """Blasts found in a film.

    Attributes:
        flashes: Blasts in order of time.
        times: Times of the tested frames [s].
        statistic: Statistic of the test after each.
        threshold: Threshold of the statistic.
        latency_s: Smallest delay from first light to the alarm [s].
        binned: Side of the squares of pixels that were averaged [px].
        rejected: Rejected alarms, in order of time.
    """

    flashes: tuple[Flash, ...]
    times: Float[np.ndarray, " frame"]
    statistic: Float[np.ndarray, " frame"]
    threshold: float
    latency_s: float
    binned: int
    rejected: tuple[Rejected, ...] = ()


class _Kept(NamedTuple):
    """A frame as tested."""

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
    exposure_s: float = 0.0,
) -> FlashDetections:
    """Search frames for blasts.

    Args:
        blocks: Times at the middle of the exposures [s] and linear light, full scale 1;
            or with `changes` the changes of its logarithm by events.
        rate_hz: Frame rate [Hz].
        threshold: Threshold of the statistic.
        changes: True for changes by events.
        exposure_s: Exposure of a frame, 0 if not known [s].
    """
    watch = FlashWatch(rate_hz, threshold, changes=changes, exposure_s=exposure_s)
    flashes: list[Flash] = []
    rejected: list[Rejected] = []
    times, statistics = [np.zeros(0)], [np.zeros(0)]
    for block in chain(blocks, [None]):
        flashes += watch.finish() if block is None else watch.push(*block)
        rejected += watch.rejected
        times.append(watch.times)
        statistics.append(watch.statistic)
    return FlashDetections(
        tuple(flashes),
        np.concatenate(times),
        np.concatenate(statistics),
        threshold,
        watch.latency_s,
        watch.binned,
        tuple(sorted(rejected)),
    )


class FlashWatch:
    """Search of an unlimited stream of frames, or of changes, in bounded memory.

    An alarm is raised within milliseconds of a fireball, and decided `DECISION_FRAMES`
    later, for example 0.6 s at 100 frames a second.

    Attributes:
        rejected: Alarms that the last push rejected.
        times: Times of the frames that the last push tested [s].
        statistic: Statistic of the test after each.
        latency_s: Smallest delay from first light to the alarm [s].
        binned: Side of the squares of pixels that are averaged [px].
    """

    def __init__(
        self,
        rate_hz: float,
        threshold: float,
        *,
        changes: bool = False,
        exposure_s: float = 0.0,
        shape: tuple[int, int] | None = None,
    ):
        """Create the search.

        Args:
            rate_hz: Frame rate [Hz].
            threshold: Threshold of the statistic.
            changes: True for changes by events.
            exposure_s: Exposure of a frame, 0 if not known [s].
            shape: Height and width [px]; None for those of the first image.
        """
        self._group = 1 if changes else max(1, round(rate_hz / TUNED_RATE_HZ))
        rate = rate_hz / self._group
        self._threshold, self._changes = threshold, changes
        # averaged frames are one longer exposure
        self._exposure_s = exposure_s + (self._group - 1) / rate_hz
        self._stays = stays_for(rate)
        self._watch: Watch | None = None
        self._shape = shape
        self._kept: deque[_Kept] = deque(maxlen=FRAMES_BEFORE + DECISION_FRAMES)
        self._alarm: int | None = None
        self._pending: deque[tuple[int, Seen]] = deque()
        self._spurned: tuple[int, tuple[int, int, int, int]] | None = None
        self._number = -1
        self._parts: np.ndarray | float = 0.0
        self._part_times: list[float] = []
        self.latency_s, self.binned = (self._stays - 1) / rate, 1
        self._start()

    def _start(self) -> None:
        self._flashes: list[Flash] = []
        self._rejected: list[Rejected] = []
        self._times: list[float] = []
        self._statistics: list[float] = []

    def push(
        self, times: Sequence[float] | np.ndarray, images: Iterable[Image | None]
    ) -> tuple[Flash, ...]:
        """Process frames; return the blasts that are decided by now.

        Args:
            times: Times, as in `detect_flashes` [s].
            images: Light, or changes; None is a change of zero.
        """
        self._start()
        for time, image in zip(times, images, strict=True):
            if self._group == 1:
                # a copy, since callers reuse their buffers
                self._add(float(time), None if image is None else np.array(image))
                continue
            self._parts = self._parts + np.asarray(image, np.float32)
            self._part_times.append(float(time))
            if len(self._part_times) == self._group:
                mean = self._parts / np.float32(self._group)
                self._add(float(np.mean(self._part_times)), mean)
                self._parts, self._part_times = 0.0, []
        return self._reported()

    def finish(self) -> tuple[Flash, ...]:
        """Return the remaining blasts at the end of the frames."""
        self._start()
        while self._pending:
            self._decide(*self._pending.popleft())
        return self._reported()

    def _reported(self) -> tuple[Flash, ...]:
        self.rejected = tuple(sorted(self._rejected))
        self.times = np.array(self._times)
        self.statistic = np.array(self._statistics)
        return tuple(self._flashes)

    def _begin(self, image: Image | None) -> Watch:
        """Create the test for the shape of the first frame, or the given one."""
        shape = self._shape if image is None else image.shape
        if shape is None:
            raise ValueError("shape: expected it for a first step without events")
        self.binned = max(1, math.ceil(max(shape) / MAX_WIDTH))
        self._still = _binned(np.zeros(shape, np.float32), self.binned)
        self._none = np.zeros(self._still.shape, bool)
        self._watch = Watch(self._still.shape, stays=self._stays)
        return self._watch

    def _add(self, time: float, image: Image | None) -> None:
        """Test a frame."""
        self._number += 1
        number = self._number
        watch = self._watch or self._begin(image)
        # averaging before the logarithm: light adds up, its logarithm does not
        image = self._still if image is None else _binned(image, self.binned)
        if not self._changes:
            seen = watch.frame(image)
        elif image is self._still or not image.any():
            # one image for all steps without events
            seen, image = watch.rest(), self._still
        else:
            seen = watch.change(image)
        lit = self._none if watch.last is None else watch.last.lit
        self._kept.append(_Kept(number, time, image, lit))
        self._times.append(time)
        self._statistics.append(seen.statistic)
        loud = seen.statistic > self._threshold
        if self._alarm is None and loud:
            self._alarm = number
            self._pending.append((number, seen))
        # one alarm for each blast: its remaining evidence is dropped
        if self._alarm is not None and number - self._alarm >= FRAMES_AFTER:
            self._alarm = None
            watch.forget()
        if self._pending and number - self._pending[0][0] >= DECISION_FRAMES:
            self._decide(*self._pending.popleft())

    def _decide(self, number: int, seen: Seen) -> None:
        """Check an alarm by all stored frames; measure it if it is a blast."""
        frames = [one for one in self._kept if one.number > number - FRAMES_BEFORE]
        numbers = np.array([one.number for one in frames])
        at = int(np.searchsorted(numbers, number))
        begun = max(at - seen.frames + 1, 0)
        reason = self._objection(frames, begun, at, seen)
        if reason is not None:
            self._rejected.append(Rejected(frames[at].time, reason))
            self._spurned = number, seen.box
            return
        frames = [one for one in frames if one.number <= number + FRAMES_AFTER]
        self._flashes += _measured(
            frames,
            number,
            seen,
            self._group,
            self.binned,
            self._changes,
            self._exposure_s,
        )

    def _objection(
        self, frames: "list[_Kept]", begun: int, at: int, seen: Seen
    ) -> str | None:
        """Return the reason for the rejection of an alarm; None for a blast."""
        number = frames[at].number
        if self._spurned is not None:
            last, box = self._spurned
            # pixels of the rejected alarm do not count again for that long, so later
            # evidence in its tile is the rest of it
            if number - last <= FRAMES_AFTER + REMEMBERED and _overlap(box, seen.box):
                return SAME_AS_REJECTED
        left, top, right, bottom = seen.box
        images = np.stack([one.image for one in frames])
        part = images[:, top:bottom, left:right]
        changes = part
        if not self._changes:
            logs = np.log(np.maximum(part, 0.0) + LIGHT_OFFSET)
            changes = np.diff(logs, axis=0, prepend=logs[:1])
        if sparkles(changes, begun, at):
            return SPARKLE
        spots, earliest, _ = _spots(frames, images, begun, at, seen, self._changes)
        return GROWS_ON if grows_on(spots, earliest) else None


def _overlap(one: tuple[int, int, int, int], other: tuple[int, int, int, int]) -> bool:
    across = min(one[2], other[2]) > max(one[0], other[0])
    return across and min(one[3], other[3]) > max(one[1], other[1])


def _binned(image: Image, side: int) -> Float[np.ndarray, "row column"]:
    """Return the means of squares of pixels, without incomplete ones at the edges."""
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
) -> tuple[list[Silhouette], float, float]:
    """Return the silhouettes about an alarm, the last dark time, and the next [s]."""
    times = np.array([one.time for one in frames])
    seed = seed_of([one.lit for one in frames[begun : at + 1]], seen.box)
    if not events:
        return silhouettes(times, images, begun, seed)
    first = max(begun - 2, 0)
    shares = (np.cumsum(images[first:], axis=0) > LIT_SUM).astype(np.float32)
    # a step earlier than the first, as the frame before it is unknown
    before = times[first - 1] if first else times[0] - (times[1] - times[0])
    spots, dark = joined(times[first:], shares, seed, float(before))
    return spots, dark, spots[0].time_s if spots else float(times[-1])


def _measured(
    frames: "list[_Kept]",
    number: int,
    seen: Seen,
    group: int,
    binned: int,
    events: bool,
    exposure_s: float,
) -> list[Flash]:
    """Return the flash about an alarm; an empty list without a measurable spot."""
    numbers = np.array([one.number for one in frames])
    times = np.array([one.time for one in frames])
    at = int(np.searchsorted(numbers, number))
    begun = max(at - seen.frames + 1, 0)
    images = np.stack([one.image for one in frames])
    spots, earliest, shown = _spots(frames, images, begun, at, seen, events)
    if not spots:
        return []
    spots = [_unbinned(one, binned) for one in spots]
    # event pixels respond late by an unknown part of their low-pass
    earliest -= LAG_S if events else 0.0
    fitted = growth(spots, earliest, shown, exposure_s)
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
    # the middle of the first square of pixels, counted from the middle of a pixel
    offset = 0.5 * (side - 1)
    return one._replace(
        radius_px=side * one.radius_px,
        x_px=side * one.x_px + offset,
        y_px=side * one.y_px + offset,
        area_px=side**2 * one.area_px,
        sigma_px=side * one.sigma_px,
    )


def sparkles(
    changes: Float[np.ndarray, "frame row column"], begun: int, at: int
) -> bool:
    """Return True if pixels light up after an alarm as often as before it.

    A pixel is lit by a change that is large compared with its own noise, as in
    `Brightening`: the logarithm of light is noisy in the dark.

    Args:
        changes: Changes of the logarithm of light between frames, about the alarm.
        begun: Number of the frame in which its evidence began.
        at: Number of the frame of the alarm.
    """
    noise = NORMAL * np.median(np.abs(changes), axis=0)
    least = np.maximum(LIT_LOG_CHANGE, PIXEL_NOISES * noise)
    lit = np.count_nonzero(changes > least, axis=(1, 2))
    before, after = lit[begun : at + 1].mean(), lit[at + SETTLED_FRAMES :]
    # too few frames or pixels give no rate
    if len(after) < MIN_FITTED or before < MIN_PIXELS:
        return False
    return bool(after.mean() > SPARKLE_RATIO * before)


def grows_on(seen: Sequence[Silhouette], earliest_s: float) -> bool:
    """Return True if a spot grows when the slowest fireball would slow down.

    Args:
        seen: Its silhouettes in order of time. Those after a cut or a leap, and those
            with an uncertain radius, are left out.
        earliest_s: Time of the last frame without it [s].
    """
    whole = [
        one
        for one in growing(seen)
        if one.sigma_px <= MAX_RELATIVE_ERROR * one.radius_px
    ]
    time, radius, error = (
        np.array([getattr(one, name) for one in whole])
        for name in ("time_s", "radius_px", "sigma_px")
    )
    if len(time) < 2 * MIN_FITTED:
        return False
    since = time - 0.5 * (earliest_s + seen[0].time_s)
    late = since > 0.5 * since[-1]
    if np.count_nonzero(late) < MIN_FITTED:
        return False
    since, radius, error = since[late], radius[late], error[late]
    # a power law is a line in logarithms
    slope, sigma = _slope(np.log(since), np.log(radius))
    fireball, _ = _slope(np.log(since), np.log(-np.expm1(-since / SLOWEST_S)))
    # errors of neighbouring silhouettes are common and do not average out
    shared = float(np.mean(error / radius)) / float(np.log(since[-1] / since[0]))
    return slope - 2.0 * float(np.hypot(sigma, shared)) > fireball


def _slope(
    x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"]
) -> tuple[float, float]:
    """Return the slope of a line by least squares, and its standard deviation."""
    x, y = x - x.mean(), y - y.mean()
    square = float(x @ x)
    slope = float(x @ y) / square
    left = y - slope * x
    return slope, float(np.sqrt(left @ left / (len(x) - 2) / square))


class Tail(NamedTuple):
    r"""Tail of the largest statistics of sequences without a blast.

    Attributes:
        level: Start of the tail, $u$.
        scale: Mean excess $\sigma$, or the Pareto scale.
        shape: Shape of the Pareto tail; 0 is exponential.
        per_hour: Rate at which the level is exceeded, $\nu_u$ [1/h].
        trials: Number of sequences.
        hours: Length of all of them [h].
        greatest: Largest observed value.
    """

    level: float
    scale: float
    shape: float
    per_hour: float
    trials: int
    hours: float
    greatest: float = -math.inf

    def threshold(self, false_alarms_per_hour: float) -> float:
        """Return the statistic that is exceeded at a rate without a blast [1/h].

        For less than one false alarm in the whole film it is above the largest observed
        value.
        """
        rarer = math.log(1.0 / (self.hours * false_alarms_per_hour))
        beyond = self.greatest + self.scale * rarer if rarer > 0.0 else -math.inf
        return max(self._by_tail(false_alarms_per_hour), beyond)

    def _by_tail(self, false_alarms_per_hour: float) -> float:
        ratio = math.log(self.per_hour / false_alarms_per_hour)
        if ratio <= 0.0:
            return self.level
        if self.shape == 0.0:
            return self.level + self.scale * ratio
        return self.level + self.scale * math.expm1(self.shape * ratio) / self.shape


MEASURED = Tail(
    level=0.8988,
    scale=0.7115,
    shape=0.097,
    per_hour=600,
    trials=2000,
    hours=2000 * 0.3 / HOUR_S,
    greatest=6.288,
)
"""Tail of the test's largest statistic, by `calibration/visual_detector.py`.

An hour here consists of scenes that resemble a flash, not of an empty street: lamps,
cars, glints, shots, lightning, a moving camera and a noisy one in turn, one in every
0.3 s.
"""


def flash_threshold(false_alarms_per_hour: float = 1.0) -> float:
    """Return the threshold of the statistic for a blast.

    Args:
        false_alarms_per_hour: Mean rate of false alarms [1/h].

    Raises:
        InputError: The rate is not positive.
    """
    rate = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    return MEASURED.threshold(rate)


def event_changes(
    events: RecordedEvents, threshold: tuple[float, float] = (0.2, 0.2)
) -> Iterator[Block]:
    """Yield the ends of steps [s], and the changes of light by the events of each.

    Args:
        events: Events in order of time.
        threshold: Change of the logarithm per event, brighter and darker.
    """
    steps = EventSteps((events.height, events.width), threshold)
    if not len(events.t):
        return
    last = int(events.t[-1]) // STEP_US + 1
    still = np.zeros(steps.shape, np.float32)
    for first in range(0, last, BLOCK_STEPS):
        until = STEP_US * min(first + BLOCK_STEPS, last)
        bounds = np.searchsorted(events.t, [STEP_US * first, until]).tolist()
        part = (column[slice(*bounds)] for column in events[:4])
        x, y, t, p = part
        times, images = steps.push(t, x, y, p > 0, until)
        yield times, np.stack([still if one is None else one for one in images])


class EventSteps:
    """Changes of light by events in each step of `STEP_S`, as the events come.

    Attributes:
        shape: Height and width of the images [px].
    """

    def __init__(
        self,
        shape: tuple[int, int],
        threshold: tuple[float, float] = (0.2, 0.2),
        first_us: int = 0,
    ):
        """Begin without events.

        Args:
            shape: Height and width [px].
            threshold: Change of the logarithm per event, brighter and darker.
            first_us: Start of the first step, a multiple of `STEP_S` [us].
        """
        self.shape = shape
        self._brighter, self._darker = threshold
        self._step = first_us // STEP_US
        self._waiting = np.zeros((3, 0))

    def push(
        self,
        t_us: Integer[np.ndarray, " event"],
        x: Integer[np.ndarray, " event"],
        y: Integer[np.ndarray, " event"],
        brighter: Bool[np.ndarray, " event"],
        until_us: int,
    ) -> tuple[Float[np.ndarray, " step"], list[Image | None]]:
        """Add events; return the ends of the completed steps [s], and their changes.

        Args:
            t_us: Times, in order [us].
            x: Columns.
            y: Rows.
            brighter: True for brighter, False for darker.
            until_us: Time before which all events are known [us].

        Returns:
            None in place of an image for a step without events.
        """
        pixel = y.astype(np.int64) * self.shape[1] + x
        amount = np.where(brighter, self._brighter, -self._darker)
        new = np.stack([t_us, pixel, amount])
        events = np.concatenate([self._waiting, new], axis=1)
        steps = np.arange(self._step, max(until_us // STEP_US, self._step))
        bounds = np.searchsorted(events[0], STEP_US * np.append(steps, steps[-1:] + 1))
        images: list[Image | None] = []
        for low, high in pairwise(bounds.tolist()):
            if low == high:
                images.append(None)
                continue
            changes = np.bincount(
                events[1, low:high].astype(np.int64),
                weights=events[2, low:high],
                minlength=self.shape[0] * self.shape[1],
            )
            images.append(changes.reshape(self.shape).astype(np.float32))
        self._waiting = events[:, bounds[-1] :].copy() if steps.size else events
        self._step += steps.size
        return STEP_S * (steps + 1), images


def log_of(
    flashes: Sequence[Flash], camera: Camera, comments: Sequence[str] = ()
) -> Observations:
    """Return the rows: first light, direction and radii of each flash.

    Args:
        flashes: The flashes.
        camera: The camera that recorded them.
        comments: Provenance.
    """
    place = np.asarray(camera.position, float)
    rows: list[tuple[str, float, float, float, str]] = []
    for number, flash in enumerate(flashes, 1):
        shot = str(number) if len(flashes) > 1 else ""
        grown, nan = flash.growth, float("nan")
        to = direction_of(camera, grown)
        rows += [
            ("flash_time_s", grown.time_s, grown.sigma_s, nan, shot),
            ("bearing_rad", to.bearing_rad, to.bearing_sd_rad, nan, shot),
            ("elevation_rad", to.elevation_rad, to.elevation_sd_rad, nan, shot),
        ]
        for seen in _reported(flash):
            radius = radius_in_middle(camera, seen)
            sigma = seen.sigma_px * radius / seen.radius_px
            rows.append(("fireball_radius_px", radius, sigma, seen.time_s, shot))
    quantity, value, sigma, time, shots = zip(*rows, strict=True) if rows else ((),) * 5
    return observed(
        (SENSOR,) * len(rows),
        quantity,
        value,
        sigma,
        position=np.tile(place, (len(rows), 1)),
        time=np.array(time, float),
        shot=tuple(shots),
        comments=tuple(comments),
    )


def _reported(flash: Flash) -> list[Silhouette]:
    """Return a few growing silhouettes, denser where growth is fast."""
    large = [
        one
        for one in growing(flash.silhouettes)
        if one.radius_px >= MIN_RADIUS and one.time_s > flash.growth.time_s
    ]
    whole = [one for one in large if one.sigma_px <= MAX_RELATIVE_ERROR * one.radius_px]
    # where most radii are uncertain, as by lit ground, the others are too large as well
    if 2 * len(whole) < len(large):
        return []
    if len(whole) <= MAX_RADII:
        return whole
    # geometric spacing, since growth slows down
    which = np.unique(np.geomspace(1, len(whole), MAX_RADII).round().astype(int) - 1)
    return [whole[i] for i in which]
