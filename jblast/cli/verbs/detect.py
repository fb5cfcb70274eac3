"""Find a blast in what was heard or seen: when it came, and how sure that is.

In sound a template is looked for, or without one and without a charge a bank of pulses
made from the laws of blasts; in frames, a video or events a flash that grows. Exit code
3: nothing was found.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.numbers import positive, positive_of_any_size
from jblast.cli.arguments.options import NOT_FOUND, given, path
from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.signals.detect_files import FilmDetections, SoundDetections

Answer = tuple[dict[str, Any], str, Callable[[Path, str], list[str]]]


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "recordings",
        metavar="RECORDING",
        nargs="+",
        type=path,
        help="WAV or FLAC of one to eight channels, each searched; several files are "
        "taken to begin at the same time, unless --positions gives them clocks. Or one "
        "directory of PNG frames, video, or file of events (.h5, .npz, .raw, .aedat4)",
    )
    verb.add_argument(
        "--fps",
        metavar="HZ",
        type=positive_of_any_size,
        help="frames a second: frame k stands at k/fps; a directory needs it, a video "
        "is taken for slow motion with it",
    )
    verb.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="whose camera filmed it: its pose and lens turn the place in the image "
        "into a direction, and with --out into a log for jblast fit",
    )
    verb.add_argument(
        "--template",
        metavar="TEMPLATE.wav",
        type=path,
        help="sound to look for, of one channel and any rate; an arrival is when its "
        "first sample lands",
    )
    verb.add_argument(
        "--charge",
        metavar="KG",
        type=positive,
        help="look for the pulse of a charge of TNT on the ground; needs --range",
    )
    verb.add_argument(
        "--range", metavar="M", type=positive, help="at this distance from it"
    )
    verb.add_argument(
        "--false-alarms",
        metavar="PER_HOUR",
        type=positive,
        help="set the threshold: of noise alone, in each channel; in film, of scenes "
        "that look like a blast (default: 1)",
    )
    verb.add_argument(
        "--blast-form",
        action="store_true",
        help="without a template: accept only sounds with the form of a blast pulse, "
        "no doors, clicks or most thunder, and no reverberant or distant blasts",
    )
    verb.add_argument(
        "--stream",
        action="store_true",
        help="filter block by block, as what listens for ever does; the noise is that "
        "of the first ten seconds",
    )
    verb.add_argument(
        "--positions",
        metavar="STATIONS.csv",
        type=path,
        help="where the microphones stood: sensor (stem of a file's name, or "
        "stem.channel, from 1), east_m, north_m, up_m, perhaps clock; with --out",
    )
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="also write detect.json, detection.png, of sound what the filter put out "
        "(filtered.wav, in standard deviations of the noise), and with --positions or "
        "--scene observations.csv, a log for jblast fit",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what --out holds of these files"
    )


def run(asked: argparse.Namespace) -> int:
    """Search, write, print; return the exit code."""
    from jblast.signals.detect_files import (
        SoundDetections,
        detect,
        recording_kind,
    )

    of_sound = {
        "template": asked.template,
        "mass_kg": asked.charge,
        "range_m": asked.range,
        "blast_form": asked.blast_form,
        "stream": asked.stream,
        "positions": asked.positions,
    }
    of_film = {"fps": asked.fps, "scene": asked.scene}
    kind = recording_kind(asked.recordings, of_sound, of_film)
    if kind == "sound":
        _check(asked)
    if asked.out:
        from jblast.report.fit.files import check_directory

        check_directory(asked.out, asked.force)
    if asked.scene or (kind == "sound" and not asked.template):
        from jblast.cli.jax_start import start_jax

        start_jax(quick=True)
    found = detect(
        asked.recordings,
        **of_sound,
        **of_film,
        **given(asked, false_alarms="false_alarms_per_hour"),
    )
    from jblast.results import to_json

    is_sound = isinstance(found, SoundDetections)
    document, words, write = _of_sound(found) if is_sound else _of_film(found)
    text = to_json(document)
    written = write(Path(asked.out), text) if asked.out else []
    if asked.json:
        sys.stdout.write(text)
    else:
        sys.stdout.write(words)
        if written:
            sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
        if "observations.csv" in written:
            log = Path(asked.out) / "observations.csv"
            free = "--free origin_time_s,charge_east_m,charge_north_m"
            scene = free if is_sound else f"--scene {asked.scene}"
            sys.stdout.write(f"Fit it with: jblast fit {log} {scene}\n")
    return 0 if found.detected else NOT_FOUND


def _check(asked: argparse.Namespace) -> None:
    """Refuse options that do not go together.

    Raises:
        InputError: As said.
    """
    from jblast.signals.detect_files import check_target

    check_target(asked.template, asked.charge, asked.range, blast_form=asked.blast_form)
    if asked.positions and not asked.out:
        raise InputError("--positions: expected --out to write the log to, got none")


def _of_sound(found: "SoundDetections") -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.report.detect import detection_document, detection_text

    searched, dead, method, log = found
    document = detection_document(
        searched, dead, method.keys, log.arrays if log else ()
    )

    def write(folder: Path, text: str) -> list[str]:
        from jblast.report.detect_files import write_detection

        return write_detection(folder, searched, text, log)

    return document, detection_text(searched, dead, method.words, log), write


def _of_film(found: "FilmDetections") -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.report.flash import (
        Searched,
        flash_answer,
        flash_text,
        rejected_alarms,
        slow_film,
    )
    from jblast.signals.flash.search import SLOW_HZ

    seen, hz = found.flashes, found.frames_hz
    warnings = [] if hz >= SLOW_HZ else [slow_film(hz)]
    answer = flash_answer(
        seen,
        Searched(*found[1:8]),
        found.false_alarms_per_hour,
        found.directions,
        [*warnings, *rejected_alarms(seen.rejected)],
    )

    def write(folder: Path, text: str) -> list[str]:
        from jblast.report.detect_files import write_flashes

        shape = found.height, found.width
        return write_flashes(folder, seen, shape, text, found.log)

    return answer.to_dict(), flash_text(answer), write
