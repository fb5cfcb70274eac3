"""Events of a scene with a blast: of frames at given times, and of a film."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
from jaxtyping import ArrayLike, Float, PRNGKeyArray

from jblast.errors import argument, require
from jblast.scene import Camera, Scene
from jblast.sensors.camera.film import (
    LIGHT_ERROR,
    Block,
    Film,
    subdivided,
)
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.pixel import (
    Events,
    NoiseModel,
    Pixel,
    log_intensity,
    noisy_pixel,
    pixel_events,
)
from jblast.sensors.camera.rendering import render
from jblast.sensors.camera.stream import event_stream


def camera_pixel(
    camera: Camera, noise: NoiseModel | None = None, key: PRNGKeyArray | None = None
) -> Pixel:
    """Return the pixels of a camera: ideal ones, or with noise.

    Raises:
        InputError: There is noise without a key.
    """
    thresholds = camera.threshold[0], camera.threshold[1]
    if noise is None:
        return Pixel(*thresholds)
    require(key is not None, argument("key"), "a random key for the noise", "none")
    assert key is not None
    return noisy_pixel(key, thresholds, noise, (camera.height, camera.width))


def events(
    scene: Scene,
    camera: Camera,
    times: Float[ArrayLike, " time"],
    *,
    capacity: int,
    noise: NoiseModel | None = None,
    key: PRNGKeyArray | None = None,
    **options: Any,
) -> Events:
    """Return the events of a camera for a scene's fireballs, under jit, vmap and grad.

    The scene is rendered at the times, as instants. Between two of them the logarithm
    of the light is linear, so times of events are of second order in the interval.
    `film_events` chooses the times.

    Args:
        scene: Charges and air.
        camera: The camera, with the thresholds of the events.
        times: Times of the frames [s], rising.
        capacity: Largest number of events; `lost` counts the others.
        noise: Imperfections; None for an ideal camera.
        key: Random key of the noise.
        options: Options of `render`.

    Returns:
        Time, pixel and polarity of the events, in order of time.

    Raises:
        InputError: As `render` and `pixel_events`, or there is noise without a key.

    Example:
        `jblast.events(scene, scene.camera, jnp.arange(100) / 1e3, capacity=100_000)`
    """
    # events have no exposure; the photoreceptor's lag is part of the noise model
    instant = replace(camera, exposure_s=jnp.zeros_like(camera.exposure_s))
    light = luminance(render(scene, instant, times, **options))
    pixel, clock = camera_pixel(camera, noise, key), jnp.asarray(times)
    return pixel_events(log_intensity(light), clock, pixel, capacity=capacity)[0]


def film_events(
    film: Film,
    *,
    noise: NoiseModel | None = None,
    key: PRNGKeyArray | None = None,
    bound_s: float | None = None,
    seen: Callable[[float], object] = lambda time: None,
) -> Iterator[Events]:
    """Yield the events of a film's camera, block by block, on the common clock.

    Args:
        film: The film; its first frame is the reference of the events.
        noise: Imperfections; None for an ideal camera.
        key: Random key of the noise.
        bound_s: Bound of the time error of all but `film.LEFT` of the events [s];
            default: `Film.stamp_error_s`.
        seen: Called with the last time of each block, before its events.
    """
    pixel = camera_pixel(film.camera, noise, key)
    least = float(min(film.camera.threshold))
    # the reference of a pixel with a reset is the light itself
    light_error = math.inf if noise is None else LIGHT_ERROR * least
    if bound_s is None:
        bound_s = film.stamp_error_s(noise=noise is not None)

    def blocks() -> Iterator[Block]:
        for times, light in subdivided(film, least, bound_s, light_error):
            seen(float(times[-1]))
            yield times, light

    return event_stream(blocks(), pixel)
