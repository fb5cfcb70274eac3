"""Convert frames, or a video, to the events of an event camera."""

import argparse
import sys

from jblast.cli.arguments.numbers import (
    positive_of_any_size,
    seed,
    share,
    threshold_pair,
)
from jblast.cli.arguments.options import add_force, add_json, given, path
from jblast.cli.arguments.verb_parser import VerbParser


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "frames",
        metavar="FRAMES_DIR|VIDEO",
        type=path,
        help="folder of PNG frames (or of .npy files with linear light as floats, full "
        "scale 1) in the order of their names, or a video",
    )
    verb.inputs.add_argument(
        "--fps",
        type=positive_of_any_size,
        metavar="HZ",
        help="frame rate [Hz]: frame k is at k/fps; required for a folder (default: "
        "clock of the video, which is wrong for slow motion)",
    )
    verb.inputs.add_argument(
        "--srgb",
        action="store_true",
        help="sRGB values in PNG frames (default: linear light)",
    )
    verb.model.add_argument(
        "--threshold",
        type=threshold_pair,
        metavar="STEP[,DARKER]",
        help="change of ln(light) that triggers an event, brighter and darker "
        "(default: 0.2 for both)",
    )
    verb.model.add_argument(
        "--noise",
        choices=("on", "off"),
        default="on",
        help="camera model: ideal (off), or with scattered thresholds, limited "
        "bandwidth, leak, hot pixels, shot noise and refractory time (on) (default: "
        "on)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of the noise (default: 0)"
    )
    verb.advanced.add_argument(
        "--darkest",
        type=share,
        metavar="LIGHT",
        help="linear light, as a part of full scale, below which changes trigger no "
        "event (default: half a step of the file's bit depth, 0.00196 for 8 bits; 1e-6 "
        "for floats)",
    )
    verb.outputs.add_argument(
        "--out",
        required=True,
        metavar="FILE",
        type=path,
        help="file of events: .h5 (HDF5 in the layout of DSEC), .npz, .raw (EVT3) or "
        ".aedat4",
    )
    add_json(verb, "summary as JSON, instead of text")
    add_force(verb, "an existing --out")


def run(options: argparse.Namespace) -> int:
    """Read, convert and write block by block; print the number of events."""
    from jblast.cli.jax_start import start_jax

    # Each block runs the same program, so that optimised code pays in long films.
    start_jax()
    from jblast.report.film import EventsAnswer, dark_film, events_text
    from jblast.sensors.camera.film import film_to_events

    noise = options.noise == "on"
    made = film_to_events(
        options.frames,
        options.out,
        fps=options.fps,
        noise=noise,
        seed=options.seed,
        srgb=options.srgb,
        darkest=options.darkest,
        force=options.force,
        **given(options, threshold="threshold"),
    )
    below = made.below_darkest
    answer = EventsAnswer(
        frames=made.frames,
        width=made.width,
        height=made.height,
        fps=made.frames_hz,
        duration_s=made.seconds,
        threshold=made.threshold,
        srgb=options.srgb,
        noise=options.noise,
        # The ideal camera has no random numbers: a seed would suggest otherwise.
        seed=options.seed if noise else None,
        written=made.written,
        bits=made.bits,
        darkest=made.darkest,
        below_darkest=below,
        warnings=(dark_film(below, made.darkest),) if below else (),
        out=options.out,
    )
    for warning in answer.warnings:
        # On stderr, as stdout may be JSON for another program.
        sys.stderr.write(f"jblast: warning: {warning}\n")
    sys.stdout.write(answer.to_json() if options.json else events_text(answer))
    return 0
