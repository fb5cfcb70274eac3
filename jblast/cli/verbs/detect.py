"""Detect a blast in sound, film or camera events: its arrival time and uncertainty.

Sound is searched for a template (--template), for the pulse of a charge (--charge and
--range), or for a bank of pulses made from blast laws. Frames, video and camera events
are searched for a growing flash. Exit code 3: nothing is found.
"""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.logs import fit_command
from jblast.cli.arguments.numbers import positive, positive_of_any_size
from jblast.cli.arguments.options import NOT_FOUND, add_force, add_json, given, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, whole_number

if TYPE_CHECKING:
    from jblast.signals.detect_files import (
        ClipDetections,
        FilmDetections,
        SoundDetections,
    )


def image_size(text: str) -> tuple[int, int]:
    """Return width and height of `640x480`."""
    sides = [whole_number(side) for side in text.lower().split("x")]
    if len(sides) != 2 or not all(sides):
        raise argparse.ArgumentTypeError(
            f"expected width and height, such as 640x480, got {text!r}"
        )
    return sides[0] or 0, sides[1] or 0


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "recordings",
        metavar="RECORDING",
        nargs="+",
        type=path,
        help="WAV or FLAC files of one to eight channels, each searched; several "
        "files start simultaneously, unless --positions has their clocks. Or one "
        "folder of PNG frames, one file of camera events (.h5, .npz, .raw, .aedat4, "
        ".dat, .csv, .txt), or one or more videos, whose sound tracks are searched",
    )
    verb.inputs.add_argument(
        "--fps",
        metavar="HZ",
        type=positive_of_any_size,
        help="frame rate [Hz]: frame k is at k/fps; required for a folder; of a video "
        "in slow motion the rate of the camera (default: clock of the video)",
    )
    verb.inputs.add_argument(
        "--positions",
        metavar="STATIONS.csv",
        type=path,
        help="positions of microphones or clips: columns sensor (stem of a file's "
        "name, or stem.channel, from 1), east_m, north_m, up_m, and optionally clock; "
        "requires --out",
    )
    verb.inputs.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file of the camera, whose pose and lens convert the image position "
        "to a direction, and with --out to a log for jblast fit",
    )
    verb.inputs.add_argument(
        "--size",
        metavar="WIDTHxHEIGHT",
        type=image_size,
        help="image size of camera events [px], for files that do not state it: "
        "640x480",
    )
    verb.model.add_argument(
        "--template",
        metavar="TEMPLATE.wav",
        type=path,
        help="sound to search for, one channel at any sampling rate; the arrival is "
        "the time of its first sample",
    )
    verb.model.add_argument(
        "--charge",
        metavar="KG",
        type=positive,
        help="TNT mass of a charge on the ground [kg], whose pulse is searched for; "
        "requires --range",
    )
    verb.model.add_argument(
        "--range",
        metavar="M",
        type=positive,
        help="distance of --charge [m]",
    )
    verb.advanced.add_argument(
        "--false-alarms",
        metavar="PER_HOUR",
        type=positive,
        help="accepted false alarms per hour: due to noise in each channel of sound, "
        "due to scenes that resemble a blast in film (default: 1)",
    )
    verb.advanced.add_argument(
        "--all-sounds",
        action="store_true",
        help="search without a template for impulsive sounds of any form: also "
        "reverberant or distant blasts, but doors, clicks and thunder as well "
        "(default: sounds with the form of a blast pulse)",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="folder for detect.json and detection.png; for sound also filtered.wav "
        "(filter output in standard deviations of the noise); with --positions or "
        "--scene also observations.csv, a log for jblast fit",
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Search, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.results import to_json
    from jblast.signals.detect_files import detect

    if options.positions and not options.out:
        raise InputError("--positions: expected --out to write the log to, got none")
    if options.out:
        from jblast.report.fit.files import check_directory

        check_directory(options.out, options.force)
    start_jax(quick=True)
    found = detect(
        options.recordings,
        template=options.template,
        mass_kg=options.charge,
        range_m=options.range,
        all_sounds=options.all_sounds,
        positions=options.positions,
        fps=options.fps,
        scene=options.scene,
        size=options.size,
        **given(options, false_alarms="false_alarms_per_hour"),
    )
    document, words = _answer(found)
    text = to_json(document)
    if options.out:
        from jblast.report.detect_files import LOG, write_detection

        folder = Path(options.out)
        written = write_detection(folder, text, found)
        words += f"\nWritten to {folder}: {', '.join(written)}\n"
        if LOG in written:
            words += f"Fit it with: {fit_command(folder / LOG, options.scene)}\n"
    sys.stdout.write(text if options.json else words)
    return 0 if found.detected else NOT_FOUND


def _answer(
    found: "SoundDetections | FilmDetections | ClipDetections",
) -> tuple[dict[str, Any], str]:
    """Return the document and the text."""
    from jblast.report.detect import detection_answer, detection_text
    from jblast.report.flash import ClipsAnswer, flash_answer, flash_text
    from jblast.signals.detect_files import ClipDetections, SoundDetections

    if isinstance(found, SoundDetections):
        return detection_answer(found).to_dict(), detection_text(found)
    if not isinstance(found, ClipDetections):
        answer = flash_answer(found)
        return answer.to_dict(), flash_text(answer)
    answers = tuple(map(flash_answer, found.clips))
    words = [f"{Path(a.recording.path).name}: {flash_text(a)}" for a in answers]
    return ClipsAnswer(found.detected, answers).to_dict(), "\n".join(words)
