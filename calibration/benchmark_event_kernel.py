"""Frames to events on a GPU: frames a second, beside the copying of the same bytes.

640 x 480 pixels, frames in the device's memory: a disc whose edge, a logistic 1 px
wide, moves out at 260 px/s, at 1,000 frames/s, over a constant background. Each pixel
only grows brighter, so that its count is known from its first and last light.
"""

import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from calibration.benchmark_events import Row, rates_table
from jblast.sensors.camera.events.ideal import (
    count_events,
    first_reference,
    log_intensity,
)
from jblast.sensors.camera.events.warp_stream import EventKernel
from jblast.sensors.camera.image import grey_composite

SHAPE, FRAMES, FPS = (480, 640), 4096, 1000.0
REPEATS = 10
THRESHOLD = 0.2
SPEED, START = 260.0, 3.0
BACKGROUND, BRIGHT = 0.16, 200


def event_kernel_text(shape: tuple[int, int] = SHAPE, frames: int = FRAMES) -> str:
    """Measure and return the table."""
    device = jax.devices()[0]
    with jax.enable_x64(True):
        rows = _rows(shape, frames)
    head = (
        f"Frames to events: {device.device_kind}, jax {jax.__version__}, "
        f"{frames} frames of {shape[1]} x {shape[0]} pixels"
    )
    return rates_table(head, "frames/s", rows)


def _rows(shape: tuple[int, int], frames: int) -> list[Row]:
    """Measure each way; the first is the copying of RGBA frames."""
    film = _film(shape, frames)
    behind = jnp.full(shape, BACKGROUND, jnp.float32)
    grey = _grey(film, behind)
    copy, scan = jax.jit(jnp.copy), jax.jit(_counted)
    ends = jnp.array([0, -1])
    known = _known(log_intensity(grey_composite(film[ends], behind).astype(float)))
    known_grey = _known(log_intensity(grey[ends].astype(float) / 255.0))
    colour = _kernel(shape, np.asarray(behind))
    plain = _kernel(shape, None)

    def timed(label, run, *counts) -> Row:
        found, expected = counts or (None, None)
        return label, _rate(run, frames), found, expected

    return [
        timed("copied, RGBA of 8 bits", lambda: copy(film)),
        timed(
            "composited and counted, JAX scan",
            lambda: scan(film, behind),
            int(scan(film, behind)),
            known,
        ),
        timed(
            "composited and converted, Warp kernel",
            lambda: _converted(colour, film),
            _converted(colour, film),
            known,
        ),
        timed(
            "the same, events in order on the host",
            lambda: _converted(colour, film) and colour.in_order(),
        ),
        timed("copied, grey of 8 bits", lambda: copy(grey)),
        timed(
            "converted, grey of 8 bits, Warp kernel",
            lambda: _converted(plain, grey),
            _converted(plain, grey),
            known_grey,
        ),
    ]


def _kernel(shape, background) -> EventKernel:
    return EventKernel(shape, (THRESHOLD, THRESHOLD), background=background)


def _converted(kernel: EventKernel, film) -> int:
    """Convert a film from its beginning; its events stay on the device."""
    kernel.time = -np.inf
    return kernel.advance(np.arange(len(film)) / FPS, film)


def _counted(film, behind):
    """Return how many events there are, by a scan over the frames."""
    logs = log_intensity(grey_composite(film, behind))
    both = jnp.float32(THRESHOLD), jnp.float32(THRESHOLD)
    counts, _, _ = count_events(logs, both, first_reference(logs[0]))
    return jnp.abs(counts).sum()


def _known(ends) -> int:
    """Return the events of pixels that only grow brighter."""
    return int(jnp.floor((ends[1] - ends[0] + 1e-12) / THRESHOLD).sum())


def _film(shape: tuple[int, int], frames: int):
    """Return RGBA frames of the disc, on the device."""
    y, x = jnp.mgrid[: shape[0], : shape[1]].astype(jnp.float32)
    radius = jnp.hypot(x - shape[1] / 2, y - shape[0] / 2)

    def frame(edge):
        alpha = jnp.round(255.0 * jax.nn.sigmoid(edge - radius)).astype(jnp.uint8)
        return jnp.stack([jnp.full_like(alpha, BRIGHT)] * 3 + [alpha], axis=-1)

    # it comes to rest inside the image, as a fireball does
    times = jnp.arange(frames, dtype=jnp.float32) / FPS
    edges = START + SPEED * 0.4 * (1.0 - jnp.exp(-times / 0.4))
    return jax.jit(lambda edges: jax.lax.map(frame, edges))(edges)


def _grey(film, behind):
    """Return the same frames, composited and rounded to 8 bits."""
    part = jax.jit(lambda f: jnp.round(255.0 * grey_composite(f, behind)))
    return jnp.concatenate(
        [part(film[a : a + 64]).astype(jnp.uint8) for a in range(0, len(film), 64)]
    )


def _rate(run: Callable[[], Any], frames: int) -> float:
    """Return frames a second, the best of several runs."""
    jax.block_until_ready(run())
    best = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        jax.block_until_ready(run())
        best = min(best, time.perf_counter() - start)
    return frames / best
