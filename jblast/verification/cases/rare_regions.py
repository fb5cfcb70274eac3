r"""Rare events of known probability: several regions, shells, curved and rough edges.

All are in standard normal coordinates. Half-spaces along different coordinates are
independent, a shell is a tail of the chi-squared distribution, and an edge
$u_1 = e(q)$, with $q$ the sum of squares of the other coordinates, is one integral over
that distribution.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import quad
from scipy.special import ndtr
from scipy.stats import chi2, ncx2, norm

from jblast.study.rare.design_point import Margin

UNEQUAL = (4.0, 4.3, 4.7, 5.0)


@dataclass(frozen=True)
class RareRegion:
    """An event and its probability.

    Attributes:
        name: Kind of the event.
        margin: Positive in the event.
        dimensions: Number of random variables.
        probability: Exact.
    """

    name: str
    margin: Margin
    dimensions: int
    probability: float


def tail(distance: float) -> float:
    """Return the probability of a half-space at a distance from the origin."""
    return float(ndtr(-distance))


def any_of(*probabilities: float) -> float:
    """Return the probability that one of several independent events happens."""
    return float(1.0 - np.prod(1.0 - np.asarray(probabilities)))


def beyond_edge(edge: Callable[[float], float], dimensions: int) -> float:
    """Return the probability of $u_1 > e(q)$."""
    others = dimensions - 1

    def density(length: float) -> float:
        # of the length of the other coordinates, so that it is finite at 0
        return float(
            ndtr(-edge(length**2)) * 2.0 * length * chi2.pdf(length**2, others)
        )

    return float(quad(density, 1e-12, 12.0, epsabs=0.0, epsrel=1e-9, limit=200)[0])


def shell(dimensions: int, probability: float) -> RareRegion:
    """Return the event that the distance from the origin exceeds a radius."""
    radius = float(np.sqrt(chi2.isf(probability, dimensions)))
    return RareRegion(
        "shell",
        lambda u: jnp.linalg.norm(u) - radius,
        dimensions,
        probability,
    )


def curved(name: str, dimensions: int, distance: float, bend: float) -> RareRegion:
    """Return $u_1 > d + b q$: wrapped about the origin where b is negative."""
    return RareRegion(
        name,
        lambda u: u[0] - distance - bend * jnp.sum(u[1:] ** 2),
        dimensions,
        beyond_edge(lambda q: distance + bend * q, dimensions),
    )


def island() -> RareRegion:
    """Return a half-space and a ball whose slope is negligible at the origin."""
    centre, radius = jnp.array([0.0, -4.3, 0.0, 0.0, 0.0]), np.sqrt(2.0 * np.log(5 / 3))

    def margin(u: Float[Array, "5"]) -> Float[Array, ""]:
        hill = 5.0 * jnp.exp(-0.5 * jnp.sum((u - centre) ** 2)) - 3.0
        return jnp.maximum(u[0] - 4.0, hill)

    # the ball, radius 1, ends 3 before the edge of the half-space
    ball = float(ncx2.cdf(radius**2, 5, 4.3**2))
    return RareRegion("half-space, island", margin, 5, tail(4.0) + ball)


def rare_regions() -> list[RareRegion]:
    """Return all events."""
    rough = quad(
        lambda x: ndtr(-4.2 + 0.02 * np.sin(20.0 * x)) * norm.pdf(x),
        -9.0,
        9.0,
        epsabs=0.0,
        epsrel=1e-9,
        limit=2000,
    )[0]
    return [
        RareRegion("half-space", lambda u: u[0] - 4.5, 3, tail(4.5)),
        RareRegion("half-space", lambda u: u[0] - 4.5, 20, tail(4.5)),
        RareRegion(
            "2 equal half-spaces", lambda u: jnp.abs(u[0]) - 4.5, 2, 2 * tail(4.5)
        ),
        RareRegion(
            "8 equal half-spaces",
            lambda u: jnp.max(jnp.abs(u)) - 4.5,
            4,
            any_of(*[2 * tail(4.5)] * 4),
        ),
        RareRegion(
            "8 equal half-spaces",
            lambda u: jnp.max(u) - 4.5,
            8,
            any_of(*[tail(4.5)] * 8),
        ),
        RareRegion(
            "16 equal half-spaces",
            lambda u: jnp.max(jnp.abs(u)) - 4.5,
            8,
            any_of(*[2 * tail(4.5)] * 8),
        ),
        RareRegion(
            "4 unequal half-spaces",
            lambda u: jnp.max(u - jnp.array(UNEQUAL)),
            4,
            any_of(*map(tail, UNEQUAL)),
        ),
        RareRegion(
            "2 scales of margin",
            lambda u: jnp.maximum(u[0] - 4.2, 0.01 * (u[1] - 4.0)),
            2,
            any_of(tail(4.2), tail(4.0)),
        ),
        island(),
        shell(2, 1e-5),
        shell(8, 1e-6),
        RareRegion(
            "cylinder",
            lambda u: jnp.linalg.norm(u[:2]) - 5.0,
            3,
            float(chi2.sf(25.0, 2)),
        ),
        curved("curved away", 3, 4.0, 0.2),
        curved("curved towards", 3, 4.5, -0.08),
        curved("wrapped", 3, 4.0, -0.2),
        curved("wrapped", 8, 4.0, -0.2),
        RareRegion(
            "corner", lambda u: jnp.minimum(u[0], u[1]) - 2.0, 2, tail(2.0) ** 2
        ),
        RareRegion(
            "rough",
            lambda u: u[0] - 4.2 + 0.02 * jnp.sin(20.0 * u[1]),
            3,
            float(rough),
        ),
        RareRegion(
            "flat, common", lambda u: jnp.where(u[0] > 2.0, 1.0, -1.0), 2, tail(2.0)
        ),
        RareRegion(
            "flat, rare", lambda u: jnp.where(u[0] > 4.0, 1.0, -1.0), 2, tail(4.0)
        ),
    ]
