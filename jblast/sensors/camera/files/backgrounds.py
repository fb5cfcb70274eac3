"""Backgrounds of films: a grey, a colour, a picture, a folder of frames or a video."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument
from jblast.scene import Camera
from jblast.sensors.camera.files.images import frame_files
from jblast.sensors.camera.files.recordings import (
    MovingBackground,
    background_frames,
    background_image,
    background_video,
)

Background = float | Float[np.ndarray, "..."] | MovingBackground


def background_named(
    text: str, camera: Camera, times: Float[np.ndarray, " frame"]
) -> Background:
    """Return the background that a command-line word names.

    Args:
        text: A grey of linear light, 0 to 1; red, green and blue with commas between; a
            PNG file; a directory of them, one per frame; or a video that starts at the
            first frame. PNG files are sRGB.
        camera: Camera, whose image size a file must have.
        times: Times of the frames to render [s].

    Raises:
        InputError: It is none of these, or there are too few images.
    """
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        return _read(text, camera, times - times[0])
    # numbers are linear light, files are sRGB
    light = np.array(numbers)
    if len(numbers) not in (1, 3) or not ((light >= 0) & (light <= 1)).all():
        raise InputError(
            f"{argument('background')}: expected one or three numbers from 0 to 1, "
            f"got {text!r}"
        )
    return numbers[0] if len(numbers) == 1 else light


def _read(
    text: str, camera: Camera, times: Float[np.ndarray, " frame"]
) -> Float[np.ndarray, "..."] | MovingBackground:
    """Return the image of a file, or pictures for times from the first frame on."""
    path = Path(text)
    if path.is_dir():
        files = frame_files(path)
        if len(files) < len(times):
            raise InputError(
                f"{path}: expected at least {len(times):,} frames, one per rendered "
                f"frame, got {len(files):,}"
            )
        return background_frames(files[: len(times)], times, camera)
    if not path.is_file():
        raise InputError(
            f"{argument('background')}: expected a grey, R,G,B, a PNG file, a "
            f"directory of them or a video, got {text!r}"
        )
    if path.suffix.lower() == ".png":
        return background_image(path, camera)
    background = background_video(path, camera)
    # the last frame lasts one mean interval, as all others do
    lasts = background.times[-1] * len(background.times) / (len(background.times) - 1)
    if times[-1] > lasts:
        raise InputError(
            f"{path}: expected a video as long as the film, {times[-1]:.6g} s, got one "
            f"of {lasts:.6g} s"
        )
    return background
