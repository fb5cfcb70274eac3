r"""Pictures of an explosion from several sides, in place of the procedural fireball.

Pictures of heat, soot and dust show one explosion on the ground, from views all around
and above, at phases: times since the burst over the duration of its fireball. They have
no size and no brightness of their own:

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

The foot of these pictures is at the charge, or on the ground below it as long as the
charge is not higher than half the largest radius. If the charge is higher, the foot is
that much below it: the picture is then that of a burst on the ground, raised. Seen from
another elevation than its own, the picture is shifted so that the middle of the cloud
keeps its height in the world. The wind carries the middle as it carries the law's ball,
lower parts less and upper parts more, by the height in the picture; the foot does not
move. After the last phase the last picture remains, and fades within half of that time.

Photographs of an explosion are pictures without heat. Their burst is at the charge, and
nothing carries them. Lengths are scaled by the cube root of the mass, times by the
duration of the fireball, and a blank picture is their last. They light nothing.

The picture shown is that of the view nearest by direction on the unit sphere about the
blast: the largest $d \cdot u$, $d$ towards the camera, $u$ towards the viewer. It is on
a billboard: a plane through its foot, across the line of sight. A ray from the camera
meets it at a point in metres, so that range, focal length, roll and distortion act on
it as on any point.

Each view has its own up, a fixed vector $v$ of the world that is up in its pictures.
The billboard's up is the part of $v - (d \cdot v)^3\,u$ across the line of sight. Near
the view it is $v$. As the camera climbs to where $v$ points, it turns away from the
view's side, because $v$ alone would turn with every step. A picture has to turn
somewhere, as no field of directions on a sphere is without such a point. It turns at
two points behind the view, 58 degrees from straight behind, towards $v$ and away from
it. A set should have other views there.

Limits of a flat picture: it hides, and is hidden, at the billboard's distance as a
whole. The ground does not cut it: seen from above, the foot of a fireball is nearer
than the billboard. A camera nearer than the fireball's radius is not inside it.

A picture with several texels per pixel would flicker if it were sampled between pixels.
Its convolution with $[1, 2, 1]/4$, the texels then 1, 2, 4 ... apart, has the variance
$(4^n - 1)/6$ texels after $n$ times: that of a tent $2^n$ texels wide minus that of the
interpolation. For a pixel $s$ texels wide the two next pictures are mixed so that the
variance is $(s^2 - 1)/6$ exactly. This increases the square of a disc's radius,
$R = 2\sigma$, by at most two thirds of a square pixel.

References:
    Parab's thesis, 3.2.2: views on the upper hemisphere, the nearest shown.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from jblast.scene import Air, Charge
from jblast.sensors.camera.fireball import Appearance, Cloud, cloud
from jblast.sensors.camera.geometry import Rays
from jblast.sensors.camera.image import blackbody_light, srgb_to_linear
from jblast.sensors.camera.tiles import (
    SLACK,
    TILE,
    corner_rays,
    over_corners,
    without_direction,
)
from jblast.types import as_numbers
from jblast.waves.fireballs import (
    LARGEST_RADIUS,
    fireball_duration,
    fireball_growth_time,
)

GRAZING = 1e-4
"""Cosine between ray and line of sight below which a ray misses the billboard (89.994
degrees): nearly parallel rays would meet it arbitrarily far away."""
TESTED_PHASES = 24
"""Phases at which `picture_met` tests a picture, geometrically spaced because the cloud
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


Seen = Callable[[Rays], Float[Array, "4 row column"]]
"""Light of a fire along rays: red, green and blue times alpha, and alpha."""
Shown = tuple[Bool[Array, "_ _"], Callable[[], Seen]]
"""Mask of the tiles that may show a fire, and what prepares its light."""


class ExplosionViews(eqx.Module):
    """Pictures of an explosion from several sides.

    Attributes:
        frames: Heat; red, green, blue of soot and dust (sRGB); opacity; 8 bits each.
        direction: Unit vector from the blast to each viewer: east, north, up.
        up: Unit vector that is up in each view's pictures, across its direction.
        radius: Visible radius in each picture [px]; without heat, the length of
            1 m/kg^(1/3) in it.
        spread: Covariance of the silhouette's columns with its rows, and variance of
            its rows, over the variance of its columns [-].
        box: First and last column, first and last row that show anything [px].
        height: Height of the middle of the cloud above its foot at each phase, over its
            visible radius [-].
        phase: Time of each frame since the burst over the fireball's duration, rising.
        anchor: (x, y) of the burst in each view's pictures [px].
        hot: True for pictures with heat, which are scaled and lit by the fireball's
            laws; false for pictures of an explosion that have its own size and light.
    """

    frames: UInt8[Array, "view frame height width 5"]
    direction: Float[Array, "view 3"] = eqx.field(converter=as_numbers)
    up: Float[Array, "view 3"] = eqx.field(converter=as_numbers)
    radius: Float[Array, "view frame"] = eqx.field(converter=as_numbers)
    spread: Float[Array, "view frame 2"] = eqx.field(converter=as_numbers)
    box: Float[Array, "view frame 4"] = eqx.field(converter=as_numbers)
    height: Float[Array, " frame"] = eqx.field(converter=as_numbers)
    phase: Float[Array, " frame"] = eqx.field(converter=as_numbers)
    anchor: Float[Array, "view 2"] = eqx.field(converter=as_numbers)
    hot: bool = eqx.field(static=True, default=True)

    def duration(self, charge: Charge) -> Float[Array, ""]:
        """Return the duration of a charge's pictures, without the fading [s]."""
        return self.phase[-1] * life(charge)

    def instants(self, charge: Charge) -> Float[np.ndarray, " instant"]:
        """Return the times of frames and of rapid growth, since the burst [s]."""
        # doubling steps follow the decelerating growth
        growth = fireball_growth_time(charge.tnt_mass("fireball_radius_m"))
        growing = float(growth) * 0.25 * 2.0 ** np.arange(6)
        phases = np.asarray(self.phase, float)
        phases = np.append(phases, (1.0 + FADING) * phases[-1])
        return np.unique(np.concatenate([growing, float(life(charge)) * phases]))

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


def life(charge: Charge) -> Float[Array, ""]:
    """Return the duration of a charge's fireball [s]."""
    return fireball_duration(charge.tnt_mass("fireball_radius_m"))


def shown_for_s(charge: Charge, views: ExplosionViews | None) -> float:
    """Return the duration of a charge's fire in a film, without the fading [s]."""
    return float(life(charge) if views is None else views.duration(charge))


class Standing(NamedTuple):
    """Size and position of the pictures of a charge at an instant.

    Attributes:
        foot: Point of the anchor of the pictures, from the camera: east, north, up [m].
        radius: Length of the visible radius [m].
        drift: Drift of the cloud's middle with the wind: east, north, up [m].
        phase: Time since the burst over the fireball's duration.
        temperature: Temperature of the middle of the fireball [K].
        air: Temperature of the surrounding air [K].
    """

    foot: Float[Array, "3"]
    radius: Float[Array, ""]
    drift: Float[Array, "3"]
    phase: Float[Array, ""]
    temperature: Float[Array, ""]
    air: Float[Array, ""]


def standing(
    views: ExplosionViews,
    charge: Charge,
    ball: Cloud,
    origin: Float[Array, "3"],
    time: Float[Array, ""],
) -> Standing:
    """Return size and position of a charge's pictures at a time.

    Args:
        views: The pictures.
        charge: The charge.
        ball: Its fireball by the laws at the time, relative to the origin.
        origin: The camera's position, relative to which positions are: east, north, up
            [m].
        time: Time on the common clock [s].
    """
    phase = charge.since(time) / life(charge)
    burst = jnp.stack(charge.position_m) - origin
    if not views.hot:
        size = jnp.cbrt(charge.tnt_mass("fireball_radius_m"))
        still = jnp.zeros_like(burst)
        return Standing(burst, size, still, phase, ball.temperature, ball.air)
    foot = burst.at[2].set(foot_height(charge) - origin[2])
    radius = jnp.where(ball.radius > 0.0, ball.radius, 1.0)
    drift = (ball.centre - burst).at[2].set(0.0)
    return Standing(foot, radius, drift, phase, ball.temperature, ball.air)


def foot_height(charge: Charge) -> Float[Array, ""]:
    """Return the height of the foot of a charge's pictures [m].

    On the ground, unless the burst is more than half its largest radius above it.
    """
    largest = LARGEST_RADIUS * jnp.cbrt(charge.tnt_mass("fireball_radius_m"))
    return charge.up - jnp.clip(charge.up, 0.0, ON_GROUND * largest)


class Laid(NamedTuple):
    """One picture on the plane across the line of sight, through the foot.

    Attributes:
        axes: Right, down and forward of the picture, as rows.
        far: Distance of the plane from the camera [m].
        scale: Texels per metre [1/m].
        anchor: Column and row of the picture at the foot.
        drift: Drift of the cloud's middle with the wind, to the right and down [m].
        middle: Apparent height of the middle above the foot [m].
        level: Cosine of the elevation of the line of sight.
    """

    axes: Float[Array, "3 3"]
    far: Float[Array, ""]
    scale: Float[Array, ""]
    anchor: tuple[Float[Array, ""], Float[Array, ""]]
    drift: tuple[Float[Array, ""], Float[Array, ""]]
    middle: Float[Array, ""]
    level: Float[Array, ""]

    def met(self, rays: Rays) -> "Met":
        """Return the intersections of rays with the picture."""
        east, north, up = rays.direction
        # written out: a matrix product would go through memory
        right, down, ahead = (a[0] * east + a[1] * north + a[2] * up for a in self.axes)
        ever = (ahead > GRAZING) & (rays.farthest > 0.0) & (self.far > 0.0)
        distance = self.far / jnp.where(ever, ahead, 1.0)
        right, down = right * distance, down * distance
        # heights of points are visible from the side, and not from above
        higher = jnp.clip(-down / self.middle, 0.0, HIGHEST) - 1.0
        carried = 1.0 + self.level * higher
        x = self.anchor[0] + self.scale * (right - carried * self.drift[0])
        y = self.anchor[1] + self.scale * (down - carried * self.drift[1])
        return Met(x, y, ever, distance)


class Met(NamedTuple):
    """Intersections of rays with a picture.

    Attributes:
        x: Column [px], also outside the picture.
        y: Row, likewise.
        ever: False for rays that miss its plane.
        distance: Distance along each ray [m].
    """

    x: Float[Array, "row column"]
    y: Float[Array, "row column"]
    ever: Bool[Array, "row column"]
    distance: Float[Array, "row column"]


def laid_on(
    views: ExplosionViews,
    stands: Standing,
    view: Int[Array, ""],
    frame: Int[Array, ""],
) -> Laid:
    """Return a view's picture of a frame on its plane, as a camera sees it."""
    sight = stands.foot
    apart = jnp.any(sight != 0.0)
    # a camera at the foot sees nothing; any finite vector avoids 0 / 0
    sight = jnp.where(apart, sight, 1.0)
    far = jnp.sqrt(jnp.sum(jnp.square(sight)))
    axes = billboard_axes(sight / far, views.direction[view], views.up[view])
    across = stands.radius
    if views.hot:
        # the outline of a ball of radius R at distance d has the radius
        # R / sqrt(1 - sin^2)
        sine = jnp.minimum(across / far, CLOSEST)
        across = across / jnp.sqrt(1.0 - jnp.square(sine))
    radius, level = level_radius(views, axes, view, frame), -axes[1, 2]
    # difference of the middle's apparent height here and in the picture
    raised = views.height[frame] * radius * (level - views.up[view, 2])
    x, y = views.anchor[view]
    right, down, _ = axes @ stands.drift
    middle = jnp.maximum(views.height[frame] * level, LOWEST) * across
    far, scale = jnp.where(apart, far, 0.0), radius / across
    return Laid(axes, far, scale, (x, y + raised), (right, down), middle, level)


def nearest_view(views: ExplosionViews, stands: Standing) -> Int[Array, ""]:
    """Return the view nearest to the direction of the camera; the first of equals."""
    return jnp.argmax(views.direction @ -stands.foot)


def picture_seen(
    views: ExplosionViews, stands: Standing, corners: Rays, appearance: Appearance
) -> Shown:
    """Return the tiles that may show a charge, and what prepares its light.

    Differentiable in all numbers of scene, camera and time except at kinks: where a ray
    passes a texel's centre, and at a frame's phase; and at jumps: where the nearest
    view changes, or something hides it.

    Args:
        views: The pictures.
        stands: Their size and position.
        corners: Rays at the corners of the tiles.
        appearance: Exposure.
    """
    dtype = corners.direction.dtype
    frames, parts = views.frames_at(stands.phase)
    view = nearest_view(views, stands)
    cells, planes = jnp.zeros((), bool), []
    for frame in frames:
        laid = laid_on(views, stands, view, frame)
        met = laid.met(corners)
        pitch = ray_pitch(met, laid.anchor)
        # smoothing and interpolation spread the silhouette by up to two pixels
        box = wider(views.box[view, frame], 2.0 * jnp.maximum(pitch, 1.0))
        cells |= box_tiles(met, box)
        planes.append((laid, pitch))
    cells = jnp.any(parts > 0.0) & (cells | without_direction(corners))

    def prepared() -> Seen:
        # 256 black bodies per instant, one for each value of heat, instead of one per
        # texel
        heat = jnp.arange(256, dtype=dtype) / 255.0
        light = blackbody_light(stands.air + heat * (stands.temperature - stands.air))
        glow = light / appearance.white
        day = (appearance.daylight / appearance.white).astype(dtype)
        pictures = []
        for (_, pitch), frame, part in zip(planes, frames, parts, strict=True):
            picture = texel_light(views.frames[view, frame], glow, day).astype(dtype)
            # a border of a texel, in which the light falls to zero
            edge = ((1, 1), (1, 1), (0, 0))
            pictures.append(jnp.pad(part * low_passed(picture, pitch), edge))

        def seen(rays: Rays) -> Float[Array, "4 row column"]:
            total = jnp.zeros((*rays.farthest.shape, 4), dtype)
            for (laid, _), picture in zip(planes, pictures, strict=True):
                met = laid.met(rays)
                visible = met.ever & (met.distance < rays.farthest)
                light = _interpolated(picture, met.x, met.y)
                total = total + jnp.where(visible[..., None], light, 0.0)
            return jnp.moveaxis(total, -1, 0)

        return seen

    return cells, prepared


def picture_met(
    views: ExplosionViews, charge: Charge, rays: Rays, air: Air
) -> Bool[Array, ""]:
    """Return True if a ray ever meets a charge's picture, where it shows anything."""
    charge = charge.as_if_at_zero()

    def at(phase):
        time = charge.time_s + phase * life(charge)
        ball = cloud(charge, time, air)
        ball = replace(ball, centre=ball.centre - rays.origin)
        stands = standing(views, charge, ball, rays.origin, time)
        frames, _ = views.frames_at(phase)
        view = nearest_view(views, stands)
        laid = laid_on(views, stands, view, frames[0])
        met = laid.met(rays)
        pitch = ray_pitch(laid.met(corner_rays(rays)), laid.anchor)
        first, last, top, bottom = wider(views.box[view, frames[0]], pitch)
        inside = (met.x > first) & (met.x < last) & (met.y > top) & (met.y < bottom)
        return jnp.any(inside & met.ever)

    phases = jnp.geomspace(1e-3, views.phase[-1], TESTED_PHASES)
    return jnp.any(jax.lax.map(at, phases))


def wider(box: Float[Array, "4"], margin: Float[Array, ""]) -> Float[Array, "4"]:
    """Return a box with a margin: first and last x, first and last y."""
    return box + margin * jnp.array([-1.0, 1.0, -1.0, 1.0], box.dtype)


def box_tiles(met: Met, box: Float[Array, "4"]) -> Bool[Array, "_ _"]:
    """Return the mask of the tiles that may show part of a box."""

    def spans(places, first, last):
        low = over_corners(jnp.where(met.ever, places, jnp.inf), jnp.minimum)
        high = over_corners(jnp.where(met.ever, places, -jnp.inf), jnp.maximum)
        slack = SLACK * (high - low)
        return (high + slack >= first) & (low - slack <= last)

    some = over_corners(met.ever, jnp.logical_or)
    return some & spans(met.x, box[0], box[1]) & spans(met.y, box[2], box[3])


def ray_pitch(
    met: Met, anchor: tuple[Float[Array, ""], Float[Array, ""]]
) -> Float[Array, ""]:
    """Return the distance between neighbouring rays on a picture, at its anchor [px].

    It is the root of the area per ray, and so the same in all directions. It is taken
    in the tile at the corner nearest to the anchor.

    Args:
        met: Intersections of the rays at the corners of tiles.
        anchor: Column and row.
    """
    x, y = met.x, met.y
    away = jnp.square(x - anchor[0]) + jnp.square(y - anchor[1])
    row, column = jnp.divmod(jnp.argmin(jnp.where(met.ever, away, jnp.inf)), x.shape[1])
    # the last corner has no tile beyond it
    row = jnp.minimum(row, x.shape[0] - 2)
    column = jnp.minimum(column, x.shape[1] - 2)
    x_down, y_down = (p[row + 1, column] - p[row, column] for p in (x, y))
    x_right, y_right = (p[row, column + 1] - p[row, column] for p in (x, y))
    area = jnp.abs(x_right * y_down - x_down * y_right) / TILE**2
    some = area > 0.0
    return jnp.where(some, jnp.sqrt(jnp.where(some, area, 1.0)), 1.0)


def _interpolated(
    picture: Float[Array, "height width 4"],
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
) -> Float[Array, "row column 4"]:
    """Return the light between texels of a picture with a border of one texel."""
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


def level_radius(
    views: ExplosionViews,
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


def billboard_axes(
    forward: Float[Array, "3"], towards: Float[Array, "3"], up: Float[Array, "3"]
) -> Float[Array, "3 3"]:
    """Return right, down and forward of a billboard, as rows.

    Args:
        forward: Direction of the line of sight, from the camera.
        towards: Direction of the view, from the blast.
        up: Unit vector that is up in its pictures.
    """
    tilted_up = up - (-jnp.dot(forward, up)) ** 3 * towards
    right = jnp.cross(forward, tilted_up)
    square = jnp.sum(jnp.square(right))
    turned = square > 0.0  # otherwise a pole of the field: any right will do
    right = jnp.where(turned, right, jnp.cross(forward, up))
    right = right / jnp.sqrt(jnp.where(turned, square, 1.0))
    return jnp.stack([right, jnp.cross(forward, right), forward])


def low_passed(
    picture: Float[Array, "height width channel"], pitch: Float[Array, ""]
) -> Float[Array, "height width channel"]:
    """Return a picture without detail finer than a pixel.

    Continuous in the pitch, with a kink at the powers of two.

    Args:
        picture: Premultiplied linear light.
        pitch: Width of a pixel in texels; up to one the picture is unchanged.
    """
    square = jnp.square(pitch)
    for n in range(LEVELS):
        # both variances mixed: (4^n - 1) / 6 and that after the next convolution
        part = jnp.clip((square - 4.0**n) / (3.0 * 4.0**n), 0.0, 1.0)

        def coarser(fine: Array, n: int = n, part: Array = part) -> Array:
            coarse = _convolved(_convolved(fine, 2**n, 0), 2**n, 1)
            return (1.0 - part) * fine + part * coarse

        picture = jax.lax.cond(part > 0.0, coarser, lambda fine: fine, picture)
    return picture


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
