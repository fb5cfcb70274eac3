"""Frames with the shipped views of an explosion: how many a second, 640 x 480 pixels.

    python -m calibration.benchmarks views > calibration/results/benchmark_views.txt
    PYTHONPATH=. python -m calibration.benchmark_views --gpu

The film is that of `filmed`: 15 kg from 40 m away, from the burst until the fire is
out, its fireball 0.4 of the image's height wide; nearest view, frames in memory as red,
green and blue. On processors frames are made one after another, in windows that follow
the fire (`jblast.render`), and what counts is the time of processors: others may use
the machine. On a GPU they are made in batches by `vmap`, of the rows and columns in
which the fire ever is, found beforehand; all else is the background.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from calibration.cases import (
    BACKGROUND,
    Filmed,
    filmed,
    processor_seconds,
)
from jblast.errors import InputError
from jblast.sensors.camera import (
    ExplosionViews,
    Rays,
    explosion_views,
    luminance,
    pixel_rays,
    render,
)

FRAMES, BATCH, REPEATS = 64, 256, 3
MARGIN = 8
"""Rows and columns around those in which the fire is seen."""
LOOKED = 24
"""Frames of the film from which these are told."""


def views_text() -> str:
    """Measure processors and return the table; the default case comes first."""
    lines = [
        f"Explosion views: cpu, jax {jax.__version__}, {FRAMES} frames of 640 x 480"
    ]
    lines += ["", f"{'':34}{'frames/s of a core':>20}{'of two':>10}"]
    cases: list[tuple[str, bool, dict[str, Any]]] = [
        ("nearest view, float64", True, {}),
        ("nearest view, float32", False, {}),
        ("without light on the ground, f32", False, {"flash": False}),
        ("smooth ball, float32", False, {"ball": True}),
    ]
    for label, wide, changed in cases:
        with jax.enable_x64(wide):
            rate = core_rate(**changed)
        lines.append(f"{label:34}{rate:20.3g}{2 * rate:10.3g}")
    return "\n".join(lines)


def core_rate(*, flash: bool = True, ball: bool = False, frames: int = FRAMES) -> float:
    """Return frames a second of a processor's time.

    Args:
        flash: Whether the fire lights the ground.
        ball: The smooth ball in place of views.
        frames: Of the film.
    """
    views = None if ball else explosion_views()
    return 1.0 / processor_seconds(views, filmed(frames, flash=flash))


def fire_window(views: ExplosionViews, film: Filmed) -> tuple[slice, slice]:
    """Return the rows and columns of a film in which its fire is ever seen."""
    some = film.times[np.linspace(0, len(film.times) - 1, LOOKED).round().astype(int)]
    seen = render(film.scene, film.camera, some, views=views, alpha=True)
    fire = np.any(np.asarray(seen)[..., 3] > 0.0, axis=0)
    spans = []
    for axis, size in enumerate(fire.shape):
        found = np.flatnonzero(np.any(fire, axis=1 - axis))
        if not len(found):
            raise InputError("film: expected an explosion in view, got none")
        spans.append(
            slice(max(found[0] - MARGIN, 0), min(found[-1] + MARGIN, size - 1) + 1)
        )
    return spans[0], spans[1]


def batched(
    views: ExplosionViews,
    film: Filmed,
    *,
    window: bool = True,
    grey: bool = False,
    smoothed: bool = True,
) -> Callable[[jax.Array], jax.Array]:
    """Return what makes a batch of frames of their times.

    Args:
        views: The set.
        film: Of a camera that stands still.
        window: Whether to look only where the fire ever is.
        grey: Luminance in place of three colours.
        smoothed: Whether it is asked, and computed, what is finer than a pixel; here
            a texel is always larger than one.
    """
    rays, size = pixel_rays(film.camera), (film.camera.height, film.camera.width)
    part = (
        fire_window(views, film) if window else (slice(0, size[0]), slice(0, size[1]))
    )
    looked = Rays(rays.origin, rays.direction[:, *part], rays.farthest[part])
    views = replace(views, windows=False, smoothed=smoothed)
    channels = () if grey else (3,)

    def frame(views, looked, moment):
        layer = views.seen(film.scene, looked, moment, film.appearance)
        layer = jnp.moveaxis(layer, 0, -1)
        light = layer[..., :3] + (1.0 - layer[..., 3:]) * BACKGROUND
        light = luminance(light) if grey else light
        behind = jnp.full((*size, *channels), BACKGROUND, light.dtype)
        return behind.at[part].set(light)

    @eqx.filter_jit
    def frames(views, looked, moments):
        return jax.vmap(lambda moment: frame(views, looked, moment))(moments)

    return lambda moments: frames(views, looked, moments)


def batch_rate(
    make: Callable[[jax.Array], jax.Array], times: np.ndarray, batch: int
) -> float:
    """Return frames a second of batches, the last of them ready."""
    moments = [jnp.asarray(times[a : a + batch]) for a in range(0, len(times), batch)]
    moments = [part for part in moments if len(part) == batch]
    jax.block_until_ready(make(moments[0]))
    best = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        made = None
        for part in moments:
            made = make(part)  # the one before is let go
        jax.block_until_ready(made)
        best = min(best, time.perf_counter() - start)
    return batch * len(moments) / best


def batches_text(batch: int = BATCH, *, width: int = 640, height: int = 480) -> str:
    """Measure batches on the device there is, and return the table.

    Args:
        batch: Frames at once; the film has eight times as many.
        width: Of the image [px].
        height: Likewise.
    """
    device = jax.devices()[0]
    film = filmed(8 * batch, width=width, height=height, flash=False)
    views = explosion_views(towards=np.asarray(film.camera.position))
    rows, columns = fire_window(views, film)
    head = (
        f"Explosion views: {device.platform}, {device.device_kind}, jax "
        f"{jax.__version__}, float32, {width} x {height} in batches of {batch}; fire "
        f"in {rows.stop - rows.start} rows and {columns.stop - columns.start} columns"
    )
    lines = [head, "", f"{'':38}{'frames/s':>12}"]

    def row(label: str, make: Callable[[jax.Array], jax.Array]) -> None:
        rate = batch_rate(make, film.times.astype(np.float32), batch)
        lines.append(f"{label:38}{rate:12.3g}")
        print(lines[-1], file=sys.stderr, flush=True)

    row("nearest view, RGB", batched(views, film))
    sharp = batched(views, film, smoothed=False)
    some = jnp.asarray(film.times[::8].astype(np.float32))
    off = float(jnp.max(jnp.abs(sharp(some) - batched(views, film)(some))))
    row(f"the same, not low-passed ({off:.0e} off)", sharp)
    row("nearest view, grey", batched(views, film, grey=True, smoothed=False))
    whole = batched(views, film, window=False, smoothed=False)
    row("nearest view, RGB, whole images", whole)
    shape = (height, width, 3)

    @jax.jit
    def empty(moments):
        return jnp.broadcast_to(moments[:, None, None, None], (batch, *shape)) + 0.0

    row("nothing but RGB written", empty)
    return "\n".join(lines)


def main() -> None:
    """Print the table of batches."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gpu", action="store_true", help="refuse to run without one")
    parser.add_argument("--batch", type=int, default=BATCH, metavar="N")
    parser.add_argument("--width", type=int, default=640, metavar="PX")
    parser.add_argument("--height", type=int, default=480, metavar="PX")
    asked = parser.parse_args()
    if asked.gpu and jax.devices()[0].platform != "gpu":
        parser.error(f"expected a GPU, got {jax.devices()[0].platform}")
    print(batches_text(asked.batch, width=asked.width, height=asked.height))


if __name__ == "__main__":
    main()
