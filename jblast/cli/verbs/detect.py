"""Detect a blast in sound, film or camera events: its arrival time and uncertainty.

Sound is searched for a template (--template), for the pulse of a charge (--charge and
--range), or for a bank of pulses made from blast laws. Frames, video and camera events
are searched for a growing flash. Exit code 3: nothing is found.
"""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.logs import fit_command
from jblast.cli.arguments.numbers import positive, positive_of_any_size
from jblast.cli.arguments.options import NOT_FOUND, add_force, add_json, given, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, whole_number

if TYPE_CHECKING:
    from jblast.report.flash import FlashAnswer
    from jblast.signals.detect_files import (
        ClipDetections,
        FilmDetections,
        SoundDetections,
    )

Answer = tuple[dict[str, Any], str, Callable[[Path, str], list[str]]]


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
    verb.advanced.add_argument(
        "--stream",
        action="store_true",
        help="search packet by packet, as a live stream; the arrivals are the same",
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
    from jblast.signals.detect_files import (
        ClipDetections,
        SoundDetections,
        detect,
        recording_kind,
    )

    of_sound = {
        "template": options.template,
        "mass_kg": options.charge,
        "range_m": options.range,
        "all_sounds": options.all_sounds,
        "stream": options.stream,
        "positions": options.positions,
    }
    of_film = {"fps": options.fps, "scene": options.scene, "size": options.size}
    # `detect` checks the same, but only after the seconds in which JAX starts
    kind = recording_kind(options.recordings, **of_sound, **of_film)
    if options.positions and not options.out:
        raise InputError("--positions: expected --out to write the log to, got none")
    if options.out:
        from jblast.report.fit.files import check_directory

        check_directory(options.out, options.force)
    # Pulses of laws and the camera of a scene need JAX; other searches use NumPy.
    if options.scene or (not options.template and _has_sound(kind, options.recordings)):
        from jblast.cli.jax_start import start_jax

        start_jax(quick=True)
    found = detect(
        options.recordings,
        **of_sound,
        **of_film,
        **given(options, false_alarms="false_alarms_per_hour"),
    )
    from jblast.results import to_json

    if isinstance(found, SoundDetections):
        document, words, write = _of_sound(found)
    elif isinstance(found, ClipDetections):
        document, words, write = _of_clips(found)
    else:
        document, words, write = _of_film(found)
    text = to_json(document)
    written = write(Path(options.out), text) if options.out else []
    if options.json:
        sys.stdout.write(text)
    else:
        sys.stdout.write(words)
        if written:
            sys.stdout.write(f"\nWritten to {options.out}: {', '.join(written)}\n")
        if "observations.csv" in written:
            log = Path(options.out) / "observations.csv"
            command = fit_command(log, options.scene)
            sys.stdout.write(f"Fit it with: {command}\n")
    return 0 if found.detected else NOT_FOUND


def _of_sound(found: "SoundDetections") -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.report.detect import detection_answer, detection_text

    searched, dead, method, log = found
    arrays = log.arrays if log else ()
    answer = detection_answer(searched, dead, method.keys, arrays)

    def write(folder: Path, text: str) -> list[str]:
        from jblast.report.detect_files import (
            PICTURE,
            detection_figure,
            write_detection,
        )

        figures = {PICTURE: partial(detection_figure, searched)}
        return write_detection(
            folder, text, figures, log and log.observations, searched
        )

    return answer.to_dict(), detection_text(searched, dead, method.words, log), write


def _has_sound(kind: str, recordings: list[str]) -> bool:
    """Return True if a recording is sound, or a video with a sound track."""
    from jblast.observations.records.clips import has_sound

    if kind != "video":
        return kind == "sound"
    return any(has_sound(Path(file)) for file in recordings)


def _of_clips(found: "ClipDetections") -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.report.flash import ClipsAnswer, flash_text

    names = [Path(clip.path) for clip in found.clips]
    answers = tuple(map(film_answer, found.clips))
    words = "\n".join(
        f"{path.name}: {flash_text(answer)}"
        for path, answer in zip(names, answers, strict=True)
    )

    def write(folder: Path, text: str) -> list[str]:
        from jblast.report.detect_files import PICTURE, flash_figure, write_detection

        figures = {
            f"{path.stem}.{PICTURE}": partial(
                flash_figure, clip.flashes, (clip.height, clip.width)
            )
            for path, clip in zip(names, found.clips, strict=True)
        }
        return write_detection(folder, text, figures, found.log)

    return ClipsAnswer(found.detected, answers).to_dict(), words, write


def film_answer(found: "FilmDetections") -> "FlashAnswer":
    """Return the answer on a film."""
    from jblast.report.detect import sound_arrivals
    from jblast.report.flash import Searched, flash_answer, slow_film
    from jblast.signals.detect_files import bang_of
    from jblast.signals.flash.search import SLOW_HZ

    seen, hz = found.flashes, found.frames_hz
    warnings = [] if hz >= SLOW_HZ else [slow_film(hz)]
    bang = bang_of(found)
    return flash_answer(
        seen,
        Searched(*found[1:8]),
        found.false_alarms_per_hour,
        found.directions,
        [*warnings, *found.notes],
        sound_arrivals(found.sound.searched) if found.sound else (),
        bang and bang.time_s,
    )


def _of_film(found: "FilmDetections") -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.report.flash import flash_text

    answer, seen = film_answer(found), found.flashes

    def write(folder: Path, text: str) -> list[str]:
        from jblast.report.detect_files import PICTURE, flash_figure, write_detection

        draw = partial(flash_figure, seen, (found.height, found.width))
        return write_detection(folder, text, {PICTURE: draw}, found.log)

    return answer.to_dict(), flash_text(answer), write
