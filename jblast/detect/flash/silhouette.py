r"""The luminous silhouette of a fireball: where it is, and how large.

$$R = c_q\,\sigma_x, \qquad \sigma_x^2 = \frac{\sum w\,(x - \bar x)^2}{\sum w} -
\frac{1}{12}, \qquad w = \max(h - q\,h_\mathrm{max},\ 0)$$

with $h$ the height of a column of it, as the sum of the shares of its pixels that
shine, and 1/12 what a pixel's own width adds. $c_q$ makes it the radius of a disc, and
of the half disc above the ground alike; $c_0 = 2$. What is lower than a share $q$ of
the highest column is left out: ground that the fire lights is a wide and low strip
about its foot. How much the radius depends on $q$, and on how brightly a pixel has to
shine to be a part of it, tells how far it is to be trusted: the edge of a fireball is
sharp, that of the light which it throws is not.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

Image = Float[np.ndarray, "height width"]

LOW = 0.3
"""Columns lower than this share of the highest are left out, $q$."""
OTHERS = (0.15, 0.5)
"""Shares beside it. Half of what the radius differs between them is an error of it."""
SHINES = 0.5
"""Share of the light of a fireball from which on a pixel is a part of it."""
FAINTER, BRIGHTER = 0.3, 0.7
"""Likewise, beside it."""
GLOW = 3.0
"""Times what the radius differs between those is an error, too: light on the ground,
which falls as the distance's cube, is a third wider where it is so much fainter, and
says nothing of the fireball."""
PIXEL = 0.3
"""Error of a radius: of where an edge stands in a pixel, and of a glare [px]."""
SHARE = 0.02
"""And a share of it: a fireball is rough."""

UNSURE = 0.25
"""Error, as a share of the radius, from which on a radius is not used: ground that the
fire lights as brightly as itself makes all radii of a film too large, and a fit would
take them for so many independent ones."""


class Silhouette(NamedTuple):
    """A fireball at an instant, in the image.

    Attributes:
        time_s: When [s].
        radius_px: Of the disc or half disc whose columns spread as much [px].
        x_px: Mean column [px].
        y_px: Mean row [px].
        area_px: Pixels that shine.
        cut: Whether an edge of the image cuts it left or right.
        sigma_px: Standard deviation of the radius [px].
    """

    time_s: float
    radius_px: float
    x_px: float
    y_px: float
    area_px: float
    cut: bool
    sigma_px: float = PIXEL


def silhouette(
    time_s: float, share: Image, seed: Bool[np.ndarray, "height width"]
) -> Silhouette | None:
    """Return the bright spot about a seed; None if there is none.

    Args:
        time_s: When [s].
        share: How much of each pixel shines, 0 to 1.
        seed: Where it is to be: of the connected spots that touch it the largest.
    """
    spot = _spot(share, SHINES, seed)
    if spot is None:
        return None
    weight = _within(spot, share)
    columns, rows = weight.sum(axis=0), weight.sum(axis=1)
    middle, radius = _spread(columns, LOW)
    low, high = (_spread(columns, share)[1] for share in OTHERS)
    faint, bright = (
        radius if other is None else _spread(_within(other, share).sum(axis=0), LOW)[1]
        for other in (_spot(share, level, seed) for level in (FAINTER, BRIGHTER))
    )
    errors = PIXEL, SHARE * radius, 0.5 * (high - low), GLOW * (faint - bright)
    sigma = float(np.linalg.norm(errors))
    cut = bool(spot[:, 0].any() or spot[:, -1].any())
    row = float(rows @ np.arange(len(rows))) / float(weight.sum())
    area = float(spot.sum())
    return Silhouette(time_s, radius, middle, row, area, cut, sigma)


def _spot(
    share: Image, level: float, seed: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"] | None:
    """Return the largest spot brighter than a level that touches a seed, if any."""
    from scipy import ndimage

    names = np.zeros(share.shape, np.int32)
    ndimage.label(share > level, np.ones((3, 3)), output=names)
    sizes = np.bincount(names.ravel())
    touched = np.unique(names[seed])
    touched = touched[touched > 0]
    if not len(touched):
        return None
    return names == touched[np.argmax(sizes[touched])]


def _within(spot: Bool[np.ndarray, "height width"], share: Image) -> Image:
    """Return how much shines of a spot and of the pixels at its edge."""
    from scipy import ndimage

    return np.where(ndimage.binary_dilation(spot), share, 0.0)


def _spread(columns: Float[np.ndarray, " width"], low: float) -> tuple[float, float]:
    """Return the middle of what is higher than a share, and the radius [px]."""
    weight = np.maximum(columns - low * columns.max(), 0.0)
    x = np.arange(len(columns))
    middle = float(weight @ x) / float(weight.sum())
    variance = float(weight @ (x - middle) ** 2) / float(weight.sum()) - 1.0 / 12.0
    return middle, _over_deviation(low) * float(np.sqrt(max(variance, 0.0)))


@cache
def _over_deviation(low: float) -> float:
    """Return a disc's radius over the standard deviation of its columns, $c_q$."""
    x = np.linspace(-1.0, 1.0, 20_001)
    weight = np.maximum(np.sqrt(1.0 - x**2) - low, 0.0)
    return float(np.sqrt(weight.sum() / (weight @ x**2)))
