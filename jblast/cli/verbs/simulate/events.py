"""Turn frames into what an event camera would send: any sequence of PNG files."""

import argparse
import sys

from jblast.cli.arguments.numbers import positive_of_any_size, seed, threshold_pair
from jblast.cli.arguments.paths import path


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "frames",
        metavar="FRAMES_DIR",
        type=path,
        help="directory of PNG frames, taken in the order of their names",
    )
    verb.add_argument(
        "--fps",
        required=True,
        type=positive_of_any_size,
        metavar="HZ",
        help="frames a second: frame k stands at k/fps",
    )
    verb.add_argument(
        "--threshold",
        type=threshold_pair,
        default="0.2",
        metavar="STEP[,DARKER]",
        help="change of the logarithm of light that gives an event, brighter and "
        "darker (default: 0.2 for both)",
    )
    verb.add_argument(
        "--noise",
        choices=("on", "off"),
        default="on",
        help="off: the ideal camera; on (default): thresholds that differ, limited "
        "bandwidth, leak, hot pixels, shot noise and refractory time",
    )
    verb.add_argument("--seed", type=seed, default=0, help="of the noise (default: 0)")
    verb.add_argument(
        "--srgb",
        action="store_true",
        help="grey values are sRGB; by default they are linear light",
    )
    verb.add_argument(
        "--out",
        required=True,
        metavar="FILE",
        type=path,
        help="events.h5 (HDF5 in the layout of DSEC) or events.npz",
    )
    verb.add_argument("--json", action="store_true", help="print a summary as JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Read, convert and write block by block; say how many events there were."""
    from jblast.cli.jax_start import start_jax

    start_jax()
    import jax

    from jblast.cli.arguments.paths import refuse_existing, writing
    from jblast.report.film.answer import EventsAnswer, as_json
    from jblast.report.film.text import events_text
    from jblast.sensors.camera.events.log_intensity import grey_table
    from jblast.sensors.camera.events.noise import NoiseModel
    from jblast.sensors.camera.events.noisy import noisy_stream
    from jblast.sensors.camera.events.stream import stream_events
    from jblast.sensors.camera.files.events import check_suffix, write_events
    from jblast.sensors.camera.files.frames import frame_files, read_frame, read_frames

    fps, thresholds = asked.fps, asked.threshold
    check_suffix(asked.out)
    refuse_existing(asked.out, force=asked.force)
    files = frame_files(asked.frames)
    height, width = read_frame(files[0]).shape
    blocks = _timed(read_frames(files, srgb=asked.srgb), fps, len(files))
    table = grey_table(srgb=asked.srgb)
    if asked.noise == "off":
        events = stream_events(blocks, thresholds, table=table)
    else:
        key, shape = jax.random.key(asked.seed), (height, width)
        effects = NoiseModel()
        events = noisy_stream(key, blocks, shape, thresholds, effects, table=table)
    seconds = (len(files) - 1) / fps
    with writing(asked.out):
        written = write_events(asked.out, events, width, height, duration_s=seconds)
    answer = EventsAnswer(
        frames=len(files),
        width=width,
        height=height,
        fps=fps,
        duration_s=seconds,
        threshold=thresholds,
        srgb=asked.srgb,
        noise=asked.noise,
        seed=None if asked.noise == "off" else asked.seed,
        **written._asdict(),
        out=asked.out,
    )
    sys.stdout.write(as_json(answer) if asked.json else events_text(answer))
    return 0


def _timed(blocks, fps: float, total: int):
    """Give each block its times, and tell how many frames are through."""
    import numpy as np

    from jblast.progress import counted

    through, done = counted(total, "frames"), 0
    for frames in blocks:
        yield (done + np.arange(len(frames))) / fps, frames
        done += len(frames)
        through(done)
