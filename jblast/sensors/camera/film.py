r"""Frames of a scene in order of time, and the instants sampled for events.

A film is rendered block by block, so that its length does not affect the memory.

For events the light is sampled at separate instants, and its logarithm is linear
between two of them. An interval is halved as long as its middle shows that this shifts
events by more than a bound. If the logarithm in the middle is off by $d$ and changes by
$D$ over the length $T$, a crossing is shifted by $d\,T/D$, and by less than $T$ in any
case. Both halves must satisfy the bound too: a jump on a slope may leave the middle
unchanged, but not that of the next interval.

This bounds the events of an ideal camera, whose levels are fixed. A pixel that is reset
takes its next reference from the light between two instants, and an error of the light
in a steep interval shifts an event in a slow one. For such a camera the error of the
light is bounded, too.

A recorded film is converted into a file of the events of an event camera, block by
block.
"""

import math
import os
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, argument
from jblast.files import refuse_existing, writing
from jblast.progress import counted
from jblast.scene import Camera, Scene
from jblast.sensors.camera.billboards import ViewSet
from jblast.sensors.camera.files.event_files import Written, check_suffix, write_events
from jblast.sensors.camera.files.recordings import ImageSequence, open_recording
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import CameraPath, pixels_moved
from jblast.sensors.camera.image import BACKGROUND, bare, images, luminance
from jblast.sensors.camera.pixel import (
    DARKEST,
    NoiseModel,
    Pixel,
    grey_light,
    noisy_pixel,
    rounding,
)
from jblast.sensors.camera.rendering import check_camera, render, render_carried
from jblast.sensors.camera.stream import Block, event_stream
from jblast.sensors.camera.surroundings import Landscape, Outlook, outlook_of
from jblast.waves.fireball import fireball_duration, fireball_growth_time

PIXELS = 1 << 22
"""Pixels of a block of frames: 100 MB of three channels in float64. Larger blocks use
more memory, smaller ones call the compiled program more often."""
MAX_BLOCK = 20
"""Largest number of frames of a block: a second at 20, 60, 100 or 1000 frames per
second is a whole number of blocks, so that none is padded."""
Frames = Float[np.ndarray, "_ _ _ 3"]
STAMP_ERROR = 1e-4
"""Bound of the time error of an event [s]: a fifth of the response time of the noisy
camera's photoreceptor, and of its refractory period."""
EXACT_ERROR = 1e-6
"""Bound of that of an ideal camera [s]: event files have whole microseconds."""
LIGHT_ERROR = 5e-4
"""Bound of the error of the logarithm of light for a camera with resets, in thresholds:
found by trial, so that 99 in 100 of its events are within `STAMP_ERROR` too."""
JUMP = 1 / 16
"""Resolution of the time of a jump of the light, as a share of the bound of times: a
jump has no finer interval in which its logarithm is linear."""
LEFT = 0.01
"""Accepted share of the events of an interval outside the bound."""
PER_LIFE = 32
"""First instants over the time a fireball glows: passages of a pixel last longer."""
MOVED = 0.5
"""Shift of the ground between first instants of a moving camera [px]. At a whole pixel
or more, a fine pattern may look the same and be missed."""
BLOCK = 16
"""Instants of a block. Full blocks of one size share one compiled program."""
QUIET = 1e-3
"""Sum of the changes of all pixels, in thresholds, up to which an interval is not
refined: on average a thousandth of an event is affected."""
THRESHOLD = (0.2, 0.2)
"""Default change of the logarithm of light per event, up and down."""


@dataclass(frozen=True)
class Film:
    """A scene, a camera, and the times of the frames.

    Attributes:
        scene: The scene.
        camera: The camera.
        times: Times of the frames on the common clock, not falling [s].
        background: Linear light: a grey, a colour, an image, or moving pictures; or
            ground and sky for a moving camera.
        views: Pictures that replace the procedural fireball.
        supersample: Rays along each side of a pixel.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        appearance: Exposure, and distribution of the smoke; None: defaults.
        path: Pose of the camera's carrier over time; None for a fixed camera.
        gain: Factor of the light of frames (`image.picture_gain`); not for events.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    background: float | Float[np.ndarray, "..."] | ImageSequence | Landscape = (
        BACKGROUND
    )
    views: ViewSet | None = None
    supersample: int = 1
    depth: Float[np.ndarray, "height width"] | None = None
    appearance: Appearance | None = None
    path: CameraPath | None = None
    gain: float = 1.0

    def at_instants(self) -> "Film":
        """Return the film without exposure: event cameras do not integrate light."""
        return self._still

    @cached_property
    def _still(self) -> "Film":
        # zero keeps the field's structure, so that the compiled program is shared
        camera = eqx.tree_at(
            lambda c: c.exposure_s, self.camera, 0.0 * self.camera.exposure_s
        )
        return replace(self, camera=camera)

    def frames(self) -> Iterator[tuple[slice, Frames]]:
        """Yield slice and frames of each block; two blocks are in memory.

        Linear light, full scale 1, not clipped.

        Raises:
            InputError: A file of the background cannot be read, or has another size
                than the image; and as in `render`.
        """
        length = self._length()
        for start in range(0, len(self.times), length):
            which = slice(start, min(start + length, len(self.times)))
            yield which, self._shot(self._rendered(self.times[which]))

    def some(self, numbers: Sequence[int]) -> Frames:
        """Return some frames by their numbers, as instants."""
        still, length = self.at_instants(), self._length()
        parts = [numbers[a : a + length] for a in range(0, len(numbers), length)]
        frames = [still._rendered(self.times[part]) for part in parts]
        return self._shot(np.concatenate(frames))

    def light(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ _ _"]:
        """Return the grey light at some instants, without exposure.

        A moving background is linear between its frames.
        """
        still, length = self.at_instants(), self._length()
        parts = [slice(a, a + length) for a in range(0, len(times), length)]
        frames = [still._rendered(times[part]) for part in parts]
        return np.concatenate([luminance(part) for part in frames])

    def _shot(self, frames: Frames) -> Frames:
        """Return frames with the gain of a picture."""
        return frames if self.gain == 1.0 else self.gain * frames

    def _length(self) -> int:
        """Return the number of frames that are rendered together."""
        pixels = self.camera.width * self.camera.height
        return max(1, min(MAX_BLOCK, PIXELS // pixels))

    def _rendered(self, times: Float[np.ndarray, " few"]) -> Frames:
        """Return linear light at a few times."""
        count = len(times)
        # padded to the size of a block, so that one compiled program serves all
        times = np.pad(times, (0, self._length() - count), mode="edge")
        background = self._behind
        if isinstance(background, ImageSequence):
            # a moving background starts with the film, whatever the clock
            background = background.at(times - self.times[0])
        if self.path is not None:
            if not isinstance(background, Landscape):
                size = len(times), self.camera.height, self.camera.width, 3
                background = np.broadcast_to(background, size)
            carried = render_carried(
                self.scene,
                self.camera,
                self.path,
                times,
                background=background,
                supersample=self.supersample,
                appearance=self._shown,
                views=self.views,
            )
            return np.asarray(carried)[:count]
        assert not isinstance(background, Landscape), "needs the path of a camera"
        # before the first charge there is only the background: nothing is rendered
        if times.max() + float(self.camera.exposure_s) <= self._begins:
            check_camera(self.camera, ground=self._ground)
            return bare(self.camera, background, len(times))[:count]
        frames = render(
            self.scene,
            self.camera,
            times,
            background=background,
            depth=self.depth,
            appearance=self._shown,
            ground=self._ground,
            supersample=self.supersample,
            views=self.views,
            outlook=self._outlook,
        )
        return np.asarray(frames)[:count]

    @cached_property
    def _behind(
        self,
    ) -> Float[Array, "..."] | ImageSequence | Landscape:
        """Background; a grey or colour becomes an image, once for all blocks."""
        if isinstance(self.background, ImageSequence | Landscape):
            return self.background
        return images(self.camera, self.background, len(self.times))

    @cached_property
    def _shown(self) -> Appearance:
        """Appearance; created once, because its arrays are on the device."""
        return self.appearance or Appearance()

    @cached_property
    def _begins(self) -> float:
        """Time of the first detonation, before which only the background shows [s]."""
        return min(float(charge.time_s) for charge in self.scene.charges)

    @property
    def _ground(self) -> bool:
        """False with pictures: from above they also show parts below the ground."""
        return self.views is None

    @cached_property
    def _outlook(self) -> Outlook:
        """Outlook of a fixed camera, computed once for all blocks."""
        appearance, views = self._shown, self.views
        return outlook_of(
            self.camera,
            None if self.depth is None else jnp.asarray(self.depth, float),
            ground=self._ground,
            supersample=self.supersample,
            lit=appearance.flash and (views is None or views.glows),
            lit_ground=True,
        )


def growth_instants(scene: Scene) -> Float[np.ndarray, " time"]:
    """Return the instants that resolve the growth of all fireballs, unsorted [s].

    The detonation and ten instants after it, each twice as late as the one before.
    """
    found = []
    for charge in scene.charges:
        mass = charge.tnt_mass("fireball_radius_m")
        growth = float(fireball_growth_time(mass))
        late = growth * 0.25 * np.append(0.0, 2.0 ** np.arange(10))
        found.append(float(charge.time_s) + late)
    return np.concatenate(found)


def first_instants(film: Film) -> Float[np.ndarray, " time"]:
    """Return the first instants to evaluate, from the first frame to the last [s].

    They resolve the fireball's life, densely after a burst; or the frames of pictures
    that replace it; and the frames of a moving background.
    """
    start, stop = float(film.times[0]), float(film.times[-1])
    charges = film.scene.charges
    bursts = np.array([float(charge.time_s) for charge in charges])
    masses = [charge.tnt_mass("fireball_radius_m") for charge in charges]
    # the shortest life decides for all charges
    step = min(float(fireball_duration(mass)) for mass in masses) / PER_LIFE
    found = [bursts]
    if film.views is None:
        found.append(growth_instants(film.scene))
    else:
        for burst, charge in zip(bursts, charges, strict=True):
            found.append(burst + film.views.instants(charge))
    if isinstance(film.background, ImageSequence):
        found.append(start + film.background.times)
    if film.path is not None:
        moved = np.asarray(pixels_moved(film.camera, film.path), float)
        shifts = np.arange(0.0, moved[-1], MOVED)
        found.append(np.interp(shifts, moved, np.asarray(film.path.time, float)))
    even = np.linspace(start, stop, 1 + max(1, int(np.ceil((stop - start) / step))))
    inside = np.concatenate([even, *found])
    inside = np.unique(inside[(inside >= start) & (inside <= stop)])
    # instants that differ only by rounding are merged
    apart = np.diff(inside, prepend=-np.inf) > 1e-9 * (stop - start)
    return inside[apart]


class Interval(NamedTuple):
    """Interval between two instants, with its middle once that is sufficient.

    Attributes:
        times: Both ends, or ends and middle [s].
        light: Light at these times.
        is_half: True for half of an interval whose middle satisfied the bounds.
    """

    times: tuple[float, ...]
    light: tuple[Float[np.ndarray, "height width"], ...]
    is_half: bool = False


class _Bounds(NamedTuple):
    """Bounds that an interval must satisfy; see `subdivided`."""

    threshold: float
    time_s: float
    light: float


def subdivided(
    film: Film,
    threshold: float,
    bound_s: float = STAMP_ERROR,
    light_error: float = math.inf,
) -> Iterator[Block]:
    """Yield times [s] and grey light of a film, close enough together for events.

    Blocks have `BLOCK` instants except the last.

    Args:
        film: The film; its exposure is not used.
        threshold: The smaller threshold: smaller changes cause no events.
        bound_s: Bound of the time error of all but `LEFT` of an ideal camera's events
            [s].
        light_error: Bound of the error of the logarithm of light, for all but `LEFT` of
            its changes.
    """
    times: list[float] = []
    light: list[np.ndarray] = []
    for time, image in _instants(film, _Bounds(threshold, bound_s, light_error)):
        times.append(time)
        light.append(image)
        if len(times) == BLOCK:
            yield np.array(times), np.stack(light)
            times, light = [], []
    if times:
        yield np.array(times), np.stack(light)


def _instants(film: Film, bounds: _Bounds):
    """Yield time and image of one instant after another."""
    knots = first_instants(film)
    last = knots[0], film.light(knots[:1])[0]
    yield last
    for begin in range(1, len(knots), BLOCK):
        part = knots[begin : begin + BLOCK]
        ends = [last, *zip(part, film.light(part), strict=True)]
        intervals = deque(
            Interval((a[0], b[0]), (a[1], b[1])) for a, b in pairwise(ends)
        )
        while intervals:
            while intervals and len(intervals[0].times) == 3:
                interval = intervals.popleft()
                yield interval.times[1], interval.light[1]
                yield interval.times[2], interval.light[2]
            _refine(intervals, film, bounds)
        last = ends[-1]


def _refine(intervals: deque[Interval], film: Film, bounds: _Bounds) -> None:
    """Evaluate the middles of the first intervals without one; halve coarse ones."""
    # one block of middles at a time: the program has a fixed number of frames
    front = [i for i, interval in enumerate(intervals) if len(interval.times) == 2][
        :BLOCK
    ]
    if not front:
        return
    middles = [0.5 * sum(intervals[i].times) for i in front]
    images = film.light(np.array(middles))
    # from the back, so that an insertion does not shift the indices before it
    for i, time, image in reversed(list(zip(front, middles, images, strict=True))):
        (start, stop), (before, after), is_half = intervals[i]
        light = before, image, after
        fine = _is_fine(stop - start, light, bounds)
        if fine and is_half:
            intervals[i] = Interval((start, time, stop), light)
        else:
            intervals[i] = Interval((time, stop), light[1:], fine)
            intervals.insert(i, Interval((start, time), light[:2], fine))


def _is_fine(length: float, light, bounds: _Bounds) -> bool:
    """Return True if an interval with its middle satisfies the bounds."""
    before, middle, after = (np.log(np.maximum(image, DARKEST)) for image in light)
    # total change: proportional to the number of events, also for a peak between the
    # ends
    passed = np.abs(middle - before) + np.abs(after - middle)
    if passed.sum() <= QUIET * bounds.threshold:
        return True
    # light is not more exact than its rounding
    off = np.abs(middle - 0.5 * (before + after)) - rounding(middle)
    bad = np.zeros(passed.shape, bool)
    if length > bounds.time_s:
        # d T / D of the module's docstring, without a division by a change of zero
        bad |= off * length > bounds.time_s * np.abs(after - before)
    if length > JUMP * bounds.time_s:
        # two linear halves have a quarter of the error of one (quadratic light)
        bad |= off > 4.0 * bounds.light
    return bool(passed[bad].sum() <= LEFT * passed.sum())


class ConvertedFilm(NamedTuple):
    """Events of a converted film.

    Attributes:
        frames: Number of frames.
        width: Width of a frame [px].
        height: Height of a frame [px].
        frames_hz: Frames per second.
        seconds: Time from the first frame to the last.
        threshold: Change of the logarithm of light per event, up and down.
        written: Numbers of events.
        bits: Bit depth of the frames; None for floats.
        darkest: Linear light, as a fraction of full scale, below which changes cause no
            events.
        below_darkest: Share of the pixel values below that.
    """

    frames: int
    width: int
    height: int
    frames_hz: float
    seconds: float
    threshold: tuple[float, float]
    written: Written
    bits: int | None
    darkest: float
    below_darkest: float


def film_to_events(
    film: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    fps: float | None = None,
    threshold: tuple[float, float] = THRESHOLD,
    noise: bool = True,
    seed: int = 0,
    srgb: bool = False,
    darkest: float | None = None,
    force: bool = False,
) -> ConvertedFilm:
    """Write the events of a film, block by block, as `jblast events` does.

    Args:
        film: Folder of PNG frames or of .npy files of linear light, or a video.
        out: Event file: .h5 (HDF5 in the layout of DSEC), .npz, .raw or .aedat4.
        fps: Frames per second; required for a folder.
        threshold: Change of the logarithm of light per event, up and down.
        noise: True for a camera with its imperfections.
        seed: Seed of the noise.
        srgb: True if grey values of PNG frames are sRGB, else linear light.
        darkest: Linear light, as a fraction of full scale, below which changes cause no
            events; default: half a step of the frames' bits, 1e-6 for floats.
        force: True to overwrite the file.

    Raises:
        InputError: The film cannot be read, the file cannot be written, or an argument
            cannot be used.
    """
    check_suffix(Path(out), writing=True)
    refuse_existing(out, force=force)
    opened = open_recording(os.fspath(film), fps, srgb=srgb)
    if srgb and opened.is_video:
        raise InputError(
            f"{argument('srgb')}: expected PNG frames, got {film}, which states its "
            "own curve"
        )
    darkest = opened.darkest if darkest is None else darkest
    if darkest == 0.0:
        raise InputError(
            f"{argument('darkest')}: expected a number above 0 and at most 1, got 0"
        )
    through, dark = counted(len(opened), "frames"), 0
    floor = np.searchsorted(grey_light(srgb=srgb), darkest)  # of 8 bits

    def blocks() -> Iterator[Any]:
        nonlocal dark
        done = 0
        for times, frames in opened.blocks(decoded=False):
            whole = frames.dtype == np.uint8
            dark += np.count_nonzero(frames < (floor if whole else darkest))
            yield times, frames
            done += len(times)
            through(done)

    pixel = Pixel(*threshold)
    if noise:
        shape = opened.height, opened.width
        pixel = noisy_pixel(jax.random.key(seed), threshold, NoiseModel(), shape)
    events = event_stream(blocks(), pixel, srgb=srgb, darkest=darkest)
    seconds = float(opened.times[-1])
    with writing(out):
        written = write_events(
            Path(out), events, opened.width, opened.height, duration_s=seconds
        )
    return ConvertedFilm(
        frames=len(opened),
        width=opened.width,
        height=opened.height,
        frames_hz=opened.frames_hz,
        seconds=seconds,
        threshold=threshold,
        written=written,
        bits=opened.bits,
        darkest=darkest,
        below_darkest=int(dark) / (len(opened) * opened.width * opened.height),
    )
