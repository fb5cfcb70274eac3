"""Sensors and media tuned to a recording: a file of sound or events, frames, a video.

`tune` does what `jblast tune SCENE RECORDED` does: it reads the scene and the
recording, and fits the free parameters to it.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, argument
from jblast.inference.tuning.result import Tuned
from jblast.inference.tuning.tune_sight import (
    STEPS,
    paired,
    tune_events,
    tune_frames,
)
from jblast.inference.tuning.tune_sound import recorded_sound, tune_sound
from jblast.observations.records.clips import VIDEOS
from jblast.observations.records.formats import is_record
from jblast.scene import Camera, read_scene
from jblast.sensors.camera.files.backgrounds import background_named
from jblast.sensors.camera.files.event_files import EVENT_FORMATS, read_events
from jblast.sensors.camera.files.recordings import ImageSequence, open_recording
from jblast.sensors.camera.image import BACKGROUND, linear_to_srgb
from jblast.sensors.listening import with_ambient


def tune(
    scene: str | os.PathLike[str],
    recorded: str | os.PathLike[str],
    freed: Sequence[str] = (),
    *,
    sensor: str | None = None,
    full_scale: float | None = None,
    fps: float | None = None,
    start: float | None = None,
    background: str | None = None,
) -> Tuned:
    """Tune a scene's sensors and media to a recording.

    Args:
        scene: File of the scene.
        recorded: Sound of a microphone or pressure gauge; or a folder of PNG frames, a
            video, or a file of events of its camera.
        freed: Further parameters to tune.
        sensor: For sound: name of the sensor; default: that of the file, or the only
            one.
        full_scale: For sound: pascals per sample of 1; default: 1 for floats, the
            sensor's for integers.
        fps: For frames: frame rate; default: the camera's.
        start: For frames and events: time of frame 0, or of time 0 of events, on the
            scene's clock [s]; default: the first explosion.
        background: For frames and events: light or picture behind the blast
            (`background_named`); default: a grey of 0.18.

    Raises:
        InputError: The scene or the recording cannot be read, or an argument does not
            apply to this kind.
        NothingHeardError: The time is free, and the record has no blast.
    """
    source, path = os.fspath(scene), os.fspath(recorded)
    uncertain = read_scene(source)
    if not Path(path).exists():
        raise InputError(f"{path}: no such file or directory; expected a recording")
    # files of events are recognised by their suffix alone
    suffix = Path(path).suffix.lower()
    # a text may be a record of sound or of events: here it is one of sound
    is_sound = suffix in (".txt", ".csv") or suffix not in (*EVENT_FORMATS, *VIDEOS)
    if is_sound and is_record(Path(path)) and not Path(path).is_dir():
        of_sight = {"fps": fps, "start": start, "background": background}
        _refuse(of_sight, path, "frames or events")
        uncertain, _ = with_ambient(uncertain)
        sound = recorded_sound(path, uncertain.scene, source, sensor, full_scale)
        return tune_sound(uncertain, sound, list(freed))
    _refuse({"sensor": sensor, "full_scale": full_scale}, path, "sound")
    camera = uncertain.scene.camera
    if camera is None:
        raise InputError(f"{source}: expected the [camera] of {path}, got none")
    # frames and events have no common clock with the scene, so time 0 is an assumption
    if start is None:
        start = min(float(charge.time_s) for charge in uncertain.scene.charges)
    if suffix in EVENT_FORMATS:
        _refuse({"fps": fps}, path, "frames or a video")
        events = read_events(path, size=(camera.width, camera.height))
        _check_size(source, path, camera, events.width, events.height)
        if not len(events.t):
            raise InputError(f"{path}: expected events, got none")
        time = start + 1e-6 * np.asarray(events.t, float)
        # polarity 0 or 1 to -1 or 1
        sign = 2 * np.asarray(events.p, int) - 1
        x, y = (np.asarray(place, int) for place in (events.x, events.y))
        # the record begins at its time 0, or at an event before it
        pairs = paired(x, y, time, sign, min(start, float(time[0])))
        # a still background is the same at any time
        behind = _background(background, camera, np.array([0.0]))
        return tune_events(uncertain, pairs, list(freed), behind)
    film = open_recording(
        path, float(camera.frames_hz) if fps is None else fps, srgb=True
    )
    _check_size(source, path, camera, film.width, film.height)
    # the reader gives linear light; residuals are uniform in grey values of the file
    light = np.concatenate([np.asarray(part, float) for _, part in film.blocks()])
    values = STEPS * linear_to_srgb(light)
    behind = _background(background, camera, film.times)
    return tune_frames(uncertain, values, start + film.times, list(freed), behind)


def _background(word: str | None, camera: Camera, times: np.ndarray) -> Any:
    """Return the constant light behind the blast."""
    if word is None:
        return BACKGROUND
    light = background_named(word, camera, times)
    if isinstance(light, ImageSequence):
        raise InputError(
            f"{argument('background')}: expected light or a still picture, got {word!r}"
        )
    return light


def _check_size(
    source: str, path: str, camera: Camera, width: int, height: int
) -> None:
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"{path}: expected {camera.width} x {camera.height} pixels, as [camera] of "
            f"{source} has, got {width} x {height}"
        )


def _refuse(options: dict[str, Any], path: str, kind: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise InputError(
                f"{argument(name)}: expected it with {kind} only, got {path}"
            )
