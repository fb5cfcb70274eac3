"""A fit to events by smooth counts of them, for the notebook of the camera.

The film is a fireball of 100 kg from 80 m, 250
frames/s; its events are an ideal camera's.

The fit compares smooth counts of the scene's frames with those of the events: the
running sum of a pixel's events, brighter less darker, smoothed in time. The smoothing
is at first so long that a start several frames late still has a gradient, and then
shorter, with the temperature of the counts falling at the same rate.
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
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.pixel import (
    Events,
    Pixel,
    log_intensity,
    pixel_events,
    smooth_counts,
)
from jblast.sensors.camera.rendering import render

MASS, START = 100.0, 0.12
"""True charge mass [kg] and time of explosion [s]."""
TIMES = np.arange(76) * 4e-3
"""Frame times [s], as close as the growth of the fireball needs: 4.6 ms for 1/e."""
THRESHOLDS = (0.2, 0.2)
"""Changes of ln(light) that trigger an event, typical of event cameras."""
HEIGHT, WIDTH = 18, 24
"""Size of the film [px], with which the example takes seconds."""
STAGES = ((0.5, 40e-3), (0.2, 15e-3), (0.1, 5e-3), (0.1, 0.1e-3))
"""Temperature of the counts and smoothing time [s] of each stage.

The first smoothing time is ten frames, so that a start several frames late still
overlaps with the truth. The last is below one frame: it leaves the counts as they are.
"""
MAX_STEPS = 200
"""Levenberg-Marquardt steps in a stage: a stage that needs more is not converging."""
PRECISION = 1e-4
"""Relative step at which a stage ends, far below what whole events can resolve."""
MAX_EVENTS = 32
"""Events of a pixel between two frames at most: exp(32 x 0.2) = 600 times the light."""


def film_camera() -> Camera:
    """Return the camera of the example, 80 m south of the charge."""
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
    """Return unknowns of the order of one: ln(mass / kg), and time in 0.1 s."""
    return np.array([np.log(mass), 10.0 * start])


def log_frames(
    values: Float[Array, "2"], times: Float[Array, " frame"]
) -> Float[Array, "frame height width"]:
    """Return the logarithm of the light of each frame for `coordinates`."""
    mass, start = jnp.exp(values[0]), 0.1 * values[1]
    charge = dataclasses.replace(
        Charge(position_m=(0.0, 0.0, 1.5)), mass_kg=mass, time_s=start
    )
    # without light on the ground: the fireball itself carries the parameters
    look = Appearance(flash=False)
    scene, camera = Scene(charge), film_camera()
    frames = render(scene, camera, times, appearance=look)
    return log_intensity(luminance(frames))


@jax.jit
def true_frames(times: Float[Array, " frame"]) -> Float[Array, "frame height width"]:
    """Return the film of the true parameters, as the logarithm of light."""
    return log_frames(jnp.asarray(coordinates(MASS, START)), times)


def true_counts() -> Int[np.ndarray, "interval height width"]:
    """Return the net events of each pixel between frames of the true film."""
    times = jnp.asarray(TIMES)
    pixel = Pixel(*THRESHOLDS)
    events, _ = pixel_events(true_frames(times), times, pixel, capacity=1 << 14)
    return event_counts(events, TIMES, (HEIGHT, WIDTH))


class EventFit(NamedTuple):
    """Result of a fit to events.

    Attributes:
        values: Parameters, in the order and the units of the start.
        misfit: Root mean square residual [events].
        steps: Number of steps in all stages.
        converged: Whether the last stage converged before its limit of steps. A stage
            without a gradient also ends early: the misfit is then large.
    """

    values: Float[np.ndarray, " unknown"]
    misfit: float
    steps: int
    converged: bool


def event_counts(
    events: Events, times: Float[np.ndarray, " frame"], shape: tuple[int, int]
) -> Int[np.ndarray, "interval height width"]:
    """Return the net events (brighter less darker) of each pixel between times.

    Args:
        events: Events in order of time.
        times: Frame times [s]; events outside of them are ignored.
        shape: Height and width [px].
    """
    number = int(events.count)
    x, y, sign, time = (
        np.asarray(field)[:number]
        for field in (events.x, events.y, events.polarity, events.time)
    )
    interval = np.searchsorted(times, time, side="left") - 1
    # events at the very first time belong to no interval
    inside = (interval >= 0) & (interval < len(times) - 1)
    counts = np.zeros((len(times) - 1, *shape), int)
    # `add.at`, because several events of a pixel fall into one interval
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
    max_steps: int = MAX_STEPS,
) -> EventFit:
    """Fit parameters of a scene to net events by least squares.

    Args:
        log_frames: Logarithm of the light, from parameters and frame times.
        start: Initial parameters, of the order of one, such as logarithms.
        counts: Net events between the times (`event_counts`).
        times: Frame times [s], evenly spaced, closer than the motion to be resolved.
        thresholds: Thresholds of brighter and darker events, both positive.
        stages: Temperature and smoothing time [s] of each stage.
        max_steps: Largest number of steps in each stage.
    """
    clock = jnp.asarray(times)
    # running sums instead of counts: a late event still has a gradient
    known = jnp.cumsum(jnp.asarray(counts, clock.dtype), axis=0)
    values, steps = jnp.asarray(start, clock.dtype), 0
    misfit, converged = np.inf, False
    for stage in stages:
        given = (*(jnp.asarray(number) for number in stage), known, clock, thresholds)
        values, left, taken, ended = _stage(log_frames, values, given, max_steps)
        steps, misfit, converged = steps + int(taken), float(left), bool(ended)
    return EventFit(np.asarray(values), misfit, steps, converged)


@eqx.filter_jit
def _stage(log_frames, start, given, max_steps):
    """Return parameters, misfit, number of steps and convergence of one stage."""
    temperature, width, known, times, thresholds = given
    apart = (times[1:, None] - times[None, 1:]) / width
    weights = jnp.exp(-0.5 * jnp.square(apart))
    # normalised at the bounds of the film too, where the kernel is cut
    weights = weights / weights.sum(axis=1, keepdims=True)

    def residuals(values, _):
        frames = log_frames(values, times)
        up, down = smooth_counts(frames, thresholds, temperature, most=MAX_EVENTS)
        sums = jnp.cumsum(up - down, axis=0) - known
        return jnp.tensordot(weights, sums, 1).ravel()

    solver = optx.LevenbergMarquardt(rtol=PRECISION, atol=PRECISION)
    options = {"jac": "fwd"}  # few parameters, many residuals
    # no exception: a stage that does not converge is reported (`converged`)
    found = optx.least_squares(
        residuals, solver, start, max_steps=max_steps, throw=False, options=options
    )
    left = jnp.sqrt(jnp.mean(jnp.square(residuals(found.value, None))))
    ended = found.result == optx.RESULTS.successful
    return found.value, left, found.stats["num_steps"], ended
