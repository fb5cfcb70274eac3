"""Films turned into files of the events that an event camera would send."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax

from jblast.errors import InputError, argument
from jblast.files import refuse_existing, writing
from jblast.progress import counted
from jblast.sensors.camera.events.ideal import count_below, grey_table
from jblast.sensors.camera.events.noise import NoiseModel, noisy_stream
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.files.event_files import Written, check_suffix, write_events
from jblast.sensors.camera.files.recordings import open_recording

THRESHOLD = (0.2, 0.2)
"""Default change of the logarithm of light that gives an event, up and down."""


class ConvertedFilm(NamedTuple):
    """Events of a film, as they were written.

    Attributes:
        frames: Number of frames.
        width: Of a frame [px].
        height: Of a frame [px].
        frames_hz: Frames a second.
        seconds: From the first frame to the last.
        threshold: Change of the logarithm of light that gives an event, up and down.
        written: Numbers of events.
        bits: Bit depth of the frames; None of floats.
        darkest: Linear light, as a fraction of full scale, below which changes give no
            events.
        below_darkest: Share of the pixel values that are darker than that.
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
        out: File of events: .h5 (HDF5 in the layout of DSEC), .npz, .raw or .aedat4.
        fps: Frames a second; a folder needs it.
        threshold: Change of the logarithm of light that gives an event, up and down.
        noise: Whether the camera has its imperfections.
        seed: Of the noise.
        srgb: Whether grey values of PNG frames are sRGB; else they are linear light.
        darkest: Linear light, as a fraction of full scale, below which changes give no
            event; default: half a step of the frames' bits, 1e-6 of floats.
        force: Whether the file may be overwritten.

    Raises:
        InputError: The film cannot be read, the file cannot be written, or an argument
            cannot be used.
    """
    check_suffix(Path(out))
    refuse_existing(out, force=force)
    opened = open_recording(os.fspath(film), fps, srgb=srgb)
    if srgb and opened.is_video:
        raise InputError(
            f"{argument('srgb')}: is said of PNG frames; {film} names its own curve"
        )
    darkest = opened.darkest if darkest is None else darkest
    if darkest == 0.0:
        raise InputError(
            f"{argument('darkest')}: expected a number above 0 and at most 1, got 0"
        )
    through, dark = counted(len(opened), "frames"), 0

    def blocks() -> Iterator[Any]:
        nonlocal dark
        done = 0
        for times, frames in opened.blocks(decoded=False):
            dark += count_below(frames, darkest, srgb=srgb)
            yield times, frames
            done += len(times)
            through(done)

    table = grey_table(srgb=srgb, darkest=darkest)
    if noise:
        key, shape = jax.random.key(seed), (opened.height, opened.width)
        model = NoiseModel()
        events = noisy_stream(
            key, blocks(), shape, threshold, model, table=table, darkest=darkest
        )
    else:
        events = stream_events(blocks(), threshold, table=table, darkest=darkest)
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
        below_darkest=dark / (len(opened) * opened.width * opened.height),
    )
