"""Frames of a scene in order of time, block by block: of any length."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import equinox as eqx
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.scene import Camera, Scene
from jblast.sensors.camera.files.frames import read_colours
from jblast.sensors.camera.image.grey_composite import luminance
from jblast.sensors.camera.rendering.billboards import Views
from jblast.sensors.camera.rendering.render import BACKGROUND, render

PIXELS = 1 << 22
"""Of a block of frames: 100 MB of three channels in float64. The rays are computed for
each block, so that short ones are slow."""

LONGEST = 16
"""Frames of a block."""

Frames = Float[np.ndarray, "_ _ _ 3"]


@dataclass(frozen=True)
class Film:
    """What is filmed, and when.

    Attributes:
        scene: What explodes.
        camera: Who looks.
        times: Of the frames, on the common clock, not falling [s].
        background: Linear light: a grey, a colour or an image; or a PNG file for each
            frame, sRGB.
        views: Pictures to show in place of the procedural fireball.
        supersample: Rays along each side of a pixel.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    background: float | Float[np.ndarray, "..."] | tuple[Path, ...] = BACKGROUND
    views: Views | None = None
    supersample: int = 1

    def at_instants(self) -> "Film":
        """Return the same without exposure: an event camera does not gather light."""
        camera = eqx.tree_at(
            lambda c: c.exposure_s, self.camera, 0.0 * self.camera.exposure_s
        )
        return replace(self, camera=camera)

    def frames(self) -> Iterator[tuple[slice, Frames]]:
        """Return the frames of each block, and which they are; two blocks are held.

        Linear light, full scale 1, not clipped.

        Raises:
            InputError: A file of the background cannot be read, or has another size
                than the image; and as in `render`.
        """
        length = self._length()
        for start in range(0, len(self.times), length):
            which = slice(start, min(start + length, len(self.times)))
            places = np.arange(which.start, which.stop, dtype=float)
            yield which, self._rendered(self.times[which], places)

    def some(self, numbers: Sequence[int]) -> Frames:
        """Return a few frames by their numbers, as instants."""
        still, length = self.at_instants(), self._length()
        parts = [numbers[a : a + length] for a in range(0, len(numbers), length)]
        frames = [
            still._rendered(self.times[part], np.asarray(part, float)) for part in parts
        ]
        return np.concatenate(frames)

    def light(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ _ _"]:
        """Return the grey light at some instants, whatever the exposure [s].

        A background that moves is linear between its frames.
        """
        still, length = self.at_instants(), self._length()
        places = np.interp(times, self.times, np.arange(len(self.times)))
        parts = [slice(a, a + length) for a in range(0, len(times), length)]
        frames = [still._rendered(times[part], places[part]) for part in parts]
        return np.concatenate([luminance(part) for part in frames])

    def _length(self) -> int:
        """Return how many frames are rendered together."""
        pixels = self.camera.width * self.camera.height
        return max(1, min(LONGEST, PIXELS // pixels))

    def _rendered(
        self, times: Float[np.ndarray, " few"], places: Float[np.ndarray, " few"]
    ) -> Frames:
        """Return what is seen at a few times, each at a place between the frames."""
        count = len(times)
        # as many as in every block, so that there is one program
        room = (0, self._length() - count)
        times, places = (np.pad(v, room, mode="edge") for v in (times, places))
        background = self.background
        if isinstance(background, tuple):
            background = self._moving(background, places)
        frames = render(
            self.scene,
            self.camera,
            times,
            background=background,
            # a picture from above shows also what its billboard has below ground
            ground=self.views is None,
            supersample=self.supersample,
            views=self.views,
        )
        return np.asarray(frames)[:count]

    def _moving(
        self, files: tuple[Path, ...], place: Float[np.ndarray, " _"]
    ) -> Float[np.ndarray, "_ _ _ 3"]:
        """Return the background at places between its frames, linear between them."""
        before = np.floor(place).astype(int)
        images = {k: background_image(files[k], self.camera) for k in np.unique(before)}
        for k in np.unique(before[place > before] + 1):
            images.setdefault(k, background_image(files[k], self.camera))
        share = place - before
        return np.stack(
            [
                images[k] if not s else (1.0 - s) * images[k] + s * images[k + 1]
                for k, s in zip(before, share, strict=True)
            ]
        )


def background_image(path: Path, camera: Camera) -> Float[np.ndarray, "height width 3"]:
    """Return the linear light of an sRGB file that is to stand behind a scene.

    Args:
        path: A PNG file.
        camera: Whose image size it must have.

    Raises:
        InputError: It cannot be read, or has another size.
    """
    image = read_colours(path)
    if image.shape[:2] != (camera.height, camera.width):
        raise InputError(
            f"{path}: expected {camera.width} x {camera.height} pixels as the "
            f"camera has, got {image.shape[1]} x {image.shape[0]}"
        )
    return image
