r"""A pressure whose every probability is known: mass, range and scatter are uncertain.

Peak pressure falls with the scaled distance $Z = R\,W^{-1/3}$ alone, and $\ln Z$ is
normal where $\ln R$ and $\ln W$ are. So the probability of a pressure above a threshold
is that of $Z$ below a root, averaged over the scatter of the law by Gauss-Hermite
quadrature; nothing is drawn.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import root_scalar
from scipy.special import ndtr

from jblast.waves import kingery_bulmash_pressure

NODES = 120
"""Of the quadrature; half as many agree to 1e-9."""


class RarePressure(NamedTuple):
    """What is believed, and what is asked.

    Attributes:
        mass_kg: Median of the charge.
        mass_factor: Its standard deviation, as a factor.
        range_m: Median of the range.
        range_factor: Its standard deviation, as a factor.
        scatter: Standard deviation of ln of a pressure about the law.
        threshold_pa: A pressure that is rarely passed.
    """

    mass_kg: float = 15.0
    mass_factor: float = 1.5
    range_m: float = 40.0
    range_factor: float = 1.05
    scatter: float = 0.1
    threshold_pa: float = 22e3


CASE = RarePressure()


def pressure(u: Float[Array, "3"], case: RarePressure = CASE) -> Float[Array, ""]:
    """Return the peak pressure [Pa] of a draw in standard normal coordinates."""
    law = kingery_bulmash_pressure(
        case.range_m * case.range_factor ** u[1],
        case.mass_kg * case.mass_factor ** u[0],
    )
    return law * jnp.exp(case.scatter * u[2])


def margin(u: Float[Array, "3"]) -> Float[Array, ""]:
    """Return ln of the pressure over its threshold."""
    return jnp.log(pressure(u) / CASE.threshold_pa)


def probability_above(threshold_pa: float, case: RarePressure = CASE) -> float:
    """Return how probable a pressure above a threshold is, without a draw."""
    log_pressure = jax.jit(
        lambda log_z: jnp.log(kingery_bulmash_pressure(jnp.exp(log_z), 1.0))
    )
    middle, sd = _log_z(case)
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    total = 0.0
    for node, weight in zip(nodes, weights / weights.sum(), strict=True):
        wanted = np.log(threshold_pa) - case.scatter * node
        root = root_scalar(
            lambda z, wanted=wanted: float(log_pressure(jnp.asarray(z))) - wanted,
            bracket=(np.log(0.2), np.log(1e4)),
            xtol=1e-12,
        ).root
        total += weight * ndtr((root - middle) / sd)
    return float(total)


def mean_pressure(case: RarePressure = CASE) -> float:
    """Return the mean pressure [Pa], without a draw."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    middle, sd = _log_z(case)
    values = kingery_bulmash_pressure(jnp.exp(middle + sd * nodes), jnp.ones(NODES))
    mean = float(np.asarray(values) @ weights / weights.sum())
    return mean * float(np.exp(0.5 * case.scatter**2))


def _log_z(case: RarePressure) -> tuple[float, float]:
    """Return mean and standard deviation of ln of the scaled distance."""
    middle = np.log(case.range_m) - np.log(case.mass_kg) / 3
    spread = np.hypot(np.log(case.range_factor), np.log(case.mass_factor) / 3)
    return float(middle), float(spread)
