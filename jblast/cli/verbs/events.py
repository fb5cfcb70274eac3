"""Turn frames into what an event camera would send: files in order, or a video."""

import argparse
import sys

from jblast.cli.arguments.numbers import (
    positive_of_any_size,
    seed,
    share,
    threshold_pair,
)
from jblast.cli.arguments.options import path, refuse_existing, writing
from jblast.errors import InputError


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "frames",
        metavar="FRAMES_DIR|VIDEO",
        type=path,
        help="directory of PNG frames (or .npy files of linear light as floats, full "
        "scale 1), taken in the order of their names, or a video",
    )
    verb.add_argument(
        "--fps",
        type=positive_of_any_size,
        metavar="HZ",
        help="frames a second: frame k stands at k/fps; a video goes by its own clock "
        "if nothing is said, which for slow motion is not that of what was filmed",
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
        help="grey values of PNG frames are sRGB; by default they are linear light",
    )
    verb.add_argument(
        "--darkest",
        type=share,
        metavar="LIGHT",
        help="linear light, as a part of full scale, below which changes give no event "
        "(default: half a step of 8 bits, 0.00196, or of as many bits as the file has; "
        "1e-6 of floats)",
    )
    verb.add_argument(
        "--out",
        required=True,
        metavar="FILE",
        type=path,
        help="events.h5 (HDF5 in the layout of DSEC), .npz, .raw (EVT3) or .aedat4",
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

    from jblast.report.film import EventsAnswer, as_json, dark_film, events_text
    from jblast.sensors.camera.events.ideal import count_below, grey_table
    from jblast.sensors.camera.events.noise import NoiseModel, noisy_stream
    from jblast.sensors.camera.events.stream import stream_events
    from jblast.sensors.camera.files.event_files import check_suffix, write_events
    from jblast.sensors.camera.files.recordings import open_recording

    thresholds = asked.threshold
    check_suffix(asked.out)
    refuse_existing(asked.out, force=asked.force)
    film = open_recording(asked.frames, asked.fps, srgb=asked.srgb)
    if asked.srgb and film.is_video:
        raise InputError(
            f"--srgb: is said of PNG frames; {asked.frames} names its own curve"
        )
    darkest = film.darkest if asked.darkest is None else asked.darkest
    if darkest == 0.0:
        raise InputError("--darkest: expected a number above 0 and at most 1, got 0")
    dark = 0

    def counted_blocks():
        nonlocal dark
        for times, frames in _counted(film.blocks(decoded=False), len(film)):
            dark += count_below(frames, darkest, srgb=asked.srgb)
            yield times, frames

    blocks = counted_blocks()
    table = grey_table(srgb=asked.srgb, darkest=darkest)
    if asked.noise == "off":
        events = stream_events(blocks, thresholds, table=table, darkest=darkest)
    else:
        key, shape = jax.random.key(asked.seed), (film.height, film.width)
        effects = NoiseModel()
        events = noisy_stream(
            key, blocks, shape, thresholds, effects, table=table, darkest=darkest
        )
    seconds = float(film.times[-1])
    with writing(asked.out):
        written = write_events(
            asked.out, events, film.width, film.height, duration_s=seconds
        )
    below = dark / (len(film) * film.width * film.height)
    answer = EventsAnswer(
        frames=len(film),
        width=film.width,
        height=film.height,
        fps=film.frames_hz,
        duration_s=seconds,
        threshold=thresholds,
        srgb=asked.srgb,
        noise=asked.noise,
        seed=None if asked.noise == "off" else asked.seed,
        **written._asdict(),
        bits=film.bits,
        darkest=darkest,
        below_darkest=below,
        warnings=(dark_film(below, darkest),) if below else (),
        out=asked.out,
    )
    for warning in answer.warnings:
        sys.stderr.write(f"jblast: warning: {warning}\n")
    sys.stdout.write(as_json(answer) if asked.json else events_text(answer))
    return 0


def _counted(blocks, total: int):
    """Return the blocks, and tell how many frames are through."""
    from jblast.progress import counted

    through, done = counted(total, "frames"), 0
    for times, frames in blocks:
        yield times, frames
        done += len(times)
        through(done)
