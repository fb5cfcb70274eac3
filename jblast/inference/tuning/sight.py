r"""What frames and events say of a scene.

Frames: the grey value of each pixel as a file of 8 bits has it, sRGB, against that of
`render`, with the tone curve of pictures (`camera.image`). Rounding leaves
$1/\sqrt{12}$ of a step.

Events: an ideal pixel sends one where the logarithm of its light has changed by a
threshold since the last, so of each event $i$ and the one before it at its pixel

$$L(t_i) - L(t_{i-1}) = \pm\theta_\pm$$

holds as exactly as stamps tell the time: linear in the thresholds and smooth in all
else, where counts are staircases. What is left is weighed as Student-t errors are, of
the size that it has itself, so that events from noise count little.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.scene import Camera, Scene
from jblast.sensors.camera.events.scene import pixel_light
from jblast.sensors.camera.fireball import WHITE, Appearance
from jblast.sensors.camera.image import linear_to_srgb, luminance, toned
from jblast.sensors.camera.rendering import render

STEPS = 255.0
ROUNDING = 12.0**-0.5
"""Standard deviation of what rounding leaves, in steps of 8 bits."""
FREEDOM = 4.0
"""Of the Student-t errors of events."""
STAMP = 0.5e-6 * 3.0**-0.5
"""Standard deviation of a stamp in whole microseconds [s]."""
TO_MEDIAN = 0.6745

Ints = Int[Array, " event"] | Int[np.ndarray, " event"]
Floats = Float[Array, " event"] | Float[np.ndarray, " event"]


class FramesEvidence(eqx.Module):
    """Pixels of some frames, and what would be seen.

    Attributes:
        values: Grey values of pixels, in steps of 8 bits.
        counted: 1 where a value has changed by so much that its rounding may be taken
            for noise, else 0: what is lit by less is rounded alike everywhere.
        times: Of the frames, on the common clock [s].
        pixels: Which of all, row by row.
        background: Linear light.
        index: Of no sensor.
    """

    values: Float[Array, "frame pixel"]
    counted: Float[Array, "frame pixel"]
    times: Float[Array, " frame"]
    pixels: Int[Array, " pixel"]
    background: Float[Array, "..."]
    index: int = eqx.field(static=True, default=-1)

    def predicted(self, scene: Scene) -> Float[Array, "frame pixel"]:
        """Return the values that are expected."""
        camera = camera_of(scene)
        frames = render(
            scene,
            camera,
            self.times,
            background=self.background,
            appearance=look_of(camera),
        )
        values = STEPS * linear_to_srgb(luminance(toned(frames)))
        return values.reshape(len(self.times), -1)[:, self.pixels]

    def groups(self) -> tuple[Int[Array, " value"], int]:
        """Return the frame of each value, and how many frames there are."""
        frames, pixels = self.values.shape
        return jnp.repeat(jnp.arange(frames), pixels), frames

    def misfit(self, scene: Scene) -> Float[Array, ""]:
        """Return the rms of what is left, in steps of 8 bits."""
        left = self.counted * (self.values - self.predicted(scene))
        return jnp.sqrt(jnp.square(left).sum() / jnp.maximum(self.counted.sum(), 1.0))

    def weights(self, scene: Scene) -> Float[Array, ""]:
        """Return the standard deviation of each value."""
        del scene
        return jnp.asarray(ROUNDING)

    def residuals(
        self, scene: Scene, weights: Float[Array, ""]
    ) -> tuple[Float[Array, "frame pixel"]]:
        """Return what is left over its standard deviation."""
        left = self.values - self.predicted(scene)
        return (self.counted * left / weights,)


class EventPairs(NamedTuple):
    """Events, each with when its pixel sent one before.

    Attributes:
        x: Column.
        y: Row.
        time: When it was sent, on the common clock [s].
        before: When the one before was, or the record began [s].
        sign: 1 for brighter, -1 for darker.
    """

    x: Ints
    y: Ints
    time: Floats
    before: Floats
    sign: Ints


class EventsEvidence(eqx.Module):
    """Events, and what would be seen.

    Attributes:
        events: Some of a camera's.
        size: Rows and columns of the image.
        background: Linear light.
        index: Of no sensor.
    """

    events: EventPairs
    size: tuple[int, int] = eqx.field(static=True)
    background: Float[Array, "..."]
    index: int = eqx.field(static=True, default=-1)

    def changes(
        self, scene: Scene, later: Float[Array, ""] | float = 0.0
    ) -> Float[Array, " event"]:
        """Return the change of the logarithm of light from event to event.

        Args:
            scene: What is there.
            later: By which all events are counted later [s].
        """
        camera, events = camera_of(scene), self.events
        light = pixel_light(
            scene, camera, background=self.background, appearance=look_of(camera)
        )
        x, y = jnp.asarray(events.x, float), jnp.asarray(events.y, float)
        time, before = jnp.asarray(events.time), jnp.asarray(events.before)
        return light(time + later, x, y) - light(before, x, y)

    def groups(self) -> tuple[Ints, int]:
        """Return the pixel of each event, and how many pixels there are."""
        height, width = self.size
        return self.events.y * width + self.events.x, height * width

    def left(self, scene: Scene) -> Float[Array, " event"]:
        """Return the change that no threshold explains, in thresholds."""
        threshold = camera_of(scene).threshold
        own = jnp.where(self.events.sign > 0, threshold[0], threshold[1])
        return self._left(scene) / own

    def misfit(self, scene: Scene) -> Float[Array, ""]:
        """Return the typical size of what is left, in thresholds."""
        return jnp.median(jnp.abs(self.left(scene))) / TO_MEDIAN

    def weights(self, scene: Scene) -> Float[Array, " event"]:
        """Return the standard deviation of what is left of each, in logarithms."""
        _, slope = jax.jvp(
            lambda later: self.changes(scene, later), (jnp.zeros(()),), (jnp.ones(()),)
        )
        stamp = jnp.abs(slope) * STAMP * jnp.sqrt(2.0)
        left = self._left(scene)
        # the size of what stamps do not explain, by its median
        size = jnp.median(jnp.abs(left)) / TO_MEDIAN
        sd = jnp.sqrt(jnp.square(stamp) + jnp.square(size) + 1e-20)
        far = (FREEDOM + jnp.square(left / sd)) / (FREEDOM + 1.0)
        return sd * jnp.sqrt(far)

    def residuals(
        self, scene: Scene, weights: Float[Array, " event"]
    ) -> tuple[Float[Array, " event"]]:
        """Return what is left over its standard deviation.

        Of logarithms: over a threshold that is looked for, all that is left would
        grow less with it.
        """
        return (self._left(scene) / weights,)

    def _left(self, scene: Scene) -> Float[Array, " event"]:
        threshold = camera_of(scene).threshold
        own = jnp.where(self.events.sign > 0, threshold[0], threshold[1])
        sign = jnp.asarray(self.events.sign, own.dtype)
        return self.changes(scene) - sign * own


def camera_of(scene: Scene) -> Camera:
    """Return a scene's camera."""
    assert scene.camera is not None, "it is asked for before"
    return scene.camera


def look_of(camera: Camera) -> Appearance:
    """Return how a camera is exposed."""
    if camera.daylight is None:
        return Appearance(white=WHITE)
    return Appearance(white=camera.daylight / jnp.pi)
