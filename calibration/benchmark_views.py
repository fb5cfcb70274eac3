"""Frames with the shipped views of an explosion: how many a second, 640 x 480 pixels.

    python -m calibration.benchmarks views > calibration/results/benchmark_views.txt
    PYTHONPATH=. python -m calibration.benchmark_views --gpu

The film is that of `filmed`: 15 kg from 40 m away, from the burst until the fire is
out, its fireball 0.4 of the image's height wide; nearest view, frames in memory as red,
green and blue. On processors frames are made one after another, on the tiles that show
the fire (`jblast.render`), and what counts is the time of processors: others may use
the machine. On a GPU they are made in batches by `vmap`, as whole images.
"""

import argparse
import sys
import time
from collections.abc import Callable
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
from jblast.sensors.camera import ExplosionViews, explosion_views, luminance
from jblast.sensors.camera.rendering import light, view_of

FRAMES, BATCH, REPEATS = 64, 256, 3


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


def batched(
    views: ExplosionViews, film: Filmed, *, grey: bool = False
) -> Callable[[jax.Array], jax.Array]:
    """Return what makes a batch of frames of their times.

    Args:
        views: The set.
        film: Of a camera that stands still.
        grey: Luminance in place of three colours.
    """
    view = view_of(
        film.scene,
        film.camera,
        BACKGROUND,
        views=views,
        appearance=film.appearance,
        dtype=jnp.float32,
        reverse=False,
    )

    @eqx.filter_jit
    def frames(view, moments):
        seen = jnp.moveaxis(
            jax.vmap(lambda moment: light(view, moment))(moments), 1, -1
        )
        return luminance(seen) if grey else seen

    return lambda moments: frames(view, moments)


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
    head = (
        f"Explosion views: {device.platform}, {device.device_kind}, jax "
        f"{jax.__version__}, float32, {width} x {height} in batches of {batch}"
    )
    lines = [head, "", f"{'':38}{'frames/s':>12}"]

    def row(label: str, make: Callable[[jax.Array], jax.Array]) -> None:
        rate = batch_rate(make, film.times.astype(np.float32), batch)
        lines.append(f"{label:38}{rate:12.3g}")
        print(lines[-1], file=sys.stderr, flush=True)

    row("nearest view, RGB", batched(views, film))
    row("nearest view, grey", batched(views, film, grey=True))
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
