"""Frames to events: pixel-frames a second, beside the copying of the same bytes.

    python -m calibration.benchmarks events > calibration/results/benchmark_events.txt

346 x 260 pixels, frames in memory: a bright disc whose edge, a logistic 1 px wide,
moves out at 260 px/s, at 1,000 frames/s. Each pixel only grows brighter, so that its
count is known from its first and last light. Rates are the best of several runs.
"""

import os
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from calibration.charts import EFFECTS, USUAL
from calibration.timing import best_of
from jblast.sensors.camera.pixel import (
    EIGHT_BITS,
    NoiseModel,
    Pixel,
    grey_light,
    log_intensity,
    noisy_pixel,
    pixel_events,
)
from jblast.sensors.camera.stream import event_stream

HEIGHT, WIDTH, FRAMES, FPS = 260, 346, 512, 1000.0
BLOCK = 32
REPEATS = 5
THRESHOLD = 0.2
TABLE = np.log(np.maximum(grey_light(), EIGHT_BITS))
"""Logarithm of the light of each value of 8 bits."""
SPEED, EDGE, START = 260.0, 1.0, 3.0
BACKGROUND, BRIGHT = 0.16, 200


def events_text() -> str:
    """Measure and return the table."""
    device = jax.devices()[0]
    name = device.device_kind if device.platform == "gpu" else f"{os.cpu_count()} cores"
    with jax.enable_x64(True):
        rows = _rows()
    head = (
        f"Frames to events: {device.platform}, {name}, jax {jax.__version__}, "
        f"{FRAMES} frames of {WIDTH} x {HEIGHT} pixels"
    )
    return rates_table(head, "pixel-frames/s", rows)


def rates_table(head: str, unit: str, rows: list["Row"]) -> str:
    """Return the rates, what part of the first they are, and counts of events."""
    copied = rows[0][1]
    titles = f"{unit:>15}{'of copying':>12}{'events':>12}{'known':>12}"
    lines = [head, "", f"{'':44}{titles}"]
    for label, rate, found, known in rows:
        counts = "".join(f"{'' if n is None else f'{n:,}':>12}" for n in (found, known))
        lines.append(f"{label:44}{rate:15.2g}{rate / copied:12.1%}{counts}".rstrip())
    return "\n".join(lines)


Row = tuple[str, float, int | None, int | None]


def _rows() -> list[Row]:
    """Measure each way; the first is the copying of RGBA frames."""
    times = np.arange(FRAMES) / FPS
    alpha = disc(times)
    colour = np.full((*alpha.shape, 4), BRIGHT, np.uint8)
    colour[..., 3] = alpha
    opacity = alpha.astype(np.float32) / 255.0
    light = BACKGROUND + opacity * np.float32(BRIGHT / 255.0 - BACKGROUND)
    grey = np.round(255.0 * light).astype(np.uint8)
    copy = np.empty_like(colour)

    rows: list[Row] = [
        ("copied, RGBA of 8 bits", _rate(lambda: np.copyto(copy, colour)), None, None),
    ]
    films = {
        "converted, grey of 8 bits": (grey, TABLE[grey]),
        "converted, float32": (light, _log(light)),
    }
    for label, (frames, logs) in films.items():
        found = streamed(times, frames)
        rows.append((label, *found, known_count(logs)))
    noisy = np.random.default_rng(0).integers(0, 256, (64, HEIGHT, WIDTH), np.uint8)
    label = "converted, every pixel in every frame"
    rows.append((label, *streamed(times[:64], noisy), None))
    rows.append(("converted by JAX, whole frames", *jitted(times, grey)))
    cameras = {**EFFECTS, "all of these": USUAL}
    for name, effects in cameras.items():
        rows.append((f"grey of 8 bits, {name}", *flawed(times, grey, effects), None))
    return rows


def flawed(times: np.ndarray, grey: np.ndarray, effects: NoiseModel):
    """Return pixel-frames a second of a camera with imperfections, and its events."""
    times, grey = times[:256], grey[:256]
    key, shape, both = jax.random.key(0), (HEIGHT, WIDTH), (THRESHOLD, THRESHOLD)
    found = 0

    def run() -> None:
        nonlocal found
        blocks = zip(_cut(times), _cut(grey), strict=True)
        stream = event_stream(blocks, noisy_pixel(key, both, effects, shape))
        found = sum(int(part.count) for part in stream)

    rate = _rate(run, len(grey))
    return rate, found


def _log(light: np.ndarray) -> np.ndarray:
    return np.asarray(log_intensity(light.astype(float)))


def disc(times: np.ndarray) -> np.ndarray:
    """Return the opacity of the disc, 255 full scale."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    radius = np.hypot(x - WIDTH / 2, y - HEIGHT / 2)
    # it comes to rest inside the image, as a fireball does
    edges = START + SPEED * 0.4 * (1.0 - np.exp(-times / 0.4))
    shape = [1.0 / (1.0 + np.exp((radius - edge) / EDGE)) for edge in edges]
    return np.stack([np.round(255.0 * part).astype(np.uint8) for part in shape])


def known_count(logs: np.ndarray) -> int:
    """Return the events of pixels that only grow brighter."""
    change = logs[-1] - logs[0]
    return int(np.floor((change + 1e-12) / THRESHOLD).sum())


def _cut(frames: np.ndarray) -> list[np.ndarray]:
    return [frames[a : a + BLOCK] for a in range(0, len(frames), BLOCK)]


def streamed(times: np.ndarray, frames: np.ndarray) -> tuple[float, int]:
    """Return pixel-frames a second of the stream, and its events."""
    found = 0

    def run() -> None:
        nonlocal found
        blocks = zip(_cut(times), _cut(frames), strict=True)
        parts = event_stream(blocks, Pixel(THRESHOLD, THRESHOLD))
        found = sum(int(part.count) for part in parts)

    return _rate(run, frames.shape[0]), found


def jitted(times: np.ndarray, grey: np.ndarray) -> tuple[float, int, int]:
    """Return the same of `pixel_events`, compiled, over a part that fits in memory."""
    times, grey = times[:64], grey[:64]
    table = jnp.asarray(TABLE, jnp.float32)
    known = known_count(TABLE[grey])

    @jax.jit
    def convert(frames, times):
        pixel = Pixel(THRESHOLD, THRESHOLD)
        return pixel_events(table[frames], times, pixel, capacity=1 << 17)[0]

    frames, clock = jnp.asarray(grey), jnp.asarray(times)
    events = convert(frames, clock)
    rate = _rate(lambda: jax.block_until_ready(convert(frames, clock)), len(grey))
    return rate, int(events.count), known


def _rate(run: Callable[[], Any], frames: int = FRAMES) -> float:
    """Return pixel-frames a second of a run over so many frames."""
    return frames * HEIGHT * WIDTH / best_of(run, REPEATS)[0]
