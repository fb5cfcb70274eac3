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
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, UInt8

from jblast.errors import InputError, argument
from jblast.files import refuse_existing, writing
from jblast.progress import counted
from jblast.scene import Camera, Scene
from jblast.sensors.camera import rendering
from jblast.sensors.camera.explosion import ExplosionViews
from jblast.sensors.camera.files.event_files import Written, check_suffix, write_events
from jblast.sensors.camera.files.recordings import ImageSequence, open_recording
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import CameraPath, pixels_moved
from jblast.sensors.camera.image import BACKGROUND
from jblast.sensors.camera.pixel import (
    DARKEST,
    NoiseModel,
    Pixel,
    grey_light,
    noisy_pixel,
    rounding,
)
from jblast.sensors.camera.rendering import View, view_of
from jblast.sensors.camera.stream import Block, event_stream
from jblast.sensors.camera.surroundings import Landscape
from jblast.waves.fireballs import fireball_growth_time

PIXELS = 1 << 22
"""Pixels of a block of frames: 100 MB of three channels in float64. Larger blocks use
more memory, smaller ones call the compiled program more often."""
BLOCK = 20
"""Largest number of frames or instants of a block: a second at 20, 60, 100 or 1000
frames per second is a whole number of blocks."""
Frames = Float[np.ndarray, "_ _ _ 3"]
STAMP_ERROR = 1e-4
"""Bound of the time error of an event [s]: a fifth of the response time of the noisy
camera's photoreceptor, and of its refractory period."""
EXACT_ERROR = 1e-6
"""Bound of that of an ideal camera that sees the law's fireball [s]: event files have
whole microseconds."""
RUN_ERROR = 2.5e-3
"""Bound of that of runs, which last for minutes [s]: a quarter of a frame at 100 Hz. On
average times of a flight are off by 0.02 to 0.15 ms; 1 ms takes twice the instants."""
LIGHT_ERROR = 5e-4
"""Bound of the error of the logarithm of light for a camera with resets, in thresholds:
found by trial, so that 99 in 100 of its events are within `STAMP_ERROR` too."""
JUMP = 1 / 16
"""Resolution of the time of a jump of the light, as a share of the bound of times: a
jump has no finer interval in which its logarithm is linear."""
QUARTERS = 4.0
"""Time error of an interval that passes, over that of the quarters which are returned:
a kink or a jump is in one of them, and smooth light is off by a sixteenth."""
LEFT = 0.01
"""Accepted share of the events of an interval outside the bound."""
PER_AGE = 4
"""First instants of a fireball: the age between two grows by a quarter. Fireballs and
smoke change in proportion to their age, and intervals are sampled at their quarters."""
MOVED = 4.0
"""Shift of the ground between first instants of a moving camera [px]. Intervals are
sampled at their quarters, each pixel; the finest pattern repeats after two pixels."""
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
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        appearance: Exposure, and distribution of the smoke; None: defaults.
        path: Pose of the camera's carrier over time; None for a fixed camera.
        gain: Factor of the light of frames (`image.picture_gain`); not for events.
        dtype: Precision of the light of events; None for that of the scene.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    background: float | Float[np.ndarray, "..."] | ImageSequence | Landscape = (
        BACKGROUND
    )
    views: ExplosionViews | None = None
    depth: Float[np.ndarray, "height width"] | None = None
    appearance: Appearance | None = None
    path: CameraPath | None = None
    gain: float = 1.0
    dtype: Any = None

    def frames(self) -> Iterator[tuple[slice, Frames]]:
        """Yield slice and frames of each block, rendered while the last one is used.

        Linear light, full scale 1, not clipped.

        Raises:
            InputError: A file of the background cannot be read, or has another size
                than the image; and as in `render`.
        """
        count, size = len(self.times), self._block

        def done(which: slice, found: Future[Frames]) -> tuple[slice, Frames]:
            return which, found.result()

        waiting: deque[tuple[slice, Future[Frames]]] = deque()
        with ThreadPoolExecutor(1) as ahead:
            for start in range(0, count, size):
                which = slice(start, min(start + size, count))
                waiting.append((which, ahead.submit(self.shot, self.times[which])))
                if len(waiting) > 1:
                    yield done(*waiting.popleft())
            yield done(*waiting.popleft())

    def shot(self, times: Float[np.ndarray, " _"]) -> Frames:
        """Return the frames that begin at some times."""
        return self._rendered(self._view, times)

    def levels(
        self, times: Float[np.ndarray, " _"]
    ) -> UInt8[np.ndarray, "_ _ _ channel"]:
        """Return the frames that begin at some times, sRGB of 8 bits."""
        return self._rendered(self._view, times, rendering.levels)

    def instants(self, times: Float[np.ndarray, " _"]) -> Frames:
        """Return the light of some instants, without exposure and gain."""
        return self._rendered(self._still, times)

    def light(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ _ _"]:
        """Return the grey light of some instants, as event cameras see it.

        A moving background is linear between its frames.
        """
        return self._rendered(self._still, times, rendering.grey)

    def stamp_error_s(self, *, noise: bool) -> float:
        """Return the bound of the time error of all but `LEFT` of the events [s].

        Pictures are interpolated between times that are milliseconds apart, so that
        their light is not known to a microsecond.

        Args:
            noise: True for a camera with its imperfections.
        """
        return EXACT_ERROR if self.views is None and not noise else STAMP_ERROR

    @property
    def _block(self) -> int:
        """Number of frames that are rendered together."""
        pixels = self.camera.width * self.camera.height
        return max(1, min(BLOCK, PIXELS // pixels))

    def _rendered(
        self, view: View, times: Float[np.ndarray, " _"], shown: Any = rendering.colours
    ) -> np.ndarray:
        """Return images of some times; one compiled program serves all blocks."""
        clock = np.pad(times, (0, -len(times) % self._block), mode="edge")
        behind, done = None, []
        for start in range(0, len(clock), self._block):
            now = clock[start : start + self._block]
            if isinstance(self.background, ImageSequence):
                # a moving background starts with the film, whatever the clock
                behind = self.background.at(now - self.times[0])
            images = rendering.frames(view, now, behind, shown=shown)
            done.append(np.asarray(images))
        return np.concatenate(done)[: len(times)]

    @cached_property
    def _view(self) -> View:
        """The view of frames, in single precision."""
        return self._seen(self.camera, jnp.float32, self.gain)

    @cached_property
    def _still(self) -> View:
        """The view of events, without exposure."""
        none = jnp.zeros_like(self.camera.exposure_s)
        return self._seen(replace(self.camera, exposure_s=none), self.dtype)

    def _seen(self, camera: Camera, dtype: Any, gain: float = 1.0) -> View:
        behind = self.background
        return view_of(
            self.scene,
            camera,
            BACKGROUND if isinstance(behind, ImageSequence) else behind,
            depth=self.depth,
            appearance=self.appearance,
            views=self.views,
            path=self.path,
            gain=gain,
            dtype=dtype,
            reverse=False,
        )


def first_instants(film: Film) -> Float[np.ndarray, " time"]:
    """Return the first instants to evaluate, from the first frame to the last [s].

    They resolve the age of fireballs, from the detonation on; the frames of pictures
    that replace them; the frames of a moving background; and the motion of the camera.
    """
    start, stop = float(film.times[0]), float(film.times[-1])
    found = [np.array([start, stop])]
    for charge in film.scene.charges:
        burst, mass = float(charge.time_s), charge.tnt_mass("fireball_radius_m")
        first, last = 0.25 * float(fireball_growth_time(mass)), stop - burst
        if last > first:
            count = math.log(last / first) / math.log1p(1.0 / PER_AGE)
            ages = first * (1.0 + 1.0 / PER_AGE) ** np.arange(count)
            found.append(burst + np.append(0.0, ages))
        if film.views is not None:
            found.append(burst + film.views.instants(charge))
    if isinstance(film.background, ImageSequence):
        found.append(start + film.background.times)
    if film.path is not None:
        moved = np.asarray(pixels_moved(film.camera, film.path), float)
        shifts = np.arange(0.0, moved[-1], MOVED)
        found.append(np.interp(shifts, moved, np.asarray(film.path.time, float)))
    inside = np.concatenate(found)
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
    knots, begin = first_instants(film), 1
    last = knots[0], film.light(knots[:1])[0]
    yield last
    intervals: deque[Interval] = deque()
    while intervals or begin < len(knots):
        # enough intervals for a whole block of middles
        if begin < len(knots) and len(_untested(intervals)) < BLOCK:
            part = knots[begin : begin + BLOCK]
            ends = [last, *zip(part, film.light(part), strict=True)]
            intervals.extend(
                Interval((a[0], b[0]), (a[1], b[1])) for a, b in pairwise(ends)
            )
            begin, last = begin + BLOCK, ends[-1]
        _refine(intervals, film, bounds)
        while intervals and len(intervals[0].times) == 3:
            interval = intervals.popleft()
            yield interval.times[1], interval.light[1]
            yield interval.times[2], interval.light[2]


def _untested(intervals: deque[Interval]) -> list[int]:
    """Return the places of the intervals without a middle."""
    return [i for i, interval in enumerate(intervals) if len(interval.times) == 2]


def _refine(intervals: deque[Interval], film: Film, bounds: _Bounds) -> None:
    """Evaluate the middles of the first intervals without one; halve coarse ones."""
    # one block of middles at a time: the program has a fixed number of frames
    front = _untested(intervals)[:BLOCK]
    middles = [0.5 * sum(intervals[i].times) for i in front]
    images = film.light(np.array(middles))
    tested = []
    for i, image in zip(front, images, strict=True):
        (start, stop), (before, after), _ = intervals[i]
        light = before, image, after
        tested.append((light, _is_fine(float(stop - start), light, bounds)))
    # from the back, so that an insertion does not shift the indices before it
    for i, time, (light, fine) in reversed([*zip(front, middles, tested, strict=True)]):
        (start, stop), _, is_half = intervals[i]
        fine = bool(fine)
        if fine and is_half:
            intervals[i] = Interval((start, time, stop), light)
        else:
            intervals[i] = Interval((time, stop), light[1:], fine)
            intervals.insert(i, Interval((start, time), light[:2], fine))


@jax.jit
def _is_fine(length, light, bounds: _Bounds) -> Bool[Array, ""]:
    """Return True if an interval with its middle satisfies the bounds."""
    before, middle, after = (jnp.log(jnp.maximum(image, DARKEST)) for image in light)
    # total change: proportional to the number of events, also for a peak between the
    # ends
    passed = jnp.abs(middle - before) + jnp.abs(after - middle)
    # light is not more exact than its rounding
    off = jnp.abs(middle - 0.5 * (before + after)) - rounding(middle)
    # d T / D of the module's docstring, without a division by a change of zero
    bound = QUARTERS * bounds.time_s
    late = (off * length > bound * jnp.abs(after - before)) & (length > bound)
    # two linear halves have a quarter of the error of one (quadratic light)
    dark = (off > 4.0 * bounds.light) & (length > JUMP * bounds.time_s)
    total, bad = passed.sum(), jnp.where(late | dark, passed, 0.0).sum()
    return (total <= QUIET * bounds.threshold) | (bad <= LEFT * total)


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
