"""Films and events that `jblast detect` is given: which they are, read and searched."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.detect.flash.directions import Direction
    from jblast.detect.flash.search import FlashDetections
    from jblast.observations import Observations
    from jblast.report.flash import FlashAnswer, Kind as FilmKind
    from jblast.scene import Camera

Kind = Literal["sound", "frames", "video", "events"]
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".ogv")
EVENTS = (".h5", ".hdf5", ".npz", ".raw", ".aedat4")
OF_SOUND = ("template", "charge", "range", "blast_form", "stream", "positions")
OF_PICTURES = ("fps", "scene")


def kind_of(path: str) -> Kind:
    """Return what a path holds: a folder frames, a file by its suffix, else sound."""
    suffix = Path(path).suffix.lower()
    if Path(path).is_dir():
        return "frames"
    if suffix in VIDEOS:
        return "video"
    return "events" if suffix in EVENTS else "sound"


def kind_asked(asked: Namespace) -> Kind:
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


def flashes_found(asked: Namespace, kind: "FilmKind") -> Found:
    """Search a film or events.

    Raises:
        InputError: They cannot be read, or do not go with the scene.
    """
    from jblast.detect.flash.search import SLOW_HZ, detect_flashes
    from jblast.detect.flash.tail import flash_threshold
    from jblast.report.flash import Searched, flash_answer, rejected_alarms, slow_film

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


def _frames(path: str, asked: Namespace, exposure_s: float) -> tuple[Any, ...]:
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


def _events(path: str, asked: Namespace, camera: "Camera | None") -> tuple[Any, ...]:
    """Return blocks of changes, and what they are."""
    from jblast.detect.flash.event_changes import STEP_S, event_changes
    from jblast.sensors.camera.files.events.read import read_events

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
    from jblast.detect.flash.directions import direction_of
    from jblast.detect.flash.log import log_of

    directions = [direction_of(camera, flash.growth) for flash in seen.flashes]
    comments = [f"jblast detect of {Path(path).name}: first light, place and growth"]
    return directions, log_of(seen.flashes, camera, comments)
