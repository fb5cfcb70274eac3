"""Find a blast in what was heard or seen: when it came, and how sure that is.

In sound a template is looked for, or without one and without a charge a bank of pulses
made from the laws of blasts; in frames, a video or events a flash that grows. Exit code
3: nothing was found.
"""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive, positive_of_any_size
from jblast.cli.arguments.paths import path

if TYPE_CHECKING:
    from jblast.report.flash import Kind

NOT_FOUND = 3


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
        default=1.0,
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
    from jblast.cli.arguments.flash_film import kind_asked

    kind = kind_asked(asked)
    if kind != "sound":
        return _run_film(asked, kind)
    from jblast.progress import stages

    begin = stages({"reading": 1.0, "searching": 4.0, "writing": 2.0})
    begin("reading")
    import json

    from jblast.cli.arguments.sound import channels_of, searched_for, stations_of
    from jblast.report.detect import detection_document, detection_text

    _check(asked)
    channels, dead = channels_of(asked.recordings)
    stations = stations_of(asked.positions, channels)
    begin("searching")
    searched, method = searched_for(asked, channels)
    begin("writing")
    log, written = None, []
    if stations is not None:
        from jblast.detect.array.log import log_of

        log = log_of(searched, stations, _provenance(asked, method.words))
    arrays = log.arrays if log else ()
    document = detection_document(searched, dead, method.keys, arrays)
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if asked.out:
        from jblast.report.detect_files import write_detection

        written = write_detection(Path(asked.out), searched, text, log)
    if asked.json:
        sys.stdout.write(text)
    else:
        sys.stdout.write(detection_text(searched, dead, method.words, log))
        if written:
            sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
        if "observations.csv" in written:
            sys.stdout.write(
                f"Fit it with: jblast fit {Path(asked.out) / 'observations.csv'} "
                "--free origin_time_s,charge_east_m,charge_north_m\n"
            )
    return 0 if document["detected"] else NOT_FOUND


def _run_film(asked: argparse.Namespace, kind: "Kind") -> int:
    """Watch, write, print; return the exit code."""
    import json

    from jblast.cli.arguments.flash_film import flashes_found
    from jblast.progress import stages
    from jblast.report.flash import flash_text

    if asked.out:
        from jblast.report.fit.files import check_directory

        check_directory(asked.out, asked.force)
    begin = stages({"watching": 4.0, "writing": 1.0})
    begin("watching")
    found = flashes_found(asked, kind)
    begin("writing")
    document = found.answer.to_dict()
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    written: list[str] = []
    if asked.out:
        from jblast.report.detect_files import write_flashes

        written = write_flashes(
            Path(asked.out), found.watched, found.shape, text, found.log
        )
    if asked.json:
        sys.stdout.write(text)
    else:
        sys.stdout.write(flash_text(found.answer))
        if written:
            sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
        if "observations.csv" in written:
            sys.stdout.write(
                f"Fit it with: jblast fit {Path(asked.out) / 'observations.csv'} "
                f"--scene {asked.scene}\n"
            )
    return 0 if found.answer.detected else NOT_FOUND


def _check(asked: argparse.Namespace) -> None:
    """Refuse options that do not go together, and a folder that is not free.

    Raises:
        InputError: As said.
    """
    from jblast.errors import InputError

    if asked.template and (asked.charge or asked.range):
        other = "--charge" if asked.charge else "--range"
        raise InputError(f"--template: expected it or {other}, got both")
    if (asked.charge is None) != (asked.range is None):
        one, other = ("--charge", "--range")[:: 1 if asked.charge else -1]
        raise InputError(f"{one}: expected {other} beside it, got none")
    if asked.blast_form and (asked.template or asked.charge):
        other = "--template" if asked.template else "--charge"
        raise InputError(f"--blast-form: expected no {other} beside it, got both")
    if asked.positions and not asked.out:
        raise InputError("--positions: expected --out to write the log to, got none")
    if asked.out:
        from jblast.report.fit.files import check_directory

        check_directory(asked.out, asked.force)


def _provenance(asked: argparse.Namespace, how: str) -> list[str]:
    """Return the comment lines of the log."""
    names = ", ".join(Path(file).name for file in asked.recordings)
    return [f"jblast detect of {names}: {how}"]
