"""Frames of a scene with a blast, as a camera takes them."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError, shown
from jblast.scene import Camera, Scene
from jblast.sensors.camera.geometry.pixel_rays import pixels
from jblast.sensors.camera.image.behind import (
    BACKGROUND,
    Background,
    fitting,
    images,
)
from jblast.sensors.camera.image.compositing import straight
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.exposure import exposed
from jblast.sensors.camera.rendering.fireball_window import (
    fireballs_in_window,
    fireballs_over,
)
from jblast.sensors.camera.rendering.outlook import Outlook, brightened, outlook_of
from jblast.sensors.camera.rendering.view_set import ViewSet
from jblast.types import as_float_array


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
    """Return what a camera sees of a scene's fireballs before a background.

    A frame gathers light from its time on, over the camera's exposure; an exposure of
    zero is an instant. Its place decides what is seen:

    - Behind the background's `depth`, or below the ground, there is nothing.
    - Of a fireball partly outside the image the part inside is there; of one behind the
      camera, nothing. From within it the camera sees the smoke before its lens.
    - A pixel whose rays all miss shows the background. Without supersampling a fireball
      smaller than a pixel is therefore seen whole or not at all; with n, to 1/n^2.
    - Before detonation there is nothing.
    - A pixel beyond the lens's fold, which shows no direction, keeps the background.
    - The fire lights the ground, and what the depth image shows (`flash.py`), unless
      the appearance says otherwise; the sky and a background without depth or ground
      stay as they are, and so does all where pictures of one's own stand for the
      fire.

    It has derivatives in all numbers of the scene, the camera, the times and the
    background, except where a fireball begins, where two change their order, where one
    is a point at the camera, and on the horizon from a camera on the ground.

    Args:
        scene: Charges, each by its position (a `range` is not looked at), and air.
        camera: Who looks.
        times: When the frames begin, on the common clock, not falling [s].
        background: A grey, a colour, an image, an image a time, or a function of time.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        ground: Whether the plane up = 0 hides what is below it. It is not drawn.
        alpha: Whether to leave the background out: red, green, blue, straight alpha.
        supersample: Rays along each side of a pixel; the flash lights what is behind by
            the pixel's middle.
        exposures: Instants that stand for an exposure, in the middles of as many equal
            parts; the frame is their mean.
        appearance: How the fireball is exposed, and how its smoke is distributed.
        views: Pictures of an explosion to show in place of the procedural fireball;
            what they cannot show is said where they are defined. Of the appearance
            pictures of one's own take nothing; an explosion set takes its white, its
            daylight and its flash.
        outlook: Of the same camera, from `outlook_of`, for who renders its frames
            part by part; `depth`, `ground` and `supersample` are then its own.

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
        depth = _checked_depth(as_float_array(depth), camera)
    size = (camera.height, camera.width, 3)
    source: Any = background
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
    """Return what `render` promises, of inputs that fit."""
    rays, lit, supersample = outlook.rays, outlook.lit, outlook.supersample
    appearance, views = shown_by
    simple = views is None and supersample == exposures == 1 and not alpha

    def instant(time, behind):
        """Return one instant: premultiplied, or over what is behind."""
        if not alpha:
            if callable(source):
                image: Any = source(time)
                behind = fitting(as_float_array(image), [size], size)
            if lit is not None:
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

    # what a frame computes on its way is computed again for gradients: it would fill
    # the memory
    @jax.checkpoint
    def frame(inputs):
        if exposures == 1:
            return instant(*inputs)
        return jax.lax.cond(exposure > 0, gathered, instant, *inputs)

    if exposures == 1:  # in the middle
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
    """Refuse a camera that something carries, whose place is not one of the world.

    Raises:
        InputError: It is.
    """
    if camera.mount:
        raise InputError(
            f'camera mount: expected a camera that stands still, got "{camera.mount}"; '
            "one that moves is for render_carried, which takes its path"
        )


def check_camera(camera: Camera, *, ground: bool) -> None:
    """Refuse a camera that something carries, or one below the ground.

    Args:
        camera: Who looks.
        ground: Whether there is one.

    Raises:
        InputError: It is.
    """
    check_stands(camera)
    if ground and not isinstance(camera.position, Tracer):
        _check_above_ground(float(np.asarray(camera.position)[2]))


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


def _check_above_ground(up: float) -> None:
    if up < 0:
        raise InputError(
            "camera position: expected a place not below the ground, up = 0, "
            f"got up = {up:g} m"
        )


def _checked_depth(depth: Float[Array, "..."], camera: Camera) -> Float[Array, "..."]:
    expected = (camera.height, camera.width)
    if depth.shape != expected:
        raise InputError(f"depth: expected shape {expected}, got {depth.shape}")
    if not isinstance(depth, Tracer) and not (np.asarray(depth) >= 0).all():
        raise InputError("depth: expected distances, got a negative one or NaN")
    return depth
