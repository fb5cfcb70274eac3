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

from jblast.waves.euler.layout import laid_out
from jblast.waves.euler.state import Primitives

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
    rise = means[1:] - means[:-1]
    a = jnp.concatenate([(means[0] - inner)[None], rise])
    b = jnp.concatenate([rise, (outer - means[-1])[None]])
    a, b = laid_out((a, b))
    if limited:
        s = 2.0 * jnp.maximum(a * b, 0.0) / (a * a + b * b + TINY)
    else:
        s = jnp.ones_like(a)
    mean, twist = 0.25 * s * (a + b), (0.25 * KAPPA) * s * s * (b - a)
    return means - mean + twist, means + mean + twist


def reconstruct(
    cells: Primitives, *, fitted: bool, limited: bool
) -> tuple[Primitives, Primitives]:
    """Return values at the inner and at the outer face of each cell.

    Beyond the centre or a wall lies the mirrored flow. Towards a fitted shock the flow
    goes on straight. Where a density or pressure at a face would not be positive, both
    faces of the cell take its mean: so does positivity survive the reconstruction.

    Args:
        cells: Means of the cells.
        fitted: Whether a fitted shock is the outer end, not a wall.
        limited: Whether slopes are limited.
    """
    faces = []
    for name, q in zip(Primitives._fields, cells, strict=True):
        sign = -1.0 if name == "velocity" else 1.0
        outer = 2.0 * q[-1] - q[-2] if fitted else sign * q[-1]
        faces.append(face_values(q, sign * q[0], outer, limited))
    inner, outer = (Primitives(*side) for side in zip(*faces, strict=True))
    good = (
        jnp.minimum(
            jnp.minimum(inner.density, outer.density),
            jnp.minimum(inner.pressure, outer.pressure),
        )
        > 0.0
    )
    inside, outside = (
        Primitives(*(jnp.where(good, f, q) for f, q in zip(side, cells, strict=True)))
        for side in (inner, outer)
    )
    return inside, outside
