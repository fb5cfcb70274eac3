r"""What a black body looks like: its light and colour in linear sRGB.

Planck's law, weighed by the colour matching functions of the CIE 1931 observer, in the
piecewise Gaussian fit of Wyman, Sloan and Shirley (2013, their listing 1):

$$X = K_m \int B_\lambda(T)\,\bar x(\lambda)\,d\lambda, \qquad K_m = 683\ \text{lm/W}$$

The fit is within 1 % of the luminance and 0.003 of the chromaticity that the tables
give. Below some 1900 K the colour is redder than sRGB can show: its blue is negative.
It is made positive by a smooth step, and the luminance kept.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.sensors.camera.image.grey_composite import luminance
from jblast.types import as_float_array

FIRST_RADIATION = 1.191042972e-16
"""$2 h c^2$ [W m2/sr]. CODATA 2018, exact."""

SECOND_RADIATION = 1.438776877e-2
"""$h c / k$ [m K]. CODATA 2018, exact."""

EFFICACY = 683.0
"""Lumens in a watt of green light [lm/W]. SI Brochure, 9th edition."""

WAVELENGTHS = np.arange(360e-9, 831e-9, 5e-9)
"""Those summed over [m]; 5 nm is the step the CIE's tables are used at."""

LOBES: tuple[tuple[int, float, float, float, float], ...] = (
    (0, 0.362, 442.0, 0.0624, 0.0374),
    (0, 1.056, 599.8, 0.0264, 0.0323),
    (0, -0.065, 501.1, 0.0490, 0.0382),
    (1, 0.821, 568.8, 0.0213, 0.0247),
    (1, 0.286, 530.9, 0.0613, 0.0322),
    (2, 1.217, 437.0, 0.0845, 0.0278),
    (2, 0.681, 459.0, 0.0385, 0.0725),
)
"""Of x, y or z: height, middle [nm], inverse widths below and above it [1/nm]."""

LINEAR_SRGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""From X, Y, Z to linear red, green, blue: primaries of BT.709, white D65."""

SMALLEST = 0.01
"""How smooth the step is, as a part of the luminance: it lifts a channel that would be
zero by half of this."""


def blackbody_light(
    temperature: Float[ArrayLike, "..."],
) -> Float[Array, "... 3"]:
    r"""Luminous light of a black body.

    Args:
        temperature: $T$ [K], positive.

    Returns:
        Linear red, green, blue [cd/m2], not negative; 0.2126 red + 0.7152 green +
        0.0722 blue is the luminance.
    """
    xyz, scale = _relative_xyz(as_float_array(temperature))
    ratio = xyz @ jnp.asarray(LINEAR_SRGB.T, xyz.dtype) / xyz[..., 1:2]
    shown = 0.5 * (ratio + jnp.sqrt(jnp.square(ratio) + SMALLEST**2))
    weight = luminance(shown)
    return (scale * xyz[..., 1] / weight)[..., None] * shown


def blackbody_xyz(temperature: Float[ArrayLike, "..."]) -> Float[Array, "... 3"]:
    """Tristimulus values X, Y, Z of a black body [cd/m2]; Y is its luminance.

    Args:
        temperature: $T$ [K], positive.
    """
    xyz, scale = _relative_xyz(as_float_array(temperature))
    return scale[..., None] * xyz


def matching_functions() -> Float[np.ndarray, "wavelength 3"]:
    """Return the colour matching functions at `WAVELENGTHS` [-]."""
    nanometres = 1e9 * WAVELENGTHS
    functions = np.zeros((len(nanometres), 3))
    for axis, height, middle, below, above in LOBES:
        away = nanometres - middle
        width = np.where(away < 0, below, above)
        functions[:, axis] += height * np.exp(-0.5 * np.square(width * away))
    return functions


def _relative_xyz(
    temperature: Float[Array, "..."],
) -> tuple[Float[Array, "... 3"], Float[Array, "..."]]:
    r"""Return X, Y, Z over a scale [cd/m2], and the scale, which may underflow.

    The scale is $e^{-x}$ at the longest wavelength, $x = h c / (\lambda k T)$: what is
    left is near one for any temperature, so that ratios keep their gradients.
    """
    dtype = temperature.dtype
    longest = SECOND_RADIATION / float(WAVELENGTHS[-1])
    inverse = 1.0 / temperature

    def outer(numbers):
        return jnp.tensordot(inverse, jnp.asarray(numbers, dtype), 0)

    terms = SECOND_RADIATION / WAVELENGTHS
    scale = jnp.exp(-longest * inverse)
    part = jnp.exp(-outer(terms - longest))  # of the whole exponential: one, not two
    relative = part / (1.0 - scale[..., None] * part)
    step = WAVELENGTHS[1] - WAVELENGTHS[0]
    power = EFFICACY * step * FIRST_RADIATION / WAVELENGTHS**5
    weights = jnp.asarray(power[:, None] * matching_functions(), dtype)
    return relative @ weights, scale
