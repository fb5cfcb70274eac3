"""Find a blast in what was heard or seen: when it came, and how sure that is.

In sound a template is looked for, or without one and without a charge a bank of pulses
made from the laws of blasts; in frames, a video or events a flash that grows. Exit code
3: nothing was found.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from jblast.cli.arguments.numbers import positive, positive_of_any_size
from jblast.cli.arguments.options import EVENT_FILES, path
from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.observations import Observations
    from jblast.report.flash import FlashAnswer, Kind as FilmKind
    from jblast.scene import Camera
    from jblast.signals.flash.fireball import Direction
    from jblast.signals.flash.search import FlashDetections

NOT_FOUND = 3
Kind = Literal["sound", "frames", "video", "events"]
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ogv")
OF_SOUND = ("template", "charge", "range", "blast_form", "stream", "positions")
OF_PICTURES = ("fps", "scene")


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
        from jblast.signals.arrival_log import log_of

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


def _run_film(asked: argparse.Namespace, kind: "FilmKind") -> int:
    """Watch, write, print; return the exit code."""
    import json

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


def kind_of(path: str) -> Kind:
    """Return what a path holds: a folder frames, a file by its suffix, else sound."""
    suffix = Path(path).suffix.lower()
    if Path(path).is_dir():
        return "frames"
    if suffix in VIDEOS:
        return "video"
    return "events" if suffix in EVENT_FILES else "sound"


def kind_asked(asked: argparse.Namespace) -> Kind:
    """Return what kind of recording is to be searched.

    Raises:
        InputError: Sound and pictures in one call, several films, or an option that
            the kind has no use for; or there is no such file.
    """
    kinds: list[Kind] = [kind_of(path) for path in asked.recordings]
    seen = [
        p for p, kind in zip(asked.recordings, kinds, strict=True) if kind != "sound"
    ]
    if seen and len(asked.recordings) > 1:
        raise InputError(
            f"{seen[0]}: expected one folder of frames, video or file of events at a "
            f"time, and no sound beside it; got {len(asked.recordings)} recordings"
        )
    unused = OF_SOUND if seen else OF_PICTURES
    for name in unused:
        if getattr(asked, name):
            first = asked.recordings[0]
            if not Path(first).exists():
                raise InputError(f"{first}: no such file or directory")
            only = "sound" if seen else "frames, a video or events"
            option = name.replace("_", "-")
            raise InputError(f"--{option}: expected it with {only} only, got {first}")
    return kinds[0]


class Found(NamedTuple):
    """What a film was searched for, and what was seen.

    Attributes:
        answer: As it is printed.
        watched: As it was seen.
        shape: Height and width of the image [px].
        log: Rows; None without a scene.
    """

    answer: "FlashAnswer"
    watched: "FlashDetections"
    shape: tuple[int, int]
    log: "Observations | None"


def flashes_found(asked: argparse.Namespace, kind: "FilmKind") -> Found:
    """Search a film or events.

    Raises:
        InputError: They cannot be read, or do not go with the scene.
    """
    from jblast.report.flash import Searched, flash_answer, rejected_alarms, slow_film
    from jblast.signals.flash.search import SLOW_HZ, detect_flashes, flash_threshold

    path = asked.recordings[0]
    camera = None if asked.scene is None else camera_of(asked.scene)
    blocks, size, frames, rate, seconds = (
        _events(path, asked, camera)
        if kind == "events"
        else _frames(path, asked, 0.0 if camera is None else float(camera.exposure_s))
    )
    if camera is not None and size != (camera.width, camera.height):
        raise InputError(
            f"{asked.scene}: [camera]: expected {size[0]} x {size[1]} pixels as in "
            f"{path}, got {camera.width} x {camera.height}"
        )
    height = flash_threshold(asked.false_alarms)
    seen = detect_flashes(blocks, rate, height, changes=kind == "events")
    searched = Searched(path, kind, size[0], size[1], frames, rate, seconds)
    warnings = [] if rate >= SLOW_HZ else [slow_film(rate)]
    warnings += rejected_alarms(seen.rejected)
    directions: Sequence[Direction] = ()
    log = None
    if camera is not None:
        directions, log = _rows(seen, camera, path)
    answer = flash_answer(seen, searched, asked.false_alarms, directions, warnings)
    return Found(answer, seen, (size[1], size[0]), log)


def camera_of(scene: str) -> "Camera":
    """Return a scene's camera.

    Raises:
        InputError: It has none.
    """
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.scene import read_scene

    camera = read_scene(scene).scene.camera
    if camera is None:
        raise InputError(f"{scene}: expected a [camera] that filmed this, got none")
    return camera


def _frames(path: str, asked: argparse.Namespace, exposure_s: float) -> tuple[Any, ...]:
    """Return blocks of frames at the middle of their exposures, and what they are."""
    from jblast.progress import counted
    from jblast.sensors.camera.files.recordings import open_recording

    if asked.fps is None and Path(path).is_dir():
        raise InputError(
            f"{path}: expected --fps HZ, as PNG frames do not tell how many of them a "
            "second has; got none"
        )
    film = open_recording(path, asked.fps, srgb=True)
    if len(film) < 2:
        raise InputError(f"{path}: expected at least two frames, got {len(film)}")
    through = counted(len(film), "frames")

    def blocks():
        done = 0
        for times, light in film.blocks():
            yield times + 0.5 * exposure_s, light
            done += len(times)
            through(done)

    seconds = float(film.times[-1] - film.times[0])
    size = (film.width, film.height)
    return blocks(), size, len(film), float(film.frames_hz), seconds


def _events(
    path: str, asked: argparse.Namespace, camera: "Camera | None"
) -> tuple[Any, ...]:
    """Return blocks of changes, and what they are."""
    from jblast.sensors.camera.files.event_files import read_events
    from jblast.signals.flash.search import STEP_S, event_changes

    if asked.fps is not None:
        raise InputError(f"--fps: expected it with frames or a video only, got {path}")
    size = None if camera is None else (camera.width, camera.height)
    events = read_events(path, size=size)
    if not len(events.t):
        raise InputError(f"{path}: expected events, got none")
    first = int(events.t[0]) if events.t[0] < 0 else 0
    events = events._replace(t=events.t - first)
    threshold = (0.2, 0.2)
    if camera is not None:
        brighter, darker = (float(step) for step in camera.threshold)
        threshold = brighter, darker
    seconds = 1e-6 * float(events.t[-1])
    steps = int(events.t[-1]) // round(1e6 * STEP_S) + 1
    blocks = event_changes(events, threshold)
    return blocks, (events.width, events.height), steps, 1.0 / STEP_S, seconds


def _rows(
    seen: "FlashDetections", camera: "Camera", path: str
) -> tuple[Sequence["Direction"], "Observations"]:
    """Return directions, and the rows of a log."""
    from jblast.signals.flash.fireball import direction_of
    from jblast.signals.flash.search import log_of

    directions = [direction_of(camera, flash.growth) for flash in seen.flashes]
    comments = [f"jblast detect of {Path(path).name}: first light, place and growth"]
    return directions, log_of(seen.flashes, camera, comments)
