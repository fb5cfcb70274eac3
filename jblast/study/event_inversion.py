"""Parameters of a scene, fitted to the events of an event camera.

Smooth counts of the scene's frames are compared with those of the events: the running
sum of a pixel's events, brighter less darker, smoothed in time. The smoothing is at
first so long that a start several frames late still has a gradient, and then shorter,
with the temperature of the counts falling at the same rate. A small synthetic film of a
fireball serves as an example.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera.events.ideal import (
    Events,
    ideal_events,
    log_intensity,
    smooth_counts,
)
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render

MASS, START = 100.0, 0.12
"""Charge [kg] and when it goes off [s]."""
TIMES = np.arange(76) * 4e-3
"""Of the frames [s]; the fireball grows by 1/e in 4.6 ms."""
THRESHOLDS = (0.2, 0.2)
"""Changes of the logarithm of light of an event; typical of event cameras."""
HEIGHT, WIDTH = 18, 24
"""Size of the film [px]: it keeps the example to seconds."""
STAGES = ((0.5, 40e-3), (0.2, 15e-3), (0.1, 5e-3), (0.1, 0.1e-3))
"""Temperature, and the time smoothed over [s], one stage after another."""
MOST_STEPS = 200
"""Of Levenberg and Marquardt's method, in each stage."""
PRECISION = 1e-4
"""A stage ends where a step changes less than this, relative."""
MAX_EVENTS = 32
"""Largest number of events of a pixel between two frames."""


def film_camera() -> Camera:
    """Return a camera 80 m south of the charge."""
    position = jnp.array([0.0, -80.0, 3.0])
    return Camera(
        position=position,
        quaternion=look_at(position, jnp.array([0.0, 0.0, 4.0])),
        focal=jnp.array([100.0, 100.0]),
        center=jnp.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
    )


def coordinates(mass: float, start: float) -> Float[np.ndarray, "2"]:
    """Return numbers of the order of one: ln of kilograms, tenths of seconds."""
    return np.array([np.log(mass), 10.0 * start])


def log_frames(
    values: Float[Array, "2"], times: Float[Array, " frame"]
) -> Float[Array, "frame height width"]:
    """Return the logarithm of the light for some `coordinates`."""
    mass, start = jnp.exp(values[0]), 0.1 * values[1]
    charge = dataclasses.replace(
        Charge(position_m=(0.0, 0.0, 1.5)), mass_kg=mass, time_s=start
    )
    # what the fire does to the ground is left out: the fireball itself is looked for
    look = Appearance(flash=False)
    scene, camera = Scene(charge=charge), film_camera()
    frames = render(scene, camera, times, exposures=1, appearance=look)
    return log_intensity(luminance(frames))


@jax.jit
def true_frames(times: Float[Array, " frame"]) -> Float[Array, "frame height width"]:
    """Return the film itself."""
    return log_frames(jnp.asarray(coordinates(MASS, START)), times)


def true_counts() -> Int[np.ndarray, "interval height width"]:
    """Return the film's events between frames, brighter less darker."""
    times = jnp.asarray(TIMES)
    events = ideal_events(true_frames(times), times, THRESHOLDS, capacity=1 << 14)
    return event_counts(events, TIMES, (HEIGHT, WIDTH))


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
        up, down = smooth_counts(frames, thresholds, temperature, most=MAX_EVENTS)
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
