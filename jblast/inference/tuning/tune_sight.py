"""A scene tuned to what its camera saw: frames, or events."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError
from jblast.inference.tuning.answer import answer
from jblast.inference.tuning.notes import Note
from jblast.inference.tuning.result import Explained, Kind, Tuned
from jblast.inference.tuning.search.beginnings import best_of_several
from jblast.inference.tuning.search.solve import (
    Problem,
    Solution,
    problem_from,
    widening,
)
from jblast.inference.tuning.sight import (
    ROUNDING,
    STEPS as STEPS,
    EventPairs,
    EventsEvidence,
    FramesEvidence,
)
from jblast.inference.tuning.unknowns import Unknown, filled, unknowns_of
from jblast.scene import Scene, UncertainScene
from jblast.scene.uncertain import with_values
from jblast.sensors.camera.image import BACKGROUND
from jblast.waves.fireball import fireball_growth_time

MOST_FRAMES, MOST_VALUES, MOST_EVENTS = 24, 200_000, 10_000
CHANGED = 2.0
"""Steps of 8 bits from which on a pixel is said to change."""
ROUNDED_ALIKE = 6.0
"""Steps of 8 bits: of what has changed by less, neighbours are rounded alike."""
FRAME_ERROR = 2.0 * ROUNDING
"""What may be left of frames, in steps of 8 bits."""
EVENT_ERROR = 0.05
"""What may be left of events, in thresholds: a real camera's effects leave more."""


def tune_frames(
    uncertain: UncertainScene,
    frames: Float[np.ndarray, "frame height width"],
    times: Float[np.ndarray, " frame"],
    names: Sequence[str],
    background: Float[ArrayLike, "..."] = BACKGROUND,
) -> Tuned:
    """Return what frames tell of a scene.

    Args:
        uncertain: The scene; what it leaves free, or gives a prior, is looked for, too.
        frames: Grey values, sRGB, in steps of 8 bits.
        times: Of the frames, on the common clock [s].
        names: What else is looked for.
        background: Linear light behind the fireball.

    Raises:
        InputError: A name is none, nothing is looked for or explodes, or the frames
            show nothing that changes.
    """
    uncertain, unknowns, scene = _begun(uncertain, names, "frames")
    chosen = _evenly(np.flatnonzero(times > _first(scene)), MOST_FRAMES)
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
    most = min(MOST_VALUES // len(chosen), _round_number(int(changing.sum()), 256))
    pixels = _evenly(np.flatnonzero(changing), most)
    values = flat[np.ix_(chosen, pixels)]
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


def tune_events(
    uncertain: UncertainScene,
    events: EventPairs,
    names: Sequence[str],
    background: Float[ArrayLike, "..."] = BACKGROUND,
) -> Tuned:
    """Return what events tell of a scene.

    Args:
        uncertain: As of `tune_frames`.
        events: All of a camera's (`paired`).
        names: What else is looked for.
        background: Linear light behind the fireball.

    Raises:
        InputError: A name is none, nothing is looked for or explodes, or there are no
            events.
    """
    uncertain, unknowns, scene = _begun(uncertain, names, "events")
    count = len(events.x)
    if not count:
        raise InputError("events: expected some, got none")
    most = min(MOST_EVENTS, _round_number(count, 1000))
    chosen = np.sort(np.random.default_rng(0).permutation(count)[:most])
    some = EventPairs(*(jnp.asarray(np.asarray(field)[chosen]) for field in events))
    camera = scene.camera
    assert camera is not None, "it is asked for in `_begun`"
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
    """Return events with the time of the one before at each pixel.

    Args:
        x: Columns.
        y: Rows.
        time: On the common clock, not falling [s].
        sign: 1 for brighter, -1 for darker.
        start: When the record began [s].
    """
    pixel = np.asarray(y, np.int64) * 65_536 + np.asarray(x, np.int64)
    order = np.argsort(pixel, kind="stable")
    before = np.full(len(time), start)
    same = pixel[order][1:] == pixel[order][:-1]
    before[order[1:][same]] = np.asarray(time)[order[:-1][same]]
    return EventPairs(x, y, np.asarray(time, float), before, sign)


def _begun(
    uncertain: UncertainScene, names: Sequence[str], kind: Kind
) -> tuple[UncertainScene, tuple[Unknown, ...], Scene]:
    """Return what is looked for, and a scene that holds a number for each."""
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
            f"{source}: [charge] range_m: expected position_m, which a camera needs to "
            "see it; got a range"
        )
    grows = scene.fireball_growth
    uncertain, unknowns = unknowns_of(uncertain, names, kind, None)
    if not unknowns:
        raise InputError(f"{source}: expected something to tune, got nothing free")
    scene = uncertain.scene
    if grows is None and "fireball_growth_s" in names:
        mass = scene.charge.tnt_mass("fireball_radius_m")
        scene = with_values(scene, {"fireball_growth_s": fireball_growth_time(mass)})
    scene = filled(scene, -1, names, 1.0)
    return replace(uncertain, scene=scene), unknowns, scene


def _first(scene: Scene) -> float:
    return min(float(np.asarray(charge.time_s)) for charge in scene.charges)


def _evenly(numbers: np.ndarray, most: int) -> np.ndarray:
    """Return at most so many of some numbers, evenly chosen."""
    if len(numbers) <= most:
        return numbers
    return numbers[np.linspace(0, len(numbers) - 1, most).round().astype(int)]


def _round_number(count: int, of: int) -> int:
    """Return a count rounded down, so that records share programs."""
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
