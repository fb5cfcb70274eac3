"""Frames of a scene with a blast, by a camera at rest or moving.

A frame is the background, lit by the fireballs, with the fireballs or pictures of an
explosion over it. With an exposure, a frame is the mean of instants in the middles of
equal parts of it. A fixed camera shares its rays between all frames; a camera on a
moving body has its own at each frame, or at each part of an exposure. `in_view` returns
True if any ray of the image meets a fireball at any time of its life.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import InputError, shown
from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import MOUNTS
from jblast.sensors.camera.billboards import ViewSet
from jblast.sensors.camera.fireball import (
    Appearance,
    cloud,
    fireballs_in_window,
    fireballs_over,
)
from jblast.sensors.camera.geometry import (
    CameraPath,
    Rays,
    camera_rays,
    carried_camera,
    pixel_rays,
    pixels,
    surfaces_seen,
    to_camera,
    turned_rays,
)
from jblast.sensors.camera.image import (
    BACKGROUND,
    Background,
    fitting,
    images,
    straight,
)
from jblast.sensors.camera.surroundings import (
    Landscape,
    Outlook,
    brightened,
    flash,
    landscape,
    outlook_of,
)
from jblast.types import as_float_array
from jblast.waves.fireball import fireball_duration

INSTANTS = 16
"""Instants of a fireball's life at which `in_view` tests it, evenly spaced. A fireball
that touches the image only between two of them is not found."""


def render(
    scene: Scene,
    camera: Camera,
    times: Float[ArrayLike, " time"],
    *,
    background: Background = BACKGROUND,
    depth: Float[ArrayLike, "height width"] | None = None,
    ground: bool = True,
    alpha: bool = False,
    supersample: int = 1,
    exposures: int = 8,
    appearance: Appearance | None = None,
    views: ViewSet | None = None,
    outlook: Outlook | None = None,
) -> Float[Array, "time height width channel"]:
    """Return a camera's frames of a scene's fireballs before a background.

    A frame gathers light from its time on, over the camera's exposure; an exposure of
    zero is an instant. Visibility:

    - Nothing is visible behind the background's `depth` or below the ground.
    - A fireball is cut at the bounds of the image, and invisible behind the camera.
      From inside it the camera sees the smoke before its lens.
    - A pixel whose rays all miss shows the background. Without supersampling a fireball
      smaller than a pixel is therefore seen whole or not at all; with n, to 1/n^2.
    - Before detonation nothing is visible.
    - A pixel beyond the lens's fold, which shows no direction, keeps the background.
    - The fire lights the ground and the surfaces of the depth image (`flash`), unless
      the appearance excludes it. The sky, and a background without depth or ground, are
      not lit; nor is anything if user-supplied pictures replace the fire.

    It has derivatives in all numbers of the scene, the camera, the times and the
    background, except where a fireball begins, where two change their order, where one
    is a point at the camera, and on the horizon from a camera on the ground.

    Args:
        scene: Charges, each with a position (a `range` is not used), and air.
        camera: The camera.
        times: Starts of the frames on the common clock, not falling [s].
        background: A grey, a colour, an image, an image per time or a function of time.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: True if the plane up = 0 hides what is below it. It is not drawn.
        alpha: True to omit the background: red, green, blue, straight alpha.
        supersample: Rays along each side of a pixel; the flash is calculated at the
            pixel's middle.
        exposures: Number of instants averaged over an exposure, in the middles of equal
            parts.
        appearance: Exposure, and distribution of the smoke.
        views: Pictures of an explosion that replace the procedural fireball; their
            limits are stated at their definition. User-supplied pictures ignore the
            appearance; an explosion set uses its white, its daylight and its flash.
        outlook: Result of `outlook_of` for the same camera, for callers that render the
            frames in several calls; it then defines `depth`, `ground` and
            `supersample`.

    Returns:
        Linear light, full scale 1, not clipped; three channels, or four with `alpha`.

    Raises:
        InputError: Outside jit: times fall or are not finite, the camera is below the
            ground, a depth is negative or NaN. Anywhere: a size does not fit.

    Example:
        `frames = jblast.render(scene, scene.camera, jnp.arange(100) / 1e3)`
    """
    check_camera(camera, ground=ground)
    times = as_float_array(times)
    _check_times(times)
    for name, number in (("supersample", supersample), ("exposures", exposures)):
        if number < 1:
            raise InputError(f"{name}: expected at least 1, got {number}")
    if depth is not None:
        depth = as_float_array(depth)
        expected = (camera.height, camera.width)
        if depth.shape != expected:
            raise InputError(f"depth: expected shape {expected}, got {depth.shape}")
        if not isinstance(depth, Tracer):
            bad = np.argwhere(~(np.asarray(depth) >= 0))
            if len(bad):
                row, column = bad[0]
                raise InputError(
                    "depth: expected distances of 0 m or more, got "
                    f"{np.asarray(depth)[row, column]:g} at row {row}, column {column}"
                )
    size = (camera.height, camera.width, 3)
    source: Any = background
    # a function is evaluated at each instant inside the program, never as a whole film
    if not callable(background):
        source = images(camera, background, len(times))
    appearance = Appearance() if appearance is None else appearance
    exposure = camera.exposure_s
    if not isinstance(exposure, Tracer) and exposure.item() == 0:
        exposures = 1  # fewer programs to compile
    if outlook is None:
        outlook = outlook_of(
            camera,
            depth,
            ground=ground,
            supersample=supersample,
            lit=appearance.flash and not alpha and (views is None or views.glows),
            # a picture may hold what is below ground, but the ground is there
            lit_ground=ground or views is not None,
        )
    shown_by = appearance, views
    return _render(
        scene, outlook, times, source, exposure, shown_by, exposures, size, alpha
    )


@eqx.filter_jit
def _render(
    scene: Scene,
    outlook: Outlook,
    times: Float[Array, " time"],
    source: Any,
    exposure: Float[Array, ""],
    shown_by: tuple[Appearance, ViewSet | None],
    exposures: int,
    size: tuple[int, int, int],
    alpha: bool,
) -> Float[Array, "time height width channel"]:
    """Return the result of `render` for checked inputs."""
    rays, lit, supersample = outlook.rays, outlook.lit, outlook.supersample
    appearance, views = shown_by
    # this frequent case composites in place, only where fireballs are
    simple = views is None and supersample == exposures == 1 and not alpha

    def instant(time, behind):
        """Return one instant: premultiplied, or composited over the background."""
        if not alpha:
            if callable(source):
                image: Any = source(time)
                behind = fitting(as_float_array(image), [size], size)
            if lit is not None:
                # light adds to the background before the fire covers it
                behind = brightened(behind, lit, scene, time, appearance)
            if simple:
                return behind
        if views is not None:
            layer = views.seen(scene, rays, time, appearance)
        else:
            layer = fireballs_in_window(scene, rays, time, appearance)
        seen = pixels(layer, supersample)
        if alpha:
            return seen
        return seen[..., :3] + (1.0 - seen[..., 3:]) * behind

    def gathered(time, behind):
        """Return the mean over an exposure."""
        nothing = jnp.zeros((*size[:2], 4 if alpha else 3), rays.direction.dtype)
        return exposed(lambda t: instant(t, behind), time, exposure, exposures, nothing)

    # gradients recompute the intermediate images of a frame: storing them would fill
    # the memory
    @jax.checkpoint
    def frame(inputs):
        if exposures == 1:
            return instant(*inputs)
        return jax.lax.cond(exposure > 0, gathered, instant, *inputs)

    if exposures == 1:  # one instant stands for the exposure: its middle
        times = times + 0.5 * exposure
    if not callable(source) and source.ndim == 4:
        frames = jax.lax.map(frame, (times, source))
    else:
        behind = None if callable(source) else source
        frames = jax.lax.map(lambda time: frame((time, behind)), times)
    if simple:
        return fireballs_over(scene, rays, times, appearance, frames)
    return straight(frames) if alpha else frames


def check_stands(camera: Camera) -> None:
    """Reject a camera that is carried: its position is not one of the world.

    Raises:
        InputError: The camera has a mount.
    """
    if camera.mount:
        raise InputError(
            f'camera mount: expected a fixed camera, got "{camera.mount}"; '
            "use render_carried with the path of a moving one"
        )


def check_camera(camera: Camera, *, ground: bool) -> None:
    """Reject a camera that is carried or below the ground.

    Args:
        camera: The camera.
        ground: True if there is a ground.

    Raises:
        InputError: The camera is carried, or below the ground.
    """
    check_stands(camera)
    if ground and not isinstance(camera.position, Tracer):
        up = float(np.asarray(camera.position)[2])
        if up < 0:
            raise InputError(
                "camera position: expected a position on or above the ground, up = 0, "
                f"got up = {up:g} m"
            )


def _check_times(times: Float[Array, "..."]) -> None:
    if times.ndim != 1:
        raise InputError(f"times: expected a list of numbers, got shape {times.shape}")
    if isinstance(times, Tracer):
        return
    clock = np.asarray(times)  # what JAX computes inside jit is traced
    if not np.isfinite(clock).all():
        raise InputError(f"times: expected finite numbers, got {shown(clock.tolist())}")
    falls = np.flatnonzero(np.diff(clock) < 0)
    if len(falls):
        before, after = clock[falls[0]], clock[falls[0] + 1]
        raise InputError(
            f"times: expected times in order, got {after:g} s after {before:g} s"
        )


def exposed(
    instant: Callable[[Float[Array, ""]], Float[Array, "height width channel"]],
    time: Float[Array, ""],
    exposure: Float[Array, ""],
    parts: int,
    nothing: Float[Array, "height width channel"],
) -> Float[Array, "height width channel"]:
    """Return the mean of instants in the middles of equal parts of an exposure.

    Args:
        instant: Returns the image at a time [s].
        time: Start of the exposure [s].
        exposure: Length of the exposure [s].
        parts: Number of parts.
        nothing: An image of zeros.
    """

    def add(total, part):
        return total + instant(time + part * exposure), None

    # midpoint rule, of second order in the length of a part
    middles = (jnp.arange(parts, dtype=time.dtype) + 0.5) / parts
    return jax.lax.scan(add, nothing, middles)[0] / parts


def render_carried(
    scene: Scene,
    camera: Camera,
    path: CameraPath,
    times: Float[ArrayLike, " time"],
    *,
    background: Landscape | Float[ArrayLike, "time height width 3"] | None = None,
    supersample: int = 1,
    exposures: int = 8,
    appearance: Appearance | None = None,
    views: ViewSet | None = None,
) -> Float[Array, "time height width 3"]:
    """Return the frames of a camera on a moving body; otherwise as `render`.

    One program serves all poses. The ground, up = 0, hides what is below it.

    Args:
        scene: Charges, each with a position, and air.
        camera: Position and quaternion relative to the body: forward, left, up [m].
        path: Pose of the body over time.
        times: Starts of the frames on the common clock [s].
        background: Ground and sky, by default even ground and a clear sky; or an image
            per time, taken by this camera.
        supersample: Rays along each side of a pixel.
        exposures: Number of instants averaged over an exposure, if there is one.
        appearance: Exposure, and distribution of the smoke.
        views: Pictures of an explosion in place of the procedural fireball.

    Returns:
        Linear light, full scale 1, not clipped.

    Raises:
        InputError: Outside jit: a time is outside the path.
    """
    if camera.mount not in MOUNTS:
        raise InputError("camera mount: expected a mount on a vehicle, got none")
    times = as_float_array(times)
    if not isinstance(times, Tracer):
        first, last = float(path.time[0]), float(path.time[-1])
        starts = np.asarray(times)
        if len(starts) and not first <= starts.min() <= starts.max() <= last:
            raise InputError(
                f"times: expected times within the camera's path, {first:g} to "
                f"{last:g} s, got {starts.min():g} to {starts.max():g} s"
            )
    exposure = camera.exposure_s
    if not isinstance(exposure, Tracer) and exposure.item() == 0:
        exposures = 1
    # the lens is inverted once; each pose only rotates its rays
    lens = camera_rays(camera, supersample)
    middles = lens if supersample == 1 else camera_rays(camera, 1)
    look = Appearance() if appearance is None else appearance
    behind = landscape() if background is None else background
    if not isinstance(behind, Landscape):
        behind = as_float_array(behind)
    counts = (supersample, exposures)
    return _carried_frames(
        scene, camera, path, times, behind, (lens, middles), counts, (look, views)
    )


@eqx.filter_jit
def _carried_frames(
    scene: Scene,
    camera: Camera,
    path: CameraPath,
    times: Float[Array, " time"],
    background: Landscape | Float[Array, "time height width 3"],
    lenses: tuple[Rays, Rays],
    counts: tuple[int, int],
    shown_by: tuple[Appearance, ViewSet | None],
) -> Float[Array, "time height width 3"]:
    supersample, exposures = counts
    appearance, views = shown_by
    pixel = 1.0 / jnp.max(camera.focal)

    def instant(time, behind):
        here = carried_camera(camera, path, time)
        rays = turned_rays(lenses[0], here)
        ends = rays if supersample == 1 else turned_rays(lenses[1], here)
        if views is None:
            layer = fireballs_in_window(scene, rays, time, appearance)
        else:
            layer = views.seen(scene, rays, time, appearance)
        if isinstance(background, Landscape):
            fine = background.light(rays, pixel / supersample)
            behind = pixels(fine, supersample)
        if appearance.flash and (views is None or views.glows):
            lit = flash(scene, surfaces_seen(ends, image=False), time, appearance)
            behind = behind * (1.0 + jnp.moveaxis(lit, 0, -1))
        seen = pixels(layer, supersample)
        return seen[..., :3] + (1.0 - seen[..., 3:]) * behind

    @jax.checkpoint
    def frame(inputs):
        time, behind = inputs
        if exposures == 1:
            return instant(time + 0.5 * camera.exposure_s, behind)

        nothing = jnp.zeros((camera.height, camera.width, 3), times.dtype)
        return exposed(
            lambda t: instant(t, behind), time, camera.exposure_s, exposures, nothing
        )

    if isinstance(background, Landscape):
        return jax.lax.map(lambda time: frame((time, None)), times)
    return jax.lax.map(frame, (times, background))


def in_view(
    scene: Scene, camera: Camera, views: ViewSet | None = None
) -> Bool[Array, ""]:
    """Return True if any ray of the image meets a fireball, at any time of its life.

    A fireball smaller than a pixel counts. Obstacles in front of it are ignored.

    Args:
        scene: The scene.
        camera: The camera.
        views: Pictures shown in place of the procedural fireball.
    """
    return _in_view(scene, camera, views)


@eqx.filter_jit
def _in_view(scene: Scene, camera: Camera, views: ViewSet | None) -> Bool[Array, ""]:
    rays = pixel_rays(camera, ground=False)
    shown = [
        _meets_fireball(
            scene, charge, rays, 0.71 / jnp.min(camera.focal)
        )  # to a pixel's corner
        if views is None
        else views.is_met(scene, charge, rays)
        for charge in scene.charges
    ]
    # `as_if_at_zero` makes a charge that never detonates visible: excluded here
    happens = [~charge.never for charge in scene.charges]
    return jnp.any(jnp.stack(shown) & jnp.stack(happens))


def off_axis(scene: Scene, camera: Camera) -> Float[Array, ""]:
    """Return the angle from the camera's axis to the first charge, 0 to pi [rad]."""
    charge = scene.charge
    right, down, ahead = to_camera(camera, jnp.stack(charge.position_m))
    return jnp.arctan2(jnp.hypot(right, down), ahead)


def _meets_fireball(
    scene: Scene, charge: Charge, rays: Rays, margin: Float[Array, ""]
) -> Bool[Array, ""]:
    """Return True if a ray meets the sphere, or passes it within an angle [rad]."""
    charge = charge.as_if_at_zero()
    life = fireball_duration(charge.tnt_mass("fireball_radius_m"))

    def at(part):
        ball = cloud(scene, charge, charge.time_s + part * life)
        offset = ball.centre - rays.origin
        along = jnp.tensordot(offset, rays.direction, 1)
        square = jnp.sum(jnp.square(offset))
        # the margin is an angle, so a distance grows with that to the ball
        reach = ball.radius + margin * jnp.sqrt(square)
        met = (square - jnp.square(along) < jnp.square(reach)) & (along > -ball.radius)
        return jnp.any(met & (rays.farthest > 0.0))

    return jnp.any(jax.lax.map(at, jnp.linspace(1 / INSTANTS, 1.0, INSTANTS)))
