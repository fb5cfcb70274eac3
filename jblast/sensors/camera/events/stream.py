"""Frames to events for long recordings: block by block, fast, on the host.

Most pixels of a block of frames cross no threshold. Which ones do is seen by the
extremes of the block, compared with bounds in the units of the image: no logarithm is
taken of the others. The few that are left are followed frame by frame. The events are
those of `ideal_events`, in the same order.
"""

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from jaxtyping import ArrayLike, Float, UInt8

from jblast.errors import InputError
from jblast.sensors.camera.events.composite_strip import CompositeStrip
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.log_intensity import (
    DARKEST,
    EIGHT_BITS,
    grey_table,
)
from jblast.sensors.camera.events.pixel import check_light, check_thresholds
from jblast.sensors.camera.events.strip import Found, Strip

# each block has its own number of frames, so no axis has a name
Frames = UInt8[np.ndarray, "_ _ _ ..."] | Float[np.ndarray, "_ _ _"]
Block = tuple[Float[np.ndarray, " _"], Frames]


def stream_events(
    blocks: Iterable[Block],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    *,
    table: Float[np.ndarray, "256"] | None = None,
    background: Float[np.ndarray, "height width"] | None = None,
    in_logarithms: bool = False,
    begun: Float[np.ndarray, "height width"] | None = None,
    refractory_s: float | None = None,
    darkest: float | None = None,
    workers: int | None = None,
) -> Iterator[Events]:
    """Return the events of each block of a stream.

    Two blocks are held in memory at a time; sixteen to thirty-two frames a block are
    the fastest. How a stream is cut into blocks does not change its events.

    Args:
        blocks: Times [s], rising through the stream, and frames of linear light: grey
            values of 8 bits, floats with full scale 1, or with a `background` RGBA of
            8 bits.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        table: Logarithm of the light of each 8-bit value; by default `grey_table()`.
        background: Grey light behind the frames, full scale 1.
        in_logarithms: Whether float frames hold the logarithm of the light already.
        begun: How far the logarithm of the first frame is above a pixel's reference;
            by default nowhere.
        refractory_s: So long a pixel is held in reset after an event [s]; see
            `reset_pixel`. By default it is not.
        darkest: Floor of float frames and of RGBA over a background, as a fraction of
            full scale (`log_intensity.darkest_of`); by default `DARKEST`, and half a
            step of 8 bits for RGBA. The floor of grey values is that of `table`.
        workers: Threads, each for a strip of rows; by default one a core.

    Raises:
        InputError: Times do not rise, a frame has another size than the first, light is
            not finite, or a threshold is not positive.
    """
    check_thresholds(thresholds)
    table = grey_table() if table is None else table
    if darkest is None:
        darkest = DARKEST if background is None else EIGHT_BITS
    workers = workers or os.cpu_count() or 1
    strips: list[Strip] = []
    found: list[Found] = []
    width, shape, time, seen = 0, (), -np.inf, 0
    with ThreadPoolExecutor(workers) as pool:
        for times, frames in blocks:
            if not len(times):
                continue
            shape = shape or frames.shape[1:]
            _check(times, time, frames, shape)
            check_light(frames, seen)
            time, width, seen = times[-1], shape[1], seen + len(times)
            if not strips:
                options = table, in_logarithms, refractory_s, darkest
                begun = np.zeros(shape[:2]) if begun is None else begun
                strips = _strips(shape, thresholds, begun, options, background, workers)
            jobs = [
                pool.submit(strip.advance, times, strip.rows_of(frames))
                for strip in strips
            ]
            if found:  # put in order while the next block is being counted
                yield gathered(found, width)
            found = [job.result() for job in jobs]
        if found:
            yield gathered(found, width)


def _check(times, before, frames, shape) -> None:
    """Refuse times out of order, and frames of another size."""
    if not (np.diff(times, prepend=before) > 0.0).all():
        raise InputError("frames: expected times that rise from frame to frame")
    if frames.shape[1:] != shape:
        raise InputError(
            f"frames: expected {shape[1]} x {shape[0]} pixels as in the first, got "
            f"{frames.shape[2]} x {frames.shape[1]}"
        )


def _strips(shape, thresholds, begun, options, background, workers) -> list[Strip]:
    """Cut the image into strips of rows, one a worker."""
    height, width = shape[:2]
    both = [np.broadcast_to(np.asarray(t, float), (height, width)) for t in thresholds]
    edges = np.linspace(0, height, min(workers, height) + 1).astype(int)
    strips = []
    for a, b in pairwise(edges):
        steps = both[0][a:b], both[1][a:b]
        given = slice(a, b), width, steps, begun[a:b], *options
        strips.append(
            Strip(*given)
            if background is None
            else CompositeStrip(*given, background=background[a:b])
        )
    return strips


def gathered(found: Sequence[Found], width: int) -> Events:
    """Return the events of all strips in order of time, then of pixel."""
    pixel, time, sign = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(time)
    # ties by pixel: two sorts of one key each are several times faster than lexsort
    run = np.cumsum(np.diff(time[order], prepend=-np.inf) != 0.0)
    key = run * (1 + pixel.max(initial=0)) + pixel[order]
    order = order[np.argsort(key)]
    y, x = np.divmod(pixel[order], width)
    count, lost = np.asarray(len(order)), np.asarray(0)
    return Events(x, y, time[order], sign[order], count, lost)
