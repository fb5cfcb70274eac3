"""What a planned answer leans on: priors, other unknowns, the slopes of the laws."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.design.covariance import spread_left
from jblast.inference.design.planned_log import Planned
from jblast.inference.design.summary import Sensitivity
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.quantities import ADDITIVE, TIMES
from jblast.sensors.record import clock_offsets

KNOWN_GAIN = 1.5
"""An sd is sensitive to a number that, once known, makes it smaller by this factor."""
PRIOR_LOSS = 1.2
"""It is sensitive to a prior that, once dropped, makes it larger by this factor."""


def leans_on(plan: Planned, target: int) -> tuple[Sensitivity, ...]:
    """Say which other numbers decide how well one is known.

    Args:
        plan: The layout.
        target: Index of the number.

    Returns:
        One for each that matters, the most first.
    """
    posterior, z = plan.posterior, plan.z
    has_prior = np.asarray(posterior.parameters.has_prior())
    matrix = np.asarray(information(posterior, jnp.asarray(z)))
    now = spread_left(posterior, z, matrix, target).width
    answer = []
    for i, name in enumerate(posterior.parameters.names):
        if i == target:
            continue
        known = spread_left(posterior, z, matrix, target, known=i)
        without = None
        if has_prior[i]:
            without = spread_left(posterior, z, matrix, target, unbelieved=i)
        gain = _ratio(now, known.width)
        loss = 1.0 if without is None else _ratio(without.width, now)
        if gain < KNOWN_GAIN and loss < PRIOR_LOSS:
            continue
        entry = Sensitivity(posterior.parameters.names[target], name, known, without)
        answer.append((max(gain, loss), entry))
    return tuple(entry for _, entry in sorted(answer, key=lambda pair: -pair[0]))


def _ratio(wide: float, narrow: float) -> float:
    """How many times wider; 1 where neither is known."""
    if np.isinf(wide):
        return 1.0 if np.isinf(narrow) else np.inf
    return wide / narrow if narrow > 0 else np.inf


def mass_exponents(plan: Planned) -> dict[str, tuple[float, float]]:
    r"""Return the least and largest $d \ln y / d \ln W$ of each quantity.

    Of an air arrival $y$ is the travel time; other times hardly depend on the mass. A
    scene of several charges, or of a fixed mass, has none.
    """
    posterior, z = plan.posterior, jnp.asarray(plan.z)
    parameters, layout = posterior.parameters, posterior.layout
    if "charge_mass_kg" not in parameters.names:
        return {}
    i = parameters.names.index("charge_mass_kg")
    there = parameters.scene_at(z)
    start = np.asarray(clock_offsets(there, layout) + there.charge.time_s)
    value, moved, grown = map(np.asarray, _mass_slopes(posterior, z, i))
    quantities = [
        q for q in layout.quantities() if q == "air_arrival_s" or q not in ADDITIVE
    ]
    answer = {}
    for quantity in quantities:
        rows = np.isin(layout.quantity, quantity)
        if rows.any():
            base = value[rows] - (start[rows] if quantity in TIMES else 0.0)
            exponent = moved[rows] / base / grown
            answer[quantity] = (float(exponent.min()), float(exponent.max()))
    return answer


@kept
def _mass_slopes(posterior: Posterior, z: Float[Array, " free"], mass: int):
    """Return predictions, their slopes in a mass's coordinate, and that of ln mass."""

    def readings(step):
        there = z.at[mass].add(step)
        name = posterior.parameters.names[mass]
        grown = jnp.log(posterior.parameters.values(there)[name])
        return posterior.misfit(there).predicted, grown

    step = jnp.zeros((), z.dtype)
    (value, _), (moved, grown) = jax.jvp(readings, (step,), (jnp.ones_like(step),))
    return value, moved, grown
