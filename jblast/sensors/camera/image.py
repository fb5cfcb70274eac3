r"""Light in pixels: black bodies, sRGB and tone curve.

Black bodies. Planck's law, weighted by the colour matching functions of the CIE 1931
observer in the piecewise Gaussian fit of Wyman, Sloan and Shirley (2013, listing 1):

$$X = K_m \int B_\lambda(T)\,\bar x(\lambda)\,d\lambda, \qquad K_m = 683\ \text{lm/W}$$

The fit is within 1 % of the luminance and 0.003 of the chromaticity of the tables.
Below some 1900 K the colour is redder than sRGB can show: its blue is negative. It is
made positive by a smooth step, at the same luminance.

Tone. Exposure and a curve for highlights are applied to pictures, not to events. A
picture cannot show light above full scale. Channels that are clipped one by one change
their hue: orange light becomes yellow, then white. Here all channels are divided by the
largest, $p$, and mixed with more white the brighter they are:

$$c' = g\,\frac{c}{p} + 1 - g, \qquad g = \frac{1}{K_d\,(p - 1) + 1}, \qquad p > 1$$

This is the PBR Neutral curve of the Khronos Group with the start of compression
$K_s = 1$ and without its correction for reflections. Light up to full scale is
unchanged, so that frames remain measurements. The mean level of a picture follows the
level of light. The key, the grey shown for the mean luminance $Y$ [cd/m2], is

$$\alpha(Y) = 1.03 - \frac{2}{2 + \log_{10}(Y + 1)}$$

References:
    Khronos Group (2024), Khronos PBR Neutral Tone Mapper, specification
    (github.com/KhronosGroup/ToneMapping).
    Krawczyk, Myszkowski and Seidel (2005), Lightness perception in tone reproduction
    for high dynamic range images. Computer Graphics Forum 24(3): 635, eq. 11.
"""

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import require
from jblast.scene import Camera
from jblast.types import as_numbers

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue (ITU-R BT.709-6, item 3.2)."""
FIRST_RADIATION = 1.191042972e-16
"""$2 h c^2$ [W m2/sr]. CODATA 2018, exact."""
SECOND_RADIATION = 1.438776877e-2
"""$h c / k$ [m K]. CODATA 2018, exact."""
EFFICACY = 683.0
"""Luminous efficacy of green light [lm/W]. SI Brochure, 9th edition."""
WAVELENGTHS = np.arange(360e-9, 831e-9, 5e-9)
"""Wavelengths of the sums [m]; 5 nm is the step at which the CIE's tables are used."""
LOBES: tuple[tuple[int, float, float, float, float], ...] = (
    (0, 0.362, 442.0, 0.0624, 0.0374),
    (0, 1.056, 599.8, 0.0264, 0.0323),
    (0, -0.065, 501.1, 0.0490, 0.0382),
    (1, 0.821, 568.8, 0.0213, 0.0247),
    (1, 0.286, 530.9, 0.0613, 0.0322),
    (2, 1.217, 437.0, 0.0845, 0.0278),
    (2, 0.681, 459.0, 0.0385, 0.0725),
)
"""Index of x, y or z, height, middle [nm], inverse widths below and above it [1/nm]."""
LINEAR_SRGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""From X, Y, Z to linear red, green, blue: primaries of BT.709, white D65."""
STEP_WIDTH = 0.01
"""Width of the smooth step, as a share of the luminance: it lifts a channel that would
be zero by half of this."""
DESATURATION = 0.15
"""$K_d$ of the specification: at eight times full scale half of a colour is white."""
FULL_SUN = 3e4
"""Luminance of a white wall for which pictures have a gain of 1 [cd/m2]."""
BACKGROUND = 0.18
"""Linear light of a grey that looks half as bright as white."""
Background = (
    Float[ArrayLike, ""]
    | Float[ArrayLike, "3"]
    | Float[ArrayLike, "height width 3"]
    | Float[ArrayLike, "time height width 3"]
)
"""A grey, a colour, an image or an image per time: linear light, full scale 1."""


def straight(image: Float[Array, "... 4"]) -> Float[Array, "... 4"]:
    """Return premultiplied alpha as straight alpha; black where alpha is 0."""
    alpha = image[..., 3:]
    seen = alpha > 0
    # guarded division: gradients of transparent pixels stay finite
    colour = jnp.where(seen, image[..., :3] / jnp.where(seen, alpha, 1.0), 0.0)
    return jnp.concatenate([colour, alpha], axis=-1)


def srgb_to_linear(value: Any) -> Any:
    """Return the linear light of sRGB values; both have 1 for full scale.

    Negative values, and those above 1, follow the same curve.

    Args:
        value: An array of NumPy or of JAX; the result is of the same kind.

    References:
        IEC 61966-2-1.
    """
    xp = _namespace(value)
    bent = value > 0.04045
    # the power is evaluated at 1 on the linear branch, where its base may be negative
    above = ((xp.where(bent, value, 1.0) + 0.055) / 1.055) ** 2.4
    return xp.where(bent, above, value / 12.92)


def linear_to_srgb(light: Any) -> Any:
    """Return the sRGB values of linear light; the inverse of `srgb_to_linear`."""
    xp = _namespace(light)
    bent = light > 0.0031308
    # the power written out: XLA does not vectorise its own, six times as slow
    above = 1.055 * xp.exp(xp.log(xp.where(bent, light, 1.0)) / 2.4) - 0.055
    return xp.where(bent, above, 12.92 * light)


def _namespace(value: Any) -> Any:
    """Return NumPy for NumPy's values, JAX for all others."""
    return np if isinstance(value, np.ndarray | np.generic) else jnp


def luminance(light: Any) -> Any:
    """Return the luminance of linear light, (..., 3); NumPy's arrays stay NumPy's."""
    return light @ np.asarray(LUMINANCE, light.dtype)


def blackbody_light(
    temperature: Float[ArrayLike, "..."],
) -> Float[Array, "... 3"]:
    r"""Return the luminous light of a black body.

    Args:
        temperature: $T$ [K], positive.

    Returns:
        Linear red, green, blue [cd/m2], not negative; 0.2126 red + 0.7152 green +
        0.0722 blue is the luminance.
    """
    xyz, scale = relative_xyz(as_numbers(temperature))
    ratio = xyz @ jnp.asarray(LINEAR_SRGB.T, xyz.dtype) / xyz[..., 1:2]
    # smooth maximum of the ratio and 0
    shown = 0.5 * (ratio + jnp.sqrt(jnp.square(ratio) + STEP_WIDTH**2))
    # rescaled, so that the smooth step leaves the luminance unchanged
    weight = luminance(shown)
    return (scale * xyz[..., 1] / weight)[..., None] * shown


def matching_functions() -> Float[np.ndarray, "wavelength 3"]:
    """Return the colour matching functions at `WAVELENGTHS` [-]."""
    nanometres = 1e9 * WAVELENGTHS
    functions = np.zeros((len(nanometres), 3))
    for axis, height, middle, below, above in LOBES:
        away = nanometres - middle
        width = np.where(away < 0, below, above)
        functions[:, axis] += height * np.exp(-0.5 * np.square(width * away))
    return functions


def relative_xyz(
    temperature: Float[Array, "..."],
) -> tuple[Float[Array, "... 3"], Float[Array, "..."]]:
    r"""Return X, Y, Z over a scale [cd/m2], and the scale, which may underflow.

    The scale is $e^{-x}$ at the longest wavelength, $x = h c / (\lambda k T)$. The
    remainder is near one for any temperature, so that ratios keep their gradients.
    """
    dtype = temperature.dtype
    longest = SECOND_RADIATION / float(WAVELENGTHS[-1])
    inverse = 1.0 / temperature

    def outer(numbers):
        return jnp.tensordot(inverse, jnp.asarray(numbers, dtype), 0)

    terms = SECOND_RADIATION / WAVELENGTHS
    scale = jnp.exp(-longest * inverse)
    # a factor of the whole exponential, so that one serves both terms of the fraction
    part = jnp.exp(-outer(terms - longest))
    relative = part / (1.0 - scale[..., None] * part)
    step = WAVELENGTHS[1] - WAVELENGTHS[0]
    power = EFFICACY * step * FIRST_RADIATION / WAVELENGTHS**5
    weights = jnp.asarray(power[:, None] * matching_functions(), dtype)
    return relative @ weights, scale


def toned(light: Any) -> Any:
    """Return linear light within 0 to 1 with its hue unchanged.

    Args:
        light: Grey or red, green, blue in the last axis, full scale 1; an array of
            NumPy or of JAX.

    Returns:
        An array of the same kind; light from 0 to 1 is unchanged.
    """
    xp = _namespace(light)
    # negative channels are outside the gamut
    light = xp.maximum(light, 0.0)
    peak = xp.maximum(light.max(axis=-1, keepdims=True), 1.0)
    part = 1.0 / (DESATURATION * (peak - 1.0) + 1.0)
    return part * (light / peak) + (1.0 - part)


def picture_gain(illuminance: float) -> float:
    """Return the gain of a picture of a scene, 1 in full sun.

    Args:
        illuminance: Illuminance of a level surface by sky and sun [lx].
    """
    return _key(illuminance / math.pi) / _key(FULL_SUN)


def _key(luminance: float) -> float:
    return 1.03 - 2.0 / (2.0 + math.log10(luminance + 1.0))


def images(
    camera: Camera, background: Float[ArrayLike, "..."], count: int
) -> Float[Array, "..."]:
    """Return a background as one image, or as one image per frame.

    Args:
        camera: The camera.
        background: A number, a colour, an image or images.
        count: Number of frames.

    Raises:
        InputError: The background has another shape.
    """
    image, size = as_numbers(background), (camera.height, camera.width, 3)
    shapes = size, (count, *size)
    require(
        image.shape in ((), (3,), *shapes),
        "background",
        f"a number, a colour or shape {size} or {shapes[1]}",
        f"{image.shape}",
    )
    return jnp.broadcast_to(image, size) if image.ndim < 3 else image
