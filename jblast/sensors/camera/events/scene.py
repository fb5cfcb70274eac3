"""Events of a scene with a blast, in one call under jit, vmap and grad."""

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import ArrayLike, Float, PRNGKeyArray

from jblast.scene import Camera, Scene
from jblast.sensors.camera.events.ideal import Events, ideal_events
from jblast.sensors.camera.events.log_intensity import log_intensity
from jblast.sensors.camera.events.noise import IDEAL, NoiseModel
from jblast.sensors.camera.events.noisy import noisy_events
from jblast.sensors.camera.image.behind import BACKGROUND, Background
from jblast.sensors.camera.image.grey_composite import luminance
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.render import render
from jblast.sensors.camera.rendering.view_set import ViewSet


def events(
    scene: Scene,
    camera: Camera,
    times: Float[ArrayLike, " time"],
    *,
    capacity: int,
    key: PRNGKeyArray | None = None,
    noise: NoiseModel = IDEAL,
    background: Background = BACKGROUND,
    depth: Float[ArrayLike, "height width"] | None = None,
    ground: bool = True,
    supersample: int = 1,
    appearance: Appearance | None = None,
    views: ViewSet | None = None,
) -> Events:
    """Return what an event camera sends of a scene's fireballs.

    The scene is rendered at the times, as instants; between two of them the logarithm
    of the light is linear, so times of events are good to second order in the interval.
    `render_events` solves for them instead, on the host; `stream_events` converts films
    that do not fit in memory.

    Args:
        scene: Charges and air.
        camera: Who looks; its thresholds are the events'.
        times: Of the frames in between [s], rising.
        capacity: Room for events. If there are more, `lost` says how many.
        key: Of mismatch, hot pixels and noise; needed for those alone.
        noise: Which effects, and how large; by default none.
        background: As in `render`, with `depth`, `ground`, `supersample`, `views` and
            `appearance`.
        depth: Distance of the background along each pixel's ray [m].
        ground: Whether the plane up = 0 hides what is below it.
        supersample: Rays along each side of a pixel.
        appearance: How the fireball is exposed, and how its smoke is distributed.
        views: Pictures of an explosion in place of the procedural fireball.

    Returns:
        The events in order of time: when, at which pixel, brighter or darker.

    Raises:
        InputError: As `render` and `ideal_events`.

    Example:
        `jblast.events(scene, scene.camera, jnp.arange(100) / 1e3, capacity=100_000)`
    """
    frames = render(
        scene,
        replace(camera, exposure_s=jnp.zeros_like(camera.exposure_s)),
        times,
        background=background,
        depth=depth,
        ground=ground,
        supersample=supersample,
        exposures=1,
        appearance=appearance,
        views=views,
    )
    light = log_intensity(luminance(frames))
    thresholds, clock = (camera.threshold[0], camera.threshold[1]), jnp.asarray(times)
    if noise == IDEAL:
        return ideal_events(light, clock, thresholds, capacity=capacity)
    key = jax.random.key(0) if key is None else key
    return noisy_events(key, light, clock, thresholds, noise, capacity=capacity)
