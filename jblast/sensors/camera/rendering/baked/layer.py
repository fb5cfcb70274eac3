"""What rays see of one charge's explosion set."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.scene.charge import Charge
from jblast.scene.scene import Scene
from jblast.sensors.camera.geometry.pixel_rays import Rays
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.baked.low_pass import low_passed
from jblast.sensors.camera.rendering.baked.pictures import Pictures
from jblast.sensors.camera.rendering.baked.plane import (
    axes_of,
    laid_on,
    met_by,
    plane_of,
)
from jblast.sensors.camera.rendering.baked.texels import heat_light, texel_light
from jblast.sensors.camera.rendering.baked.window import (
    corner_rays,
    in_window,
    ray_pitch,
    touched,
)
from jblast.sensors.camera.rendering.fireball_image import cloud
from jblast.waves.fireball import fireball_duration

LOOKED = 24
"""Instants at which it is asked whether a picture is in view."""


def explosion_layer(
    views: Pictures,
    scene: Scene,
    charge: Charge,
    rays: Rays,
    time: Float[Array, ""],
    appearance: Appearance,
) -> tuple[Float[Array, "4 row column"], Float[Array, ""]]:
    """Return the premultiplied light of one charge, and the square of its distance.

    Args:
        views: The set.
        scene: Air, and the law of the fireball.
        charge: Of the scene.
        rays: Where to look, and where the background is.
        time: On the common clock [s].
        appearance: How it is exposed.
    """
    ball = cloud(scene, charge, time)
    mass = charge.tnt_mass("fireball_radius_m")
    phase = charge.since(time) / fireball_duration(mass)
    plane = plane_of(charge, rays, ball)
    glow = heat_light(ball, appearance)
    day = (appearance.daylight / appearance.white).astype(glow.dtype)
    frames, parts = views.frames_at(phase)
    sides, shares = views.views_towards(-plane.sight)
    corners, size = corner_rays(rays), rays.direction.shape[1:]
    cells, layers = jnp.zeros((), bool), []
    for view, share in zip(sides, shares, strict=True):
        axes = axes_of(views, plane, view)
        met, pictures = met_by(axes, plane, corners), []
        for frame, part in zip(frames, parts, strict=True):
            laid = laid_on(views, plane, axes, view, frame)
            x, y = met.on(laid)
            pitch = ray_pitch(x, y, met.ever, (laid.x, laid.y), size)
            margin = 2.0 * jnp.maximum(pitch, 1.0)
            box = views.box[view, frame] + margin * jnp.array([-1.0, 1.0, -1.0, 1.0])
            cells |= touched(x, y, met.ever, corners.farthest <= 0.0, box)
            picture = texel_light(views.frames[view, frame], glow, day)
            picture = picture.astype(rays.direction.dtype)
            picture = low_passed(picture, pitch) if views.smoothed else picture
            pictures.append((laid, share * part * picture))
        layers.append((axes, pictures))

    def look(part: Rays) -> Float[Array, "row column 4"]:
        total = jnp.zeros((*part.farthest.shape, 4), part.direction.dtype)
        for axes, pictures in layers:
            met = met_by(axes, plane, part)
            seen = sum(_between(picture, *met.on(laid)) for laid, picture in pictures)
            visible = met.ever & (met.distance < part.farthest)
            total = total + jnp.where(visible[..., None], seen, 0.0)
        return total

    if views.windows:
        layer = in_window(cells & (phase > 0.0), rays, look)
    else:
        layer = look(rays)
    return jnp.moveaxis(layer, -1, 0), jnp.square(plane.far)


def is_met(
    views: Pictures, scene: Scene, charge: Charge, rays: Rays
) -> Bool[Array, ""]:
    """Return whether a ray ever meets a charge's picture, where it shows anything."""
    charge = charge.as_if_at_zero()

    def at(phase):
        life = fireball_duration(charge.tnt_mass("fireball_radius_m"))
        ball = cloud(scene, charge, charge.time_s + phase * life)
        plane = plane_of(charge, rays, ball)
        frames, _ = views.frames_at(phase)
        sides, _ = views.views_towards(-plane.sight)
        axes = axes_of(views, plane, sides[0])
        laid = laid_on(views, plane, axes, sides[0], frames[0])
        size = rays.direction.shape[1:]
        few, met = (met_by(axes, plane, r) for r in (corner_rays(rays), rays))
        x, y = few.on(laid)
        pitch = ray_pitch(x, y, few.ever, (laid.x, laid.y), size)
        x, y = met.on(laid)
        first, last, top, bottom = views.box[sides[0], frames[0]]
        inside = (x > first - pitch) & (x < last + pitch)
        inside &= (y > top - pitch) & (y < bottom + pitch)
        return jnp.any(inside & met.ever)

    return jnp.any(jax.lax.map(at, jnp.geomspace(1e-3, views.phase[-1], LOOKED)))


def _between(
    picture: Float[Array, "height width 4"],
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
) -> Float[Array, "row column 4"]:
    """Return a picture's light between texels; beyond them it falls to nothing."""
    picture = jnp.pad(picture, ((1, 1), (1, 1), (0, 0)))
    height, width, channels = picture.shape
    x, y = jnp.clip(x + 1.0, 0.0, width - 1.0), jnp.clip(y + 1.0, 0.0, height - 1.0)
    left = jnp.clip(jnp.floor(x), 0, width - 2)
    top = jnp.clip(jnp.floor(y), 0, height - 2)
    place = top.astype(jnp.int32) * width + left.astype(jnp.int32)
    # whole texels: gathered three times as fast as channel by channel
    texels = picture.reshape(height * width, channels)

    def texel(step):
        return texels.at[place + step].get(mode="promise_in_bounds")

    right, low = (x - left)[..., None], (y - top)[..., None]
    above = (1.0 - right) * texel(0) + right * texel(1)
    below = (1.0 - right) * texel(width) + right * texel(width + 1)
    return (1.0 - low) * above + low * below
