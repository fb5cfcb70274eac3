r"""Flashes in a film or in camera events: search, checks, threshold, rows of a log.

The sequential test of `watch` was set for 1,000 frames a second and images up to
`WIDEST` pixels wide. Faster frames are averaged to about that rate, larger images to at
most that width. Events are summed to a change of the logarithm of light in each
millisecond.

The test raises an alarm within milliseconds. The frames that follow reject two causes
that are no blast. The first is sparkle, as of the sun on waves: pixels that light up as
often after an alarm as before it are no onset. The second is growth that does not slow
down. A radius that grows by a power law of time, as that of a balloon, has a constant
logarithmic slope $d\ln R / d\ln t = p$: 1/3 for a constant flow, 1 for a constant
speed. A fireball, $R = R_\infty (1 - e^{-t/\tau})$, has

$$\frac{d\ln R}{d\ln t} = \frac{t/\tau}{e^{t/\tau} - 1}.$$

The slope of the later half of the radii is compared with that of the slowest fireball.

The threshold follows from the greatest value of the statistic in each of many sequences
without a blast. Above a level $u$ the rate per hour is taken to fall exponentially,
as for a sum of evidence over many frames (a generalised Pareto tail of shape 0;
Pickands 1975),

$$\nu(h) = \nu_u\, e^{-(h - u)/\sigma}$$

with $\sigma$ the mean excess. If the fitted shape is above 0 the tail is heavier, and
its own quantile is used. Rare scenes may have tails of their own: the greatest observed
value is therefore taken to be exceeded once in all of the film, with the same scale
beyond it. The larger of both thresholds is used.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jblast.observations import Observations, observed
from jblast.scene import Camera
from jblast.sensors.camera.files.recorded_events import RecordedEvents
from jblast.signals.flash.fireball import (
    UNSURE,
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
    BRIGHTER,
    FAINT,
    MIN_PIXELS,
    PIXEL_NOISES,
    REMEMBERED,
    Seen,
    Watch,
    stays_for,
)
from jblast.signals.matched_filter import HOUR_S
from jblast.signals.samples import checked_positive

RATE_HZ = 1000.0
"""Frames a second that the test was set for [Hz]."""
SLOW_HZ = 500.0
"""Below this a fireball has grown between two frames; the test was not set for it."""
WIDEST = 320
"""Columns or rows that are looked at [px]."""
LEAD, AFTER = 60, 40
"""Frames that are kept before an alarm, and measured after it."""
DECIDED = 60
"""Frames after an alarm with which it is checked: by then growth by the cube root of
time has 1.5 times the slope of the slowest fireball."""
LAG_S = 0.5e-3
"""Delay by the low-pass of an event pixel, that of 300 Hz [s]."""
LIT = 0.3
"""Sum of the changes of the logarithm, by events, from which on a pixel shines."""
Image = Float[np.ndarray, "height width"]
SETTLED = 20
"""Frames after an alarm from which on a fireball lights few more pixels: two time
constants of 1 t at 1,000 frames a second."""
ENOUGH = 10
"""Frames or radii that a rate or a slope is taken from, at least."""
CONTINUES = 0.5
"""Pixels lit a frame after an alarm over those before it from which on it is sparkle.
Half way: stationary sparkle has 1, a growth that has ended 0."""
NORMAL = 1.4826
"""Standard deviation of normal noise over its median size."""
SLOWEST_S = 0.02
"""Time constant of the slowest fireball: twice that of 1 t by the law, which is known
to a factor of two (`waves.fireball`). The test was set for up to 1 t [s]."""
SPARKLE = "pixels went on lighting up as before it, as on glittering water"
GROWS_ON = "its growth did not slow down as a fireball's of up to 1 t does"
SAME_AS_REJECTED = "it belongs to what had been rejected there before"
STEP_S = 1e-3
"""Events of so long are one change [s]."""
BLOCK = 32
"""Steps whose images are in memory together: 80 MB at 640 x 480 pixels."""
Block = tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ height width"]]
SENSOR = "camera"
RADII = 8
"""Most rows of a flash with its radius."""
MIN_RADIUS = 3.0
"""Smallest reported radius [px]."""


class Flash(NamedTuple):
    """A blast that was seen.

    Attributes:
        statistic: Of the test, at the alarm.
        told_s: Time of the alarm [s].
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
        reason: Of the rejection, `SPARKLE`, `GROWS_ON` or `SAME_AS_REJECTED`.
    """

    time_s: float
    reason: str


class FlashDetections(NamedTuple):
    """Blasts found in a film.

    Attributes:
        flashes: Blasts in order of time.
        times: Of the frames that the test saw [s].
        statistic: Of the test, after each.
        threshold: From which on it is a blast.
        latency_s: From first light to the alarm, at least [s].
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
        blocks: Times [s] and linear light, full scale 1; or with `changes` the changes
            of its logarithm by events.
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
                return SAME_AS_REJECTED
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


def sparkles(
    changes: Float[np.ndarray, "frame row column"], begun: int, at: int
) -> bool:
    """Return whether pixels go on lighting up as they did before an alarm.

    A pixel is lit by a change that is large for its own noise, as in `Brightening`: in
    the dark the logarithm of light is noisy all the time.

    Args:
        changes: Of the logarithm of light, from frame to frame, about the alarm.
        begun: Number of the frame in which its evidence began.
        at: Number of the frame of the alarm.
    """
    noise = NORMAL * np.median(np.abs(changes), axis=0)
    least = np.maximum(BRIGHTER, PIXEL_NOISES * noise)
    lit = np.count_nonzero(changes > least, axis=(1, 2))
    before, after = lit[begun : at + 1].mean(), lit[at + SETTLED :]
    # of fewer pixels a rate is not known
    if len(after) < ENOUGH or before < MIN_PIXELS:
        return False
    return bool(after.mean() > CONTINUES * before)


def grows_on(seen: Sequence[Silhouette], earliest_s: float) -> bool:
    """Return whether a spot grew on when the slowest fireball slows down.

    Args:
        seen: Its silhouettes in order of time. Those after a cut or a leap, and those
            whose radius is not trusted, are left out.
        earliest_s: The last instant that does not show it [s].
    """
    whole = [one for one in growing(seen) if one.sigma_px <= UNSURE * one.radius_px]
    time, radius, error = (
        np.array([getattr(one, name) for one in whole])
        for name in ("time_s", "radius_px", "sigma_px")
    )
    if len(time) < 2 * ENOUGH:
        return False
    since = time - 0.5 * (earliest_s + seen[0].time_s)
    late = since > 0.5 * since[-1]
    if np.count_nonzero(late) < ENOUGH:
        return False
    since, radius, error = since[late], radius[late], error[late]
    slope, sigma = _slope(np.log(since), np.log(radius))
    fireball, _ = _slope(np.log(since), np.log(-np.expm1(-since / SLOWEST_S)))
    # errors of silhouettes are shared by neighbours: they do not average out
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
    r"""Tail of the greatest values of sequences without a blast.

    Attributes:
        level: From here on it is a tail, $u$.
        scale: Mean excess $\sigma$, or the Pareto scale.
        shape: Of the Pareto tail; 0 is exponential.
        per_hour: How often the level is passed, $\nu_u$ [1/h].
        trials: Sequences.
        hours: Of all of them [h].
        greatest: Value that was seen.
    """

    level: float
    scale: float
    shape: float
    per_hour: float
    trials: int
    hours: float
    greatest: float = -math.inf

    def threshold(self, false_alarms_per_hour: float) -> float:
        """Return the statistic that is passed so often without a blast [1/h].

        For fewer than one in all of the film it lies above the greatest value seen.
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

    def false_alarms(self, threshold: float) -> float:
        """Return how often a threshold is passed without a blast [1/h]."""
        excess = max(threshold - self.level, 0.0) / self.scale
        if self.shape == 0.0:
            rate = self.per_hour * math.exp(-excess)
        else:
            rate = self.per_hour * (1.0 + self.shape * excess) ** (-1.0 / self.shape)
        over = threshold - self.greatest
        return max(rate, math.exp(-max(over, 0.0) / self.scale) / self.hours)


def fitted_tail(
    greatest: Float[np.ndarray, " trial"], seconds: float, share: float = 0.05
) -> Tail:
    """Return the tail of the greatest values of sequences without a blast.

    The Pareto shape is that of L-moments (Hosking and Wallis 1987, eq. 9); below 0 it
    is set to 0, so that no end of the tail is believed in.

    Args:
        greatest: Of each sequence.
        seconds: How long each lasts [s].
        share: Of the sequences that are taken for the tail.
    """
    ordered = np.sort(greatest)
    count = max(round(share * len(ordered)), 8)
    level = float(ordered[-count - 1])
    excess = ordered[-count:] - level
    if excess.max() > 0.0:  # the rest equal the level: most have no evidence at all
        excess = excess[excess > 0.0]
        count = len(excess)
    mean = float(excess.mean())
    weights = (np.arange(count) + 0.65) / count  # plotting positions
    second = float((excess * (1.0 - weights)).mean())
    shape = -(mean / (mean - 2.0 * second) - 2.0) if mean > 2.0 * second else 0.0
    shape = max(shape, 0.0)
    scale = mean * (1.0 - shape) if shape < 1.0 else mean
    hours = len(ordered) * seconds / HOUR_S
    rate, largest = count / hours, float(ordered[-1])
    return Tail(level, scale, shape, rate, len(ordered), hours, largest)


MEASURED = Tail(
    level=0.8988,
    scale=0.7115,
    shape=0.097,
    per_hour=600,
    trials=2000,
    hours=2000 * 0.3 / HOUR_S,
    greatest=6.288,
)
"""Of the test's greatest statistic, by `calibration/visual_detector.py`.

Its hour is one of what looks like a flash, not of an empty street: lamps, cars, glints,
shots, lightning, a moving camera and a noisy one in turn, one in every 0.3 s.
"""


def flash_threshold(false_alarms_per_hour: float = 1.0) -> float:
    """Return the statistic from which on something is a blast.

    Args:
        false_alarms_per_hour: How many on average [1/h].

    Raises:
        InputError: The rate is not positive.
    """
    rate = checked_positive("false_alarms_per_hour", false_alarms_per_hour, "1/h")
    return MEASURED.threshold(rate)


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


def log_of(
    flashes: Sequence[Flash], camera: Camera, comments: Sequence[str] = ()
) -> Observations:
    """Return the rows: first light, direction and radii of each flash.

    Args:
        flashes: What was seen.
        camera: Who saw it.
        comments: Provenance.
    """
    place = np.asarray(camera.position, float)
    rows: list[tuple[str, float, float, float, str]] = []
    for number, flash in enumerate(flashes, 1):
        shot = str(number) if len(flashes) > 1 else ""
        grown, nan = flash.growth, float("nan")
        came = direction_of(camera, grown)
        rows += [
            ("flash_time_s", grown.time_s, grown.sigma_s, nan, shot),
            ("bearing_rad", came.bearing_rad, came.bearing_sd_rad, nan, shot),
            ("elevation_rad", came.elevation_rad, came.elevation_sd_rad, nan, shot),
        ]
        for seen in _some(flash):
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


def _some(flash: Flash) -> list[Silhouette]:
    """Return a few silhouettes of those that grow, denser while it grows fast."""
    large = [
        one
        for one in growing(flash.silhouettes)
        if one.radius_px >= MIN_RADIUS and one.time_s > flash.growth.time_s
    ]
    whole = [one for one in large if one.sigma_px <= UNSURE * one.radius_px]
    if 2 * len(whole) < len(large):
        return []  # what made the others too large is in these, too
    if len(whole) <= RADII:
        return whole
    which = np.unique(np.geomspace(1, len(whole), RADII).round().astype(int) - 1)
    return [whole[i] for i in which]
