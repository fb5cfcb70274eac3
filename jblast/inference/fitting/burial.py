"""Whether laws hold as deep as the posterior says that a charge may have lain."""

import inspect

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.fitting.solution import Solution
from jblast.registry import law_for
from jblast.sensors.layout import components

DEEP = 0.05
"""Share of the posterior that may lie deeper than where laws are judged."""


def valid_at_depth(
    solution: Solution, draws: Float[np.ndarray, "draw free"]
) -> Bool[np.ndarray, " row"]:
    """Return whether laws that know of depth hold at that which few draws exceed.

    A mass told too large brings a buried charge nearer to the surface, over the cube
    root by which depths are scaled; so an answer may lie in a law's range that its own
    90 % interval leaves. Depth and mass alone are put in the place of the answer's; a
    charge that is not buried is not judged, nor a row by a law that asks for no depth.

    Args:
        solution: What was found.
        draws: Coordinates drawn from the posterior.
    """
    posterior, parameters = solution.posterior, solution.posterior.parameters
    at = parameters.scene_at(jnp.asarray(solution.laplace.z))
    drawn = parameters.values_of_each(jnp.asarray(draws))
    valid = np.ones(len(posterior.measured), bool)
    by_depth = [
        any(
            "height_of_burst" in inspect.signature(law.valid).parameters
            for part, _ in components(quantity)
            for law in [law_for(part, solution.laws[part].name)]
        )
        for quantity in posterior.layout.quantity
    ]
    for shot, charge in enumerate(at.charges):
        if not float(charge.up) < 0:
            continue
        label = at.label(charge)
        known = {
            f"charge_up_m{label}": charge.up,
            f"charge_mass_kg{label}": charge.mass_kg,
        }
        up, mass = (
            np.asarray(drawn.get(name, np.full(len(draws), float(fixed))))
            for name, fixed in known.items()
        )
        deepest = np.argsort(up / np.cbrt(mass))[int(DEEP * len(draws))]
        moved = [name in known for name in parameters.names]
        deep = np.where(moved, draws[deepest], solution.laplace.z)
        holds = np.asarray(posterior.misfit(jnp.asarray(deep)).valid)
        judged = by_depth & (np.array(posterior.layout.shot) == shot)
        valid &= holds | ~judged
    return valid
