"""The answer as `jblast fit --json` prints it, key by key of the contract."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.inference.fitting.goodness_of_fit import (
    FITS,
    POOR,
    chance,
    chi_squared,
    suspected_outliers,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.suspects import explained_by, lies_far
from jblast.inference.fitting.uncertainty import HowSure
from jblast.inference.fitting.unidentified import (
    ambiguities,
    determined,
    null_directions,
)
from jblast.inference.fitting.warnings import cautions_of
from jblast.observations import Observations
from jblast.quantity_table import QUANTITIES
from jblast.scene import UncertainScene

NOTHING: dict[str, float | None] = dict.fromkeys(
    ("value", "sd", "log_sd", "q05", "q50", "q95")
)
TNT_MASS_BY = {one.tnt_factor: name for name, one in QUANTITIES.items()}
"""A quantity of each kind that explosives have a factor of their own for."""


def answer_of(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    sure: HowSure,
    valid: Bool[np.ndarray, " row"],
    deep: Bool[np.ndarray, " row"],
    residual: Float[np.ndarray, " row"],
    effects: Float[np.ndarray, " effect"],
    refit: Callable[[Observations], Solution],
) -> dict[str, Any]:
    """Put a solution into the contract's words.

    Args:
        observations: The log.
        uncertain: What was known before.
        solution: What inference found.
        sure: How sure it is.
        valid: Whether each row's laws hold at the answer.
        deep: Whether they do as deep as its interval reaches, too.
        residual: What is left of each row, in standard deviations.
        effects: The most probable shared effects.
        refit: Solves for a log of the same rows; asked where no scene fits this one.
    """
    z = solution.laplace.z
    estimates = _estimates(solution, sure)
    null = null_directions(solution)
    doubles = ambiguities(solution, bool(valid.all()))
    chi2, dof = chi_squared(
        solution.posterior, z, residual, effects, solution.identifiability.told.shape[1]
    )
    p = chance(chi2, dof)
    converged = solution.laplace.converged and sure.converged
    poor = p is not None and p < POOR
    answered = converged and not null and bool(valid.any()) and not poor
    wrong = []
    if not answered or lies_far(solution) or (p is not None and p < FITS):
        wrong = explained_by(observations, solution, answered, refit)
    return {
        "schema": 1,
        "law": {quantity: name for quantity, (name, _) in solution.laws.items()},
        "law_reason": {q: reason for q, (_, reason) in solution.laws.items()},
        "law_valid": bool((valid & deep).all()),
        "law_valid_rows": int(valid.sum()),
        "estimates": estimates,
        "derived": _derived(estimates, solution),
        "free": list(solution.posterior.parameters.names),
        "identifiable": not null and not doubles,
        "null_directions": null,
        "ambiguities": doubles,
        "determined": determined(solution),
        "posterior": sure.method,
        "converged": converged,
        "chi2": chi2,
        "dof": dof,
        "n_observations": len(observations),
        "suspected_outliers": suspected_outliers(
            observations, residual, solution.posterior.noise
        ),
        "explained_by": wrong,
        "warnings": cautions_of(
            observations, uncertain, solution, valid & deep, chi2, dof, effects
        )
        + list(sure.why),
    }


def _estimates(solution: Solution, sure: HowSure) -> dict[str, dict[str, float | None]]:
    """Summarise every free number; one in a null direction has nothing to say."""
    names = solution.posterior.parameters.names
    return {
        name: sure.marginals[name] if told else dict(NOTHING)
        for name, told in zip(names, solution.identifiability.determined, strict=True)
    }


def _derived(estimates, solution: Solution) -> dict[str, dict[str, float | None]]:
    """What follows from each mass: as TNT by pressure, and as energy by convention.

    The TNT mass by impulse is told where it differs. A log of the front alone tells
    energy: the TNT mass is that of the energy then.
    """
    z = solution.laplace.z
    parameters = solution.posterior.parameters
    scene = parameters.scene_at(jnp.asarray(z))
    derived = {}
    for charge in scene.charges:
        label = scene.label(charge)
        mass, factor = f"charge_mass_kg{label}", f"tnt_factor{label}"
        if mass not in estimates:
            continue
        if factor in parameters.names:  # the product is not normal in one coordinate
            continue
        per_kg = {
            what: float(charge.tnt_mass(quantity) / charge.mass)
            for what, quantity in TNT_MASS_BY.items()
        }
        front_alone = set(solution.posterior.layout.quantity) == {"shock_radius_m"}
        first = per_kg["energy" if front_alone else "pressure"]
        derived[f"charge_tnt_mass_kg{label}"] = _times(estimates[mass], first)
        if per_kg["impulse"] != per_kg["pressure"] and not front_alone:
            derived[f"charge_tnt_mass_by_impulse_kg{label}"] = _times(
                estimates[mass], per_kg["impulse"]
            )
        derived[f"charge_energy_j{label}"] = _times(
            estimates[mass], per_kg["energy"] * TNT_SPECIFIC_ENERGY
        )
    return derived


def _times(estimate: dict[str, float | None], factor: float):
    """Multiply an estimate; its sd in ln stays."""
    return {
        key: value if key == "log_sd" or value is None else value * factor
        for key, value in estimate.items()
    }
