"""What made these events: the numbers of a scene, from the events alone.

Smooth counts of the scene's frames are held against those of the events. What is
compared is the sum of a pixel's events so far, brighter less darker, smoothed in time:
first over so long that a start too late by several frames is felt, then over less, with
the temperature of the counts falling beside it.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.sensors.camera.events.ideal import Events, smooth_counts

STAGES = ((0.5, 40e-3), (0.2, 15e-3), (0.1, 5e-3), (0.1, 0.1e-3))
"""Temperature, and the time smoothed over [s], one stage after another."""
MOST_STEPS = 200
"""Of Levenberg and Marquardt's method, in each stage."""
PRECISION = 1e-4
"""A stage ends where a step changes less than this, relative."""
MOST = 32
"""Events a pixel can send between two frames."""


class EventFit(NamedTuple):
    """The numbers found.

    Attributes:
        values: In the order and the units of the start.
        misfit: Root mean square of what is left, in events.
        steps: Taken in all.
        converged: Whether the last stage ended of itself, and not for want of steps.
            Light that no smooth count feels any more ends a stage as well: the misfit
            is then large.
    """

    values: Float[np.ndarray, " unknown"]
    misfit: float
    steps: int
    converged: bool


def event_counts(
    events: Events, times: Float[np.ndarray, " frame"], shape: tuple[int, int]
) -> Int[np.ndarray, "interval height width"]:
    """Return brighter less darker events of each pixel between times [s].

    Args:
        events: In order of time.
        times: Of frames; events before the first and after the last are left out.
        shape: Height and width.
    """
    number = int(events.count)
    x, y, sign, time = (
        np.asarray(field)[:number]
        for field in (events.x, events.y, events.polarity, events.time)
    )
    interval = np.searchsorted(times, time, side="left") - 1
    inside = (interval >= 0) & (interval < len(times) - 1)
    counts = np.zeros((len(times) - 1, *shape), int)
    np.add.at(counts, (interval[inside], y[inside], x[inside]), sign[inside])
    return counts


def fit_events(
    log_frames: Callable[
        [Float[Array, " unknown"], Float[Array, " frame"]],
        Float[Array, "frame height width"],
    ],
    start: Float[ArrayLike, " unknown"],
    counts: Int[np.ndarray, "interval height width"],
    times: Float[np.ndarray, " frame"],
    thresholds: tuple[Float[ArrayLike, ""], Float[ArrayLike, ""]],
    *,
    stages: Sequence[tuple[float, float]] = STAGES,
    most_steps: int = MOST_STEPS,
) -> EventFit:
    """Find the numbers of a scene whose events are most like those given.

    Args:
        log_frames: Logarithm of the light for some numbers, at some times.
        start: First guess; numbers of the order of one, such as logarithms.
        counts: Events between the times (`event_counts`).
        times: Of frames [s], evenly spaced, close beside what is to be found.
        thresholds: Positive and negative, as positive numbers.
        stages: Temperatures, and times smoothed over [s].
        most_steps: In each stage.
    """
    clock = jnp.asarray(times)
    known = jnp.cumsum(jnp.asarray(counts, clock.dtype), axis=0)
    values, steps = jnp.asarray(start, clock.dtype), 0
    misfit, converged = np.inf, False
    for stage in stages:
        given = (*(jnp.asarray(number) for number in stage), known, clock, thresholds)
        values, left, taken, ended = _stage(log_frames, values, given, most_steps)
        steps, misfit, converged = steps + int(taken), float(left), bool(ended)
    return EventFit(np.asarray(values), misfit, steps, converged)


@eqx.filter_jit
def _stage(log_frames, start, given, most_steps):
    """Return the numbers of one stage, what is left, its steps, whether it ended."""
    temperature, width, known, times, thresholds = given
    apart = (times[1:, None] - times[None, 1:]) / width
    weights = jnp.exp(-0.5 * jnp.square(apart))
    weights = weights / weights.sum(axis=1, keepdims=True)

    def off(values, _):
        frames = log_frames(values, times)
        up, down = smooth_counts(frames, thresholds, temperature, most=MOST)
        sums = jnp.cumsum(up - down, axis=0) - known
        return jnp.tensordot(weights, sums, 1).ravel()

    solver = optx.LevenbergMarquardt(rtol=PRECISION, atol=PRECISION)
    options = {"jac": "fwd"}
    found = optx.least_squares(
        off, solver, start, max_steps=most_steps, throw=False, options=options
    )
    left = jnp.sqrt(jnp.mean(jnp.square(off(found.value, None))))
    ended = found.result == optx.RESULTS.successful
    return found.value, left, found.stats["num_steps"], ended
