r"""Explosion sets: pictures of heat, soot and dust, lit and scaled by the laws.

A set shows one explosion on the ground, from views all around and above, at phases:
times since the burst over the duration of its fireball. Its pictures have no size and
no brightness of their own:

- each picture is scaled so that its visible radius (two standard deviations of its
  silhouette along the horizontal of the image, which for a disc is the radius) is that
  of the scene's fireball law at the time, seen as the outline of a ball of this radius;
  both pictures between which the time lies are scaled in this way;
- its phase is the time over the law's duration for the charge;
- its light is that of a black body, by the law's temperature and the heat of each
  texel, plus the daylight on soot and dust.

Heat $h$ is the excess of temperature over the air's, relative to that in the middle of
the law's fireball: the light is that of a black body of

$$T_a + h\,(T - T_a)$$

for the fireball's temperature $T$ at the time. Soot and dust of a colour are lit by the
daylight. One opacity covers both.

A picture is on a billboard as in `billboards.py`, with the same up. Its foot is at the
charge, or on the ground below it as long as the charge is not higher than half the
largest radius. If the charge is higher, the foot is that much below it: the picture is
then that of a burst on the ground, raised. Seen from another elevation than its own,
the picture is shifted so that the middle of the cloud keeps its height in the world.
The wind carries the middle as it carries the law's ball, lower parts less and upper
parts more, by the height in the picture; the foot does not move. After the last phase
the last picture remains, and fades within half of that time.

A direction is shown by the nearest view on the unit sphere.

A picture with several texels per pixel would flicker if it were sampled between pixels.
Its convolution with $[1, 2, 1]/4$, the texels then 1, 2, 4 ... apart, has the variance
$(4^n - 1)/6$ texels after $n$ times: that of a tent $2^n$ texels wide minus that of the
interpolation. For a pixel $s$ texels wide the two next pictures are mixed so that the
variance is $(s^2 - 1)/6$ exactly. This increases the square of a disc's radius,
$R = 2\sigma$, by at most two thirds of a square pixel.

References:
    Parab's thesis, 3.2.2: views on the upper hemisphere, the nearest shown.
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from jblast.scene.charge import Charge
from jblast.scene.scene import Scene
from jblast.sensors.camera.billboards import GRAZING, ViewSet, billboard_axes
from jblast.sensors.camera.fireball import (
    Appearance,
    Cloud,
    cloud,
    corner_rays,
    in_window,
    ray_pitch,
    touched,
)
from jblast.sensors.camera.geometry import Rays
from jblast.sensors.camera.image import blackbody_light, laid_over, srgb_to_linear
from jblast.types import as_float_array
from jblast.waves.fireball import (
    LARGEST_RADIUS,
    fireball_duration,
    fireball_growth_time,
)

TESTED_PHASES = 24
"""Phases at which `is_met` tests a picture, geometrically spaced because the cloud
grows fastest at first. A view that opens only between two of them is not found."""
FADING = 0.5
"""Time in which the last picture fades, over its phase."""
CLOSEST = 0.9
"""Radius over distance up to which the outline of a ball is followed. Nearer, the
outline's radius would diverge as the camera enters the ball."""
ON_GROUND = 0.5
"""Height of a burst over its largest radius up to which its picture stands on it."""
LOWEST = 0.1
"""Smallest apparent height of the middle of a cloud, over its radius: seen from above
the height vanishes, and the wind's share by height would diverge."""
HIGHEST = 2.0
"""Height over that of the middle above which the wind carries all parts equally."""
LEVELS = 6
"""Convolutions of a picture: after six a tent 64 texels wide, half of a usual picture
of 128. A picture that is shown smaller is not smoothed further."""


class Pictures(ViewSet):
    """Pictures of an explosion on the ground.

    Attributes:
        frames: Heat; red, green, blue of soot and dust (sRGB); opacity; 8 bits each.
        direction: Unit vector from the blast to each viewer: east, north, up.
        up: Unit vector that is up in each view's pictures, across its direction.
        radius: Visible radius in each picture [px].
        spread: Covariance of the silhouette's columns with its rows, and variance of
            its rows, over the variance of its columns [-].
        box: First and last column, first and last row that show anything [px].
        height: Height of the middle of the cloud above the ground at each phase, over
            its visible radius [-].
        phase: Time of each frame since the burst over the fireball's duration, rising.
        anchor: (x, y) of the burst in each view's pictures [px].
        windows: True to calculate only the part of an image that may show some of a
            picture. Under `vmap`, where all branches are evaluated, it is slower.
        smoothed: True to remove detail finer than a pixel from pictures shown smaller
            than they are (`low_passed`). Under `vmap` that is done for all pictures and
            takes as long as the rest: omit it where no picture is shown so small.
    """

    frames: UInt8[Array, "view frame size size 5"]
    direction: Float[Array, "view 3"] = eqx.field(converter=as_float_array)
    up: Float[Array, "view 3"] = eqx.field(converter=as_float_array)
    radius: Float[Array, "view frame"] = eqx.field(converter=as_float_array)
    spread: Float[Array, "view frame 2"] = eqx.field(converter=as_float_array)
    box: Float[Array, "view frame 4"] = eqx.field(converter=as_float_array)
    height: Float[Array, " frame"] = eqx.field(converter=as_float_array)
    phase: Float[Array, " frame"] = eqx.field(converter=as_float_array)
    anchor: Float[Array, "view 2"] = eqx.field(converter=as_float_array)
    windows: bool = eqx.field(static=True, default=True)
    smoothed: bool = eqx.field(static=True, default=True)

    def view_towards(self, towards: Float[Array, "3"]) -> Int[Array, ""]:
        """Return the view nearest to a direction from the blast; the first of equals.

        Args:
            towards: Vector from the blast to the camera, of any length.
        """
        return jnp.argmax(self.direction @ towards)

    def frames_at(
        self, phase: Float[Array, ""]
    ) -> tuple[Int[Array, "2"], Float[Array, "2"]]:
        """Return the two frames around a phase, and their weights."""
        last = len(self.phase) - 1
        before = jnp.searchsorted(self.phase, phase, side="right") - 1
        before = jnp.clip(before, 0, max(last - 1, 0))
        after = jnp.minimum(before + 1, last)
        apart = self.phase[after] - self.phase[before]
        some = apart > 0.0
        part = (phase - self.phase[before]) / jnp.where(some, apart, 1.0)
        part = jnp.where(some, jnp.clip(part, 0.0, 1.0), 0.0).astype(phase.dtype)
        end = self.phase[-1].astype(phase.dtype)
        # the weight of the last picture falls linearly to zero
        there = jnp.clip(1.0 - (phase / end - 1.0) / FADING, 0.0, 1.0)
        there = jnp.where(phase > 0.0, there, 0.0)
        return jnp.stack([before, after]), there * jnp.stack([1.0 - part, part])


class ExplosionViews(Pictures):
    """Pictures of an explosion on the ground, as rays see them; see `Pictures`."""

    glows: ClassVar[bool] = True

    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return the duration of a charge's pictures, without the fading [s]."""
        return self.phase[-1] * self._life(charge)

    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return the times of frames and of rapid growth, since the burst [s]."""
        life = float(self._life(charge))
        mass = charge.tnt_mass("fireball_radius_m")
        # doubling steps follow the decelerating growth
        growing = float(fireball_growth_time(mass)) * 0.25 * 2.0 ** np.arange(6)
        phases = np.asarray(self.phase, float)
        last = (1.0 + FADING) * phases[-1:]
        return np.unique(np.concatenate([growing, life * phases, life * last]))

    def seen(
        self,
        scene: Scene,
        rays: Rays,
        time: Float[Array, ""],
        appearance: Appearance,
    ) -> Float[Array, "4 row column"]:
        """Return the image of a scene's charges along rays, nearer ones in front.

        Differentiable in all numbers of scene, camera and time except at kinks: where a
        ray passes a texel's centre, and at a frame's phase; and at jumps: where the
        nearest view changes, or something hides it.
        """
        return laid_over(
            [
                explosion_layer(self, scene, charge, rays, time, appearance)
                for charge in scene.charges
            ]
        )

    def is_met(self, scene: Scene, charge: Charge, rays: Rays) -> Bool[Array, ""]:
        """Return True if a ray ever meets the picture, where it shows anything."""
        return is_met(self, scene, charge, rays)

    def _life(self, charge: Charge) -> Float[Array, ""]:
        return fireball_duration(charge.tnt_mass("fireball_radius_m"))


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
        charge: One of the scene's charges.
        rays: Camera rays, which end at the background.
        time: Time on the common clock [s].
        appearance: Exposure.
    """
    ball = cloud(scene, charge, time)
    mass = charge.tnt_mass("fireball_radius_m")
    phase = charge.since(time) / fireball_duration(mass)
    plane = plane_of(charge, rays, ball)
    # 256 black bodies per instant, one for each value of heat, instead of one per texel
    heat = jnp.arange(256, dtype=ball.temperature.dtype) / 255.0
    light = blackbody_light(ball.air + heat * (ball.temperature - ball.air))
    glow = light / appearance.white
    day = (appearance.daylight / appearance.white).astype(glow.dtype)
    frames, parts = views.frames_at(phase)
    view = views.view_towards(-plane.sight)
    axes = axes_of(views, plane, view)
    corners, size = corner_rays(rays), rays.direction.shape[1:]
    met = met_by(axes, plane, corners)
    cells, pictures = jnp.zeros((), bool), []
    for frame, part in zip(frames, parts, strict=True):
        laid = laid_on(views, plane, axes, view, frame)
        x, y = met.on(laid)
        pitch = ray_pitch(x, y, met.ever, (laid.x, laid.y), size)
        # smoothing and interpolation spread the silhouette by up to two pixels
        margin = 2.0 * jnp.maximum(pitch, 1.0)
        box = views.box[view, frame] + margin * jnp.array([-1.0, 1.0, -1.0, 1.0])
        cells |= touched(x, y, met.ever, corners.farthest <= 0.0, box)
        picture = texel_light(views.frames[view, frame], glow, day)
        picture = picture.astype(rays.direction.dtype)
        picture = low_passed(picture, pitch) if views.smoothed else picture
        pictures.append((laid, part * picture))

    def look(part: Rays) -> Float[Array, "row column 4"]:
        met = met_by(axes, plane, part)
        seen = sum(_interpolated(picture, *met.on(laid)) for laid, picture in pictures)
        visible = met.ever & (met.distance < part.farthest)
        return jnp.where(visible[..., None], seen, 0.0)

    if views.windows:
        layer = in_window(cells & (phase > 0.0), rays, look)
    else:
        layer = look(rays)
    return jnp.moveaxis(layer, -1, 0), jnp.square(plane.far)


def is_met(
    views: Pictures, scene: Scene, charge: Charge, rays: Rays
) -> Bool[Array, ""]:
    """Return True if a ray ever meets a charge's picture, where it shows anything."""
    charge = charge.as_if_at_zero()

    def at(phase):
        life = fireball_duration(charge.tnt_mass("fireball_radius_m"))
        ball = cloud(scene, charge, charge.time_s + phase * life)
        plane = plane_of(charge, rays, ball)
        frames, _ = views.frames_at(phase)
        view = views.view_towards(-plane.sight)
        axes = axes_of(views, plane, view)
        laid = laid_on(views, plane, axes, view, frames[0])
        size = rays.direction.shape[1:]
        few, met = (met_by(axes, plane, r) for r in (corner_rays(rays), rays))
        x, y = few.on(laid)
        pitch = ray_pitch(x, y, few.ever, (laid.x, laid.y), size)
        x, y = met.on(laid)
        first, last, top, bottom = views.box[view, frames[0]]
        inside = (x > first - pitch) & (x < last + pitch)
        inside &= (y > top - pitch) & (y < bottom + pitch)
        return jnp.any(inside & met.ever)

    return jnp.any(jax.lax.map(at, jnp.geomspace(1e-3, views.phase[-1], TESTED_PHASES)))


def _interpolated(
    picture: Float[Array, "height width 4"],
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
) -> Float[Array, "row column 4"]:
    """Return a picture's light between texels; outside it falls to zero."""
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


def texel_light(
    texels: UInt8[Array, "height width 5"],
    glow: Float[Array, "256 3"],
    day: Float[Array, ""],
) -> Float[Array, "height width 4"]:
    """Return the premultiplied linear light of texels.

    Args:
        texels: Heat; red, green and blue of soot and dust, sRGB; opacity.
        glow: Light of every heat.
        day: Light of a white wall in daylight, full scale 1.
    """
    numbers = jnp.arange(256, dtype=glow.dtype) / 255.0
    shade = day * srgb_to_linear(numbers)
    # 8-bit indices are within tables of 256, so that bounds need no check
    parts = texels.astype(jnp.int32)
    light = _entries(glow, parts[..., 0]) + _entries(shade, parts[..., 1:4])
    alpha = _entries(numbers, parts[..., 4:])
    return jnp.concatenate([alpha * light, alpha], axis=-1)


def _entries(table, index):
    return table.at[index].get(mode="promise_in_bounds")


class Plane(NamedTuple):
    """Plane of a picture: across the line of sight, through the foot of the cloud.

    Attributes:
        sight: Vector from the camera to the anchor [m].
        far: Length of that vector [m].
        apart: False if the camera is at the anchor.
        radius: Visible radius of the cloud on the plane [m].
        drift: Drift of the cloud's middle with the wind: east, north, up [m].
    """

    sight: Float[Array, "3"]
    far: Float[Array, ""]
    apart: Bool[Array, ""]
    radius: Float[Array, ""]
    drift: Float[Array, "3"]


class Laid(NamedTuple):
    """Scale and position of one picture on the plane.

    Attributes:
        scale: Texels per metre [1/m].
        x: Column of the picture at the foot of the cloud [px].
        y: Row there.
        drift: Drift of the cloud's middle with the wind, to the right and down [m].
        middle: Apparent height of the middle above the foot [m].
        level: Cosine of the elevation of the line of sight.
    """

    scale: Float[Array, ""]
    x: Float[Array, ""]
    y: Float[Array, ""]
    drift: tuple[Float[Array, ""], Float[Array, ""]]
    middle: Float[Array, ""]
    level: Float[Array, ""]


class Met(NamedTuple):
    """Intersections of rays with the plane.

    Attributes:
        right: Distance to the right of the foot of the cloud [m].
        down: Distance below it [m].
        ever: False for rays that miss the plane.
        distance: Distance along each ray [m].
    """

    right: Float[Array, "row column"]
    down: Float[Array, "row column"]
    ever: Bool[Array, "row column"]
    distance: Float[Array, "row column"]

    def on(self, laid: Laid) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
        """Return the positions on a picture [px]."""
        # heights of points are visible from the side, and not from above
        higher = jnp.clip(-self.down / laid.middle, 0.0, HIGHEST) - 1.0
        carried = 1.0 + laid.level * higher
        right, down = laid.drift
        return (
            laid.x + laid.scale * (self.right - carried * right),
            laid.y + laid.scale * (self.down - carried * down),
        )


def foot_height(charge: Charge) -> Float[Array, ""]:
    """Return the height of the foot of a charge's pictures [m].

    On the ground, unless the burst is more than half its largest radius above it.
    """
    largest = LARGEST_RADIUS * jnp.cbrt(charge.tnt_mass("fireball_radius_m"))
    return charge.up - jnp.clip(charge.up, 0.0, ON_GROUND * largest)


def plane_of(charge: Charge, rays: Rays, ball: Cloud) -> Plane:
    """Return the plane of a charge's pictures."""
    east, north, _ = charge.position_m
    sight = jnp.stack([east, north, foot_height(charge)]) - rays.origin
    apart = jnp.any(sight != 0.0)
    # a camera at the foot sees nothing; any finite vector avoids 0 / 0
    sight = jnp.where(apart, sight, 1.0)
    far = jnp.sqrt(jnp.sum(jnp.square(sight)))
    # the outline of a ball of radius R at distance d has the radius R / sqrt(1 - sin^2)
    sine = jnp.minimum(ball.radius / far, CLOSEST)
    seen = ball.radius / jnp.sqrt(1.0 - jnp.square(sine))
    radius = jnp.where(ball.radius > 0.0, seen, 1.0)
    drift = ball.centre - jnp.stack([east, north, ball.centre[2]])
    return Plane(sight, far, apart, radius, drift)


def axes_of(views: Pictures, plane: Plane, view: Int[Array, ""]) -> Float[Array, "3 3"]:
    """Return right, down and forward of a view's pictures, as rows."""
    forward = plane.sight / plane.far
    return billboard_axes(forward, views.direction[view], views.up[view])


def laid_on(
    views: Pictures,
    plane: Plane,
    axes: Float[Array, "3 3"],
    view: Int[Array, ""],
    frame: Int[Array, ""],
) -> Laid:
    """Return scale and position of a view's picture of a frame on its plane."""
    radius, level = level_radius(views, axes, view, frame), -axes[1, 2]
    # difference of the middle's apparent height here and in the picture
    raised = views.height[frame] * radius * (level - views.up[view, 2])
    x, y = views.anchor[view]
    right, down, _ = axes @ plane.drift
    middle = jnp.maximum(views.height[frame] * level, LOWEST) * plane.radius
    scale = radius / plane.radius
    return Laid(scale, x, y + raised, (right, down), middle, level)


def level_radius(
    views: Pictures,
    axes: Float[Array, "3 3"],
    view: Int[Array, ""],
    frame: Int[Array, ""],
) -> Float[Array, ""]:
    r"""Return a picture's visible radius along the horizontal of the image [px].

    A view from the side is rotated in the image, the more the higher the camera. Two
    standard deviations of its own columns are then not those of the camera's. Along the
    horizontal $n$ of the picture they are $2\sqrt{n^T \Sigma n}$, with $\Sigma$ the
    covariance of the silhouette. From straight above no direction is horizontal, and
    the picture's columns are used.
    """
    across, along = -axes[1, 2], axes[0, 2]
    square = jnp.square(across) + jnp.square(along)
    some = square > 0.0
    across = jnp.where(some, across, 1.0)
    mixed, rows = views.spread[view, frame]
    shape = jnp.square(across) + (2.0 * mixed * across + rows * along) * along
    return views.radius[view, frame] * jnp.sqrt(shape / jnp.where(some, square, 1.0))


def met_by(axes: Float[Array, "3 3"], plane: Plane, rays: Rays) -> Met:
    """Return the intersections of rays with the plane of a picture."""
    east, north, up = rays.direction
    # written out: a matrix product would go through memory
    right, down, ahead = (a[0] * east + a[1] * north + a[2] * up for a in axes)
    met = (ahead > GRAZING) & (rays.farthest > 0.0) & plane.apart
    distance = plane.far / jnp.where(met, ahead, 1.0)
    return Met(right * distance, down * distance, met, distance)


def low_passed(
    picture: Float[Array, "height width channel"], pitch: Float[Array, ""]
) -> Float[Array, "height width channel"]:
    """Return a picture without detail finer than a pixel.

    Continuous in the pitch, with a kink at the powers of two.

    Args:
        picture: Premultiplied linear light.
        pitch: Width of a pixel in texels; up to one the picture is unchanged.
    """
    return jax.lax.cond(pitch > 1.0, _smoothed, lambda p, _: p, picture, pitch)


def _smoothed(picture, pitch):
    square = jnp.clip(jnp.square(pitch), 1.0, 4.0**LEVELS)
    found, level = jnp.zeros_like(picture), picture
    for n in range(LEVELS + 1):
        # tent weights in the variance: `above` falls and `below` rises between levels
        above = jnp.clip((4.0 ** (n + 1) - square) / (3.0 * 4.0**n), 0.0, 1.0)
        below = jnp.clip((square - 4.0 ** (n - 1)) / (3.0 * 4.0 ** (n - 1)), 0.0, 1.0)
        found = found + jnp.minimum(above, below) * level
        if n < LEVELS:
            level = _convolved(_convolved(level, 2**n, 0), 2**n, 1)
    return found


def _convolved(image, step: int, axis: int):
    """Return the convolution with [1, 2, 1] / 4 at a spacing of `step` texels."""
    length = image.shape[axis]
    # both neighbours are outside the picture, where it is zero
    if step >= length:
        return 0.5 * image
    room = [(0, 0)] * image.ndim
    room[axis] = (step, step)
    wide = jnp.pad(image, room)
    before = jax.lax.slice_in_dim(wide, 0, length, axis=axis)
    after = jax.lax.slice_in_dim(wide, 2 * step, 2 * step + length, axis=axis)
    return 0.5 * image + 0.25 * (before + after)
