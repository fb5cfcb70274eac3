"""Frames of a scene in order of time, block by block: of any length."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Camera, Scene
from jblast.sensors.camera.files.backgrounds import MovingBackground
from jblast.sensors.camera.geometry.camera_path import CameraPath
from jblast.sensors.camera.image.behind import BACKGROUND, bare, images
from jblast.sensors.camera.image.bloom import bloom
from jblast.sensors.camera.image.grey_composite import luminance
from jblast.sensors.camera.rendering.appearance import Appearance
from jblast.sensors.camera.rendering.carried import render_carried
from jblast.sensors.camera.rendering.landscape import Landscape
from jblast.sensors.camera.rendering.outlook import Outlook, outlook_of
from jblast.sensors.camera.rendering.render import check_camera, render
from jblast.sensors.camera.rendering.view_set import ViewSet

PIXELS = 1 << 22
"""Of a block of frames: 100 MB of three channels in float64."""

LONGEST = 20
"""Frames of a block: a second at most rates is some whole ones."""

Frames = Float[np.ndarray, "_ _ _ 3"]


@dataclass(frozen=True)
class Film:
    """What is filmed, and when.

    Attributes:
        scene: What explodes.
        camera: Who looks.
        times: Of the frames, on the common clock, not falling [s].
        background: Linear light: a grey, a colour, an image, or pictures that move; or
            ground and sky for a camera that moves.
        views: Pictures to show in place of the procedural fireball.
        supersample: Rays along each side of a pixel.
        depth: Distance of the background along each pixel's ray [m]; None is infinite.
        appearance: How bright the day is, and how the fire is drawn; None: as usual.
        path: Of what carries the camera; None if it stands still.
        bloom: Part of the light of frames that the lens spreads; events have none.
        gain: Factor of the light of frames (`image.tone.picture_gain`); events have
            none.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    background: float | Float[np.ndarray, "..."] | MovingBackground | Landscape = (
        BACKGROUND
    )
    views: ViewSet | None = None
    supersample: int = 1
    depth: Float[np.ndarray, "height width"] | None = None
    appearance: Appearance | None = None
    path: CameraPath | None = None
    bloom: float = 0.0
    gain: float = 1.0

    def at_instants(self) -> "Film":
        """Return the same without exposure: an event camera does not gather light."""
        return self._still

    @cached_property
    def _still(self) -> "Film":
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
            yield which, self._shot(self._rendered(self.times[which]))

    def some(self, numbers: Sequence[int]) -> Frames:
        """Return a few frames by their numbers, as instants."""
        still, length = self.at_instants(), self._length()
        parts = [numbers[a : a + length] for a in range(0, len(numbers), length)]
        frames = [still._rendered(self.times[part]) for part in parts]
        return self._shot(np.concatenate(frames))

    def light(self, times: Float[np.ndarray, " _"]) -> Float[np.ndarray, "_ _ _"]:
        """Return the grey light at some instants, whatever the exposure [s].

        A background that moves is linear between its frames.
        """
        still, length = self.at_instants(), self._length()
        parts = [slice(a, a + length) for a in range(0, len(times), length)]
        frames = [still._rendered(times[part]) for part in parts]
        return np.concatenate([luminance(part) for part in frames])

    def _shot(self, frames: Frames) -> Frames:
        """Return frames with the gain and the bloom of a picture."""
        frames = frames if self.gain == 1.0 else self.gain * frames
        return bloom(frames, self.bloom)

    def _length(self) -> int:
        """Return how many frames are rendered together."""
        pixels = self.camera.width * self.camera.height
        return max(1, min(LONGEST, PIXELS // pixels))

    def _rendered(self, times: Float[np.ndarray, " few"]) -> Frames:
        """Return what is seen at a few times."""
        count = len(times)
        # as many as in every block, so that there is one program
        times = np.pad(times, (0, self._length() - count), mode="edge")
        background = self._behind
        if isinstance(background, MovingBackground):
            background = background.at(times - self.times[0])
        if self.path is not None:
            if not isinstance(background, Landscape):
                size = len(times), self.camera.height, self.camera.width, 3
                background = np.broadcast_to(background, size)
            carried = render_carried(
                self.scene,
                self.camera,
                self.path,
                times,
                background=background,
                supersample=self.supersample,
                appearance=self._shown,
                views=self.views,
            )
            return np.asarray(carried)[:count]
        assert not isinstance(background, Landscape), "it is for a camera that moves"
        if times.max() + float(self.camera.exposure_s) <= self._begins:
            check_camera(self.camera, ground=self._ground)
            return bare(self.camera, background, len(times))[:count]
        frames = render(
            self.scene,
            self.camera,
            times,
            background=background,
            depth=self.depth,
            appearance=self._shown,
            ground=self._ground,
            supersample=self.supersample,
            views=self.views,
            outlook=self._outlook,
        )
        return np.asarray(frames)[:count]

    @cached_property
    def _behind(
        self,
    ) -> Float[Array, "..."] | MovingBackground | Landscape:
        """The background; of one light or colour an image, made once for all blocks."""
        if isinstance(self.background, MovingBackground | Landscape):
            return self.background
        return images(self.camera, self.background, len(self.times))

    @cached_property
    def _shown(self) -> Appearance:
        """How it is shown; made once, for it stands on the device."""
        return self.appearance or Appearance()

    @cached_property
    def _begins(self) -> float:
        """When the first charge goes off: until then there is nothing to see [s]."""
        return min(float(charge.time_s) for charge in self.scene.charges)

    @property
    def _ground(self) -> bool:
        """A picture from above shows also what its billboard has below ground."""
        return self.views is None

    @cached_property
    def _outlook(self) -> Outlook:
        """Of a camera that stands: computed once for all blocks."""
        appearance, views = self._shown, self.views
        return outlook_of(
            self.camera,
            None if self.depth is None else jnp.asarray(self.depth, float),
            ground=self._ground,
            supersample=self.supersample,
            lit=appearance.flash and (views is None or views.glows),
            lit_ground=True,
        )
