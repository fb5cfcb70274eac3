"""Whether laws hold as deep as the posterior says that a charge may have lain."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.solution import Solution

DEEP = 0.05
"""Share of the posterior that may lie deeper than where laws are judged."""


def valid_at_depth(
    solution: Solution, draws: Float[np.ndarray, "draw free"]
) -> Bool[np.ndarray, " row"]:
    """Return whether each row's laws hold at the depth that few draws exceed.

    A mass told too large brings a buried charge nearer to the surface, over the cube
    root by which depths are scaled; so an answer may lie in a law's range that its own
    90 % interval leaves. A charge that is not buried is not judged.

    Args:
        solution: What was found.
        draws: Coordinates drawn from the posterior.
    """
    posterior, parameters = solution.posterior, solution.posterior.parameters
    at = parameters.scene_at(jnp.asarray(solution.laplace.z))
    drawn = parameters.values_of_each(jnp.asarray(draws))
    valid = np.ones(len(posterior.measured), bool)
    for shot, charge in enumerate(at.charges):
        if not float(charge.up) < 0:
            continue
        label = at.label(charge)
        up, mass = (
            np.asarray(drawn.get(f"{name}{label}", np.full(len(draws), float(known))))
            for name, known in (
                ("charge_up_m", charge.up),
                ("charge_mass_kg", charge.mass),
            )
        )
        scaled = up / np.cbrt(mass)
        deep = draws[np.argsort(scaled)[int(DEEP * len(draws))]]
        holds = np.asarray(posterior.misfit(jnp.asarray(deep)).valid)
        valid &= holds | (np.array(posterior.layout.shot) != shot)
    return valid
