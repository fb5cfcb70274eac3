r"""Flashes in a film or in camera events: search, checks, threshold, rows of a log.

The sequential test of `watch` is tuned for 1,000 frames a second and images up to
`MAX_WIDTH` pixels wide. Faster frames are averaged to about that rate, larger images to
at most that width. Events are summed to a change of the logarithm of light in each
millisecond.

The test raises an alarm for each bright spot of the image within milliseconds. The
frames that follow decide on it, by the radius $R_k$ of all that its silhouettes lit so
far: soot hides parts of a fire again. Steps $d_k = \ln R_k - \ln R_{k-1}$ are those of
a cause, with the scatter $s_k$, or jumps, by merging spots or another glint,

$$p(d_k) = (1 - \epsilon)\,N(d_k; g_k, s_k) + \epsilon\,N(d_k; 0, s_J).$$

The steps $g_k$ of a fireball are those of $R_\infty (1 - e^{-t/\tau})$, until it has
grown, with $\tau$ up to that of the slowest; those of an inflated object are of
$(t - t_0)^p$, with $p$ from 1/3 (constant flow) to 1 (constant speed), and flicker, as
of the sun on waves, has none, and jumps in half of the frames. What grows lights new
pixels beside those that it lit before, nearly always. The glints of flicker appear
anywhere, and touch what was lit by chance, with its share of all that is lit in the
end. Evidence is the mean likelihood over the parameters. A spot below the threshold, or
with another cause, is listed as a candidate.

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
from dataclasses import dataclass, field
from itertools import chain, pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import boxcox

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
    silhouettes,
)
from jblast.signals.flash.watch import REMEMBERED, Seen, Watch, stays_for
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
FRAMES_BEFORE, DECISION_FRAMES = 60, 60
"""Frames before an alarm that are stored, for the background and the start of growth,
and frames after it, at whose end it is decided: growth by the cube root of time has
then 1.5 times the slope of the slowest fireball."""
LAG_S = 0.5e-3
"""Delay by the low-pass of an event pixel of 300 Hz [s], added to the error."""
LIT_SUM = 0.3
"""Sum of the changes of the logarithm by events from which on a pixel belongs to a
fireball: one or two events of the usual threshold, 0.2."""
Image = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
SLOWEST_S = 0.02
"""Time constant of the slowest fireball [s]: twice that of 1 t by the law, which is
known to a factor of two (`waves.fireballs`). The test is tuned for up to 1 t."""
UNRESOLVED = 8.0
"""The same, at least, in frame intervals: burning fuel grows for a third of a second
(the thesis's fireball in 12 frames), inflated objects in all 60 that are measured."""
STEP_SD, RADIUS_SD_PX, LAW_SD = 0.02, 0.1, 0.5
"""Scatter of a step of ln R: of any fireball, by 0.1 px of either radius, and, as laws
are rough, half of the law's step."""
JUMP_SD, JUMPS, FLICKERS = 0.5, 0.1, 0.5
"""Standard deviation of a jump of ln R, its probability in a frame of a spot that
grows, and of flicker. On 60 explosions soot and lit ground make up to 7 jumps in 68
frames."""
STRAYS = 0.05
"""Probability that a spot of a fireball does not touch what the fire lit before, as
where soot hides all between."""
POWERS, BEGUN = (1 / 3, 0.5, 0.7, 1.0), (0.0, 0.1, 0.3)
"""Exponents of inflated objects, and their age at first light, over the time since."""
LN_ODDS = 5.0
"""Logarithm of the odds against a fireball from which on an alarm is rejected: those
of 60 explosions were up to 2.7, of inflated discs and glitter from 9 on."""
FAINTEST_PER_HOUR = 600.0
"""False-alarm rate from which on a spot is listed as a candidate [1/h]: the start of
the tail that was measured."""
Cause = Literal["fireball", "grows_on", "flicker", "faint"]
STEP_S = 1e-3
"""Time over which events are summed to one change [s]: the tuned frame interval."""
STEP_US = round(1e6 * STEP_S)
"""The same [us]."""
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
        alarm_s: Time of the alarm [s].
        frame: Number of the first frame that shows it; of the millisecond for events.
        growth: First light, position and growth.
        silhouettes: Silhouette in each frame, from the first on.
        picture: A frame that shows it grown; None for events.
    """

    statistic: float
    alarm_s: float
    frame: int
    growth: Growth
    silhouettes: tuple[Silhouette, ...]
    picture: Image | None


class Candidate(NamedTuple):
    """A bright spot that is not reported as a blast.

    Attributes:
        time_s: Time of its first frame [s].
        frame: Number of that frame; of the millisecond for events.
        x_px: Column of its middle [px].
        y_px: Row of its middle [px].
        statistic: Largest statistic of the test.
        cause: `faint` below the threshold, `grows_on` for growth that does not slow
            down, `flicker` for sizes without an order.
    """

    time_s: float
    frame: int
    x_px: float
    y_px: float
    statistic: float
    cause: Cause


class FlashDetections(NamedTuple):
    """Blasts found in a film.

    Attributes:
        flashes: Blasts in order of time.
        times: Times of the tested frames [s].
        statistic: Statistic of the test after each.
        threshold: Threshold of the statistic.
        latency_s: Smallest delay from first light to the alarm [s].
        binned: Side of the squares of pixels that were averaged [px].
        candidates: Other bright spots, in order of time.
    """

    flashes: tuple[Flash, ...]
    times: Float[np.ndarray, " frame"]
    statistic: Float[np.ndarray, " frame"]
    threshold: float
    latency_s: float
    binned: int
    candidates: tuple[Candidate, ...] = ()


class _Kept(NamedTuple):
    """A frame as tested."""

    number: int
    time: float
    image: Image


@dataclass(eq=False)
class _Spot:
    """A bright spot of the image.

    Attributes:
        first: First frame of the evidence of `seen`.
        last: Number of the last frame in which it had evidence.
        seen: Largest statistic, after an alarm that of the alarm.
        pixels: All its pixels so far.
        alarm: Number of the frame of its alarm; None before.
        seed: Its bright pixels then.
        decided: True once the alarm is confirmed or has another cause.
    """

    first: _Kept
    last: int
    seen: Seen
    pixels: Bool[np.ndarray, "height width"]
    alarm: int | None = None
    seed: Bool[np.ndarray, "height width"] = field(init=False)
    decided: bool = False


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
        rate_hz: Frame rate, of a varying one the mean [Hz].
        threshold: Threshold of the statistic.
        changes: True for changes by events.
        exposure_s: Exposure of a frame, 0 if not known [s].
    """
    watch = FlashWatch(rate_hz, threshold, changes=changes, exposure_s=exposure_s)
    flashes: list[Flash] = []
    candidates: list[Candidate] = []
    times, statistics = [np.zeros(0)], [np.zeros(0)]
    for block in chain(blocks, [None]):
        flashes += watch.finish() if block is None else watch.push(*block)
        candidates += watch.candidates
        times.append(watch.times)
        statistics.append(watch.statistic)
    return FlashDetections(
        tuple(flashes),
        np.concatenate(times),
        np.concatenate(statistics),
        threshold,
        watch.latency_s,
        watch.binned,
        tuple(sorted(candidates)),
    )


class FlashWatch:
    """Search of an unlimited stream of frames, or of changes, in bounded memory.

    An alarm is raised within milliseconds of a fireball, and decided `DECISION_FRAMES`
    later, for example 0.6 s at 100 frames a second. Each bright spot has one alarm.

    Attributes:
        candidates: Other bright spots that the last push decided.
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
    ):
        """Create the search.

        Args:
            rate_hz: Frame rate, of a varying one the mean [Hz].
            threshold: Threshold of the statistic.
            changes: True for changes by events.
            exposure_s: Exposure of a frame, 0 if not known [s].
        """
        self._group = 1 if changes else max(1, round(rate_hz / TUNED_RATE_HZ))
        rate = rate_hz / self._group
        self._threshold, self._changes = threshold, changes
        self._faintest = min(threshold, flash_threshold(FAINTEST_PER_HOUR))
        # averaged frames are one longer exposure
        self._exposure_s = exposure_s + (self._group - 1) / rate_hz
        self._stays = stays_for(rate)
        self._watch: Watch | None = None
        self._kept: deque[_Kept] = deque(maxlen=FRAMES_BEFORE + DECISION_FRAMES)
        self._spots: list[_Spot] = []
        self._number = -1
        self._parts: list[tuple[float, Image]] = []
        self.latency_s, self.binned = (self._stays - 1) / rate, 1
        self._start()

    def _start(self) -> None:
        self._flashes: list[Flash] = []
        self.candidates: list[Candidate] = []
        self._times: list[float] = []
        self._statistics: list[float] = []

    def push(
        self, times: Sequence[float] | np.ndarray, images: Iterable[Image]
    ) -> tuple[Flash, ...]:
        """Process frames; return the blasts that are decided by now.

        Args:
            times: Times, as in `detect_flashes` [s].
            images: Light, or changes.
        """
        self._start()
        for part in zip(times, images, strict=True):
            self._parts.append(part)
            if len(self._parts) == self._group:
                every, light = zip(*self._parts, strict=True)
                self._add(
                    float(np.mean(every)),
                    np.stack(light).mean(axis=0, dtype=np.float32),
                )
                self._parts = []
        return self._reported()

    def finish(self) -> tuple[Flash, ...]:
        """Return the remaining blasts at the end of the frames."""
        self._start()
        self._settle(0)
        return self._reported()

    def _reported(self) -> tuple[Flash, ...]:
        self.times = np.array(self._times)
        self.statistic = np.array(self._statistics)
        return tuple(self._flashes)

    def _add(self, time: float, image: Image) -> None:
        """Test a frame."""
        self._number += 1
        if self._watch is None:
            self.binned = max(1, math.ceil(max(image.shape) / MAX_WIDTH))
        # averaging before the logarithm: light adds up, its logarithm does not
        image = _binned(image, self.binned)
        watch = self._watch = self._watch or Watch(image.shape, stays=self._stays)
        if not self._changes:
            seen = watch.frame(image)
        else:
            seen = watch.change(image) if image.any() else watch.rest()
        self._kept.append(_Kept(self._number, time, image))
        self._times.append(time)
        self._statistics.append(seen.statistic)
        if seen.statistic > self._faintest:
            self._follow(watch)
        self._settle(DECISION_FRAMES)

    def _settle(self, age: int) -> None:
        """Decide alarms of an age in frames; release spots without recent evidence."""
        for spot in [*self._spots]:
            if spot not in self._spots:  # a part of a fire that was just decided
                continue
            pending = spot.alarm is not None and not spot.decided
            if pending and self._number >= (spot.alarm or 0) + age:
                self._decide(spot)
            if self._number >= spot.last + min(age, REMEMBERED):
                self._spots.remove(spot)
                if spot.alarm is None:
                    self._list(spot, "faint")

    def _follow(self, watch: Watch) -> None:
        """Attribute the evidence of a frame to bright spots; raise their alarms."""
        # imported here: films without evidence do not need it
        from scipy import ndimage

        assert watch.last is not None
        bright = watch.last.bright
        every = np.logical_or.reduce([bright, *(spot.pixels for spot in self._spots)])
        names = np.zeros(every.shape, np.int32)
        ndimage.label(every, np.ones((3, 3)), output=names)
        # pixels that touch a spot belong to it, to the oldest of several
        owners = {
            int(name): spot
            for spot in reversed(self._spots)
            for name in np.unique(names[spot.pixels])
        }
        done: set[int] = set()
        for seen in watch.above(self._faintest):
            left, top, right, bottom = seen.box
            inside = np.s_[top:bottom, left:right]
            sizes = np.bincount(names[inside][bright[inside]])
            name = int(np.argmax(sizes)) if sizes.size else 0
            # scattered pixels, as of glitter, are no spot
            if name in done or 2 * sizes[name : name + 1].sum() <= sizes.sum():
                continue
            done.add(name)
            here = names == name
            spot = owners.get(name)
            if spot is None:
                spot = _Spot(self._kept[0], self._number, seen, here)
                self._spots.append(spot)
            spot.last, spot.pixels = self._number, spot.pixels | here
            if spot.alarm is not None:
                continue
            if seen.statistic >= spot.seen.statistic:
                spot.first = self._kept[-min(seen.frames, len(self._kept))]
                spot.seen = seen
            if seen.statistic > self._threshold:
                spot.alarm, spot.seed = self._number, np.zeros_like(bright)
                others = [n for n, owner in owners.items() if owner is not spot]
                spot.seed[inside] = (bright & ~np.isin(names, others))[inside]

    def _list(self, spot: _Spot, cause: Cause) -> None:
        rows, columns = np.nonzero(spot.pixels)
        side = self.binned
        self.candidates.append(
            Candidate(
                spot.first.time,
                spot.first.number * self._group,
                side * float(columns.mean()) + 0.5 * (side - 1),
                side * float(rows.mean()) + 0.5 * (side - 1),
                spot.seen.statistic,
                cause,
            )
        )

    def _decide(self, spot: _Spot) -> None:
        """Measure the spot of an alarm by all stored frames; list another cause."""
        assert spot.alarm is not None
        spot.decided = True
        frames = [one for one in self._kept if one.number > spot.alarm - FRAMES_BEFORE]
        times = np.array([one.time for one in frames])
        images = np.stack([one.image for one in frames])
        begun = max(spot.first.number - frames[0].number, 0)
        measured = _event_silhouettes if self._changes else silhouettes
        seen, earliest, shown = measured(times, images, begun, spot.seed)
        cause = verdict(seen, earliest)
        if cause != "fireball":
            self._list(spot, cause)
            return
        spot.pixels = self._fire_about(spot.pixels)
        seen = [_unbinned(one, self.binned) for one in seen]
        # event pixels respond late by an unknown part of their low-pass
        lag = LAG_S if self._changes else 0.0
        fitted = growth(seen, earliest - lag, shown, self._exposure_s)
        first = int(np.searchsorted(times, seen[0].time_s))
        self._flashes.append(
            Flash(
                spot.seen.statistic,
                float(times[spot.alarm - frames[0].number]),
                frames[first].number * self._group,
                fitted._replace(sigma_s=math.hypot(fitted.sigma_s, lag)),
                tuple(seen),
                None if self._changes else images[min(first + 15, len(images) - 1)],
            )
        )

    def _fire_about(self, fire: Mask) -> Mask:
        """Return the place of a fire, and drop the spots that are a part of it.

        What lights up nearer to a fire than half its size is a part of it: ground, and
        flames that soot or the edge of the image cuts off.
        """
        from scipy import ndimage

        half = max(map(np.ptp, np.nonzero(fire))) / 2
        near = np.asarray(ndimage.distance_transform_edt(~fire)) < half
        parts = [
            one for one in self._spots if not one.decided and (one.pixels & near).any()
        ]
        if not parts:
            return near
        self._spots = [one for one in self._spots if one not in parts]
        return self._fire_about(
            np.logical_or.reduce([fire, *(one.pixels for one in parts)])
        )


def _binned(image: Image, side: int) -> Float[np.ndarray, "row column"]:
    """Return the means of squares of pixels, without incomplete ones at the edges."""
    if side == 1:
        return image
    height, width = (size // side * side for size in image.shape)
    blocks = image[:height, :width].reshape(height // side, side, width // side, side)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def _event_silhouettes(
    times: Float[np.ndarray, " step"],
    changes: Float[np.ndarray, "step row column"],
    begun: int,
    seed: Bool[np.ndarray, "row column"],
) -> tuple[list[Silhouette], float, float]:
    """Return the same as `silhouettes` of changes by events."""
    first = max(begun - 2, 0)
    shares = (np.cumsum(changes[first:], axis=0) > LIT_SUM).astype(np.float32)
    # a step earlier than the first, as the frame before it is unknown
    before = times[first - 1] if first else times[0] - (times[1] - times[0])
    spots, dark = joined(times[first:], shares, seed, float(before))
    return spots, dark, spots[0].time_s if spots else float(times[-1])


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


def verdict(seen: Sequence[Silhouette], earliest_s: float) -> Cause:
    """Return the cause of a spot by the evidence of its radii.

    Args:
        seen: Its silhouettes in order of time.
        earliest_s: Time of the last frame without it [s].
    """
    if len(seen) < 3:
        return "fireball" if seen else "flicker"
    time, lit = (np.array([getattr(s, k) for s in seen]) for k in ("time_s", "lit_px"))
    # a fraction of a pixel has no size
    radius = np.maximum([one.reached_px for one in seen], 0.5)
    steps = np.diff(np.log(radius))
    since = time - 0.5 * (earliest_s + time[0])
    interval = float(np.median(np.diff(time)))
    grown = len(growing([one._replace(radius_px=one.reached_px) for one in seen]))
    slowest = max(SLOWEST_S, UNRESOLVED * interval)
    taus = np.geomspace(0.3 * interval, slowest, 10)[:, None]
    powers = np.repeat(POWERS, len(BEGUN))[:, None]
    ages = np.tile(BEGUN, len(POWERS))[:, None] * since[-1]
    beside = np.array([one.beside for one in seen[1:]])
    # the share of a patch of glitter that is already lit
    chance = np.clip(lit[:-1] / lit[-1], STRAYS, 1.0 - STRAYS)
    evidence: dict[Cause, float] = {}
    laws: tuple[tuple[Cause, Any, Any, Any], ...] = (
        ("fireball", np.log(-np.expm1(-since / taus)), JUMPS, 1.0 - STRAYS),
        ("grows_on", powers * np.log(since + ages), JUMPS, 1.0 - STRAYS),
        ("flicker", np.zeros((1, len(seen))), FLICKERS, chance),
    )
    for cause, curves, jumps, touching in laws:
        law = np.diff(curves, axis=1)
        # no law holds after an edge, another spot or soot
        law[:, max(grown - 1, 0) :] = 0.0
        by_pixels = RADIUS_SD_PX * np.hypot(1.0 / radius[1:], 1.0 / radius[:-1])
        scatter = np.sqrt(STEP_SD**2 + (LAW_SD * law) ** 2 + by_pixels**2)
        each = (1.0 - jumps) * _normal(steps - law, scatter)
        level = np.log(each + jumps * _normal(steps, JUMP_SD)).sum(axis=1)
        evidence[cause] = float(np.logaddexp.reduce(level)) - math.log(len(level))
        order = np.where(beside, touching, 1.0 - touching)
        evidence[cause] += float(np.log(order).sum())
    best = max(evidence, key=lambda cause: evidence[cause])
    likely = evidence[best] - evidence["fireball"] > LN_ODDS
    return best if likely else "fireball"


def _normal(x: np.ndarray, sd: np.ndarray | float) -> np.ndarray:
    return np.exp(-0.5 * (x / sd) ** 2) / (sd * math.sqrt(2.0 * math.pi))


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
        rarer = self.per_hour / false_alarms_per_hour
        # (x^shape - 1) / shape, or ln x for a shape of 0
        by_tail = self.level + self.scale * float(boxcox(max(rarer, 1.0), self.shape))
        once = self.hours * false_alarms_per_hour
        beyond = self.greatest - self.scale * math.log(once) if once < 1.0 else by_tail
        return max(by_tail, beyond)


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
    """Yield the end of each step [s], and the change of light by its events.

    Args:
        events: Events in order of time.
        threshold: Change of the logarithm per event, brighter and darker.
    """
    shape = events.height, events.width
    steps = int(events.t[-1]) // STEP_US + 1 if len(events.t) else 0
    bounds = np.searchsorted(events.t, STEP_US * np.arange(steps + 1))
    for step, (low, high) in enumerate(pairwise(bounds.tolist()), 1):
        x, y, _, p = (column[low:high] for column in events[:4])
        amount = np.where(p > 0, threshold[0], -threshold[1])
        pixel = y.astype(np.int64) * events.width + x
        change = np.bincount(pixel, amount, events.height * events.width)
        yield np.array([STEP_S * step]), change.reshape(1, *shape).astype(np.float32)


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
