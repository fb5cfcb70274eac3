"""Turn frames into what an event camera would send: files in order, or a video."""

import argparse
import sys

from jblast.cli.arguments.numbers import (
    positive_of_any_size,
    seed,
    share,
    threshold_pair,
)
from jblast.cli.arguments.options import given, path


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
    from jblast.report.film import EventsAnswer, dark_film, events_text
    from jblast.sensors.camera.film import film_to_events

    noise = asked.noise == "on"
    made = film_to_events(
        asked.frames,
        asked.out,
        fps=asked.fps,
        noise=noise,
        seed=asked.seed,
        srgb=asked.srgb,
        darkest=asked.darkest,
        force=asked.force,
        **given(asked, threshold="threshold"),
    )
    below = made.below_darkest
    answer = EventsAnswer(
        frames=made.frames,
        width=made.width,
        height=made.height,
        fps=made.frames_hz,
        duration_s=made.seconds,
        threshold=made.threshold,
        srgb=asked.srgb,
        noise=asked.noise,
        seed=asked.seed if noise else None,
        written=made.written,
        bits=made.bits,
        darkest=made.darkest,
        below_darkest=below,
        warnings=(dark_film(below, made.darkest),) if below else (),
        out=asked.out,
    )
    for warning in answer.warnings:
        sys.stderr.write(f"jblast: warning: {warning}\n")
    sys.stdout.write(answer.to_json() if asked.json else events_text(answer))
    return 0
