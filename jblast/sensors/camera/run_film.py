"""Frames and camera events of a run, packet by packet.

The light is sampled at the times of the frames and, while fireballs grow, at
`film.growth_instants`. Nothing is refined. If the light of a pixel rises or falls
steadily between two samples, its events are off by less than the interval: 10 ms at 100
frames per second, and next to a growing fireball its age. Changes that begin and end
between two samples are lost. For one burst seen from a swaying camera, 91 % of the
events match those of `film.subdivided`, which is exact to 0.1 ms at far more work. Half
of them are within 2 ms, 99 % within 9 ms.

Blocks of instants have one length, whatever the packets: these change neither frames,
nor events, nor noise. Poses and fireballs have the precision of the scene, images that
of float32, relative to the camera: the logarithm of light is exact to 1e-4 (but
rounding decides about pixels on the horizon). Loops over the visible fireballs have a
variable number of turns, so that one program serves the whole run.
"""

import math
import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.scene import Camera, Charge, Scene
from jblast.sensors.camera.files.recordings import ImageSequence
from jblast.sensors.camera.film import MAX_BLOCK, PIXELS, Film, growth_instants
from jblast.sensors.camera.fireball import (
    WINDOW_SIZES,
    Appearance,
    Cloud,
    Glow,
    GlowTable,
    cells_touched,
    cloud,
    cloud_seen,
    corner_rays,
    glow_table,
    laid_in_windows,
)
from jblast.sensors.camera.geometry import (
    CameraPath,
    Rays,
    camera_rays,
    carried_camera,
    surfaces_seen,
    turned_rays,
)
from jblast.sensors.camera.image import LUMINANCE, images, linear_to_srgb, toned
from jblast.sensors.camera.pixel import Events, NoiseModel
from jblast.sensors.camera.rendering import check_camera, exposed
from jblast.sensors.camera.scene_events import camera_pixel
from jblast.sensors.camera.stream import event_stream
from jblast.sensors.camera.surroundings import Landscape, disc_light, sphere_factor
from jblast.sensors.wave_paths import alone
from jblast.waves.propagation import ambient

FAINTEST_FLASH = 1e-5
"""Light of a fireball over that of the day, up to which it lights nothing: the
logarithm of light changes by less, far below thresholds of events."""
EXPOSURES = 8
"""Instants averaged over an exposure, as in `rendering.render`."""
SIZES = ((0.0, 0.0), *WINDOW_SIZES)
"""Windows of fireballs; finer than for `render`, because smoke stays for minutes."""
ROUNDING_S = 1e-9
"""Times that are closer together are equal [s]."""
T = TypeVar("T")
Image = Float[Array, "3 height width"]


class FilmedPacket(NamedTuple):
    """Frames and camera events of one packet, on the common clock.

    Attributes:
        time_s: Beginning of the exposure of each frame.
        frames: sRGB of 8 bits, or linear light with full scale 1, shape
            (frame, height, width, 3).
        events: Camera events.
    """

    time_s: Float[np.ndarray, " frame"]
    frames: np.ndarray
    events: Events


def filmed_packets(
    film: Film,
    bounds: Float[np.ndarray, " bound"],
    *,
    srgb: bool = True,
    noise: NoiseModel | None = None,
    seed: int = 0,
) -> Iterator[FilmedPacket]:
    """Yield the frames and camera events of consecutive packets, in bounded memory.

    Args:
        film: Camera, and times of all frames, of which the first is the reference of
            the events; ground and sky, or for a fixed camera an image.
        bounds: Beginning of each packet, and end of the last [s].
        srgb: False for frames of linear light.
        noise: Imperfections of the event camera; None for an ideal one.
        seed: Seed of the noise.

    Raises:
        InputError: The film has features that runs do not have; and as in `render`.
    """
    frames: deque[tuple[np.ndarray, ...]] = deque()
    events: deque[tuple[np.ndarray, ...]] = deque()
    ends: deque[float] = deque()

    def blocks() -> Iterator[tuple[Any, Any]]:
        for times, is_frame, grey, pictures in _blocks(film, srgb):
            frames.append((times[is_frame], pictures[is_frame]))
            ends.append(times[-1])
            yield times, grey

    key = None if noise is None else jax.random.key(seed)
    stream = event_stream(blocks(), camera_pixel(film.camera, noise, key))
    known = -math.inf
    for _, end in pairwise(np.asarray(bounds) - ROUNDING_S):
        while known < end and (found := next(stream, None)) is not None:
            whole = found.time, found.x, found.y, found.polarity
            events.append(tuple(np.asarray(x)[: int(found.count)] for x in whole))
            known = ends.popleft()
        time, x, y, sign = _taken(events, end)
        count = np.asarray(len(time)), np.asarray(0)
        times, pictures = _taken(frames, end)
        yield FilmedPacket(times, pictures, Events(x, y, time, sign, *count))


def _taken(blocks: deque[tuple[np.ndarray, ...]], end: float) -> list[np.ndarray]:
    """Remove and return the rows before a time; times are the first column."""
    taken = []
    while True:
        columns = blocks.popleft()
        count = int(np.searchsorted(columns[0], end))
        taken.append([column[:count] for column in columns])
        # the last block stays, though empty, for the shapes of an empty packet
        if count < len(columns[0]) or not blocks:
            blocks.appendleft(tuple(column[count:] for column in columns))
            return [np.concatenate(parts) for parts in zip(*taken, strict=True)]


class _View(eqx.Module):
    """Constants of a run; those of images in single precision."""

    scene: Scene
    charges: list[Charge]
    camera: Camera
    path: CameraPath | None
    table: GlowTable
    appearance: Appearance
    lens: Rays
    behind: Landscape | Image
    srgb: bool = eqx.field(static=True)
    blurred: bool = eqx.field(static=True)


def _blocks(film: Film, srgb: bool) -> Iterator[tuple[Any, Any, Any, Any]]:
    """Yield times, mask of frames, grey light and pictures of each block."""
    camera, moves = film.camera, film.path is not None
    behind: Any = film.background
    plain = film.views is None and film.depth is None and film.supersample == 1
    plain &= film.gain == 1.0
    plain &= not isinstance(behind, ImageSequence)
    if not plain or isinstance(behind, Landscape) is not moves:
        raise InputError(
            "film of a run: expected ground and sky of a moving camera or an image of "
            "a fixed one, without depth, gain, pictures of an explosion and "
            "several rays per pixel"
        )
    if not moves:
        check_camera(camera, ground=True)
        behind = jnp.moveaxis(images(camera, behind, 0), -1, 0)
    look = film.appearance or Appearance()
    table = glow_table(ambient(film.scene.air)[0], look)
    scene, charges = alone(film.scene, 0), _stacked(film.scene.charges)
    blurred = float(camera.exposure_s) > 0.0
    drawn = _single((camera_rays(camera, 1), behind))
    view = _View(scene, charges, camera, film.path, table, look, *drawn, srgb, blurred)
    size = max(1, min(MAX_BLOCK, PIXELS // (camera.width * camera.height)))
    workers = min(size, os.cpu_count() or 1)
    share = -(-size // workers)
    frames = np.asarray(film.times, float)
    extra = growth_instants(film.scene)
    extra = np.unique(extra[(extra > frames[0]) & (extra < frames[-1])])
    near = np.searchsorted(frames, extra - ROUNDING_S)
    extra = extra[frames[near] > extra + ROUNDING_S]
    times = np.concatenate([frames, extra])
    order = np.argsort(times)
    begins = min(float(charge.time_s) for charge in film.scene.charges)
    still = None
    waiting: deque[tuple[Any, Any, Any]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        for begin in range(0, len(order), size):
            some = order[begin : begin + size]
            now, is_frame = times[some], some < len(frames)
            if not moves and now[-1] + float(camera.exposure_s) <= begins:
                # a fixed camera sees its background only: nothing is rendered
                still = still or _developed(drawn[1], drawn[1], srgb)
                done = [[np.broadcast_to(x, (len(some), *x.shape)) for x in still]]
            else:
                # padded to full shares of the threads: one program serves all
                padded = np.pad(now, (0, workers * share - len(now)), mode="edge")
                shares = padded.reshape(workers, share)
                done = pool.map(
                    lambda part: [*map(np.asarray, _filmed(view, part))], shares
                )
            # the next block is rendered while this one is used
            waiting.append((now, is_frame, done))
            if len(waiting) > 1:
                yield _finished(*waiting.popleft())
        yield _finished(*waiting.popleft())


def _finished(
    times: np.ndarray, is_frame: np.ndarray, shares: Iterable[Sequence[Any]]
) -> tuple[Any, Any, Any, Any]:
    """Return times, mask of frames, grey light and pictures of a rendered block."""
    grey, pictures = (
        np.concatenate(x)[: len(times)] for x in zip(*shares, strict=True)
    )
    return times, is_frame, grey, pictures


def _stacked(charges: Sequence[Charge]) -> list[Charge]:
    """Return charges as arrays, one for each structure: a small program for many."""
    alike: dict[Any, list[Charge]] = {}
    for charge in (replace(charge, name="") for charge in charges):
        alike.setdefault(jax.tree.structure(charge), []).append(charge)
    return [jax.tree.map(lambda *x: jnp.stack(x), *some) for some in alike.values()]


def _single(tree: T) -> T:
    """Return a tree with its numbers in single precision."""
    return jax.tree.map(
        lambda x: x.astype(jnp.float32) if eqx.is_inexact_array(x) else x, tree
    )


@eqx.filter_jit
def _filmed(view: _View, times: Float[Array | np.ndarray, " instant"]) -> Any:
    """Return grey light at instants, and pictures of exposures from them on."""
    camera = view.camera

    def instant(time: Float[Array, ""]) -> Image:
        here = camera
        if view.path is not None:
            here = carried_camera(camera, view.path, time)

        def seen(charge: Charge) -> tuple[Cloud, Glow, Float[Array, "3"]]:
            ball = cloud(view.scene, charge, time)
            ball = replace(ball, centre=ball.centre - here.position)
            ends, day = view.table(ball), view.appearance.daylight
            return ball, ends, disc_light(ball, ends, view.appearance) / day

        found = [jax.vmap(seen)(alike) for alike in view.charges]
        found = jax.tree.map(lambda *x: jnp.concatenate(x), *found)
        balls, ends, flash = _single(found)
        look = _single(view.appearance)
        rays = turned_rays(view.lens, _single(here))
        light = view.behind
        if isinstance(light, Landscape):
            light = light.light(rays, 1.0 / jnp.max(_single(camera.focal)))
        rays = replace(rays, origin=jnp.zeros_like(rays.origin))
        begun = balls.radius > 0.0

        def lit(light: Image) -> Image:
            surfaces = surfaces_seen(rays, image=False)

            def turn(i: Any, total: Image) -> Image:
                n = shining[i]
                factor = sphere_factor(balls.centre[n], balls.radius[n], surfaces)
                return total + flash[n][:, None, None] * factor[None]

            return light * jax.lax.fori_loop(0, count, turn, jnp.ones_like(light))

        bright = begun & (jnp.max(flash, axis=1) > FAINTEST_FLASH)
        shining, count = jnp.argsort(~bright), jnp.sum(bright)
        if view.appearance.flash:
            light = jax.lax.cond(count > 0, lit, lambda light: light, light)
        # the farthest first; those before their detonation last
        away = jnp.sum(jnp.square(balls.centre), axis=1)
        order = jnp.argsort(jnp.where(begun, -away, jnp.inf))

        def laid(light: Image) -> Image:
            corners = corner_rays(rays)

            def turn(i: Any, images: Any) -> Any:
                ball, glow = jax.tree.map(lambda x: x[order[i]], (balls, ends))

                def lay(part: Rays, beneath: Any, _: None) -> Any:
                    over = cloud_seen(ball, glow, part, look)
                    over = jnp.moveaxis(over, 0, -1)
                    return over[..., :3] + (1.0 - over[..., 3:]) * beneath

                cells = cells_touched([ball], corners)[None]
                return laid_in_windows(cells, rays, lay, images, None, SIZES)

            images = jnp.moveaxis(light, 0, -1)[None]
            images = jax.lax.fori_loop(0, jnp.sum(begun), turn, images)
            return jnp.moveaxis(images[0], -1, 0)

        return jax.lax.cond(jnp.any(begun), laid, lambda light: light, light)

    def frame(time: Float[Array, ""]) -> Any:
        now = shown = instant(time)
        if view.blurred:
            none = jnp.zeros_like(now)
            shown = exposed(instant, time, camera.exposure_s, EXPOSURES, none)
        return _developed(now, shown, view.srgb)

    return jax.lax.map(frame, times)


def _developed(now: Image, shown: Image, srgb: bool) -> tuple[Any, Any]:
    """Return the grey light of an instant, and the picture of an exposure."""
    red, green, blue = (w * x for w, x in zip(LUMINANCE, now, strict=True))
    grey = red + green + blue
    if not srgb:
        return grey, jnp.moveaxis(shown, 0, -1)

    def within(light: Image) -> Image:
        return jnp.moveaxis(toned(jnp.moveaxis(light, 0, -1)), -1, 0)

    # light up to full scale has no tone: this saves half of the time
    bright = jnp.max(shown) > 1.0
    shown = jax.lax.cond(bright, within, lambda light: light, shown)
    values = jnp.rint(255.0 * linear_to_srgb(shown)).astype(jnp.uint8)
    return grey, jnp.moveaxis(values, 0, -1)
