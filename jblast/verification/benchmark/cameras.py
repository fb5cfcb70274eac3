"""Event cameras and views of an explosion: cost against error.

Events: methods to find their times, and the cost of each effect of a real camera. The
scene is a bright disc whose edge moves, with known events
(`calibration.cases`). The camera of the second chart sees it in grey
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
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from calibration import cases
from calibration.cases import (
    BACKGROUND,
    DURATION,
    MASS,
    SHAPE,
    THRESHOLD,
    WIDTH,
    analytic,
    disc_frames,
    disc_light,
    film,
    filmed,
    passed_wholly,
    processor_seconds,
)
from jblast.fidelity.timing import best_of
from jblast.progress import in_words
from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera import (
    ExplosionViews,
    explosion_views,
    linear_to_srgb,
    luminance,
    render,
)
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
from jblast.waves.fireball import fireball, fireball_duration

LEFT_OUT = Path(cases.__file__).parent / "data" / "explosion_left_out"
# So far that perspective changes the outline of the ball by 0.06 % only.
CAMERA_DISTANCE_RADII = 30.0
"""Distance of the camera of a close-up [fireball radii]."""
# Below it the fire changes the grey by less than 2 % of its own light.
MIN_OPACITY = 0.02
"""Opacity above which a pixel belongs to the fire."""
FRAMES = 32
"""Frames of the timed film."""
# Eight views of the set, as many as are left out for the comparison between sides.
EVERY = 4
"""Stride of the views compared between frames."""
Pair = tuple[ExplosionViews, int, int]
"""A set of views, a view of it and a frame."""
# The least of five: other load can only lengthen a call.
REPEATS = 5
# Frames a call: as many as the film has, so that one call is timed.
BLOCK = 32
BOTH = (THRESHOLD, THRESHOLD)
"""Positive and negative contrast threshold [-]."""
# From slow motion of a telephone to a laboratory camera.
FPS = (100, 300, 1000, 3000, 10000)
SOLVED = 1e-9
"""Tolerance of the crossing times [s], the smallest reported error."""
# 0.92 s of rest, so that events of noise alone are part of the cost.
RECORDING_S = 1.0
"""Duration of the recording of the real camera [s]."""
# A fifth of a frame at 1,000 frames/s; interpolated times of equal events agree better.
SAME_EVENT_S = 0.2e-3
"""Largest time difference of equal events of one pixel and sign [s]."""
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


class CloseUp(NamedTuple):
    """Picture of the fire alone.

    Attributes:
        grey: Luminance in front of a uniform grey (sRGB), 0 to 1.
        fire: True for pixels of the fire.
    """

    grey: Float[np.ndarray, "height width"]
    fire: Bool[np.ndarray, "height width"]


def close_up(
    views: ExplosionViews, shown: ExplosionViews, view: int, frame: int
) -> CloseUp:
    """Render a set from the direction of a view, in the size of the view's picture.

    Args:
        views: Set to render.
        shown: Set that contains the view.
        view: Number of the view.
        frame: Number of the frame in `shown`.
    """
    time = float(shown.phase[frame]) * float(fireball_duration(MASS))
    radius = float(fireball(MASS, time).radius)
    eye = CAMERA_DISTANCE_RADII * radius * np.asarray(shown.direction[view])
    size = shown.frames.shape[2]
    # tangents to a ball of radius 1 at distance d have the slope 1/sqrt(d^2 - 1)
    focal = float(shown.radius[view, frame]) * np.sqrt(CAMERA_DISTANCE_RADII**2 - 1.0)
    camera = Camera(
        position=eye,
        quaternion=look_at(eye, np.zeros(3)),
        focal=np.full(2, focal),
        center=np.asarray(shown.anchor[view]),
        width=size,
        height=size,
    )
    scene = Scene(charge=Charge(mass_kg=MASS))
    (layer,) = np.asarray(
        render(scene, camera, np.array([time]), views=views, ground=False, alpha=True)
    )
    alpha = layer[..., 3:]
    light = np.clip(alpha * layer[..., :3] + (1.0 - alpha) * BACKGROUND, 0.0, 1.0)
    return CloseUp(
        luminance(np.asarray(linear_to_srgb(light))), alpha[..., 0] > MIN_OPACITY
    )


class NearerFrame(ExplosionViews):
    """Views that show the nearer frame in time instead of a mixture of two."""

    def frames_at(
        self, phase: Float[Array, ""]
    ) -> tuple[Int[Array, "1"], Float[Array, "1"]]:
        """Return the nearer of the two frames, and its weight."""
        frames, parts = super().frames_at(phase)
        return frames[jnp.argmax(parts)][None], jnp.sum(parts)[None]


def nearer(views: ExplosionViews) -> NearerFrame:
    """Return the same views with the nearer frame in time."""
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
    """Return PSNR [dB] and SSIM of the pictures of a set, one for each pair."""
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
    """Yield all pictures of the left-out set."""
    for view in range(len(left_out.direction)):
        for frame in range(len(left_out.phase)):
            yield left_out, view, frame


def between_frames(views: ExplosionViews, every: int = EVERY) -> Iterator[Pair]:
    """Yield the pictures between those of every second frame.

    Args:
        views: The full set.
        every: Stride of the views.
    """
    for view in range(0, len(views.direction), every):
        for frame in range(1, len(views.phase) - 1, 2):
            yield views, view, frame


def view_points() -> list[BenchmarkPoint]:
    """Return the cost of a frame by each method, and its dissimilarity."""
    progress, views = in_words(), explosion_views()
    three, left_out = replace(views, sides=3), explosion_views(LEFT_OUT)
    few = thinned(views)
    methods: tuple[
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
    for name, panel, timed, shows, pairs in methods:
        progress(name)
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
        cost="processor time of a frame of 640 x 480 pixels, float64",
        error="1 - SSIM over the pixels of the fire",
        measure=view_points,
        relative=False,
    )
)


class Sent(NamedTuple):
    """Events in any order.

    Attributes:
        pixel: Number of the pixel, row by row.
        time: Time of the event [s].
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
    """Return events of float frames, with ln(light) linear between frames."""
    times, logs = film(fps)
    return sent(stream_events(_blocks(times, logs), BOTH, in_logarithms=True))


def of_bytes(fps: int) -> Sent:
    """Return events of frames of 8 bits."""
    times, logs = film(fps)
    return sent(stream_events(_blocks(times, grey(logs)), BOTH))


def of_bytes_stamped(fps: int) -> Sent:
    """Return events of 8 bits with the time of the frame after each."""
    found = of_bytes(fps)
    # the margin keeps an event exactly at a frame in that frame
    return found._replace(time=np.ceil(found.time * fps - 1e-6) / fps)


def of_functions(fps: int) -> Sent:
    """Return events without frames.

    Args:
        fps: Rate of the first samples [Hz].
    """
    times = np.linspace(0.0, DURATION, max(2, round(DURATION * fps) + 1))
    return sent(iter([frameless_events(disc_light, SHAPE, times, BOTH)]))


def grey(logs: Float[np.ndarray, "..."]) -> np.ndarray:
    """Return grey values of 8 bits."""
    return np.round(255.0 * np.exp(logs)).astype(np.uint8)


METHODS: tuple[tuple[str, Callable[[int], Sent], int], ...] = (
    *((f"frames, {fps:,}/s", of_frames, fps) for fps in FPS),
    ("8 bits, 1,000/s", of_bytes, 1000),
    ("8 bits at frame's end, 1,000/s", of_bytes_stamped, 1000),
    ("frameless from 30/s", of_functions, 30),
    ("frameless from 1,000/s", of_functions, 1000),
)


def stamp_errors(found: Sent) -> tuple[Float[np.ndarray, " event"], int, int]:
    """Compare events with the known ones, in pixels that the edge has passed.

    Returns:
        Errors of the times in pixels with the right number of events [s], the number of
        pixels, and the number of pixels with a wrong number of events.
    """
    whole = passed_wholly()
    known, _, when = analytic()
    order = np.lexsort((found.time, found.pixel))
    pixel, time = found.pixel[order], found.time[order]
    events, truth = (np.bincount(p, minlength=whole.size) for p in (pixel, known))
    right = whole & (events == truth)
    error = np.abs(time[right[pixel]] - when[right[known]])
    return error, int(whole.sum()), int((whole & ~right).sum())


def stamp_points(repeats: int = REPEATS) -> list[BenchmarkPoint]:
    """Return the cost of each method, and the mean error of its times.

    Args:
        repeats: Number of timed repetitions.
    """
    progress = in_words()
    points = []
    for name, method, fps in METHODS:
        progress(name)
        took, found = best_of(functools.partial(method, fps), repeats)
        errors, pixels, wrong = stamp_errors(found)
        largest = f"{errors.max() * 1e6:.2g} us at most"
        text = f"{largest}; count wrong in {wrong} of {pixels:,} pixels"
        cost = took / (SHAPE[0] * SHAPE[1])
        error = max(float(errors.mean()), SOLVED)
        points.append(BenchmarkPoint(name, cost, error * 1e6, text))
    return points


def noisy_events(effects: NoiseModel, fps: int = 1000) -> Sent:
    """Return the events of a real camera, with the same random pixels for all effects.

    Args:
        effects: Effects of the camera.
        fps: Frame rate [Hz].
    """
    times, frames = _long_film(fps)
    key, blocks = jax.random.key(0), _blocks(times, frames)
    return sent(noisy_stream(key, blocks, SHAPE, BOTH, effects))


@functools.cache
def _long_film(fps: int) -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(round(RECORDING_S * fps) + 1) / fps
    return times, grey(disc_frames(times))


def unlike(found: Sent, known: Sent) -> tuple[int, int]:
    """Return the numbers of missing and of extra events, relative to the known ones."""

    def alone(ours: Sent, theirs: Sent) -> int:
        # one axis: the offset between pixels and signs exceeds any time difference
        a, b = (
            np.sort((2 * e.pixel + (e.sign > 0)) * (2.0 * RECORDING_S) + e.time)
            for e in (ours, theirs)
        )
        if not b.size:
            return a.size
        after = np.searchsorted(b, a)
        near = [np.abs(a - b[np.clip(after - k, 0, b.size - 1)]) for k in (0, 1)]
        return int((np.minimum(*near) > SAME_EVENT_S).sum())

    return alone(known, found), alone(found, known)


def effect_points(repeats: int = REPEATS) -> list[BenchmarkPoint]:
    """Return the cost of each effect, and the share of wrong events without the others.

    Args:
        repeats: Number of timed repetitions.
    """
    progress = in_words()
    points, known = [], noisy_events(USUAL)
    pixel_frames = SHAPE[0] * SHAPE[1] * len(_long_film(1000)[0])
    for name, effects in {**EFFECTS, "all": USUAL}.items():
        progress(name)
        took, found = best_of(functools.partial(noisy_events, effects), repeats)
        missing, extra = unlike(found, known)
        both = known.time.size + found.time.size
        share = max(missing + extra, 0.5) / both
        text = f"{missing:,} missing, {extra:,} extra, of {both:,} of both"
        cost, full = took / pixel_frames, effects == USUAL
        points.append(BenchmarkPoint(name, cost, share, text, is_reference=full))
    return points


register_benchmark(
    Benchmark(
        name="events",
        title="Times of events: cost against error",
        cost=f"time of a pixel over {1e3 * DURATION:g} ms, with that of the light",
        error="mean error of a time [us], not below 0.001; a disc whose edge moves at "
        "260 px/s",
        measure=stamp_points,
        relative=False,
    )
)
register_benchmark(
    Benchmark(
        name="event_effects",
        title="Effects of a real event camera: cost against error without them",
        cost="time of a pixel in a frame, 8 bits at 1,000 frames/s",
        error="share of events without a counterpart within 0.2 ms, relative to a "
        "camera with all effects; half an event if none",
        measure=effect_points,
    )
)
