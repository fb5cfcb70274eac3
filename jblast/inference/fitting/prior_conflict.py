"""Is it a prior that a poor fit comes from: the same log, nothing believed of it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from jblast.inference.fitting.goodness_of_fit import (
    POOR,
    chi_squared,
    p_value,
    standardised_residuals,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.identifiability.null_space import identifiability
from jblast.inference.mode.search import optima
from jblast.inference.posterior.parameters import Parameters
from jblast.scene import Free, parameter_named

FAR = 3.0
"""A number further than this from its prior's middle, in its sds, is not believed."""


def against_priors(solution: Solution) -> dict[str, float]:
    """Return numbers by which a log fits well, but which their priors rule out.

    The search is made once more with every number free. Those are named that the log
    alone tells.
    """
    parameters = solution.posterior.parameters
    believed = [not isinstance(belief, Free) for belief in parameters.beliefs]
    if not any(believed):
        return {}
    free = Parameters(
        parameters.names,
        tuple(
            Free(positive=parameter_named(name).positive) for name in parameters.names
        ),
        parameters.scene_at(jnp.asarray(solution.laplace.z)),
    )
    posterior = replace(solution.posterior, parameters=free)
    z = np.asarray(optima(jax.random.key(0), posterior).z[0])
    identified = identifiability(posterior, z)
    left = standardised_residuals(posterior, z)
    p = p_value(
        *chi_squared(
            posterior,
            z,
            left,
            identified.identified_basis.shape[1],
        )
    )
    if p is not None and p < POOR:
        return {}
    values = free.values(jnp.asarray(z))
    against = {}
    for name, belief, is_told in zip(
        parameters.names, parameters.beliefs, identified.determined, strict=True
    ):
        away = float(belief.unconstrain(values[name]))
        if is_told and not isinstance(belief, Free) and not abs(away) < FAR:
            against[name] = float(values[name])
    return against
