"""How well the answer fits, and which readings it does not believe."""

import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammaincc
from jaxtyping import Float

from jblast.inference.posterior import Posterior
from jblast.observations import Observations

WILD = 4.0
"""A reading further off than this many standard deviations is suspected."""

POOR = 0.001
"""A fit with a smaller chance than this is called poor."""


def chi_squared(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    residual: Float[np.ndarray, " row"],
    effects: Float[np.ndarray, " effect"],
    told: int,
) -> tuple[float, int]:
    """Return chi squared and its degrees of freedom.

    Shared effects and numbers with a prior count as data that were expected at their
    means, and as unknowns; so they add to chi squared and leave the freedom alone.
    """
    priors = np.asarray(posterior.parameters.has_prior())
    chi2 = float(np.sum(residual**2) + np.sum(effects**2) + np.sum((priors * z) ** 2))
    return chi2, len(residual) + int(priors.sum()) - told


def chance(chi2: float, dof: int) -> float | None:
    """Return the chance of a larger chi squared; None without degrees of freedom."""
    return float(gammaincc(dof / 2, jnp.asarray(chi2 / 2))) if dof > 0 else None


def suspected_outliers(
    observations: Observations, residual: Float[np.ndarray, " row"]
) -> list[dict[str, object]]:
    """Name the readings further off than `WILD` standard deviations, worst first.

    Where they are more than a third of all, it is the law or the scene that is wrong,
    and none is named.
    """
    if np.sum(np.abs(residual) > WILD) > len(residual) / 3:
        return []
    return [
        {
            "sensor": observations.sensor[row],
            "quantity": observations.quantity[row],
            "sds": round(float(residual[row]), 2),
        }
        for row in np.argsort(-np.abs(residual))
        if abs(residual[row]) > WILD
    ]
