"""What Blender rendered of a frame as heat, shade and opacity."""

import numpy as np
from jaxtyping import Float

from jblast.sensors.camera.bake.coding import LEAST, Layers, heat_of_light
from jblast.sensors.camera.bake.exr import Channels

SMOOTHED = 1.1
"""Standard deviation of what shade is averaged over [px]: few rays were scattered."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB."""


def layers_of(glow: Channels, shade: Channels) -> Layers:
    """Return a frame's layers.

    Opacity and heat come from the gas that emits and absorbs, which has little noise.
    The colour under the sky is the other one's light over its own opacity, both
    averaged over the neighbours.

    Args:
        glow: Channels R, G, B, A of the gas that glows: premultiplied, linear.
        shade: The same of the gas that scatters.
    """
    alpha = np.clip(glow["A"], 0.0, 1.0)
    there = np.maximum(alpha, LEAST)
    light = sum(w * glow[c] for w, c in zip(LUMINANCE, "RGB", strict=True)) / there
    heat = np.where(alpha > LEAST, heat_of_light(np.asarray(light)), 0.0)
    opacity = np.maximum(averaged(shade["A"]), 1e-3)
    colour = np.stack([averaged(shade[c]) / opacity for c in "RGB"], axis=-1)
    return Layers(heat, np.clip(colour, 0.0, 1.0), alpha)


def averaged(
    image: Float[np.ndarray, "height width"],
) -> Float[np.ndarray, "height width"]:
    """Return an image averaged over neighbours by a Gaussian of `SMOOTHED`."""
    reach = int(np.ceil(3 * SMOOTHED))
    weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / SMOOTHED))
    weights /= weights.sum()
    for axis in (0, 1):
        size = image.shape[axis]
        around = [(reach, reach) if axis == a else (0, 0) for a in (0, 1)]
        padded = np.pad(image, around)
        shifted = (
            np.take(padded, np.arange(start, start + size), axis)
            for start in range(len(weights))
        )
        image = sum(
            (w * part for w, part in zip(weights, shifted, strict=True)),
            np.zeros_like(image),
        )
    return image
