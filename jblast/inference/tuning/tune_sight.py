r"""A scene tuned to the frames or events of its camera.

Frames: the grey value of each pixel as a file of 8 bits has it, sRGB, against that of
`render`, with the tone curve of pictures (`image.toned`). Rounding has a standard
deviation of $1/\sqrt{12}$ of a step.

Events: an ideal pixel sends one where the logarithm of its light has changed by a
threshold since the last, so for each event $i$ and the previous one at its pixel

$$L(t_i) - L(t_{i-1}) = \pm\theta_\pm$$

holds as exactly as the time stamps. It is linear in the thresholds and smooth in all
other numbers, while counts of events are step functions. Residuals are weighted as
Student-t errors of their own scale, so that events from noise have little weight.

The rim of a fireball at another position than expected has no slope towards it, and
clipped white has none at all: a search from afar can end where nothing fits. So the
residual is evaluated at several points, up to a few large changes away, and a search
begins at the best one, or at the next where that does not lead to a fit.

Pixels that do not change are left out, and frames, pixels and events are thinned to
fixed maximum numbers.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.errors import InputError
from jblast.inference.posterior.parameters import GROWTH, own_growth
from jblast.inference.tuning.result import (
    TO_MEDIAN,
    Explained,
    Kind,
    Tuned,
    answer,
)
from jblast.inference.tuning.search import (
    Problem,
    Solution,
    identified_and_null,
    problem_from,
    solve,
)
from jblast.inference.tuning.unknowns import Unknown, filled, unknowns_of
from jblast.results import Note, warning
from jblast.scene import Camera, Scene, UncertainScene
from jblast.scene.uncertain import with_values
from jblast.sensors.camera.fireball import WHITE, Appearance
from jblast.sensors.camera.image import BACKGROUND, linear_to_srgb, luminance, toned
from jblast.sensors.camera.pixel import log_intensity
from jblast.sensors.camera.rendering import light_at, render, view_of

# Largest numbers of frames, pixel values and events that are used: rounding averages
# out over far fewer, and each value is evaluated for every unknown in every step.
MAX_FRAMES, MAX_VALUES, MAX_EVENTS = 24, 200_000, 10_000
CHANGED = 2.0
"""Change of a pixel, in steps of 8 bits, above which it is used: rounding alone gives
1."""
ROUNDED_ALIKE = 6.0
"""Change in steps of 8 bits below which neighbouring pixels have equal rounding errors,
which are no noise."""
ROUNDING = 12.0**-0.5
"""Standard deviation of rounding, in steps of 8 bits."""
FRAME_ERROR = 2.0 * ROUNDING
"""Largest rms residual of well-explained frames, in steps of 8 bits: twice that of
rounding."""
EVENT_ERROR = 0.05
"""Largest typical residual of well-explained events, in thresholds. A real camera
leaves more: noise, latency, thresholds that differ between pixels."""
PLACES, TRIED = 96, 3
"""Number of places at which the residual is evaluated, and of searches from the best of
them. An evaluation costs much less than a search."""
SPREAD = 0.7
"""Standard deviation of these places in large changes."""
STEPS = 255.0  # largest grey value of 8 bits
FREEDOM = 4.0
"""Degrees of freedom of the Student-t errors of events, as for readings."""
STAMP = 0.5e-6 * 3.0**-0.5
"""Standard deviation of a time stamp rounded to microseconds [s]: a uniform error
within 0.5 us."""
Ints = Int[Array, " event"] | Int[np.ndarray, " event"]
Floats = Float[Array, " event"] | Float[np.ndarray, " event"]


def tune_frames(
    uncertain: UncertainScene,
    frames: Float[np.ndarray, "frame height width"],
    times: Float[np.ndarray, " frame"],
    names: Sequence[str],
    background: Float[ArrayLike, "..."] = BACKGROUND,
) -> Tuned:
    """Tune a scene to frames.

    Args:
        uncertain: The scene; its free numbers and those with a prior are tuned as well.
        frames: Grey values, sRGB, in steps of 8 bits.
        times: Times of the frames, on the common clock [s].
        names: Further numbers to tune.
        background: Linear light behind the fireball.

    Raises:
        InputError: A name is unknown, there is nothing to tune, no explosion, or no
            change in the frames.
    """
    scene, unknowns = _begun(uncertain, names, "frames")
    # frames before the first explosion show the background alone
    chosen = _evenly(np.flatnonzero(times > _first(scene)), MAX_FRAMES)
    if not chosen.size:
        raise InputError(
            f"frames: expected some after the first blast at {_first(scene):g} s, got "
            f"none of {len(times):,}"
        )
    flat = frames.reshape(len(frames), -1)
    changing = np.ptp(flat, axis=0) > CHANGED
    if not changing.any():
        raise InputError(
            "frames: expected a film of a blast, got pictures in which nothing changes"
        )
    # multiples of 256: films of one kind share a compiled program
    most = min(MAX_VALUES // len(chosen), _round_number(int(changing.sum()), 256))
    pixels = _evenly(np.flatnonzero(changing), most)
    values = flat[np.ix_(chosen, pixels)]
    # relative to the first frame, which has no fireball
    counted = np.abs(values - flat[0][pixels]) > ROUNDED_ALIKE
    evidence = FramesEvidence(
        values=jnp.asarray(values, float),
        counted=jnp.asarray(counted, float),
        times=jnp.asarray(times[chosen], float),
        pixels=jnp.asarray(pixels),
        background=jnp.asarray(background, float),
    )
    notes = _thinned(len(chosen), len(times), "frames")
    return _tuned(evidence, scene, unknowns, "frames", FRAME_ERROR, notes)


class EventPairs(NamedTuple):
    """Events with the time of the previous event at the same pixel.

    Attributes:
        x: Column.
        y: Row.
        time: Time of the event, on the common clock [s].
        before: Time of the previous event, or begin of the record [s].
        sign: 1 for brighter, -1 for darker.
    """

    x: Ints
    y: Ints
    time: Floats
    before: Floats
    sign: Ints


def tune_events(
    uncertain: UncertainScene,
    events: EventPairs,
    names: Sequence[str],
    background: Float[ArrayLike, "..."] = BACKGROUND,
) -> Tuned:
    """Tune a scene to events.

    Args:
        uncertain: As for `tune_frames`.
        events: All events of a camera (`paired`).
        names: Further numbers to tune.
        background: Linear light behind the fireball.

    Raises:
        InputError: A name is unknown, there is nothing to tune, no explosion, or no
            event.
    """
    scene, unknowns = _begun(uncertain, names, "events")
    count = len(events.x)
    if not count:
        raise InputError("events: expected some, got none")
    most = min(MAX_EVENTS, _round_number(count, 1000))
    # at random with a fixed seed: an even choice could resonate with the order of
    # pixels
    chosen = np.sort(np.random.default_rng(0).permutation(count)[:most])
    some = EventPairs(*(jnp.asarray(np.asarray(field)[chosen]) for field in events))
    evidence = EventsEvidence(some, jnp.asarray(background, float))
    notes = _thinned(most, count, "events")
    return _tuned(evidence, scene, unknowns, "events", EVENT_ERROR, notes)


def paired(x: Ints, y: Ints, time: Floats, sign: Ints, start: float) -> EventPairs:
    """Return events with the time of the previous one at each pixel.

    Args:
        x: Columns.
        y: Rows.
        time: Times on the common clock, ascending [s].
        sign: 1 for brighter, -1 for darker.
        start: Begin of the record [s].
    """
    # stable sort by pixel: within a pixel the order in time remains
    pixel = np.asarray(y, np.int64) * 65_536 + np.asarray(x, np.int64)
    order = np.argsort(pixel, kind="stable")
    before = np.full(len(time), start)
    same = pixel[order][1:] == pixel[order][:-1]
    before[order[1:][same]] = np.asarray(time)[order[:-1][same]]
    return EventPairs(x, y, np.asarray(time, float), before, sign)


def _begun(
    uncertain: UncertainScene, names: Sequence[str], kind: Kind
) -> tuple[Scene, tuple[Unknown, ...]]:
    """Return a scene with a value for each number to tune, and these numbers."""
    source, camera = uncertain.source or "scene", uncertain.scene.camera
    if camera is None:
        raise InputError(f"{source}: expected a [camera] that saw it, got none")
    if camera.mount:
        raise InputError(
            f"{source}: [camera] mount: expected a camera that stands still, got one "
            f"on a {camera.mount}"
        )
    scene, unknowns = unknowns_of(uncertain, names, kind, math.nan)
    # a growth time without a value starts at that of its law
    if uncertain.scene.fireball_growth is None and GROWTH in names:
        scene = with_values(scene, {GROWTH: own_growth(scene)})
    return filled(scene, -1, names, 1.0), unknowns


def _tuned(
    evidence: Any,
    scene: Scene,
    unknowns: tuple[Unknown, ...],
    kind: Kind,
    allowed: float,
    notes: Sequence[Note],
) -> Tuned:
    """Return the result of searches from several places.

    Args:
        evidence: Frames or events.
        scene: The scene.
        unknowns: The numbers to tune.
        kind: Kind of the record.
        allowed: Largest error of a record that is well explained.
        notes: Remarks.
    """
    problem = problem_from(evidence, scene, unknowns)
    found, error = best_of_several(problem, allowed)
    chi2 = float(np.square(found.left[0]).sum())
    explained = Explained(chi2, evidence.used(), {}, error, allowed)
    wider = widening(found, np.asarray(evidence.groups()))
    return answer(problem, found, kind, explained, notes, wider)


def best_of_several(problem: Problem, allowed: float) -> tuple[Solution, float]:
    """Return the best result of searches from several places, and its error.

    Args:
        problem: The problem.
        allowed: Error (`misfit`) at which no further search is made.
    """
    # reproducible places, of which the first is the start of the problem
    drawn = np.random.default_rng(0).normal(size=(PLACES, problem.start.size))
    drawn[0] = 0.0
    start, steps = np.asarray(problem.start), np.asarray(problem.steps())
    places = start + SPREAD * drawn * steps
    ended = []
    for place in places[np.argsort(_misfits(problem, places), kind="stable")[:TRIED]]:
        found = solve(problem, place)
        (error,) = _misfits(problem, found.z[None])
        ended.append((float(error), found))
        # a result within its error needs no further search
        if error <= allowed:
            break
    error, found = min(ended, key=lambda one: one[0])
    return found, error


@eqx.filter_jit
def _each_misfit(
    problem: Problem, places: Float[Array, "place unknown"]
) -> Float[Array, " place"]:
    return jax.lax.map(lambda z: problem.evidence.misfit(problem.scene_at(z)), places)


def _misfits(
    problem: Problem, places: Float[np.ndarray, "place unknown"]
) -> Float[np.ndarray, " place"]:
    """Return the error at each place; infinite where it is not finite."""
    found = np.asarray(_each_misfit(problem, jnp.asarray(places)))
    return np.where(np.isfinite(found), found, np.inf)


def widening(found: Solution, groups: Int[np.ndarray, " value"]) -> Any:
    """Return the factor by which correlated residuals widen standard deviations.

    Residuals of one group need not be independent: rounding of slowly varying values is
    similar all over a frame, and thresholds are common to the events of a pixel. The
    scatter of the groups' scores is used: $A^{-1} B A^{-1}$ with $B$ the sum over
    groups of the square of the score (White 1980; Liang and Zeger 1986, both from
    memory), where that is more than $A^{-1}$.
    """
    scores = np.array(
        [np.bincount(groups, row * found.left[0]) for row in found.slopes[0]]
    )
    _, _, covariance = identified_and_null(found.information)
    # sandwich covariance; the diagonal of the plain covariance is its lower limit
    together = covariance @ (scores @ scores.T) @ covariance
    return np.sqrt(np.maximum(np.diag(together) / np.diag(covariance), 1.0))


def _first(scene: Scene) -> float:
    return min(float(np.asarray(charge.time_s)) for charge in scene.charges)


def _evenly(numbers: np.ndarray, most: int) -> np.ndarray:
    """Return at most `most` of some numbers, evenly spaced."""
    if len(numbers) <= most:
        return numbers
    return numbers[np.linspace(0, len(numbers) - 1, most).round().astype(int)]


def _round_number(count: int, of: int) -> int:
    """Return a count rounded down to a multiple, so that records share programs."""
    return int(count) if count < of else int(count) // of * of


def _thinned(used: int, count: int, what: str) -> list[Note]:
    if used == count:
        return []
    return [warning("thinned", used=used, count=count, what=what)]


class FramesEvidence(eqx.Module):
    """Pixels of some frames, and their prediction.

    Attributes:
        values: Grey values of pixels, in steps of 8 bits.
        counted: 1 for values that changed enough for rounding to act as noise
            (`ROUNDED_ALIKE`), else 0.
        times: Times of the frames, on the common clock [s].
        pixels: Numbers of the pixels, row by row.
        background: Linear light behind the fireball.
        index: -1: no sensor.
    """

    values: Float[Array, "frame pixel"]
    counted: Float[Array, "frame pixel"]
    times: Float[Array, " frame"]
    pixels: Int[Array, " pixel"]
    background: Float[Array, "..."]
    index: int = eqx.field(static=True, default=-1)

    def predicted(self, scene: Scene) -> Float[Array, "frame pixel"]:
        """Return the predicted values."""
        camera = camera_of(scene)
        frames = render(
            scene,
            camera,
            self.times,
            background=self.background,
            appearance=look_of(camera),
        )
        # the same tone curve as in written pictures, before rounding: it is
        # differentiable
        values = STEPS * linear_to_srgb(luminance(toned(frames)))
        return values.reshape(len(self.times), -1)[:, self.pixels]

    def groups(self) -> Int[Array, " value"]:
        """Return the frame of each value."""
        frames, pixels = self.values.shape
        return jnp.repeat(jnp.arange(frames), pixels)

    def used(self) -> int:
        """Return the number of values that count."""
        return max(int(self.counted.sum()), 1)

    def misfit(self, scene: Scene) -> Float[Array, ""]:
        """Return the rms residual, in steps of 8 bits."""
        left = self.counted * (self.values - self.predicted(scene))
        return jnp.sqrt(jnp.square(left).sum() / jnp.maximum(self.counted.sum(), 1.0))

    def weights(self, scene: Scene) -> Float[Array, ""]:
        """Return the standard deviation of each value."""
        del scene
        return jnp.asarray(ROUNDING)

    def residuals(
        self, scene: Scene, weights: Float[Array, ""]
    ) -> tuple[Float[Array, "frame pixel"]]:
        """Return the residuals in standard deviations."""
        left = self.values - self.predicted(scene)
        return (self.counted * left / weights,)


class EventsEvidence(eqx.Module):
    """Events, and their prediction.

    Attributes:
        events: Events of a camera.
        background: Linear light behind the fireball.
        index: -1: no sensor.
    """

    events: EventPairs
    background: Float[Array, "..."]
    index: int = eqx.field(static=True, default=-1)

    def changes(
        self, scene: Scene, later: Float[Array, ""] | float = 0.0
    ) -> Float[Array, " event"]:
        """Return the change of the logarithm of light from event to event.

        Args:
            scene: The scene.
            later: Delay of all events [s].
        """
        camera, events = camera_of(scene), self.events
        look, x, y = look_of(camera), jnp.asarray(events.x), jnp.asarray(events.y)
        view = view_of(scene, camera, self.background, appearance=look)

        def log_light(times):
            return log_intensity(luminance(light_at(view, times, x, y)))

        after, before = jnp.asarray(events.time), jnp.asarray(events.before)
        return log_light(after + later) - log_light(before)

    def groups(self) -> Ints:
        """Return the pixel of each event."""
        return self.events.y * (1 + self.events.x.max()) + self.events.x

    def used(self) -> int:
        """Return the number of events."""
        return len(self.events.x)

    def left(self, scene: Scene) -> Float[Array, " event"]:
        """Return the residual change, in thresholds."""
        return self._left(scene) / self._thresholds(scene)

    def misfit(self, scene: Scene) -> Float[Array, ""]:
        """Return the typical residual, in thresholds."""
        return jnp.median(jnp.abs(self.left(scene))) / TO_MEDIAN

    def weights(self, scene: Scene) -> Float[Array, " event"]:
        """Return the standard deviation of each residual, in ln."""
        _, slope = jax.jvp(
            lambda later: self.changes(scene, later), (jnp.zeros(()),), (jnp.ones(()),)
        )
        # an event and the previous one have independent stamps: the root of 2
        stamp = jnp.abs(slope) * STAMP * jnp.sqrt(2.0)
        left = self._left(scene)
        # scale of the residuals by their median, which outliers do not change
        size = jnp.median(jnp.abs(left)) / TO_MEDIAN
        # 1e-20 keeps the root differentiable for events without any error
        sd = jnp.sqrt(jnp.square(stamp) + jnp.square(size) + 1e-20)
        # weights of iteratively reweighted least squares for Student-t errors
        far = (FREEDOM + jnp.square(left / sd)) / (FREEDOM + 1.0)
        return sd * jnp.sqrt(far)

    def residuals(
        self, scene: Scene, weights: Float[Array, " event"]
    ) -> tuple[Float[Array, " event"]]:
        """Return the residuals in standard deviations.

        They are in ln, not in thresholds: relative to a fitted threshold all residuals
        would shrink as the threshold grows.
        """
        return (self._left(scene) / weights,)

    def _thresholds(self, scene: Scene) -> Float[Array, " event"]:
        """Return the threshold of each event, by its sign."""
        threshold = camera_of(scene).threshold
        return jnp.where(self.events.sign > 0, threshold[0], threshold[1])

    def _left(self, scene: Scene) -> Float[Array, " event"]:
        """Return the residual change, in ln."""
        own = self._thresholds(scene)
        sign = jnp.asarray(self.events.sign, own.dtype)
        return self.changes(scene) - sign * own


def camera_of(scene: Scene) -> Camera:
    """Return a scene's camera."""
    assert scene.camera is not None, "callers check for a camera"
    return scene.camera


def look_of(camera: Camera) -> Appearance:
    """Return the exposure of a camera."""
    if camera.daylight is None:
        return Appearance(white=WHITE)
    return Appearance(white=camera.daylight / jnp.pi)
