"""Frames of a scene with a blast, by a camera at rest or moving.

A frame is the background, lit by the fireballs, with the fireballs or pictures of an
explosion over it, the farthest first. With an exposure, a frame is the mean of instants
in the middles of equal parts of it.

Poses and fireballs have the precision of the scene. Images have the precision of the
rays, and positions in them are relative to the camera: in single precision the
logarithm of light is exact to 1e-4.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float, Int, UInt8

from jblast.errors import require
from jblast.scene import Air, Camera, Charge, Scene
from jblast.scene.camera import MOUNTS
from jblast.sensors.camera.explosion import (
    ExplosionViews,
    Shown,
    Standing,
    picture_met,
    picture_seen,
    standing,
)
from jblast.sensors.camera.fireball import (
    Appearance,
    Cloud,
    Glow,
    ball_seen,
    ball_tiles,
    cloud,
    glow,
)
from jblast.sensors.camera.geometry import (
    CameraPath,
    Rays,
    carried_camera,
    lens_rays,
    pixel_rays,
    surfaces_seen,
    to_camera,
    turned_rays,
)
from jblast.sensors.camera.image import (
    BACKGROUND,
    LUMINANCE,
    Background,
    images,
    linear_to_srgb,
    straight,
    toned,
)
from jblast.sensors.camera.surroundings import (
    Landscape,
    disc_light,
    landscape,
    sphere_factor,
)
from jblast.sensors.camera.tiles import (
    corner_rays,
    on_tiles,
    padded,
    padded_rays,
    turns,
)
from jblast.types import as_numbers
from jblast.waves.fireballs import fireball_duration

BATCH = 256
"""Pixels whose light is calculated simultaneously by `light_at`."""
EXPOSURES = 8
"""Instants averaged over an exposure."""
FAINTEST_FLASH = 1e-5
"""Light of a fireball over that of the day, up to which it lights nothing: the
logarithm of light changes by less, far below thresholds of events."""
INSTANTS = 16
"""Instants of a fireball's life at which `in_view` tests it, evenly spaced. A fireball
that touches the image only between two of them is not found."""
T = TypeVar("T")
Image = Float[Array, "channel row column"]


class View(eqx.Module):
    """Everything that determines a camera's frames, except their times.

    Attributes:
        charges: The charges, stacked by structure: a small program for many.
        air: Temperature and wind.
        growth: Time constant of the fireballs' expansion [s]; None for that of the law.
        camera: The camera; its pose is relative to the body if it has a path.
        path: Pose of the camera's carrier over time; None for a fixed camera.
        lens: Rays in the camera's axes, which end at the depth image.
        background: Ground and sky, or an image of linear light, full scale 1; one with
            a fourth channel, transparent, gives the layer of the fires.
        pictures: Pictures of an explosion that replace the procedural fireball.
        appearance: Exposure, and distribution of the smoke.
        gain: Factor of the light (`image.picture_gain`).
        ground: True if the plane up = 0 hides what is below it.
        relief: True if there is a depth image.
        parts: Instants averaged over an exposure; 1 for a camera without.
        reverse: True for derivatives in reverse mode too: loops have a fixed number of
            turns, and not only those of visible fireballs.
    """

    charges: list[Charge]
    air: Air
    growth: Float[Array, ""] | None
    camera: Camera
    path: CameraPath | None
    lens: Rays
    background: Landscape | Image
    pictures: ExplosionViews | None
    appearance: Appearance
    gain: float = eqx.field(static=True)
    ground: bool = eqx.field(static=True)
    relief: bool = eqx.field(static=True)
    parts: int = eqx.field(static=True)
    reverse: bool = eqx.field(static=True)


def view_of(
    scene: Scene,
    camera: Camera,
    background: Landscape | Float[ArrayLike, "..."],
    *,
    depth: Float[ArrayLike, "height width"] | None = None,
    ground: bool = True,
    appearance: Appearance | None = None,
    views: ExplosionViews | None = None,
    path: CameraPath | None = None,
    gain: float = 1.0,
    dtype: Any = None,
    reverse: bool = True,
) -> View:
    """Return the view of a camera; other arguments as of `render`.

    Args:
        scene: Charges and air.
        camera: The camera.
        background: Ground and sky, a grey, a colour or an image.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: True if the plane up = 0 hides what is below it.
        appearance: Exposure, and distribution of the smoke.
        views: Pictures of an explosion.
        path: Pose of the carrier of a camera on a vehicle.
        gain: Factor of the light.
        dtype: Precision of images; None for that of the camera.
        reverse: False for films, which need no derivatives in reverse mode.

    Raises:
        InputError: As in `render`.
    """
    if path is None:
        check_stands(camera)
        if ground:
            _check_above_ground(camera)
    else:
        require(camera.mount in MOUNTS, "camera mount", "a mount on a vehicle", "none")
    if depth is not None:
        depth = as_numbers(depth)
        _check_depth(depth, camera)
    alike: dict[Any, list[Charge]] = {}
    for charge in (replace(charge, name="") for charge in scene.charges):
        alike.setdefault(jax.tree.structure(charge), []).append(charge)
    charges = [jax.tree.map(lambda *x: jnp.stack(x), *some) for some in alike.values()]
    look = Appearance() if appearance is None else appearance
    if not isinstance(background, Landscape):
        background = jnp.moveaxis(images(camera, background, 0), -1, 0)
    drawn = lens_rays(camera, depth), background, views
    if dtype is not None:
        drawn = _as(dtype, drawn)
    exposed = isinstance(camera.exposure_s, Tracer) or camera.exposure_s.item() > 0
    return View(
        charges,
        scene.air,
        scene.fireball_growth,
        camera,
        path,
        *drawn,
        look,
        gain,
        ground=ground,
        relief=depth is not None,
        parts=EXPOSURES if exposed else 1,
        reverse=reverse,
    )


def light(view: View, time: Float[Array, ""], behind: Image | None = None) -> Image:
    """Return the light of an instant.

    Args:
        view: The view.
        time: Time on the common clock [s].
        behind: Background at this time, in place of the view's.

    Returns:
        Linear light; times alpha, and alpha, if the background has four channels.
    """
    here, pictures = view.camera, view.pictures
    if view.path is not None:
        here = carried_camera(view.camera, view.path, time)

    def fire_of(charge: Charge) -> Fire:
        ball = cloud(charge, time, view.air, view.growth)
        ball = replace(ball, centre=ball.centre - here.position)
        ends = glow(ball.temperature, ball.air, view.appearance)
        flash = disc_light(ball, ends, view.appearance) / view.appearance.daylight
        if pictures is None:
            return Fire(ball, ends, flash, ball.centre, None)
        stands = standing(pictures, charge, ball, here.position, time)
        return Fire(ball, ends, flash, stands.foot, stands)

    found = [jax.vmap(fire_of)(alike) for alike in view.charges]
    fires = jax.tree.map(lambda *x: jnp.concatenate(x), *found)
    single = fires, here, view.appearance
    fires, here, look = _as(view.lens.direction.dtype, single)
    rays = turned_rays(view.lens, here, ground=view.ground)
    image = view.background if behind is None else behind
    if isinstance(image, Landscape):
        image = image.light(rays, 1.0 / jnp.max(here.focal))
    if view.appearance.flash and len(image) == 3 and (pictures is None or pictures.hot):
        image = _lit(view, fires, rays, image)
    if pictures is not None:
        rays = turned_rays(view.lens, here, ground=False)
    rays = replace(rays, origin=jnp.zeros_like(rays.origin))
    begun = ~(fires.ball.radius <= 0.0)  # negated: a NaN radius stays visible as NaN
    away = jnp.sum(jnp.square(fires.place), axis=1)
    farthest_first = jnp.argsort(jnp.where(begun, -away, jnp.inf))

    def laid(image: Image) -> Image:
        corners, whole = corner_rays(rays), padded_rays(rays)

        def turn(i: Any, image: Image) -> Image:
            fire = jax.tree.map(lambda x: x[farthest_first[i]], fires)
            touched, prepared = _shown(pictures, fire, corners, look)

            def over(image: Image) -> Image:
                return on_tiles(touched, whole, prepared(), image, reverse=view.reverse)

            # the pictures of a fire out of view are not prepared
            return jax.lax.cond(jnp.any(touched), over, lambda image: image, image)

        count, most = jnp.sum(begun), len(begun)
        laid = turns(count, most, turn, padded(image), reverse=view.reverse)
        return laid[:, : image.shape[1], : image.shape[2]]

    return jax.lax.cond(jnp.any(begun), laid, lambda image: image, image)


class Fire(NamedTuple):
    """A charge at an instant; positions are relative to the camera.

    Attributes:
        ball: Its fireball.
        ends: Light of the fireball's limb and middle [cd/m2].
        flash: Mean light of the fireball's disc over that of the day.
        place: Position that decides which of two fires hides the other [m].
        stands: Size and position of its pictures; None without them.
    """

    ball: Cloud
    ends: Glow
    flash: Float[Array, "3"]
    place: Float[Array, "3"]
    stands: Standing | None


def _shown(
    pictures: ExplosionViews | None, fire: Fire, corners: Rays, look: Appearance
) -> Shown:
    """Return the tiles that may show a fire, and what prepares its light."""
    if pictures is not None and fire.stands is not None:
        return picture_seen(pictures, fire.stands, corners, look)
    touched = ball_tiles(fire.ball, corners)
    return touched, lambda: lambda rays: ball_seen(fire.ball, fire.ends, rays, look)


def _lit(view: View, fires: Fire, rays: Rays, image: Image) -> Image:
    """Return a background lit by the fires."""
    bright = ~(jnp.max(fires.flash, axis=1) <= FAINTEST_FLASH)
    bright &= ~(fires.ball.radius <= 0.0)
    first = jnp.argsort(~bright)

    def lit(image: Image) -> Image:
        surfaces = surfaces_seen(rays, image=view.relief)

        def turn(i: Any, total: Image) -> Image:
            ball, flash = fires.ball, fires.flash
            n = first[i]
            factor = sphere_factor(ball.centre[n], ball.radius[n], surfaces)
            return total + flash[n][:, None, None] * factor[None]

        none = jnp.ones_like(image)
        count, most = jnp.sum(bright), len(bright)
        return image * turns(count, most, turn, none, reverse=view.reverse)

    return jax.lax.cond(jnp.any(bright), lit, lambda image: image, image)


def colours(image: Image) -> Float[Array, "row column channel"]:
    """Return linear light with the colours of a pixel together."""
    return jnp.moveaxis(image, 0, -1)


def grey(image: Image) -> Float[Array, "row column"]:
    """Return the luminance; a sum, because a matrix product takes longer."""
    red, green, blue = LUMINANCE
    return red * image[0] + green * image[1] + blue * image[2]


def levels(image: Image) -> UInt8[Array, "row column channel"]:
    """Return sRGB of 8 bits, within one of `files.images.srgb_bytes`."""
    shown = linear_to_srgb(toned(colours(image)))
    return jnp.rint(255.0 * shown).astype(jnp.uint8)


@eqx.filter_jit
def frames(
    view: View,
    times: Float[Array | np.ndarray, " time"],
    behind: Float[Array | np.ndarray, "time height width 3"] | None = None,
    *,
    shown: Callable[[Image], Array] = colours,
) -> Array:
    """Return the means of exposures, as `light`.

    Args:
        view: The view.
        times: Starts of the exposures on the common clock [s].
        behind: A background for each of them, in place of the view's.
        shown: What is returned of each: `colours`, `grey` or `levels`.
    """
    exposure = view.camera.exposure_s

    # gradients recompute the intermediate images of a frame: storing them would fill
    # the memory
    @jax.checkpoint
    def frame(inputs):
        time, image = inputs
        if image is not None:
            image = jnp.moveaxis(image.astype(view.lens.direction.dtype), -1, 0)
        if view.parts == 1:
            return shown(view.gain * light(view, time, image))
        parts = jnp.where(exposure > 0.0, view.parts, 1)

        # midpoint rule, of second order in the length of a part
        def turn(i: Any, total: Image) -> Image:
            return total + light(view, time + (i + 0.5) / parts * exposure, image)

        nothing = jnp.zeros_like(jax.eval_shape(light, view, time, image))
        total = turns(parts, view.parts, turn, nothing, reverse=view.reverse)
        return shown(view.gain * total / parts)

    return jax.lax.map(frame, (jnp.asarray(times), behind))


def light_at(
    view: View,
    times: Float[Array, " at"],
    x: Int[Array, " at"],
    y: Int[Array, " at"],
) -> Float[Array, "at 3"]:
    """Return the light of single pixels at single instants.

    Args:
        view: The view, with a background image and without a depth image.
        times: Times on the common clock [s].
        x: Columns of the pixels.
        y: Rows.
    """
    lens, behind = view.lens, jnp.asarray(view.background)

    def one(lane):
        time, direction, farthest, image = lane
        pixel = Rays(lens.origin, direction[:, None, None], farthest[None, None])
        alone = replace(view, lens=pixel, background=image[:, None, None])
        return light(alone, time)[:, 0, 0]

    lanes = times, lens.direction[:, y, x].T, lens.farthest[y, x], behind[:, y, x].T

    def whole(lane):  # whole batches: one program
        room = (0, -len(lane) % BATCH), *[(0, 0)] * (lane.ndim - 1)
        return jnp.pad(lane, room, mode="edge")

    found = jax.lax.map(one, jax.tree.map(whole, lanes), batch_size=BATCH)
    return found[: len(times)]


def render(
    scene: Scene,
    camera: Camera,
    times: Float[ArrayLike, " time"],
    *,
    background: Background | Landscape | None = None,
    depth: Float[ArrayLike, "height width"] | None = None,
    ground: bool = True,
    alpha: bool = False,
    appearance: Appearance | None = None,
    views: ExplosionViews | None = None,
    path: CameraPath | None = None,
) -> Float[Array, "time height width channel"]:
    """Return a camera's frames of a scene's fireballs before a background.

    A frame gathers light from its time on, over the camera's exposure; an exposure of
    zero is an instant. Visibility:

    - Nothing is visible behind the background's `depth`, and no fireball below the
      ground. Pictures of an explosion end where their ground begins.
    - A fireball is cut at the bounds of the image, and invisible behind the camera.
      From inside it the camera sees the smoke before its lens.
    - A pixel whose ray misses shows the background: a fireball smaller than a pixel is
      seen whole or not at all.
    - Before detonation nothing is visible.
    - A pixel beyond the lens's fold, which shows no direction, keeps the background.
    - The fire lights the ground and the surfaces of the depth image
      (`surroundings.py`), unless the appearance excludes it. The sky, and a background
      without depth or ground, are not lit; nor is anything by pictures without heat.

    It has derivatives in all numbers of the scene, the camera, the times and the
    background, except where a fireball begins, where two change their order, where one
    is a point at the camera, and on the horizon from a camera on the ground.

    Args:
        scene: Charges, each with a position (a `range` is not used), and air.
        camera: The camera. That of a path has a pose relative to the body: forward,
            left, up [m].
        times: Starts of the frames on the common clock, not falling [s].
        background: A grey, a colour, an image, an image per time, or ground and sky;
            by default a grey, for a moving camera even ground and a clear sky.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: True if the plane up = 0 hides what is below it. It is not drawn.
        alpha: True to omit the background: red, green, blue, straight alpha.
        appearance: Exposure, and distribution of the smoke.
        views: Pictures of an explosion that replace the procedural fireball.
        path: Pose over time of the body that carries the camera.

    Returns:
        Linear light, full scale 1, not clipped; three channels, or four with `alpha`.

    Raises:
        InputError: Outside jit: times fall, are not finite or outside the path, the
            camera is below the ground, a depth is negative or NaN. Anywhere: a size
            does not fit.

    Example:
        `frames = jblast.render(scene, scene.camera, jnp.arange(100) / 1e3)`
    """
    times = as_numbers(times)
    _check_times(times, path)
    if background is None:
        background = BACKGROUND if path is None else landscape()
    behind = None
    if not isinstance(background, Landscape):
        background = images(camera, background, len(times))
        if background.ndim == 4:
            behind, background = background, BACKGROUND
    view = view_of(
        scene,
        camera,
        background,
        depth=depth,
        ground=ground,
        appearance=appearance,
        views=views,
        path=path,
    )
    if not alpha:
        return frames(view, times, behind)
    clear = jnp.zeros((4, camera.height, camera.width), view.lens.direction.dtype)
    return straight(frames(replace(view, background=clear), times))


def check_stands(camera: Camera) -> None:
    """Reject a camera that is carried: its position is not one of the world.

    Raises:
        InputError: The camera has a mount.
    """
    require(
        not camera.mount,
        "camera mount",
        "a fixed camera",
        f'"{camera.mount}", which needs the path of its carrier',
    )


def _check_above_ground(camera: Camera) -> None:
    if isinstance(camera.position, Tracer):
        return
    up = float(np.asarray(camera.position)[2])
    expected = "a position on or above the ground, up = 0"
    require(up >= 0, "camera position", expected, f"up = {up:g} m")


def _check_depth(depth: Float[Array, "..."], camera: Camera) -> None:
    size = camera.height, camera.width
    require(depth.shape == size, "depth", f"shape {size}", f"{depth.shape}")
    if isinstance(depth, Tracer):
        return
    values = np.asarray(depth)
    for row, column in np.argwhere(~(values >= 0)).tolist():
        got = f"{values[row, column]:g} at row {row}, column {column}"
        require(False, "depth", "distances of 0 m or more", got)


def _check_times(times: Float[Array, "..."], path: CameraPath | None) -> None:
    require(times.ndim == 1, "times", "a list of numbers", f"shape {times.shape}")
    if isinstance(times, Tracer):
        return
    clock = np.asarray(times)  # what JAX computes inside jit is traced
    require(np.isfinite(clock).all(), "times", "finite numbers", clock.tolist())
    for before, after in pairwise(clock.tolist()):
        got = f"{after:g} s after {before:g} s"
        require(before <= after, "times", "times in order", got)
    if path is None or isinstance(path.time, Tracer) or not len(clock):
        return
    first, last = float(path.time[0]), float(path.time[-1])
    require(
        first <= clock[0] <= clock[-1] <= last,
        "times",
        f"times within the camera's path, {first:g} to {last:g} s",
        f"{clock[0]:g} to {clock[-1]:g} s",
    )


def _as(dtype: Any, tree: T) -> T:
    """Return a tree with its inexact numbers in one precision."""
    return jax.tree.map(
        lambda x: x.astype(dtype) if eqx.is_inexact_array(x) else x, tree
    )


@eqx.filter_jit
def in_view(
    scene: Scene, camera: Camera, views: ExplosionViews | None = None
) -> Bool[Array, ""]:
    """Return True if any ray of the image meets a fireball, at any time of its life.

    A fireball smaller than a pixel counts. Obstacles in front of it are ignored.

    Args:
        scene: The scene.
        camera: The camera.
        views: Pictures shown in place of the procedural fireball.
    """
    rays = pixel_rays(camera, ground=False)
    # to a pixel's corner
    margin = 0.71 / jnp.min(camera.focal)
    shown = [
        _meets_fireball(scene, charge, rays, margin)
        if views is None
        else picture_met(views, charge, rays, scene.air)
        for charge in scene.charges
    ]
    # `as_if_at_zero` makes a charge that never detonates visible: excluded here
    happens = [~charge.never for charge in scene.charges]
    return jnp.any(jnp.stack(shown) & jnp.stack(happens))


def _meets_fireball(
    scene: Scene, charge: Charge, rays: Rays, margin: Float[Array, ""]
) -> Bool[Array, ""]:
    """Return True if a ray meets the sphere, or passes it within an angle [rad]."""
    charge = charge.as_if_at_zero()
    life = fireball_duration(charge.tnt_mass("fireball_radius_m"))

    def at(part):
        time = charge.time_s + part * life
        ball = cloud(charge, time, scene.air, scene.fireball_growth)
        offset = ball.centre - rays.origin
        along = jnp.tensordot(offset, rays.direction, 1)
        square = jnp.sum(jnp.square(offset))
        # the margin is an angle, so a distance grows with that to the ball
        reach = ball.radius + margin * jnp.sqrt(square)
        met = (square - jnp.square(along) < jnp.square(reach)) & (along > -ball.radius)
        return jnp.any(met & (rays.farthest > 0.0))

    return jnp.any(jax.lax.map(at, jnp.linspace(1 / INSTANTS, 1.0, INSTANTS)))


def off_axis(scene: Scene, camera: Camera) -> Float[Array, ""]:
    """Return the angle from the camera's axis to the first charge, 0 to pi [rad]."""
    right, down, ahead = to_camera(camera, jnp.stack(scene.charges[0].position_m))
    return jnp.arctan2(jnp.hypot(right, down), ahead)
