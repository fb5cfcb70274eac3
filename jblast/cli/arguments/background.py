"""What `--background` names: light, an image, or an image for each frame."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.files.frames import frame_files
from jblast.sensors.camera.film import background_image


def background_named(
    text: str, camera: Camera, frames: int
) -> float | Float[np.ndarray, "..."] | tuple[Path, ...]:
    """Return the background a word names.

    Args:
        text: A grey of linear light, 0 to 1; red, green and blue with commas between; a
            PNG file; or a directory of them. Files are sRGB.
        camera: Whose image size a file must have.
        frames: How many there are to be.

    Raises:
        InputError: It is none of these, or there are too few frames.
    """
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        return _read(text, camera, frames)
    light = np.array(numbers)
    if len(numbers) not in (1, 3) or not ((light >= 0) & (light <= 1)).all():
        raise InputError(
            f"--background: expected one or three numbers from 0 to 1, got {text!r}"
        )
    return numbers[0] if len(numbers) == 1 else light


def _read(
    text: str, camera: Camera, frames: int
) -> Float[np.ndarray, "..."] | tuple[Path, ...]:
    """Return the image of a file, or the files of a directory, one for each frame."""
    path = Path(text)
    if path.is_file():
        return background_image(path, camera)
    if not path.is_dir():
        raise InputError(
            "--background: expected a grey, R,G,B, a PNG file or a directory of them, "
            f"got {text!r}"
        )
    files = frame_files(path)
    if len(files) < frames:
        raise InputError(
            f"{path}: expected at least {frames:,} frames, one for each that is to be "
            f"rendered, got {len(files):,}"
        )
    return tuple(files[:frames])
