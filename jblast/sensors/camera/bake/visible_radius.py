r"""The visible radius of an explosion in a picture.

$$R = 2\,\sigma_x, \qquad \sigma_x^2 = \frac{\sum_x n_x (x - \bar x)^2}{\sum_x n_x}$$

with $n_x$ how many pixels of column $x$ belong to the cloud. It is the radius of a disc
and of half a disc that stands on the ground: columns of both are as high as
$\sqrt{R^2 - x^2}$, whose variance is $R^2/4$. A rim, or lobes, do not matter as they do
for the width of the outline.
"""

import numpy as np
from jaxtyping import Float

OPAQUE = 0.5
"""Opacity from which a pixel belongs to the cloud [-]: dust that is swept over the
ground is mostly thinner."""


def visible_radius(alpha: Float[np.ndarray, "height width"]) -> float:
    """Return the radius of a silhouette [px]; 0 if nothing is opaque.

    Pixels are as wide as they are: to the variance of their middles 1/12 is added.

    Args:
        alpha: Opacity of fire and smoke, 0 to 1.
    """
    columns = (alpha > OPAQUE).sum(axis=0).astype(float)
    total = columns.sum()
    if total == 0:
        return 0.0
    place = np.arange(len(columns))
    middle = (columns @ place) / total
    variance = (columns @ np.square(place - middle)) / total
    return 2.0 * float(np.sqrt(variance + 1.0 / 12.0))
