"""Event cameras and views of an explosion: cost against error.

Events: methods to find their times, and the cost of each effect of a real camera. The
scene is a bright disc whose edge moves, with known events
(`verification.simulated_recordings`). The camera of the second chart sees it in grey
values of 8 bits, and 0.92 s more of the disc at rest.

Views: interpolation between sides and between frames. Between sides: the eight views
left out of the set that is part of jblast, at their ten phases, compared with the
interpolation from that set. Between frames: eight views of the set at phases removed
from it, every second one, so that the gaps are twice as wide as its own. Likeness is
over the pixels of the fire in either picture (sRGB luminance on a grey background); the
cost of a frame is that of a film.
"""

import functools
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.fidelity.timing import best_of
from jblast.progress import in_words
from jblast.sensors.camera import ExplosionViews, explosion_views
from jblast.sensors.camera.events.exact import frameless_events
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.noise import IDEAL, NoiseModel, noisy_stream
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.image import psnr, ssim
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.simulated_recordings import (
    DURATION,
    LEFT_OUT,
    SHAPE,
    THRESHOLD,
    WIDTH,
    analytic,
    close_up,
    disc_frames,
    disc_light,
    film,
    filmed,
    passed_wholly,
    processor_seconds,
)

FRAMES = 32
"""Of the film that is timed."""
EVERY = 4
"""Of the views that are looked at between frames."""
Pair = tuple[ExplosionViews, int, int]
"""The set that has a view, the view, and the frame."""
# The least of five: other load can only lengthen a call.
REPEATS = 5
# Frames a call: as many as the film has, so that one call is timed.
BLOCK = 32
BOTH = (THRESHOLD, THRESHOLD)
# From slow motion of a telephone to a laboratory camera.
FPS = (100, 300, 1000, 3000, 10000)
SOLVED = 1e-9
"""Crossings are solved for to this [s]: no error below it is told."""
STILL_TO = 1.0
"""So long does the real camera look [s]."""
SAME_EVENT_S = 0.2e-3
"""Events of one pixel and sign are the same within this [s]."""
USUAL = NoiseModel()
EFFECTS = {
    "none of them": IDEAL,
    "mismatch": IDEAL._replace(mismatch=USUAL.mismatch),
    "bandwidth": IDEAL._replace(bandwidth_hz=USUAL.bandwidth_hz),
    "leak and hot pixels": IDEAL._replace(
        leak_hz=USUAL.leak_hz, hot_fraction=USUAL.hot_fraction, hot_hz=USUAL.hot_hz
    ),
    "shot noise": IDEAL._replace(shot_hz=USUAL.shot_hz),
    "refractory time": IDEAL._replace(refractory_s=USUAL.refractory_s),
    "mismatch and bandwidth": IDEAL._replace(
        mismatch=USUAL.mismatch, bandwidth_hz=USUAL.bandwidth_hz
    ),
}
"""Cameras between an ideal one and `USUAL`."""


class NearerFrame(ExplosionViews):
    """The same pictures, of which the nearer one in time is shown."""

    def frames_at(
        self, phase: Float[Array, ""]
    ) -> tuple[Int[Array, "1"], Float[Array, "1"]]:
        """Return the nearer of the two frames, and how much of it is there."""
        frames, parts = super().frames_at(phase)
        return frames[jnp.argmax(parts)][None], jnp.sum(parts)[None]


def nearer(views: ExplosionViews) -> NearerFrame:
    """Return pictures of which the nearer one in time is shown."""
    return NearerFrame(
        **{part.name: getattr(views, part.name) for part in fields(views)}
    )


def thinned(views: ExplosionViews) -> ExplosionViews:
    """Return every second frame of a set."""
    kept: dict[str, Any] = {
        name: getattr(views, name)[:, ::2]
        for name in ("frames", "radius", "spread", "box")
    }
    return replace(views, **kept, height=views.height[::2], phase=views.phase[::2])


def likeness(
    views: ExplosionViews, pairs: Iterator[Pair]
) -> tuple[Float[np.ndarray, " picture"], Float[np.ndarray, " picture"]]:
    """Return PSNR [dB] and SSIM of pictures that a set shows, one for each pair."""
    found = []
    for shown, view, frame in pairs:
        true, seen = (close_up(one, shown, view, frame) for one in (shown, views))
        fire = true.fire | seen.fire
        found.append(
            (psnr(true.grey, seen.grey, fire), ssim(true.grey, seen.grey, fire))
        )
    peak, structure = np.array(found).T
    return peak, structure


def between_sides(left_out: ExplosionViews) -> Iterator[Pair]:
    """Yield the pictures left out."""
    for view in range(len(left_out.direction)):
        for frame in range(len(left_out.phase)):
            yield left_out, view, frame


def between_frames(views: ExplosionViews, every: int = EVERY) -> Iterator[Pair]:
    """Yield the pictures between those of every second frame, of some views."""
    for view in range(0, len(views.direction), every):
        for frame in range(1, len(views.phase) - 1, 2):
            yield views, view, frame


def view_points() -> list[BenchmarkPoint]:
    """Return what each way costs a frame, and how unlike the truth it is."""
    tell, views = in_words(), explosion_views()
    three, left_out = replace(views, sides=3), explosion_views(LEFT_OUT)
    few = thinned(views)
    ways: tuple[
        tuple[str, str, ExplosionViews, ExplosionViews, Callable[[], Iterator[Pair]]],
        ...,
    ] = (
        (
            "nearest view",
            "between sides",
            views,
            views,
            lambda: between_sides(left_out),
        ),
        (
            "three around",
            "between sides",
            three,
            three,
            lambda: between_sides(left_out),
        ),
        (
            "nearer frame",
            "between frames",
            nearer(views),
            nearer(few),
            lambda: between_frames(views),
        ),
        ("two mixed", "between frames", views, few, lambda: between_frames(views)),
    )
    points = []
    for name, panel, timed, shows, pairs in ways:
        tell(name)
        peak, structure = likeness(shows, pairs())
        text = (
            f"SSIM {structure.mean():.3f}, {structure.min():.3f} to "
            f"{structure.max():.3f}; PSNR {peak.mean():.1f} dB, {peak.min():.1f} to "
            f"{peak.max():.1f}; {len(peak)} pictures"
        )
        error = 1.0 - float(structure.mean())
        cost = processor_seconds(timed, filmed(FRAMES))
        points.append(BenchmarkPoint(name, cost, error, text, panel))
    return points


register_benchmark(
    Benchmark(
        name="views",
        title="Views of an explosion: cost against likeness",
        cost="time of a processor for a frame of 640 x 480 pixels, float64",
        error="1 - SSIM over the fire's pixels",
        measure=view_points,
        relative=False,
    )
)


class Sent(NamedTuple):
    """Events in any order.

    Attributes:
        pixel: Row by row.
        time: Seconds.
        sign: +1 brighter, -1 darker.
    """

    pixel: Int[np.ndarray, " event"]
    time: Float[np.ndarray, " event"]
    sign: Int[np.ndarray, " event"]


def sent(parts: Iterator[Events]) -> Sent:
    """Return the events of all parts."""
    fields = [
        (np.asarray(e.y) * WIDTH + e.x, e.time, e.polarity, int(e.count)) for e in parts
    ]
    pixel, time, sign = (
        np.concatenate([np.asarray(f[i])[: f[3]] for f in fields]) for i in range(3)
    )
    return Sent(pixel, time, sign)


def _blocks(times: np.ndarray, frames: np.ndarray) -> Iterator[tuple]:
    for a in range(0, len(times), BLOCK):
        yield times[a : a + BLOCK], frames[a : a + BLOCK]


def of_frames(fps: int) -> Sent:
    """Return events of float frames, the logarithm of light linear between them."""
    times, logs = film(fps)
    return sent(stream_events(_blocks(times, logs), BOTH, in_logarithms=True))


def of_bytes(fps: int) -> Sent:
    """Return the same of frames of 8 bits."""
    times, logs = film(fps)
    return sent(stream_events(_blocks(times, grey(logs)), BOTH))


def of_bytes_stamped(fps: int) -> Sent:
    """Return these events with the time of the frame that shows them."""
    found = of_bytes(fps)
    return found._replace(time=np.ceil(found.time * fps - 1e-6) / fps)


def of_functions(fps: int) -> Sent:
    """Return events without frames, of light first sampled so often a second."""
    times = np.linspace(0.0, DURATION, max(2, round(DURATION * fps) + 1))
    return sent(iter([frameless_events(disc_light, SHAPE, times, BOTH)]))


def grey(logs: Float[np.ndarray, "..."]) -> np.ndarray:
    """Return grey values of 8 bits."""
    return np.round(255.0 * np.exp(logs)).astype(np.uint8)


WAYS: tuple[tuple[str, Callable[[int], Sent], int], ...] = (
    *((f"frames, {fps:,}/s", of_frames, fps) for fps in FPS),
    ("8 bits, 1,000/s", of_bytes, 1000),
    ("8 bits at frame's end, 1,000/s", of_bytes_stamped, 1000),
    ("frameless from 30/s", of_functions, 30),
    ("frameless from 1,000/s", of_functions, 1000),
)


def stamp_errors(found: Sent) -> tuple[Float[np.ndarray, " event"], int, int]:
    """Compare events with those known, where the edge passed wholly.

    Returns:
        How far off each time is [s], of pixels that sent as many as they should; how
        many pixels there are; how many of them sent another number.
    """
    whole = passed_wholly()
    known, _, when = analytic()
    order = np.lexsort((found.time, found.pixel))
    pixel, time = found.pixel[order], found.time[order]
    events, truth = (np.bincount(p, minlength=whole.size) for p in (pixel, known))
    right = whole & (events == truth)
    off = np.abs(time[right[pixel]] - when[right[known]])
    return off, int(whole.sum()), int((whole & ~right).sum())


def stamp_points(repeats: int = REPEATS) -> list[BenchmarkPoint]:
    """Return what each way costs, and how far its times are off.

    Args:
        repeats: How often each is timed.
    """
    tell = in_words()
    points = []
    for name, way, fps in WAYS:
        tell(name)
        took, found = best_of(functools.partial(way, fps), repeats)
        off, pixels, wrong = stamp_errors(found)
        most = f"{off.max() * 1e6:.2g} us at most"
        text = f"{most}; count wrong in {wrong} of {pixels:,} pixels"
        cost = took / (SHAPE[0] * SHAPE[1])
        error = max(float(off.mean()), SOLVED)
        points.append(BenchmarkPoint(name, cost, error * 1e6, text))
    return points


def looked(effects: NoiseModel, fps: int = 1000) -> Sent:
    """Return what a real camera sends, the same pixels and noise for the same effects.

    Args:
        effects: Which.
        fps: Frames a second.
    """
    times, frames = _long_film(fps)
    key, blocks = jax.random.key(0), _blocks(times, frames)
    return sent(noisy_stream(key, blocks, SHAPE, BOTH, effects))


@functools.cache
def _long_film(fps: int) -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(round(STILL_TO * fps) + 1) / fps
    return times, grey(disc_frames(times))


def unlike(found: Sent, known: Sent) -> tuple[int, int]:
    """Return how many events only the known has, and how many only the other."""

    def alone(ours: Sent, theirs: Sent) -> int:
        # one line of time for each pixel and sign, far from the next
        a, b = (
            np.sort((2 * e.pixel + (e.sign > 0)) * (2.0 * STILL_TO) + e.time)
            for e in (ours, theirs)
        )
        if not b.size:
            return a.size
        after = np.searchsorted(b, a)
        near = [np.abs(a - b[np.clip(after - k, 0, b.size - 1)]) for k in (0, 1)]
        return int((np.minimum(*near) > SAME_EVENT_S).sum())

    return alone(known, found), alone(found, known)


def effect_points(repeats: int = REPEATS) -> list[BenchmarkPoint]:
    """Return what each effect costs, and how unlike a real camera's the events are.

    Args:
        repeats: How often each is timed.
    """
    tell = in_words()
    points, known = [], looked(USUAL)
    pixel_frames = SHAPE[0] * SHAPE[1] * len(_long_film(1000)[0])
    for name, effects in {**EFFECTS, "all": USUAL}.items():
        tell(name)
        took, found = best_of(functools.partial(looked, effects), repeats)
        missing, extra = unlike(found, known)
        both = known.time.size + found.time.size
        share = max(missing + extra, 0.5) / both
        text = f"{missing:,} missing, {extra:,} not sent, of {both:,} of both"
        cost, full = took / pixel_frames, effects == USUAL
        points.append(BenchmarkPoint(name, cost, share, text, is_reference=full))
    return points


register_benchmark(
    Benchmark(
        name="events",
        title="Times of events: cost against error",
        cost=f"time of a pixel over {1e3 * DURATION:g} ms, with the light's own",
        error="mean error of a time [us], not below 0.001; a disc whose edge moves at "
        "260 px/s",
        measure=stamp_points,
        relative=False,
    )
)
register_benchmark(
    Benchmark(
        name="event_effects",
        title="Effects of a real event camera: what it costs to leave them out",
        cost="time of a pixel in a frame, 8 bits at 1,000 frames/s",
        error="share of its events and of those of a camera with all effects that the "
        "other has not, to 0.2 ms; half an event if none",
        measure=effect_points,
    )
)
