r"""How alike two pictures are: the ratio of peak to noise, and structure.

$$\text{PSNR} = -10 \log_{10} \frac{1}{n} \sum (x - y)^2$$

in decibels, full scale 1; and

$$\text{SSIM} = \frac{(2 \mu_x \mu_y + C_1)(2 \sigma_{xy} + C_2)}
{(\mu_x^2 + \mu_y^2 + C_1)(\sigma_x^2 + \sigma_y^2 + C_2)}$$

of means, variances and covariance under a Gaussian of 11 x 11 pixels, 1.5 pixels wide,
about each pixel; beyond the edge the picture goes on as its mirror.

References:
    Wang, Bovik, Sheikh and Simoncelli (2004), Image quality assessment: from error
    visibility to structural similarity. IEEE Trans. Image Processing 13(4), eq. 13,
    $K_1 = 0.01$ and $K_2 = 0.03$.
"""

import numpy as np
from jaxtyping import Bool, Float

WIDTH = 1.5
"""Standard deviation of the window [px]."""
REACH = 5
"""Of the window to each side [px]."""
C1, C2 = 0.01**2, 0.03**2

Grey = Float[np.ndarray, "height width"]


def psnr(one: Grey, other: Grey, where: Bool[np.ndarray, "height width"]) -> float:
    """Return the ratio of full scale to the difference of two pictures [dB].

    Args:
        one: As it is looked at (sRGB, not linear light), 0 to 1.
        other: Likewise.
        where: Pixels that count, at least one.

    Returns:
        Infinite where they are the same.
    """
    square = float(np.mean(np.square(one - other)[where]))
    return float("inf") if square == 0.0 else -10.0 * float(np.log10(square))


def ssim(one: Grey, other: Grey, where: Bool[np.ndarray, "height width"]) -> float:
    """Return the mean structural similarity of two pictures, 1 for the same.

    Args:
        one: As it is looked at (sRGB, not linear light), 0 to 1.
        other: Likewise.
        where: Pixels whose windows count, at least one.
    """
    return float(np.mean(structural_similarity(one, other)[where]))


def structural_similarity(one: Grey, other: Grey) -> Grey:
    """Return the structural similarity about each pixel, -1 to 1."""
    mean, mean_other = _local(one), _local(other)
    variance = _local(np.square(one)) - np.square(mean)
    variance_other = _local(np.square(other)) - np.square(mean_other)
    covariance = _local(one * other) - mean * mean_other
    means = 2.0 * mean * mean_other + C1, np.square(mean) + np.square(mean_other) + C1
    spreads = 2.0 * covariance + C2, variance + variance_other + C2
    return means[0] * spreads[0] / (means[1] * spreads[1])


def _local(image: Grey) -> Grey:
    """Return the mean under the window."""
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(image, WIDTH, truncate=REACH / WIDTH, mode="reflect")
