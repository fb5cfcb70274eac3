r"""Frames and camera events of a run, packet by packet, at a multiple of real time.

The light is sampled at the times of the frames and, while a fireball grows, at
`film.growth_instants`. Nothing is refined: an event is at most the interval between two
samples away from its time in continuous light, and usually far less (the logarithm of
light is linear in between). At 100 frames per second that is 10 ms, next to a growing
fireball a quarter of its age. `film.subdivided` bounds the error by 0.1 ms, at some
hundred times the work.

Instants are rendered in blocks of fixed length. The division into packets changes
neither frames nor events, nor the noise of a camera.

Images are single precision: relative to the camera, lines of sight are exact to 1e-7
and the logarithm of light to 1e-6. Poses and fireballs are calculated before, in the
precision of the scene. For each block only fireballs that light the ground by more than
`FAINTEST_FLASH` are included in its light, and only those that may be in the image are
laid over it, each in a window around it. The loops over them have a variable number of
turns, so that one program serves all blocks of a run. A fixed camera without fireball
renders nothing.
"""

import dataclasses
import math
import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.errors import InputError
from jblast.scene import Camera, Scene
from jblast.scene.camera import quaternion_matrix
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.noise import NoiseModel, noisy_stream
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.film import MAX_BLOCK, PIXELS, Film, growth_instants
from jblast.sensors.camera.fireball import (
    SLACK,
    STRIDE,
    Appearance,
    Cloud,
    Glow,
    GlowTable,
    cloud,
    cloud_seen,
    corner_rays,
    glow_table,
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
from jblast.sensors.camera.rendering import check_camera
from jblast.sensors.camera.surroundings import Landscape, disc_light, sphere_factor
from jblast.waves.propagation import ambient

FAINTEST_FLASH = 1e-5
"""Light of a fireball over that of the day, below which it does not light the ground:
it changes the logarithm of light by less, far below any threshold of events."""
WINDOWS = (0.25, 0.5, 1.0)
"""Rows and columns of the windows of fireballs, as shares of the image."""
EXPOSURES = 8
"""Instants averaged over an exposure, if there is one."""
JOINED_S = 1e-9
"""Times that are closer together are one: rounding of the clock [s]."""


T = TypeVar("T")


class FilmedPacket(NamedTuple):
    """Frames and camera events of one packet.

    Attributes:
        time_s: Beginning of the exposure of each frame, common clock.
        frames: sRGB of 8 bits, or linear light with full scale 1, shape
            (frame, height, width, 3).
        events: Camera events, common clock.
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

    The first frame sets the reference of the events.

    Args:
        film: Camera, and times of all frames; ground and sky, or a constant background.
        bounds: Beginning of each packet, and end of the last [s].
        srgb: False for frames of linear light.
        noise: Imperfections of the event camera; None for an ideal one.
        seed: Seed of the noise.

    Raises:
        InputError: The film has pictures of an explosion, several rays per pixel, a
            depth, a changing background, a gain or bloom; or as in `render`.
    """
    run = _Run(film, srgb)
    frames: deque[tuple[np.ndarray, ...]] = deque()
    events: deque[tuple[np.ndarray, ...]] = deque()
    ends: deque[float] = deque()

    def blocks() -> Iterator[tuple[Any, Any]]:
        for times, is_frame, grey, pictures in run.blocks():
            frames.append((times[is_frame], pictures[is_frame]))
            ends.append(times[-1])
            yield times, grey

    steps = tuple(float(step) for step in film.camera.threshold)
    if noise is None:
        stream = stream_events(blocks(), steps)
    else:
        shape, key = (film.camera.height, film.camera.width), jax.random.key(seed)
        stream = noisy_stream(key, blocks(), shape, steps, noise)
    known = -math.inf
    for _, end in pairwise(np.asarray(bounds) - JOINED_S):
        while known < end and (found := next(stream, None)) is not None:
            whole = found.time, found.x, found.y, found.polarity
            events.append(tuple(np.asarray(x)[: int(found.count)] for x in whole))
            known = ends.popleft()
        time, x, y, sign = _taken(events, end)
        count = np.asarray(len(time))
        shown = Events(x, y, time, sign, count, np.asarray(0))
        yield FilmedPacket(*_taken(frames, end), shown)


def _taken(blocks: deque[tuple[np.ndarray, ...]], end: float) -> list[np.ndarray]:
    """Remove and return the rows before a time; times are the first column."""
    taken = []
    while True:
        count = int(np.searchsorted(blocks[0][0], end))
        taken.append([column[:count] for column in blocks[0]])
        rest = tuple(column[count:] for column in blocks.popleft())
        # an empty rest is kept for the shapes of an empty packet
        if len(rest[0]) or not blocks:
            blocks.appendleft(rest)
            return [np.concatenate(parts) for parts in zip(*taken, strict=True)]


class _Sight(NamedTuple):
    """Camera and fireballs at instants: arrays with the axis of instants first.

    Attributes:
        position: East, north, up [m].
        quaternion: Camera to world.
        balls: Fireball of each charge; its centre is relative to the camera.
        ends: Light of limb and middle of each.
        flash: Light of each disc over that of the day, shape (instant, charge, 3).
        ahead: Centre of each in the camera's axes [m], shape (instant, charge, 3).
    """

    position: Any
    quaternion: Any
    balls: Cloud
    ends: Glow
    flash: Any
    ahead: Any


class _Chosen(NamedTuple):
    """Fireballs of a block: numbers of charges first, then their count.

    Attributes:
        lit: Numbers of those that light the ground, and their count.
        laid: Numbers of those in the image, the farthest first, and their count.
        window: Index in `WINDOWS`, first row and first column, for each charge.
    """

    lit: tuple[Any, Any]
    laid: tuple[Any, Any]
    window: Any


class _View(NamedTuple):
    """Constants of a run in single precision."""

    camera: Camera
    lens: Rays
    appearance: Appearance
    behind: Landscape | Float[Array, "3 height width"]


class _Run:
    """Renderer of the instants of a run."""

    def __init__(self, film: Film, srgb: bool):
        """Check the film, and calculate what does not change."""
        camera = film.camera
        plain = film.views is None and film.depth is None and film.supersample == 1
        plain &= film.bloom == 0.0 and film.gain == 1.0
        fixed = film.path is None
        if not plain or isinstance(film.background, Landscape) is fixed:
            raise InputError(
                "film of a run: expected ground and sky for a moving camera or an "
                "image for a fixed one, and one ray per pixel, without depth, pictures "
                "of an explosion, gain and bloom"
            )
        self.film, self.srgb = film, srgb
        self.appearance = film.appearance or Appearance()
        self.path = jax.tree.map(jnp.asarray, film.path)
        self.table = glow_table(ambient(film.scene.air)[0], self.appearance)
        lens, behind = camera_rays(camera, 1), film.background
        if fixed:
            check_camera(camera, ground=True)
            behind = jnp.moveaxis(images(camera, behind, 0), -1, 0)
        self.view = _single(_View(camera, lens, self.appearance, behind))
        corners = corner_rays(lens)
        self.corners = np.array(corners.direction, float)
        # corners without a direction may show anything
        self.corners[:, ~(np.asarray(corners.farthest) > 0.0)] = np.nan
        # no ray is farther from the nearest corner than half a diagonal of its cell
        across = self.corners[:, 1:, 1:] - self.corners[:, :-1, :-1]
        other = self.corners[:, 1:, :-1] - self.corners[:, :-1, 1:]
        chord = np.linalg.norm(np.stack([across, other]), axis=1)
        self.cell = (0.5 + SLACK) * float(np.nanmax(chord, initial=0.0))
        size = max(1, min(MAX_BLOCK, PIXELS // (camera.width * camera.height)))
        self.workers = min(size, os.cpu_count() or 1)
        self.share = -(-size // self.workers)
        exposure = float(camera.exposure_s)
        middles = exposure * (np.arange(EXPOSURES) + 0.5) / EXPOSURES
        # events are those of instants; pictures are means over the exposure
        self.parts = np.append(0.0, middles if exposure else [])

    def blocks(self) -> Iterator[tuple[Any, Any, Any, Any]]:
        """Yield times, mask of frames, grey light and pictures of each block."""
        frames = np.asarray(self.film.times, float)
        extra = growth_instants(self.film.scene)
        extra = extra[(extra > frames[0]) & (extra < frames[-1])]
        after = frames[np.searchsorted(frames, extra)]
        before = frames[np.searchsorted(frames, extra) - 1]
        extra = np.unique(extra[np.minimum(after - extra, extra - before) > JOINED_S])
        times = np.concatenate([frames, extra])
        order = np.argsort(times)
        length = self.workers * self.share
        with ThreadPoolExecutor(self.workers) as pool:
            for begin in range(0, len(order), length):
                some = order[begin : begin + length]
                yield times[some], some < len(frames), *self.shot(times[some], pool)

    def shot(self, times: Float[np.ndarray, " few"], pool) -> tuple[Any, Any]:
        """Return grey light and pictures at a few times."""
        count, length = len(times), self.workers * self.share
        # padded to the size of a block, so that one compiled program serves all
        times = np.pad(times, (0, length - count), mode="edge")
        every = (times[:, None] + self.parts).ravel()
        scene, camera = self.film.scene, self.film.camera
        given = scene, camera, self.path, self.table, self.appearance
        sight = jax.tree.map(np.asarray, _sights(*given, every))
        chosen = self.chosen(sight)
        if self.path is None and not chosen.lit[1] + chosen.laid[1]:
            grey, pictures = self.still
            return (np.broadcast_to(x, (count, *x.shape)) for x in (grey, pictures))
        parts = len(self.parts)
        sight = jax.tree.map(lambda x: x.reshape(length, parts, *x.shape[1:]), sight)
        shares = [slice(a, a + self.share) for a in range(0, length, self.share)]

        def render(share: slice) -> list[np.ndarray]:
            some = jax.tree.map(lambda x: x[share], sight)
            return [*map(np.asarray, _rendered(self.view, some, chosen, self.srgb))]

        done = zip(*pool.map(render, shares), strict=True)
        grey, pictures = (np.concatenate(parts)[:count] for parts in done)
        return grey, pictures

    @cached_property
    def still(self) -> tuple[np.ndarray, np.ndarray]:
        """Grey light and picture of the background of a fixed camera."""
        return tuple(
            np.asarray(x)
            for x in _developed(self.view.behind, self.view.behind, self.srgb)
        )

    def chosen(self, sight: _Sight) -> _Chosen:
        """Return the fireballs that are rendered in a block, with their windows."""
        radius = sight.balls.radius
        # before detonation there is no ball, whatever its temperature
        flash = np.where(radius > 0.0, sight.flash.max(axis=-1), 0.0).max(axis=0)
        distance = np.linalg.norm(sight.ahead, axis=-1)
        # negated comparison: the camera may be inside a ball
        sine = np.where(radius < distance, radius / np.maximum(distance, radius), 1.0)
        unit = sight.ahead / np.maximum(distance, 1e-9)[..., None]
        apart = np.einsum("...i,irc->...rc", unit, self.corners)
        apart = np.arccos(np.clip(apart, -1.0, 1.0))
        hit = ~(apart > np.arcsin(sine)[..., None, None] + self.cell)
        hit |= (sine == 1.0)[..., None, None]
        hit = (hit & (radius > 0.0)[..., None, None]).any(axis=0)
        laid = np.flatnonzero(hit.any(axis=(1, 2)))
        windows = np.zeros((hit.shape[0], 3), int)
        for n in laid:
            windows[n] = self.window(hit[n])
        middle = distance[len(distance) // 2]
        laid = laid[np.argsort(-middle[laid])]
        lit = np.flatnonzero(flash > FAINTEST_FLASH)
        return _Chosen(_padded(lit, len(flash)), _padded(laid, len(flash)), windows)

    def window(self, hit: Bool[np.ndarray, "row column"]) -> tuple[int, int, int]:
        """Return the smallest window around corners: size, first row and column."""
        camera, first, need = self.film.camera, [], []
        shape = camera.height, camera.width
        for axis, size in enumerate(shape):
            at = np.flatnonzero(hit.any(axis=1 - axis)) * STRIDE
            # a ray is in one of the cells around the corner nearest to it
            first.append(max(0, int(at[0]) - STRIDE))
            need.append(min(size, int(at[-1]) + STRIDE + 1) - first[-1])
        sizes = [_window_size(share, shape) for share in WINDOWS]
        which = next(
            i for i, size in enumerate(sizes) if all(np.less_equal(need, size))
        )
        return which, *np.minimum(first, np.subtract(shape, sizes[which]))


def _window_size(share: float, shape: tuple[int, int]) -> tuple[int, int]:
    """Return the rows and columns of a window."""
    return math.ceil(share * shape[0]), math.ceil(share * shape[1])


def _padded(numbers: Int[np.ndarray, " some"], size: int) -> tuple[np.ndarray, int]:
    """Return numbers of charges in an array of fixed size, and their count."""
    return np.pad(numbers, (0, size - len(numbers))), np.asarray(len(numbers))


def _single(tree: T) -> T:
    """Return a tree with its numbers in single precision."""
    return jax.tree.map(
        lambda x: x.astype(jnp.float32) if eqx.is_inexact_array(x) else x, tree
    )


@eqx.filter_jit
def _sights(
    scene: Scene,
    camera: Camera,
    path: CameraPath | None,
    table: GlowTable,
    appearance: Appearance,
    times: Float[Array, " instant"],
) -> _Sight:
    """Return camera and fireballs at instants."""

    def at(time: Float[Array, ""]) -> _Sight:
        here = camera if path is None else carried_camera(camera, path, time)
        axes = quaternion_matrix(here.quaternion)
        found = []
        for charge in scene.charges:
            ball = cloud(scene, charge, time)
            ends = table(ball)
            flash = disc_light(ball, ends, appearance) / appearance.daylight
            offset = ball.centre - here.position
            ball = dataclasses.replace(ball, centre=offset)
            found.append((ball, ends, flash, offset @ axes))
        every = jax.tree.map(lambda *x: jnp.stack(x), *found)
        return _Sight(here.position, here.quaternion, *every)

    return _single(jax.vmap(at)(times))


@eqx.filter_jit
def _rendered(
    view: _View, sights: _Sight, chosen: _Chosen, srgb: bool
) -> tuple[Float[Array, "frame height width"], Array]:
    """Return grey light and pictures; axes of the sights: frame, part of exposure."""
    camera = view.camera
    shape = camera.height, camera.width

    def instant(sight: _Sight) -> Float[Array, "3 height width"]:
        here = dataclasses.replace(
            camera, position=sight.position, quaternion=sight.quaternion, mount=""
        )
        rays = turned_rays(view.lens, here)
        behind = view.behind
        if isinstance(behind, Landscape):
            behind = behind.light(rays, 1.0 / jnp.max(camera.focal))

        def lit() -> Float[Array, "3 height width"]:
            centred = dataclasses.replace(rays, origin=jnp.zeros_like(rays.origin))
            surfaces = surfaces_seen(centred, image=False)

            def add(i, total):
                n = chosen.lit[0][i]
                ball = jax.tree.map(lambda x: x[n], sight.balls)
                factor = sphere_factor(ball.centre, ball.radius, surfaces)
                return total + sight.flash[n][:, None, None] * factor[None]

            start = jnp.ones_like(behind)
            return behind * jax.lax.fori_loop(0, chosen.lit[1], add, start)

        light = jax.lax.cond(chosen.lit[1] > 0, lit, lambda: behind)

        def lay(i, light):
            n = chosen.laid[0][i]
            ball, ends = jax.tree.map(lambda x: x[n], (sight.balls, sight.ends))
            which, *first = chosen.window[n]

            def within(size):
                def laid(light):
                    def cut(x):
                        start = (*[0] * (x.ndim - 2), *first)
                        return jax.lax.dynamic_slice(x, start, (*x.shape[:-2], *size))

                    part = dataclasses.replace(
                        rays,
                        direction=cut(rays.direction),
                        farthest=cut(rays.farthest),
                    )
                    seen = cloud_seen(ball, ends, ball.centre, part, view.appearance)
                    over = seen[:3] + (1.0 - seen[3])[None] * cut(light)
                    return jax.lax.dynamic_update_slice(light, over, (0, *first))

                return laid

            sizes = [_window_size(share, shape) for share in WINDOWS]
            return jax.lax.switch(which, [within(size) for size in sizes], light)

        return jax.lax.fori_loop(0, chosen.laid[1], lay, light)

    def frame(parts: _Sight) -> tuple[Array, Array]:
        now = instant(jax.tree.map(lambda x: x[0], parts))
        count = len(parts.position) - 1
        if not count:
            return _developed(now, now, srgb)
        rest = jax.tree.map(lambda x: x[1:], parts)
        added = jax.lax.scan(
            lambda total, one: (total + instant(one), None), jnp.zeros_like(now), rest
        )
        return _developed(now, added[0] / count, srgb)

    return jax.lax.map(frame, sights)


def _developed(
    now: Float[Array, "3 height width"],
    exposed: Float[Array, "3 height width"],
    srgb: bool,
) -> tuple[Float[Array, "height width"], Array]:
    """Return grey light of an instant, and the picture of an exposure."""
    grey = sum(w * x for w, x in zip(LUMINANCE, now, strict=True))
    if not srgb:
        return grey, jnp.moveaxis(exposed, 0, -1)

    def within(light: Float[Array, "3 height width"]) -> Float[Array, "3 height width"]:
        return jnp.moveaxis(toned(jnp.moveaxis(light, 0, -1)), -1, 0)

    # without light above full scale the tone is unchanged: half of the time is saved
    bright = jnp.max(exposed) > 1.0
    shown = jax.lax.cond(bright, within, lambda light: light, exposed)
    values = jnp.rint(255.0 * linear_to_srgb(shown)).astype(jnp.uint8)
    return grey, jnp.moveaxis(values, 0, -1)
