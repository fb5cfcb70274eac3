"""Events of a scene with a blast: through frames, or at their exact times.

`events` renders frames, and interpolates the logarithm of the light linearly between
them, under jit, vmap and grad. `render_events` evaluates the light of the scene's
fireballs as a function of time for each pixel, so that events do not depend on a frame
rate. It is for a fixed camera and the procedural fireball.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PRNGKeyArray

from jblast.scene import Camera, Scene
from jblast.sensors.camera.billboards import ViewSet
from jblast.sensors.camera.events.exact import frameless_events
from jblast.sensors.camera.events.ideal import Events, ideal_events, log_intensity
from jblast.sensors.camera.events.noise import IDEAL, NoiseModel, noisy_events
from jblast.sensors.camera.fireball import (
    Appearance,
    GlowTable,
    cloud,
    fireballs_seen,
    glow,
    glow_table,
)
from jblast.sensors.camera.geometry import Rays, Surfaces, pixel_rays, surfaces_seen
from jblast.sensors.camera.image import BACKGROUND, Background, luminance
from jblast.sensors.camera.rendering import check_stands, render
from jblast.sensors.camera.surroundings import disc_light, flash, sphere_factor
from jblast.types import as_float_array
from jblast.waves.propagation import ambient


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
    """Return the events of a camera for a scene's fireballs.

    The scene is rendered at the times, as instants. Between two of them the logarithm
    of the light is linear, so times of events are of second order in the interval.
    `render_events` solves for them instead, on the host; `stream_events` converts films
    that do not fit in memory.

    Args:
        scene: Charges and air.
        camera: The camera, with the thresholds of the events.
        times: Times of the frames [s], rising.
        capacity: Largest number of events; `lost` counts the others.
        key: Random key of mismatch, hot pixels and noise; not used without noise.
        noise: Effects and their sizes; by default none.
        background: As in `render`, with `depth`, `ground`, `supersample`, `views` and
            `appearance`.
        depth: Distance of the background along each pixel's ray [m].
        ground: True if the plane up = 0 hides what is below it.
        supersample: Rays along each side of a pixel.
        appearance: Exposure, and distribution of the smoke.
        views: Pictures of an explosion that replace the procedural fireball.

    Returns:
        Time, pixel and polarity of the events, in order of time.

    Raises:
        InputError: As `render` and `ideal_events`.

    Example:
        `jblast.events(scene, scene.camera, jnp.arange(100) / 1e3, capacity=100_000)`
    """
    frames = render(
        scene,
        # events have no exposure; the photoreceptor's lag is part of the noise model
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


def render_events(
    scene: Scene,
    camera: Camera,
    times: Float[np.ndarray, " time"],
    *,
    background: Float[ArrayLike, "..."] = BACKGROUND,
    depth: Float[ArrayLike, "height width"] | None = None,
    ground: bool = True,
    appearance: Appearance | None = None,
    tolerance: float = 1e-9,
) -> Events:
    """Return the events of an ideal camera for a scene's fireballs.

    The light is that of `render` without exposure and with one ray per pixel; the
    thresholds are the camera's.

    Args:
        scene: Charges, each with a position, and air.
        camera: The camera.
        times: First samples, which bound the search; see `frameless_events` [s].
        background: A grey, a colour, or an image of them (height, width, 3), constant
            in time.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: True if the plane up = 0 hides what is below it.
        appearance: Exposure, and distribution of the smoke.
        tolerance: Tolerance of the times of events [s].
    """
    light = pixel_light(
        scene,
        camera,
        background=background,
        depth=depth,
        ground=ground,
        appearance=appearance,
    )
    with jax.enable_x64(True):
        table = glow_table(ambient(scene.air)[0], light.appearance)
    light = replace(light, table=table)
    positive, negative = np.asarray(camera.threshold, float)
    both, shape = (positive, negative), (camera.height, camera.width)
    touched = _touched_pixels(scene, light.rays, jnp.asarray(times))
    if light.lit is not None:
        step = jnp.min(jnp.asarray(camera.threshold))
        touched |= _brightened_pixels(light, light.lit, jnp.asarray(times), step)
    # pixels that the fire can neither cover nor light send no events
    pixels = np.flatnonzero(touched)
    return frameless_events(
        light, shape, times, both, tolerance=tolerance, pixels=pixels
    )


class PixelLight(eqx.Module):
    """Logarithm of the grey light of single pixels at single instants.

    Attributes:
        scene: Charges and air.
        rays: One ray per pixel.
        background: Light behind the fireballs, without theirs, full scale 1.
        appearance: Exposure, and distribution of the smoke.
        lit: Surfaces of the background that fireballs light; None if they light none.
        table: Tabulated glow of the fireballs; None for Planck's law.
    """

    scene: Scene
    rays: Rays
    background: Float[Array, "height width 3"]
    appearance: Appearance
    lit: Surfaces | None
    table: GlowTable | None = None

    def __call__(
        self, time: Float[Array, " at"], x: Float[Array, " at"], y: Float[Array, " at"]
    ) -> Float[Array, " at"]:
        """Return the logarithm of light at times, columns and rows."""
        at = y.astype(int), x.astype(int)

        def seen(time, direction, farthest, end):
            rays = Rays(
                self.rays.origin, direction[:, None, None], farthest[None, None]
            )
            light = fireballs_seen(self.scene, rays, time, self.appearance, self.table)
            if end is None:
                return light[:, 0, 0], jnp.zeros((3,), light.dtype)
            there = Surfaces(*(part[..., None, None] for part in end))
            gained = flash(self.scene, there, time, self.appearance, self.table)
            return light[:, 0, 0], gained[:, 0, 0]

        ends, axes = None, None
        if self.lit is not None:
            ends = [part[..., *at] for part in jax.tree.leaves(self.lit)]
            axes = [1, 1, 0]
        lanes = self.rays.direction[:, *at], self.rays.farthest[at], ends
        colour, gained = jax.vmap(seen, (0, 1, 0, axes))(time, *lanes)
        behind = luminance(self.background[at] * (1.0 + gained))
        return log_intensity(luminance(colour[:, :3]) + (1.0 - colour[:, 3]) * behind)


def pixel_light(
    scene: Scene,
    camera: Camera,
    *,
    background: Float[ArrayLike, "..."] = BACKGROUND,
    depth: Float[ArrayLike, "height width"] | None = None,
    ground: bool = True,
    appearance: Appearance | None = None,
) -> PixelLight:
    """Return the light of a scene for a camera; arguments as of `render_events`."""
    check_stands(camera)
    if depth is not None:
        depth = as_float_array(depth)
    appearance = Appearance() if appearance is None else appearance
    rays, behind = pixel_rays(camera, depth, ground=ground), as_float_array(background)
    light = PixelLight(
        scene,
        rays,
        jnp.broadcast_to(behind, (camera.height, camera.width, 3)),
        appearance,
        surfaces_seen(rays, image=depth is not None) if appearance.flash else None,
    )
    # as arrays without weak types: Python's numbers would compile programs of their own
    return jax.tree.map(
        lambda v: jax.lax.convert_element_type(v, v.dtype) if v.dtype != bool else v,
        light,
    )


@eqx.filter_jit
def _touched_pixels(
    scene: Scene, rays: Rays, times: Float[Array, " time"]
) -> Bool[Array, "height width"]:
    """Return the mask of pixels that a fireball may touch between the times.

    Radius and rise only grow. Between two times the cloud stays within a sphere about
    the midpoint of its centres: that of the later radius plus half of the distance.
    """

    def between(reached, ends):
        for charge in scene.charges:
            low, high = (cloud(scene, charge, time) for time in ends)
            offset = 0.5 * (low.centre + high.centre) - rays.origin
            displaced = 0.5 * (high.centre[2] - low.centre[2])
            along = jnp.tensordot(offset, rays.direction, 1)
            square = jnp.sum(jnp.square(offset)) - jnp.square(jnp.maximum(along, 0.0))
            # negated: a NaN radius may be anywhere
            reached |= ~(square > jnp.square(high.radius + displaced))
        return reached, None

    none = jnp.zeros(rays.farthest.shape, bool)
    return jax.lax.scan(between, none, (times[:-1], times[1:]))[0]


@eqx.filter_jit
def _brightened_pixels(
    light: PixelLight,
    surfaces: Surfaces,
    times: Float[Array, " time"],
    step: Float[Array, ""],
) -> Bool[Array, "height width"]:
    """Return the mask of pixels whose background the fire may brighten by a step.

    The light of a fireball only fades while it is opaque. Between two times a cloud
    stays within a sphere as in `_touched_pixels`, of which a surface sees more.
    """
    look = light.appearance

    def between(most, ends):
        gained = jnp.zeros((), times.dtype)
        for charge in light.scene.charges:
            low, high = (cloud(light.scene, charge, time) for time in ends)
            displaced = 0.5 * jnp.sqrt(jnp.sum(jnp.square(high.centre - low.centre)))
            centre, reach = 0.5 * (low.centre + high.centre), high.radius + displaced
            offset = centre[:, None, None] - surfaces.place
            within = jnp.sum(jnp.square(offset), axis=0) < jnp.square(reach)
            factor = jnp.where(within, 1.0, sphere_factor(centre, reach, surfaces))
            black = replace(low, optical_depth=jnp.full_like(low.radius, jnp.inf))
            hot = glow(low.temperature, low.air, look)
            shine = disc_light(black, hot, look) / look.daylight
            gained = gained + shine[None, None] * factor[..., None]
        return jnp.maximum(most, luminance(light.background * gained)), None

    none = jnp.zeros(surfaces.solid.shape, times.dtype)
    most = jax.lax.scan(between, none, (times[:-1], times[1:]))[0]
    dark = luminance(light.background)
    return surfaces.solid & ~(log_intensity(dark + most) - log_intensity(dark) < step)
