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

Pixels that do not change are left out, and frames, pixels and events are thinned to
fixed maximum numbers.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.errors import InputError
from jblast.inference.tuning.result import (
    TO_MEDIAN,
    Explained,
    Kind,
    Note,
    Tuned,
    answer,
)
from jblast.inference.tuning.search import (
    Problem,
    Solution,
    best_of_several,
    problem_from,
    widening,
)
from jblast.inference.tuning.unknowns import Unknown, filled, unknowns_of
from jblast.scene import Camera, Scene, UncertainScene
from jblast.scene.uncertain import with_values
from jblast.sensors.camera.events.scene import pixel_light
from jblast.sensors.camera.fireball import WHITE, Appearance
from jblast.sensors.camera.image import BACKGROUND, linear_to_srgb, luminance, toned
from jblast.sensors.camera.rendering import render
from jblast.waves.fireball import fireball_growth_time

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
    uncertain, unknowns, scene = _begun(uncertain, names, "frames")
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
    problem = problem_from(evidence, scene, unknowns)
    used = max(int(counted.sum()), 1)
    found, rms = best_of_several(problem, FRAME_ERROR)
    left = _left(problem, found)
    wider = widening(problem, found.z)
    notes = _thinned(len(chosen), len(times), "frames")
    explained = Explained(float(np.square(left).sum()), used, {}, rms, FRAME_ERROR)
    return answer(problem, found, "frames", explained, notes, wider)


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
    uncertain, unknowns, scene = _begun(uncertain, names, "events")
    count = len(events.x)
    if not count:
        raise InputError("events: expected some, got none")
    most = min(MAX_EVENTS, _round_number(count, 1000))
    # at random with a fixed seed: an even choice could resonate with the order of
    # pixels
    chosen = np.sort(np.random.default_rng(0).permutation(count)[:most])
    some = EventPairs(*(jnp.asarray(np.asarray(field)[chosen]) for field in events))
    camera = scene.camera
    assert camera is not None, "`_begun` requires a camera"
    size = camera.height, camera.width
    evidence = EventsEvidence(some, size, jnp.asarray(background, float))
    problem = problem_from(evidence, scene, unknowns)
    found, typical = best_of_several(problem, EVENT_ERROR)
    left = _left(problem, found)
    explained = Explained(
        float(np.square(left).sum()), left.size, {}, typical, EVENT_ERROR
    )
    notes = _thinned(len(chosen), count, "events")
    wider = widening(problem, found.z)
    return answer(problem, found, "events", explained, notes, wider)


def paired(
    x: np.ndarray, y: np.ndarray, time: np.ndarray, sign: np.ndarray, start: float
) -> EventPairs:
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
) -> tuple[UncertainScene, tuple[Unknown, ...], Scene]:
    """Return the numbers to tune, and a scene with a value for each."""
    source = uncertain.source or "scene"
    scene = uncertain.scene
    if scene.camera is None:
        raise InputError(f"{source}: expected a [camera] that saw it, got none")
    if scene.camera.mount:
        raise InputError(
            f"{source}: [camera] mount: expected a camera that stands still, got one "
            f"on a {scene.camera.mount}"
        )
    if all(bool(np.asarray(charge.never)) for charge in scene.charges):
        raise InputError(
            f"{source}: [charge] time_s: expected a blast, got one that never happens"
        )
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, which the image of a "
            "camera depends on; got a range"
        )
    grows = scene.fireball_growth
    uncertain, unknowns = unknowns_of(uncertain, names, kind, None)
    if not unknowns:
        raise InputError(f"{source}: expected something to tune, got nothing free")
    scene = uncertain.scene
    # a growth time without a value starts at that of its law
    if grows is None and "fireball_growth_s" in names:
        mass = scene.charge.tnt_mass("fireball_radius_m")
        scene = with_values(scene, {"fireball_growth_s": fireball_growth_time(mass)})
    scene = filled(scene, -1, names, 1.0)
    return replace(uncertain, scene=scene), unknowns, scene


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
    return [Note("thinned", {"used": used, "count": count, "what": what})]


def _left(problem: Problem, found: Solution) -> Float[np.ndarray, " value"]:
    (left,) = _residuals(problem, jnp.asarray(found.z))
    return np.asarray(left).ravel()


@eqx.filter_jit
def _residuals(problem: Problem, z):
    scene = problem.scene_at(z)
    return problem.evidence.residuals(scene, problem.evidence.weights(scene))


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

    def groups(self) -> tuple[Int[Array, " value"], int]:
        """Return the frame of each value, and how many frames there are."""
        frames, pixels = self.values.shape
        return jnp.repeat(jnp.arange(frames), pixels), frames

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
        size: Rows and columns of the image.
        background: Linear light behind the fireball.
        index: -1: no sensor.
    """

    events: EventPairs
    size: tuple[int, int] = eqx.field(static=True)
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
        light = pixel_light(
            scene, camera, background=self.background, appearance=look_of(camera)
        )
        x, y = jnp.asarray(events.x, float), jnp.asarray(events.y, float)
        time, before = jnp.asarray(events.time), jnp.asarray(events.before)
        return light(time + later, x, y) - light(before, x, y)

    def groups(self) -> tuple[Ints, int]:
        """Return the pixel of each event, and how many pixels there are."""
        height, width = self.size
        return self.events.y * width + self.events.x, height * width

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
