"""Frames of a camera that moves: one pose a frame, or a part of its exposure."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.scene import Camera, Scene
from jblast.scene.camera import MOUNTS
from jblast.sensors.camera.geometry.camera_path import (
    CameraPath,
    camera_rays,
    carried_camera,
    turned_rays,
)
from jblast.sensors.camera.geometry.pixel_rays import Rays, pixels
from jblast.sensors.camera.geometry.surfaces import surfaces_seen
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.exposure import exposed
from jblast.sensors.camera.rendering.fireball_window import fireballs_in_window
from jblast.sensors.camera.rendering.flash import flash
from jblast.sensors.camera.rendering.landscape import Landscape, landscape
from jblast.sensors.camera.rendering.view_set import ViewSet
from jblast.types import as_float_array


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
    """Return what a camera on a moving body sees of a scene; as `render` else.

    One program, whatever the poses are. The ground, up = 0, hides what is below it.

    Args:
        scene: Charges, each by its position, and air.
        camera: Place and quaternion are those on the body: forward, left, up [m].
        path: Where the body is at which time.
        times: When the frames begin, on the common clock [s].
        background: Ground and sky, by default even ground and a clear sky; or a picture
            for each time, taken by such a camera.
        supersample: Rays along each side of a pixel.
        exposures: Instants that stand for an exposure, if there is one.
        appearance: How the fireball is exposed, and how its smoke is distributed.
        views: Pictures of an explosion in place of the procedural fireball.

    Returns:
        Linear light, full scale 1, not clipped.

    Raises:
        InputError: Outside jit: a time is before the path begins or after its end.
    """
    if camera.mount not in MOUNTS:
        raise InputError("camera mount: expected one on a vehicle, got one that stands")
    times = as_float_array(times)
    if not isinstance(times, Tracer):
        check_times_on(path, np.asarray(times))
    exposure = camera.exposure_s
    if not isinstance(exposure, Tracer) and exposure.item() == 0:
        exposures = 1
    lens = camera_rays(camera, supersample)
    middles = lens if supersample == 1 else camera_rays(camera, 1)
    look = Appearance() if appearance is None else appearance
    behind = landscape() if background is None else background
    if not isinstance(behind, Landscape):
        behind = as_float_array(behind)
    counts = (supersample, exposures)
    return _frames(
        scene, camera, path, times, behind, (lens, middles), counts, (look, views)
    )


def check_times_on(path: CameraPath, times: Float[np.ndarray, " time"]) -> None:
    """Refuse times at which nobody knows where the camera is.

    Raises:
        InputError: There are such.
    """
    first, last = float(path.time[0]), float(path.time[-1])
    if len(times) and not first <= times.min() <= times.max() <= last:
        raise InputError(
            f"times: expected times within the camera's path, {first:g} to {last:g} s, "
            f"got {times.min():g} to {times.max():g} s"
        )


@eqx.filter_jit
def _frames(
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
