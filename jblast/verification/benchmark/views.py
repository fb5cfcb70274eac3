"""Views of an explosion: ways between sides and between frames, by what each misses.

Between sides: the eight views left out of the set that comes with jblast, at their ten
phases, beside what it shows from there. Between frames: eight of its views at phases
that were taken out of it, every second one, so that the gaps are twice as wide as the
set's own. Likeness is over the pixels that are the fire's in either picture, of what is
looked at (sRGB luminance before a grey); what a frame costs is that of a film.
"""

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.progress import in_words
from jblast.sensors.camera import ExplosionViews, explosion_views
from jblast.sensors.camera.image import psnr, ssim
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.cases.explosion_frames import (
    LEFT_OUT,
    close_up,
    filmed,
    processor_seconds,
)

FRAMES = 32
"""Of the film that is timed."""
EVERY = 4
"""Of the views that are looked at between frames."""


class NearerFrame(ExplosionViews):
    """The same pictures, of which the nearer one in time is shown."""

    def frames_at(
        self, phase: Float[Array, ""]
    ) -> tuple[Int[Array, "1"], Float[Array, "1"]]:
        """Return the nearer of the two frames, and how much of it is there."""
        frames, parts = super().frames_at(phase)
        return frames[jnp.argmax(parts)][None], jnp.sum(parts)[None]


Pair = tuple[ExplosionViews, int, int]
"""The set that has a view, the view, and the frame."""


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
