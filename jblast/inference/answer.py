"""The answer as `jblast fit --json` prints it, key by key of the contract."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.inference.cautions import cautions_of
from jblast.inference.combinations import combination, space_of
from jblast.inference.cure import cure_of_ambiguity, cure_of_null
from jblast.inference.fisher import information
from jblast.inference.goodness import chi_squared, suspected_outliers
from jblast.inference.identifiability import told_combinations
from jblast.inference.laplace import laplace, marginals
from jblast.inference.optimum import SEPARATE
from jblast.inference.solution import Solution
from jblast.observations import Observations
from jblast.scene import UncertainScene

NOTHING: dict[str, float | None] = dict.fromkeys(
    ("value", "sd", "log_sd", "q05", "q50", "q95")
)
TNT_MASS_BY = {
    "pressure": "peak_overpressure_pa",
    "impulse": "positive_impulse_pa_s",
    "energy": "shock_radius_m",
}
"""A quantity of each kind that explosives have a factor of their own for."""
NEAR = 6.0
"""Another optimum within this of the best, in -2 ln density, is an ambiguity."""


def answer_of(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    valid: Bool[np.ndarray, " row"],
    residual: Float[np.ndarray, " row"],
    effects: Float[np.ndarray, " effect"],
) -> dict[str, Any]:
    """Put a solution into the contract's words.

    Args:
        observations: The log.
        uncertain: What was known before.
        solution: What inference found.
        valid: Whether each row's laws hold at the answer.
        residual: What is left of each row, in standard deviations.
        effects: The most probable shared effects.
    """
    z = solution.laplace.z
    estimates = _estimates(solution)
    null = _null_directions(solution)
    doubles = _ambiguities(solution, bool(valid.all()))
    chi2, dof = chi_squared(
        solution.posterior, z, residual, effects, solution.identifiability.told.shape[1]
    )
    return {
        "schema": 1,
        "law": {quantity: name for quantity, (name, _) in solution.laws.items()},
        "law_reason": {q: reason for q, (_, reason) in solution.laws.items()},
        "law_valid": bool(valid.all()),
        "estimates": estimates,
        "derived": _derived(estimates, solution),
        "free": list(solution.posterior.parameters.names),
        "identifiable": not null and not doubles,
        "null_directions": null,
        "ambiguities": doubles,
        "determined": _determined(solution),
        "posterior": "laplace",
        "converged": solution.laplace.converged,
        "chi2": chi2,
        "dof": dof,
        "n_observations": len(observations),
        "suspected_outliers": suspected_outliers(
            observations, residual, solution.posterior.noise
        ),
        "warnings": cautions_of(
            observations, uncertain, solution, valid, chi2, dof, effects
        ),
    }


def _estimates(solution: Solution) -> dict[str, dict[str, float | None]]:
    """Summarise every free number; one in a null direction has nothing to say."""
    names = solution.posterior.parameters.names
    told = marginals(solution.posterior.parameters, solution.laplace)
    return {
        name: told[name] if determined else dict(NOTHING)
        for name, determined in zip(
            names, solution.identifiability.determined, strict=True
        )
    }


def _derived(estimates, solution: Solution) -> dict[str, dict[str, float | None]]:
    """What follows from each mass: as TNT by pressure, and as energy by convention.

    The TNT mass by impulse is told where it differs.
    """
    z = solution.laplace.z
    parameters = solution.posterior.parameters
    scene = parameters.scene_at(jnp.asarray(z))
    derived = {}
    for charge in scene.charges:
        label = f".{charge.name}" if scene.others else ""
        mass, factor = f"charge_mass_kg{label}", f"tnt_factor{label}"
        if mass not in estimates:
            continue
        if factor in parameters.names:  # the product is not normal in one coordinate
            continue
        per_kg = {
            what: float(charge.tnt_mass(quantity) / charge.mass)
            for what, quantity in TNT_MASS_BY.items()
        }
        derived[f"charge_tnt_mass_kg{label}"] = _times(
            estimates[mass], per_kg["pressure"]
        )
        if per_kg["impulse"] != per_kg["pressure"]:
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


def _null_directions(solution: Solution) -> list[dict[str, Any]]:
    parameters = solution.posterior.parameters
    return [
        {
            "parameters": {
                name: float(weight)
                for name, weight in zip(parameters.names, direction, strict=True)
                if weight != 0
            },
            "space": space_of(parameters.space(), direction),
            "cure": cure_of_null(solution.posterior, solution.laplace.z, direction),
        }
        for direction in solution.identifiability.null
    ]


def _determined(solution: Solution) -> list[dict[str, Any]]:
    parameters, normal = solution.posterior.parameters, solution.laplace
    answer = []
    for form in told_combinations(solution.identifiability):
        text, is_product = combination(parameters.names, parameters.space(), form)
        value = float(form @ normal.z)
        sd = float(np.sqrt(form @ normal.covariance @ form))
        moved = solution.identifiability.followed @ form - value
        is_global = np.all(np.abs(moved) < max(sd, 1e-6 * abs(value)))
        if is_product:
            with np.errstate(over="ignore"):
                value = float(np.exp(value))
            sd = value * sd
        if not np.isfinite([value, sd]).all():
            continue
        entry = {"combination": text, "value": value, "sd": sd}
        if not is_global:
            entry["note"] = "near the answer only: the invariance is curved"
        answer.append(entry)
    return answer


def _ambiguities(solution: Solution, valid: bool) -> list[dict[str, Any]]:
    """Name every other optimum that the data cannot rule out.

    One that differs in numbers the data do not determine anyway is none, nor is one
    where a law does not hold, if the best lies where all do.
    """
    found, posterior = solution.optima, solution.posterior
    best = solution.laplace.z
    told: list[np.ndarray] = [best]
    answer = []
    for z, density in zip(*map(np.asarray, found), strict=True):
        if 2 * (found.log_density[0] - density) > NEAR:
            continue
        if min(_apart(solution, other, z) for other in told) < SEPARATE:
            continue
        if valid and not np.asarray(posterior.misfit(jnp.asarray(z)).valid).all():
            continue
        if not laplace(posterior, z, solution.identifiability.told).converged:
            continue
        told.append(z)
        values = posterior.parameters.values(jnp.asarray(z))
        sds = np.sqrt(np.diag(solution.laplace.covariance))
        differ = [
            name
            for name, moved in zip(
                posterior.parameters.names, np.abs(z - best) > sds, strict=True
            )
            if moved
        ]
        answer.append(
            {
                "parameters": {name: float(value) for name, value in values.items()},
                "reason": _reason(differ, 2 * float(found.log_density[0] - density)),
                "cure": cure_of_ambiguity(posterior, best, z),
            }
        )
    return answer


def _apart(solution: Solution, one, other) -> float:
    """Distance of two places in standard deviations of what is determined."""
    away = (one - other)[list(solution.identifiability.determined)]
    if len(solution.identifiability.null):
        kept = np.flatnonzero(solution.identifiability.determined)
        sds = np.sqrt(np.diag(solution.laplace.covariance))[kept]
        return float(np.max(np.abs(away) / sds, initial=0.0))
    metric = np.asarray(information(solution.posterior, jnp.asarray(one)))
    return float(np.sqrt(away @ metric @ away))


def _reason(differ: list[str], cost: float) -> str:
    places = {"charge_east_m", "charge_north_m", "charge_up_m"} & set(differ)
    what = "another place" if places else "another solution"
    return (
        f"{what} of {', '.join(sorted(differ)) or 'all'} explains the log nearly as "
        f"well (chi squared differs by {cost:.2g})"
    )
