r"""From means in cells to values at their faces: MUSCL, limited smoothly.

With $a$ and $b$ the differences to the neighbours and van Albada's limiter

$$s = \frac{2\,ab}{a^2 + b^2} \text{ if } ab > 0, \text{ else } 0$$

a cell's value at its outer face is $q + \tfrac{s}{4}[(1-\kappa s)a + (1+\kappa s)b]$,
at its inner face $q - \tfrac{s}{4}[(1+\kappa s)a + (1-\kappa s)b]$, with
$\kappa = \tfrac13$: van Leer's schemes with the limiter of Anderson, Thomas and van
Leer (1986), AIAA J. 24:1453. It has no switch but at extrema, so it differentiates.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.state import Primitives
from jblast.waves.euler.xla_layout import materialized

KAPPA = 1.0 / 3.0
TINY = 1e-30
"""Keeps 0/0 away where nothing changes; far below any square that matters."""


def face_values(
    means: Float[Array, "cell ..."],
    inner: Float[Array, "..."],
    outer: Float[Array, "..."],
    limited: bool,
) -> tuple[Float[Array, "cell ..."], Float[Array, "cell ..."]]:
    """Return each cell's values at its inner and at its outer face.

    Args:
        means: Of the cells.
        inner: What stands for a cell within the first.
        outer: What stands for a cell beyond the last.
        limited: Whether slopes are limited.
    """
    around = materialized(jnp.concatenate([inner[None], means, outer[None]]))
    a, b = means - around[:-2], around[2:] - means
    if limited:
        s = 2.0 * jnp.maximum(a * b, 0.0) / (a * a + b * b + TINY)
    else:
        s = jnp.ones_like(a)
    mean, twist = 0.25 * s * (a + b), (0.25 * KAPPA) * s * s * (b - a)
    return means - mean + twist, means + mean + twist


def reconstruct(
    cells: Primitives, *, fitted: bool, limited: bool
) -> tuple[Primitives, Primitives]:
    """Return values on the inner and on the outer side of each face.

    Beyond the centre or a wall lies the mirrored flow. Towards a fitted shock the flow
    goes on straight, densities and pressures not below zero. Between positive means
    limited values are positive: none is off its mean by more than 0.55 of the
    difference to the lesser neighbour. Without the limiter, where a density or pressure
    would not be positive, both faces of the cell take its mean.

    Args:
        cells: Means of the cells.
        fitted: Whether a fitted shock is the outer end, not a wall.
        limited: Whether slopes are limited.
    """
    mirror = (1.0, -1.0, 1.0)
    faces = []
    for name, sign, q in zip(Primitives._fields, mirror, cells, strict=True):
        beyond = sign * q[-1]
        if fitted:
            straight = 2.0 * q[-1] - q[-2]
            beyond = straight if name == "velocity" else jnp.maximum(straight, 0.0)
        faces.append(face_values(q, sign * q[0], beyond, limited))
    if not limited:
        (low, high), _, (least, most) = faces
        good = jnp.minimum(jnp.minimum(low, high), jnp.minimum(least, most)) > 0.0
        faces = [
            tuple(jnp.where(good, f, q) for f in pair)
            for pair, q in zip(faces, cells, strict=True)
        ]
    # Joined, so that a CPU keeps it: `layout.py`.
    signed = list(zip(mirror, faces, strict=True))
    left = [jnp.concatenate([sign * i[:1], o]) for sign, (i, o) in signed]
    right = [jnp.concatenate([i, sign * o[-1:]]) for sign, (i, o) in signed]
    return Primitives(*left), Primitives(*right)
