"""What stands behind a scene: an image, or pictures one after another."""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.files.frames import read_colours
from jblast.sensors.camera.files.video.read import Video, open_video

HELD = 1 << 27
"""Bytes of a video's frames that are held, decoded: events look at a time again."""

AHEAD = 64
"""Frames that are rather decoded on the way than leapt over."""

ROUNDING = 1e-9
"""So near to a picture, it is that one [intervals]."""

Image = Float[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class MovingBackground:
    """Pictures behind a scene, linear in time between two of them.

    Attributes:
        times: Of the pictures, from the film's first frame on, rising [s].
        picture: Returns the linear light of one by its number, full scale 1.
    """

    times: Float[np.ndarray, " picture"]
    picture: Callable[[int], Image]

    def at(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ _ _ 3"]:
        """Return the background at some times from the film's first frame on [s].

        The last picture stays as long as it is asked for.
        """
        place = np.interp(times, self.times, np.arange(len(self.times)))
        whole = np.rint(place)
        place = np.where(np.abs(place - whole) < ROUNDING, whole, place)
        before = np.floor(place).astype(int)
        share = place - before
        needed = np.union1d(before, before[share > 0] + 1)
        images = {int(k): self.picture(int(k)) for k in needed}
        return np.stack(
            [
                images[k] if not s else (1.0 - s) * images[k] + s * images[k + 1]
                for k, s in zip(before.tolist(), share.tolist(), strict=True)
            ]
        )


def background_frames(
    files: Sequence[Path], times: Float[np.ndarray, " picture"], camera: Camera
) -> MovingBackground:
    """Return sRGB files as a background.

    Args:
        files: PNG, one for each time; read when they are needed.
        times: From the film's first frame on [s].
        camera: Whose image size they must have.
    """
    return MovingBackground(times, lambda k: background_image(files[k], camera))


def background_video(path: str | Path, camera: Camera) -> MovingBackground:
    """Return a video as a background; its first frame stands behind the film's first.

    Args:
        path: Whatever FFmpeg reads.
        camera: Whose image size it must have.

    Raises:
        InputError: It has another size; and as in `open_video`.
    """
    video = open_video(path)
    check_size(video.path, video.width, video.height, camera)
    frames = _FramesInAnyOrder(video)
    return MovingBackground(video.times, lambda k: video.colours(frames.values(k)))


def background_image(path: Path, camera: Camera) -> Image:
    """Return the linear light of an sRGB file that is to stand behind a scene.

    Args:
        path: A PNG file.
        camera: Whose image size it must have.

    Raises:
        InputError: It cannot be read, or has another size.
    """
    image = read_colours(path)
    check_size(path, image.shape[1], image.shape[0], camera)
    return image


def check_size(path: Path, width: int, height: int, camera: Camera) -> None:
    """Refuse pictures of another size than a camera's.

    Raises:
        InputError: They are.
    """
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"{path}: expected {camera.width} x {camera.height} pixels as the "
            f"camera has, got {width} x {height}"
        )


class _FramesInAnyOrder:
    """Frames of a video by their numbers; quick if asked for nearly in turn.

    Attributes:
        video: The video.
        held: Values of the last frames decoded, by number.
    """

    def __init__(self, video: Video):
        self.video = video
        self.held: OrderedDict[int, np.ndarray] = OrderedDict()
        self._frames: Iterator[np.ndarray] = iter(())
        self._next = len(video) + AHEAD + 1

    def values(self, number: int) -> np.ndarray:
        """Return the values of a frame, as `Video.frames` does."""
        if number not in self.held and not 0 <= number - self._next <= AHEAD:
            self._frames, self._next = self.video.frames(number), number
        while number not in self.held:
            frame = next(self._frames)
            self.held[self._next] = frame
            self._next += 1
            if len(self.held) > max(2, HELD // frame.nbytes):
                self.held.popitem(last=False)
        self.held.move_to_end(number)
        return self.held[number]
