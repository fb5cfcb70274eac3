"""What `jblast tune` is asked to tune: the record by its kind, and who recorded it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.inference.tuning import Tuned
    from jblast.scene import Camera, UncertainScene

EVENTS = (".h5", ".hdf5", ".npz", ".raw", ".aedat4")
SOUND_ONLY = ("sensor", "full_scale")
SIGHT_ONLY = ("fps", "start", "background")


def tuned_as_asked(asked: argparse.Namespace, names: list[str]) -> "Tuned":
    """Return what a command line asks for.

    Raises:
        InputError: Something in it cannot be.
        NothingHeardError: The time is looked for, and no blast is in the record.
    """
    from jblast.observations.records.formats import is_record
    from jblast.scene import read_scene

    uncertain = read_scene(asked.scene)
    recorded = Path(asked.recorded)
    if not recorded.exists():
        raise InputError(
            f"{asked.recorded}: no such file or directory; expected what was recorded"
        )
    is_events = recorded.suffix.lower() in EVENTS
    if not is_events and is_record(recorded) and not recorded.is_dir():
        _refuse(asked, SIGHT_ONLY, "frames or events")
        return _heard(uncertain, asked, names)
    _refuse(asked, SOUND_ONLY, "sound")
    camera = uncertain.scene.camera
    if camera is None:
        raise InputError(
            f"{asked.scene}: expected a [camera] that saw {asked.recorded}, got none"
        )
    start = asked.start
    if start is None:
        times = [float(charge.time_s) for charge in uncertain.scene.charges]
        start = min(times)
        if not np.isfinite(start):
            raise InputError(
                f"{asked.scene}: [charge] time_s: expected a blast, got one that never "
                "happens"
            )
    if is_events:
        return _events(uncertain, camera, asked, names, start)
    return _frames(uncertain, camera, asked, names, start)


def _heard(
    uncertain: "UncertainScene", asked: argparse.Namespace, names: list[str]
) -> "Tuned":
    from jblast.inference.tuning import recorded_sound, tune_sound
    from jblast.sensors.listening.ambient import with_ambient

    uncertain, _ = with_ambient(uncertain)
    sound = recorded_sound(
        asked.recorded, uncertain.scene, asked.scene, asked.sensor, asked.full_scale
    )
    return tune_sound(uncertain, sound, names)


def _frames(
    uncertain: "UncertainScene",
    camera: "Camera",
    asked: argparse.Namespace,
    names: list[str],
    start: float,
) -> "Tuned":
    from jblast.inference.tuning.tune_sight import STEPS, tune_frames
    from jblast.sensors.camera.files.recordings import open_recording
    from jblast.sensors.camera.image.compositing import linear_to_srgb

    hz = float(camera.frames_hz) if asked.fps is None else asked.fps
    film = open_recording(asked.recorded, hz, srgb=True)
    _check_size(asked, camera, film.width, film.height)
    light = np.concatenate([np.asarray(part, float) for _, part in film.blocks()])
    values = STEPS * linear_to_srgb(light)
    background = _background(asked, camera, film.times)
    return tune_frames(uncertain, values, start + film.times, names, background)


def _events(
    uncertain: "UncertainScene",
    camera: "Camera",
    asked: argparse.Namespace,
    names: list[str],
    start: float,
) -> "Tuned":
    from jblast.inference.tuning.tune_sight import paired, tune_events
    from jblast.sensors.camera.files.events.read import read_events

    if asked.fps is not None:
        raise InputError(
            f"--fps: expected it with frames or a video only, got {asked.recorded}"
        )
    events = read_events(asked.recorded, size=(camera.width, camera.height))
    _check_size(asked, camera, events.width, events.height)
    if not len(events.t):
        raise InputError(f"{asked.recorded}: expected events, got none")
    time = start + 1e-6 * np.asarray(events.t, float)
    sign = 2 * np.asarray(events.p, int) - 1
    x, y = (np.asarray(place, int) for place in (events.x, events.y))
    background = _background(asked, camera, np.array([0.0]))
    pairs = paired(x, y, time, sign, min(start, float(time[0])))
    return tune_events(uncertain, pairs, names, background)


def _background(asked: argparse.Namespace, camera: "Camera", times: np.ndarray):
    """Return light that stands still behind the blast."""
    from jblast.cli.arguments.background import background_named
    from jblast.sensors.camera.files.backgrounds import MovingBackground
    from jblast.sensors.camera.image.behind import BACKGROUND

    if asked.background is None:
        return BACKGROUND
    light = background_named(asked.background, camera, times)
    if isinstance(light, MovingBackground):
        raise InputError(
            "--background: expected light or a picture that stands still, got "
            f"{asked.background!r}"
        )
    return light


def _check_size(
    asked: argparse.Namespace, camera: "Camera", width: int, height: int
) -> None:
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"{asked.recorded}: expected {camera.width} x {camera.height} pixels, as "
            f"[camera] of {asked.scene} has, got {width} x {height}"
        )


def _refuse(asked: argparse.Namespace, options: tuple[str, ...], kind: str) -> None:
    for option in options:
        if getattr(asked, option) is not None:
            name = option.replace("_", "-")
            raise InputError(
                f"--{name}: expected it with {kind} only, got {asked.recorded}"
            )
