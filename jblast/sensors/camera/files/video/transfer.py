r"""From a video's values to linear light, by the curve that its file names.

$$L = \begin{cases} V / 4.5 & V < 0.081 \\
((V + 0.099) / 1.099)^{1/0.45} & \text{else}\end{cases}$$

is BT.709's, which BT.601 and BT.2020 share; it is taken where a file names none, as
cameras do. A file may name sRGB, as ours do, a power of 2.2 or 2.8, or no curve at all.

References:
    ITU-R BT.709-6, item 1.2; ITU-T H.273, table 3 (the numbers of the curves).
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.sensors.camera.image.compositing import srgb_to_linear

UNSPECIFIED, SRGB = 2, 13
"""Their numbers in H.273."""


def bt709_to_linear(value: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the light in front of a camera whose values are BT.709's, 1 full scale."""
    above = ((value + 0.099) / 1.099) ** (1 / 0.45)
    return np.where(value < 0.081, value / 4.5, above)


CURVES = {
    **dict.fromkeys((1, UNSPECIFIED, 6, 14, 15), bt709_to_linear),
    4: lambda value: value**2.2,
    5: lambda value: value**2.8,
    8: lambda value: value,
    SRGB: srgb_to_linear,
}


def light_table(number: int, bits: int, path: Path) -> Float[np.ndarray, " value"]:
    """Return the linear light of each value that `bits` bits can hold.

    Args:
        number: Of the curve, as in H.273.
        bits: 8 or 16; all of them full scale.
        path: The video, for the message.

    Raises:
        InputError: It is another curve, such as those of HDR.
    """
    if number not in CURVES:
        raise InputError(
            f"{path}: expected a video of standard dynamic range, got one of the "
            f"transfer curve {number} of ITU-T H.273 (HDR, if 16 or 18); convert it "
            "to BT.709"
        )
    values = np.arange(1 << bits) / ((1 << bits) - 1)
    return CURVES[number](values).astype(np.float32)
