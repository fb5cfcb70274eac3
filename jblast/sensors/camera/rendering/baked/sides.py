r"""Which views of a set stand for a direction, and for how much of the picture.

The nearest, by direction on the unit sphere; or the three at the corners of the
spherical triangle that the direction is in, by barycentric weights

$$d = \sum_i \lambda_i u_i, \qquad w_i = \lambda_i \Big/ \sum_j \lambda_j$$

The triangles are those of the convex hull of all views and of their images in the
ground: every direction is in one, and one from below is shown what is seen from as far
above. Weights are continuous everywhere, with a kink at the edges of triangles.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


def nearest_side(
    directions: Float[Array, "view 3"], towards: Float[Array, "3"]
) -> tuple[Int[Array, "1"], Float[Array, "1"]]:
    """Return the nearest view, whose weight is one; the first of equals.

    Args:
        directions: Of the views, from the blast.
        towards: From the blast to the camera.
    """
    view = jnp.argmax(directions @ towards)[None]
    return view, jnp.ones(1, towards.dtype)


def three_sides(
    corners: Int[Array, "triangle 3"],
    inverses: Float[Array, "triangle 3 3"],
    towards: Float[Array, "3"],
) -> tuple[Int[Array, "3"], Float[Array, "3"]]:
    """Return the three views around a direction, and their weights.

    Args:
        corners: Views at the corners of each triangle.
        inverses: Of the matrix whose columns are a triangle's corners.
        towards: From the blast to the camera.
    """
    shares = inverses @ towards
    shares = shares / jnp.sum(jnp.abs(shares), axis=1, keepdims=True)
    best = jnp.argmax(jnp.min(shares, axis=1))
    inside = jnp.maximum(shares[best], 0.0)  # rounding, or a set without that side
    return corners[best], inside / jnp.sum(inside)


def triangles(
    directions: Float[np.ndarray, "view 3"],
) -> tuple[Int[np.ndarray, "triangle 3"], Float[np.ndarray, "triangle 3 3"]]:
    """Return the triangles between views: their corners, and inverses of these.

    Args:
        directions: Unit vectors from the blast; of one or two alone there is no
            triangle, and the first stands for all of it.
    """
    from scipy.spatial import ConvexHull, QhullError

    mirrored = directions * np.array([1.0, 1.0, -1.0])
    low = np.abs(directions[:, 2]) < 1e-6  # its own image
    views = np.concatenate([np.arange(len(directions)), np.flatnonzero(~low)])
    points = np.concatenate([directions, mirrored[~low]])
    try:
        faces = ConvexHull(points).simplices
    except (QhullError, ValueError):  # fewer than four, or all in a plane
        return np.zeros((1, 3), int), np.eye(3)[None]
    matrices = np.swapaxes(points[faces], 1, 2)
    whole = np.abs(np.linalg.det(matrices)) > 1e-9
    return views[faces[whole]], np.linalg.inv(matrices[whole])


def shown_towards(
    directions: Float[np.ndarray, "view 3"],
    towards: Float[np.ndarray, "camera 3"],
    sides: int,
) -> Int[np.ndarray, " shown"]:
    """Return which views of a set are shown in some directions, in their order.

    Args:
        directions: Of all views.
        towards: From the blast to cameras.
        sides: How many views a picture is mixed of.
    """
    if sides == 1:
        return np.unique(np.argmax(towards @ directions.T, axis=1))
    corners, inverses = triangles(directions)
    shares = np.einsum("tij,cj->cti", inverses, towards)
    shares /= np.abs(shares).sum(axis=2, keepdims=True)
    return np.unique(corners[np.argmax(shares.min(axis=2), axis=1)])
