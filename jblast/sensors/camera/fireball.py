r"""The image of a fireball: light, smoke and opacity, in a part of the image.

The cloud is a sphere whose density falls as $1 - r^2/R^2$. A ray passes its centre at
the distance $b$, at $s_c$. From $s_0$ to $s_1$ on it, with $q = (s - s_c)/R$ limited to
$\pm h$, $h^2 = 1 - b^2/R^2$, the optical depth is

$$\tau = \tfrac34\,\tau_0\,\big[h^2 q - q^3/3\big]_{q_0}^{q_1}, \qquad
\alpha = 1 - e^{-\tau}$$

and $\tau_0 h^3$ for the whole chord. Its slope is zero at the limb, so that gradients
include the edge. $s_0$ is the camera, $s_1$ the ground or the surface in front of the
cloud.

Soot alone has hundreds of optical depths, but is not evenly mixed. With $N$ lumps along
a diameter the gaps transmit light as if the depth were

$$\tau_0 = N\,(1 - e^{-\tau_s/N})$$

(Natta and Panagia 1984, from memory). A bright fireball still shows its whole disc,
because at its limb even a small alpha is much light; black smoke has a soft limb.

The light is a black body's, interpolated between the middle and the cooler limb by
$h^2$, as if the temperature fell with $b^2$. Soot reflects an even sky above and a
ground a fifth as bright: $0.6 + 0.4\,n_z$, $n$ the normal at the entry of the ray. The
wind carries the cloud (`waves/fireball.py`). The light of the fire on its surroundings
is in `surroundings.py`.

Planck's law is hundreds of exponentials. In one air and appearance the light of limb
and middle is a smooth function of the fireball's temperature alone. Where it is needed
a million times, it is tabulated as cubics between values and slopes (Hermite) at
`KNOTS` temperatures from the air's to that of the burst: its luminance to 1e-9 of its
value, however long a film is. Colour is tabulated separately from luminance and does
not affect it. It is exact to 1e-9 while anything glows, and less exact below.

Only a part of the image is calculated. A ray meets a fireball of the radius $R$ at the
distance $d$ if its angle from the middle is less than $\arcsin(R/d)$. The rays of a
cell are no farther from the nearest of its corners than these are from each other.
Cells are compared by the rays of every sixteenth row and column, and the smallest
window of a few sizes that contains all cells that may show something is calculated: one
program for all frames, with a branch for each size. Nothing is missed: the result is
that of `fireballs_seen` over the whole image. Pictures of an explosion use the same
windows.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jblast.errors import InputError, shown
from jblast.scene import Camera, Charge, Scene
from jblast.sensors.camera.geometry import Rays, pixel_rays, pixels
from jblast.sensors.camera.image import (
    FULL_SUN,
    blackbody_light,
    laid_over,
    luminance,
    straight,
)
from jblast.types import as_float_array, as_optional_float_array
from jblast.waves.fireball import HOTTEST, fireball
from jblast.waves.propagation import ambient

WHITE = FULL_SUN
"""Luminance of a white wall in the sun [cd/m2]: 1e5 lux / pi."""
LUMPS = 20.0
"""Lumps of smoke along a diameter [-]. Declared: it makes the limb a twentieth of the
radius wide, as in pictures of black smoke."""
RIM = 0.9
"""Excess of temperature at the limb over that in the middle [-]. Declared."""
SMOKE = 0.07
r"""Share of light that thick soot reflects [-]: $(1 - s)/(1 + s)$, $s^2 = 1 - w$, for
isotropic scattering with the albedo $w = 0.25$ of fresh soot (Bond and Bergstrom 2006,
from memory: 0.2 to 0.3)."""
Glow = tuple[Float[Array, "3"], Float[Array, "3"]]
"""Light of the limb and of the middle of a fireball [cd/m2]."""
FAINTEST = 1e-30
"""Light added before a logarithm [cd/m2]: far below any visible light, and far above
the smallest number of float32 (1e-38)."""
KNOTS = 4096
"""Temperatures of the glow table: cubics between them are exact to 1e-9."""
FIREBALL_SIZES = ((0.0, 0.0), (0.4, 0.3), (1.0, 1.0))
"""Rows and columns of fireball windows, as shares of the image. Few sizes, because each
is a branch that is compiled."""
STRIDE = 16
"""Rows and columns between two corners of cells: a 256th of the image's rays is tested.
A larger stride tests fewer rays and enlarges the windows."""
WINDOW_SIZES = ((0.125, 0.125), (0.25, 0.25), (0.5, 0.5), (0.75, 0.5), (1.0, 1.0))
"""Rows and columns of picture windows, as shares of the image; each contains the one
before. A cloud of smoke is higher than wide."""
WHOLE_IMAGE = 64
"""Images with fewer rows or columns are calculated as a whole: they have only a few
cells, and a window saves less than its search costs."""
SLACK = 0.1
"""Margin of a cell for the bending of its rays by the lens, as a share of its size."""


class Appearance(eqx.Module):
    """Exposure of a fireball, and distribution of its smoke.

    Attributes:
        white: Luminance that is full scale [cd/m2].
        lumps: Lumps of smoke along a diameter [-]; many make the smoke even.
        rim: Excess of temperature over the air at the limb, as a share of that in the
            middle [-].
        smoke: Share of the sky's light that thick smoke reflects [-].
        illuminance: Illuminance of a level surface by sky and sun [lx]: the light of
            the background and of the smoke. None: that under which a white wall is full
            scale, which is the usual exposure.
        flash: True if the fire lights the background (`surroundings.py`).

    Raises:
        InputError: Outside jit: a number is not positive and finite, or `rim` or
            `smoke` is above 1.
    """

    white: Float[Array, ""] = eqx.field(converter=as_float_array, default=WHITE)
    lumps: Float[Array, ""] = eqx.field(converter=as_float_array, default=LUMPS)
    rim: Float[Array, ""] = eqx.field(converter=as_float_array, default=RIM)
    smoke: Float[Array, ""] = eqx.field(converter=as_float_array, default=SMOKE)
    illuminance: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    flash: bool = eqx.field(static=True, default=True)

    @property
    def daylight(self) -> Float[Array, ""]:
        """Luminance of a white wall in the light of sky and sun [cd/m2]."""
        return self.white if self.illuminance is None else self.illuminance / math.pi

    def __check_init__(self):
        for name in ("white", "lumps", "rim", "smoke", "illuminance"):
            value = getattr(self, name)
            if value is None or isinstance(value, Tracer):
                continue
            number, part = value.item(), name in ("rim", "smoke")
            if not 0 < number < math.inf or (part and number > 1):
                raise InputError(
                    f"appearance {name}: expected a number above 0"
                    f"{', at most 1' if part else ''}, got {shown(number)}"
                )


class Cloud(eqx.Module):
    """Fireball of a charge at an instant.

    Attributes:
        centre: East, north, up [m].
        radius: Radius of the cloud [m].
        temperature: Temperature of its light [K].
        optical_depth: Optical depth of its soot along a diameter [-].
        air: Temperature of the surrounding air [K].
    """

    centre: Float[Array, "3"]
    radius: Float[Array, ""]
    temperature: Float[Array, ""]
    optical_depth: Float[Array, ""]
    air: Float[Array, ""]


def fireball_layer(
    scene: Scene,
    camera: Camera,
    time: Float[ArrayLike, ""],
    *,
    depth: Float[Array, "height width"] | None = None,
    ground: bool = True,
    supersample: int = 1,
    appearance: Appearance | None = None,
) -> Float[Array, "height width 4"]:
    """Return the fireballs of a scene at an instant, without a background.

    Args:
        scene: Charges, each by its position, and air.
        camera: The camera.
        time: Time on the common clock [s].
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: True if the plane up = 0 hides what is below it.
        supersample: Rays along each side of a pixel.
        appearance: Exposure, and distribution of the smoke.

    Returns:
        Red, green, blue in linear light, full scale 1, not clipped, and straight alpha.
    """
    rays = pixel_rays(camera, depth, supersample=supersample, ground=ground)
    layer = fireballs_seen(scene, rays, as_float_array(time), appearance)
    return straight(pixels(layer, supersample))


def fireballs_seen(
    scene: Scene,
    rays: Rays,
    time: Float[Array, ""],
    appearance: Appearance | None = None,
    shining: Callable[[Cloud], Glow] | None = None,
) -> Float[Array, "4 row column"]:
    """Return the light of all fireballs along rays, laid over each other.

    Fireballs are ordered by the distance of their centres, the nearest in front.

    Args:
        scene: Charges and air.
        rays: Camera rays.
        time: Time on the common clock [s].
        appearance: Exposure, and distribution of the smoke.
        shining: Tabulated light of limb and middle of a fireball; None for Planck's
            law.

    Returns:
        Red, green and blue times alpha, and alpha.
    """
    appearance = Appearance() if appearance is None else appearance
    return laid_over(
        [
            _fireball_seen(scene, charge, rays, time, appearance, shining)
            for charge in scene.charges
        ]
    )


class RayPassage(eqx.Module):
    """Passages of rays through a cloud; zero for rays that miss it.

    Attributes:
        column: Optical depth over that along a diameter [-], 0 to 1.
        chord: Square of the half chord over the radius, $h^2$ [-].
        height: Height of the entry point above the centre, over the radius [-].
    """

    column: Float[Array, "row column"]
    chord: Float[Array, "row column"]
    height: Float[Array, "row column"]


def passage(
    offset: Float[Array, "3"], radius: Float[Array, ""], rays: Rays
) -> RayPassage:
    """Return the passages of rays through a cloud.

    Args:
        offset: Centre relative to the camera: east, north, up [m].
        radius: Radius of the cloud [m].
        rays: Camera rays.
    """
    along = jnp.tensordot(offset, rays.direction, 1)
    aside = offset[:, None, None] - along[None] * rays.direction
    room = jnp.square(radius) - jnp.sum(jnp.square(aside), axis=0)
    met = ~(room <= 0)  # negated: a NaN radius stays visible as NaN
    half = jnp.sqrt(jnp.where(met, room, 1.0))
    # the camera may be inside the cloud: the passage then begins at it
    begin = jnp.clip(-along, -half, half)
    end = jnp.clip(rays.farthest - along, -half, half)
    # a radius of zero has no passage, and would divide by zero
    size = jnp.where(met, radius, 1.0)
    chord = jnp.where(met, room, 0.0) / jnp.square(size)
    first, last = begin / size, end / size
    # the difference of two cubes by its factors: exactly zero for an empty interval
    cubes = jnp.square(first) + first * last + jnp.square(last)
    column = 0.75 * (last - first) * jnp.maximum(chord - cubes / 3.0, 0.0)
    height = (begin * rays.direction[2] - aside[2]) / size
    return RayPassage(
        column=jnp.where(met, column, 0.0),
        chord=chord,
        height=jnp.where(met, height, 0.0),
    )


def cloud(scene: Scene, charge: Charge, time: Float[Array, ""]) -> Cloud:
    """Return the fireball of a scene's charge at a time on the common clock [s]."""
    temperature, _ = ambient(scene.air)
    mass = charge.tnt_mass("fireball_radius_m")
    since, growth = charge.since(time), scene.fireball_growth
    ball = fireball(mass, since, temperature, growth)
    air = scene.air
    centre = jnp.stack(
        [
            charge.east + ball.drift_time * air.wind_east,
            charge.north + ball.drift_time * air.wind_north,
            charge.up + ball.rise,
        ]
    )
    depth = ball.optical_depth
    return Cloud(centre, ball.radius, ball.temperature, depth, temperature)


def glow(
    temperature: Float[Array, ""], air: Float[Array, ""], appearance: Appearance
) -> Glow:
    """Return the light of the limb and of the middle of a fireball [cd/m2].

    Args:
        temperature: Temperature of its middle [K].
        air: Temperature of the surrounding air [K].
        appearance: Its `rim` states how much cooler the limb is.
    """
    # the excess over the air: a cold cloud has a limb as cold
    limb = air + appearance.rim * (temperature - air)
    return blackbody_light(limb), blackbody_light(temperature)


def _fireball_seen(
    scene: Scene,
    charge: Charge,
    rays: Rays,
    time: Float[Array, ""],
    appearance: Appearance,
    shining: Callable[[Cloud], Glow] | None,
) -> tuple[Float[Array, "4 row column"], Float[Array, ""]]:
    """Return the premultiplied light of one charge's fireball, and its distance."""
    ball = cloud(scene, charge, time)
    if shining is None:
        ends = glow(ball.temperature, ball.air, appearance)
    else:
        ends = shining(ball)
    offset = ball.centre - rays.origin
    layer = cloud_seen(ball, ends, rays, appearance)
    return layer, jnp.sqrt(jnp.sum(jnp.square(offset)))


def cloud_seen(
    ball: Cloud,
    ends: Glow,
    rays: Rays,
    appearance: Appearance,
) -> Float[Array, "4 row column"]:
    """Return the premultiplied light of one fireball along rays, and alpha.

    Args:
        ball: The fireball.
        ends: Light of its limb and of its middle [cd/m2].
        rays: Camera rays.
        appearance: Exposure, and distribution of the smoke.
    """
    met = passage(ball.centre - rays.origin, ball.radius, rays)
    alpha = -jnp.expm1(-lumpy_depth(ball, appearance) * met.column)
    day = appearance.smoke * (0.6 + 0.4 * met.height) * appearance.daylight
    light = (between(*ends, met.chord) + day[None]) / appearance.white
    return jnp.concatenate([alpha[None] * light, alpha[None]])


def lumpy_depth(ball: Cloud, appearance: Appearance) -> Float[Array, ""]:
    r"""Return $\tau_0$: the optical depth along a diameter of smoke with gaps."""
    return -appearance.lumps * jnp.expm1(-ball.optical_depth / appearance.lumps)


def between(
    limb: Float[Array, "3"], middle: Float[Array, "3"], part: Float[Array, "row column"]
) -> Float[Array, "3 row column"]:
    """Return interpolated light: luminance geometrically, colour linearly.

    This is one exponential per pixel, instead of the hundreds of Planck's law.
    """
    lights = jnp.stack([limb, middle]) + FAINTEST
    brightness = luminance(lights)
    (low, high), (cool, hot) = jnp.log(brightness), lights / brightness[:, None]
    # colour apart from brightness: a mean of lights would take the hue of the brighter
    colour = cool[:, None, None] + (hot - cool)[:, None, None] * part[None]
    return jnp.exp(low + (high - low) * part)[None] * colour


class GlowTable(eqx.Module):
    """Tabulated light of a fireball's limb and middle.

    Attributes:
        air: Temperature of the surrounding air, to which the fireball cools [K].
        pace: Step between knots [K].
        knots: Logarithm of luminance [cd/m2], the light over it, and their derivatives
            times the step.
    """

    air: Float[Array, ""]
    pace: Float[Array, ""]
    knots: Float[Array, "knot 2 2 4"]

    def __call__(self, ball: Cloud) -> Glow:
        """Return the light of limb and middle of a fireball in the table's air."""
        place = (ball.temperature - self.air) / self.pace
        # outside the table the last cubic is extended; fireballs do not leave its range
        before = jnp.clip(place.astype(int), 0, len(self.knots) - 2)
        u = place - before.astype(place.dtype)
        # cubic Hermite: value a and slope `rise` at one knot, b and `leave` at the next
        (a, rise), (b, leave) = self.knots[before], self.knots[before + 1]
        square, cube = u * u, u * u * u
        bend = 3.0 * square - 2.0 * cube
        slopes = rise * (u - 2.0 * square + cube) + leave * (cube - square)
        found = a + (b - a) * bend + slopes
        limb, middle = jnp.exp(found[:, :1]) * found[:, 1:]
        return limb, middle


@partial(jax.jit, static_argnames="knots")
def glow_table(
    air: Float[Array, ""], appearance: Appearance, *, knots: int = KNOTS
) -> GlowTable:
    """Return the table of fireballs in air of one temperature [K]."""
    pace = (HOTTEST - air) / (knots - 1)
    # slopes come with the values by one forward derivative
    temperatures = air + pace * jnp.arange(knots, dtype=pace.dtype)

    def glowing(temperature):
        light = jnp.stack(glow(temperature, air, appearance))
        grey = luminance(light)[:, None]
        return jnp.concatenate([jnp.log(grey), light / grey], axis=1)

    def knot(temperature):
        return jnp.stack(jax.jvp(glowing, (temperature,), (pace,)))

    return GlowTable(air, pace, jax.lax.map(knot, temperatures, batch_size=256))


def fireballs_in_window(
    scene: Scene, rays: Rays, time: Float[Array, ""], appearance: Appearance
) -> Float[Array, "4 row column"]:
    """Return the result of `fireballs_seen`, faster if fireballs are small.

    Args:
        scene: Charges and air.
        rays: Rays of a whole image, row by row.
        time: Time on the common clock [s].
        appearance: Exposure.
    """
    balls = [cloud(scene, charge, time) for charge in scene.charges]
    cells = cells_touched(balls, corner_rays(rays))

    def look(part: Rays) -> Float[Array, "row column 4"]:
        seen = fireballs_seen(scene, part, time, appearance)
        return jnp.moveaxis(seen, 0, -1)

    return jnp.moveaxis(in_window(cells, rays, look, FIREBALL_SIZES), -1, 0)


def fireballs_over(
    scene: Scene,
    rays: Rays,
    times: Float[Array, " time"],
    appearance: Appearance,
    behind: Float[Array, "time row column 3"],
) -> Float[Array, "time row column 3"]:
    """Return images with fireballs in front, changed only where these are.

    Args:
        scene: Charges and air.
        rays: One ray per pixel, row by row.
        times: Times of the images on the common clock [s].
        appearance: Exposure.
        behind: The images.
    """
    corners = corner_rays(rays)
    # cells of all images first: they share one size of window
    cells = jax.vmap(
        lambda time: cells_touched(
            [cloud(scene, c, time) for c in scene.charges], corners
        )
    )(times)

    # gradients recompute the contents of a window: storing them would fill the memory
    @jax.checkpoint
    def lay(
        part: Rays, beneath: Float[Array, "row column 3"], time: Float[Array, ""]
    ) -> Float[Array, "row column 3"]:
        seen = jnp.moveaxis(fireballs_seen(scene, part, time, appearance), 0, -1)
        return seen[..., :3] + (1.0 - seen[..., 3:]) * beneath

    dtype = jax.eval_shape(lay, rays, behind[0], times[0]).dtype
    return laid_in_windows(
        cells, rays, lay, behind.astype(dtype), times, FIREBALL_SIZES
    )


def cells_touched(balls: Sequence[Cloud], corners: Rays) -> Bool[Array, "_ _"]:
    """Return the mask of cells between corners that may show a fireball.

    Args:
        balls: The fireballs.
        corners: Rays at the corners of the cells.
    """
    direction = corners.direction
    # no ray of a cell is farther from the nearest corner than half a diagonal
    slope = _chord(direction[:, 1:, 1:], direction[:, :-1, :-1])
    other = _chord(direction[:, 1:, :-1], direction[:, :-1, 1:])
    size = (0.5 + SLACK) * jnp.maximum(slope, other)
    unknown = _over_corners(~(corners.farthest > 0.0), jnp.logical_or)
    found = [jnp.zeros_like(unknown)]
    for ball in balls:
        offset = ball.centre - corners.origin
        square = jnp.sum(jnp.square(offset))
        away = jnp.sqrt(jnp.where(square > 0.0, square, 1.0))
        apart = _chord(
            direction, (offset / away)[:, None, None] + jnp.zeros_like(direction)
        )
        nearest = -_over_corners(-apart, jnp.maximum)
        sine = ball.radius / away
        # camera inside the ball, which then covers every ray
        within = ~(sine < 1.0) | ~(square > 0.0)
        cosine = jnp.sqrt(1.0 - jnp.square(jnp.where(within, 0.0, sine)))
        # chords obey the triangle inequality; the sum is the chord of arcsin(R/d)
        seen = ~(nearest > sine * jnp.sqrt(2.0 / (1.0 + cosine)) + size)
        # negated comparisons: a NaN radius counts as visible
        found.append((seen | within | unknown) & ~(ball.radius <= 0.0))
    return reduce(jnp.logical_or, found)


def _chord(a: Float[Array, "3 _ _"], b: Float[Array, "3 _ _"]) -> Float[Array, "_ _"]:
    square = jnp.sum(jnp.square(a - b), axis=0)
    some = square > 0.0
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


def _over_corners(values: Array, join: Callable[[Array, Array], Array]) -> Array:
    """Return a reduction over the four corners of each cell."""
    across = join(values[:, 1:], values[:, :-1])
    return join(across[1:], across[:-1])


def corner_rays(rays: Rays) -> Rays:
    """Return the rays at the corners of all cells."""
    rows, columns = (_corner_positions(size) for size in rays.farthest.shape)
    at = np.ix_(rows, columns)
    return Rays(rays.origin, rays.direction[:, *at], rays.farthest[at])


def _corner_positions(size: int) -> Int[np.ndarray, " corner"]:
    before = np.arange(0, size - 1, STRIDE) if size > 1 else np.zeros(1, int)
    return np.append(before, size - 1)


def ray_pitch(
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
    met: Bool[Array, "row column"],
    anchor: tuple[Float[Array, ""], Float[Array, ""]],
    shape: tuple[int, ...],
) -> Float[Array, ""]:
    """Return the distance between neighbouring rays on a picture, at a point [px].

    It is the root of the area per ray, and so the same in all directions. It is taken
    in the cell at the corner nearest to the point.

    Args:
        x: Intersections of the corner rays with the picture.
        y: Likewise.
        met: Mask of the rays that meet it.
        anchor: The point.
        shape: Rows and columns of all rays.
    """
    away = jnp.square(x - anchor[0]) + jnp.square(y - anchor[1])
    row, column = jnp.divmod(jnp.argmin(jnp.where(met, away, jnp.inf)), x.shape[1])
    # the last corner has no cell beyond it
    row = jnp.minimum(row, x.shape[0] - 2)
    column = jnp.minimum(column, x.shape[1] - 2)
    down, right = (
        jnp.asarray(np.maximum(np.diff(_corner_positions(size)), 1), x.dtype)[at]
        for size, at in zip(shape, (row, column), strict=True)
    )
    x_down, y_down = (p[row + 1, column] - p[row, column] for p in (x, y))
    x_right, y_right = (p[row, column + 1] - p[row, column] for p in (x, y))
    area = jnp.abs(x_right * y_down - x_down * y_right) / (down * right)
    some = area > 0.0
    return jnp.where(some, jnp.sqrt(jnp.where(some, area, 1.0)), 1.0)


def touched(
    x: Float[Array, "row column"],
    y: Float[Array, "row column"],
    met: Bool[Array, "row column"],
    unknown: Bool[Array, "row column"],
    box: Float[Array, "4"],
) -> Bool[Array, "_ _"]:
    """Return the mask of cells that may show part of a box.

    Args:
        x: Intersections of the corner rays with the picture.
        y: Likewise.
        met: Mask of the rays that meet it.
        unknown: Corners without a direction; their cells may show anything.
        box: First and last x, first and last y.
    """

    def spans(places, first, last):
        low = -_over_corners(jnp.where(met, -places, -jnp.inf), jnp.maximum)
        high = _over_corners(jnp.where(met, places, -jnp.inf), jnp.maximum)
        slack = SLACK * (high - low)
        return (high + slack >= first) & (low - slack <= last)

    some = _over_corners(met, jnp.logical_or)
    known = spans(x, box[0], box[1]) & spans(y, box[2], box[3])
    return some & (known | _over_corners(unknown, jnp.logical_or))


def in_window(
    cells: Bool[Array, "_ _"],
    rays: Rays,
    look: Callable[[Rays], Float[Array, "row column 4"]],
    parts: Sequence[tuple[float, float]] = WINDOW_SIZES,
) -> Float[Array, "row column 4"]:
    """Return the image along all rays, calculated only in a window of touched cells.

    Args:
        cells: Mask of cells that may show something.
        rays: Rays of the whole image.
        look: Returns the image along rays; zero outside the cells.
        parts: As in `laid_in_windows`.
    """
    shape, dtype = rays.farthest.shape, jax.eval_shape(look, rays).dtype
    nothing = jnp.zeros((*shape, 4), dtype)

    def over(part: Rays, _behind: Array, _each: None) -> Array:
        return look(part)

    return laid_in_windows(cells[None], rays, over, nothing[None], None, parts)[0]


def laid_in_windows(
    cells: Bool[Array, "image _ _"],
    rays: Rays,
    lay: Callable[[Rays, Array, Any], Array],
    behind: Float[Array, "image row column _"],
    each: Any,
    parts: Sequence[tuple[float, float]] = WINDOW_SIZES,
) -> Float[Array, "image row column _"]:
    """Return images with layers over them, in windows of one size.

    Images are changed in place, one after another: none is copied.

    Args:
        cells: Mask of touched cells of each image.
        rays: Rays of every image.
        lay: Lays the layer along rays over a background, unchanged outside the cells;
            its third argument is the entry of `each`.
        behind: The images.
        each: Arrays whose first axis is that of the images, or None.
        parts: Rows and columns of windows, as shares of the image; the last is all. A
            window of zero rows or columns is not calculated.
    """
    shape = rays.farthest.shape
    if min(shape) < WHOLE_IMAGE:
        return jax.lax.map(lambda x: lay(rays, *x), (behind, each))
    sizes = np.ceil(np.array(parts) * np.array(shape)).astype(int)
    starts, needs = zip(
        *(
            jax.vmap(partial(_touched_extent, size=shape[i]))(
                jnp.any(cells, axis=2 - i)
            )
            for i in (0, 1)
        ),
        strict=True,
    )
    # one size for all images, the smallest that holds the largest extent of any of them
    needed = jnp.max(jnp.stack(needs), axis=1)
    # sizes ascend, so the number of those too small is the index of the first that fits
    which = jnp.sum(jnp.any(needed[None] > sizes[:-1], axis=1))

    def branch(size):
        rows, columns = (int(n) for n in size)

        def image(images, inputs):
            number, row, column, own = inputs
            # a window at the edge is shifted inwards: slices have a fixed size
            row = jnp.clip(row, 0, shape[0] - rows)
            column = jnp.clip(column, 0, shape[1] - columns)
            part = Rays(
                rays.origin,
                jax.lax.dynamic_slice(
                    rays.direction, (0, row, column), (3, rows, columns)
                ),
                jax.lax.dynamic_slice(rays.farthest, (row, column), (rows, columns)),
            )
            at = number, row, column, 0
            beneath = jax.lax.dynamic_slice(
                images, at, (1, rows, columns, images.shape[3])
            )
            laid = lay(part, beneath[0], own)[None]
            return jax.lax.dynamic_update_slice(images, laid, at), None

        def run():
            if not rows * columns:
                return behind
            inputs = jnp.arange(len(behind)), *starts, each
            return jax.lax.scan(image, behind, inputs)[0]

        return run

    return jax.lax.switch(which, [branch(size) for size in sizes])


def _touched_extent(
    touched: Bool[Array, " cell"], size: int
) -> tuple[Int[Array, ""], Int[Array, ""]]:
    """Return the first row or column of the touched cells, and their number."""
    places = _corner_positions(size)
    first = jnp.asarray(places)[jnp.argmax(touched)]
    last = jnp.asarray(places)[len(touched) - jnp.argmax(touched[::-1])]
    count = jnp.where(jnp.any(touched), last - first + 1, 0)
    return first, count
