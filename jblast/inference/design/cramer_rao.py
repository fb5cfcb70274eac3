r"""What a planned layout of sensors could tell, before any shot.

The Cramer-Rao bound: no unbiased answer has a covariance below the inverse of the
Fisher information $F$ (see `fisher_information`), and a fit of a log with few wild
readings comes close to it. Where $F$ tells nothing the direction is named instead, with
its cure.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError
from jblast.inference.design.added_datum import added_data
from jblast.inference.design.covariance import cramer_rao
from jblast.inference.design.planned_log import Planned, planned
from jblast.inference.design.sensitivity import leans_on, mass_exponents
from jblast.inference.design.summary import BoundSummary
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.unidentified import (
    estimable_combinations,
    null_directions,
    other_modes,
)
from jblast.inference.fitting.warnings import height_beside_the_curves, outside
from jblast.inference.identifiability.null_space import identifiability
from jblast.inference.mode.laplace import Laplace, density_and_slope, marginals
from jblast.inference.mode.search import optima
from jblast.inference.posterior.estimate import Spread
from jblast.inference.posterior.finding import Finding
from jblast.inference.posterior.fisher_information import (
    information,
    information_of_row,
)
from jblast.inference.posterior.posterior import Posterior
from jblast.observations import Observations
from jblast.progress import stages
from jblast.scene import Free, UncertainScene
from jblast.sensors.law_choice import law_names
from jblast.sensors.layout import check_scene
from jblast.sensors.simulate import STUDENT_FREEDOM, Noise

STAGES = {
    "what the layout tells": 2.0,
    "searching for a second answer": 4.0,
    "what more data would tell": 2.0,
}
"""Of a bound, and about how many seconds each takes, most of them compiling."""
STEPS = 12
"""Steps to the optimum, each of which goes most of the way."""


@dataclass(frozen=True)
class Bound:
    """What a layout could tell.

    Attributes:
        summary: What was found.
        log: The readings without error.
        posterior: What the log would say.
        z: The numbers taken for true, in the fitted coordinates.
        information: Fisher information of the log and the priors at `z`.
        covariance: Its inverse, without null directions.
        exit_code: 0 answered, 4 not identifiable.
    """

    summary: BoundSummary
    log: Observations
    posterior: Posterior
    z: Float[np.ndarray, " free"]
    information: Float[np.ndarray, "free free"]
    covariance: Float[np.ndarray, "free free"]

    @property
    def exit_code(self) -> int:
        """Return the exit code of the contract."""
        return 0 if self.summary.identifiable else 4

    def to_dict(self) -> dict[str, Any]:
        """Return what was found as JSON can hold it."""
        return self.summary.to_dict()


def bound(
    uncertain: UncertainScene,
    at: Mapping[str, ArrayLike] | None = None,
    *,
    noise: Noise = "student",
    seed: int = 0,
) -> Bound:
    """Find out what the sensors of a scene could tell of what is not known.

    Args:
        uncertain: The scene; its sensors say what they record.
        at: Numbers taken for true; needed for each that is free, the others are the
            medians of their priors.
        noise: Distribution of the independent errors.
        seed: Of the search for a second solution.

    Returns:
        The least standard deviation of each unknown (Cramer-Rao), what limits it, and
        which datum would help most.

    Raises:
        InputError: The scene and what is asked do not go together; the message says
            how.

    Example:
        `jblast.bound(jblast.read_scene("scene.toml"), {"charge_mass_kg": 15.0})`
    """
    check_scene(uncertain.scene)
    taken: dict[str, float] = {}
    for name, value in (at or {}).items():
        if np.shape(value) != ():
            raise InputError(f"at[{name!r}]: expected shape (), got {np.shape(value)}")
        taken[name] = np.asarray(value, float).item()
    begin = stages(STAGES)
    begin("what the layout tells")
    plan = planned(uncertain, taken, noise)
    posterior, z = plan.posterior, plan.z
    known = np.asarray(information(posterior, jnp.asarray(z)))
    if not np.isfinite(known).all():
        raise InputError(
            f"{plan.log.source}: what the layout tells cannot be computed at "
            f"{', '.join(f'{n} = {v:g}' for n, v in plan.values.items())}; expected "
            "values within reach of the laws"
        )
    identified = identifiability(posterior, z)
    normal = cramer_rao(posterior, z, identified.identified_basis, known)
    begin("searching for a second answer")
    found = optima(jax.random.key(seed), posterior)
    solution = Solution(posterior, plan.laws, True, found, identified, normal)
    begin("what more data would tell")
    return Bound(
        summary=_summary(plan, solution),
        log=plan.log,
        posterior=posterior,
        z=z,
        information=known,
        covariance=normal.covariance,
    )


def _summary(plan: Planned, solution: Solution) -> BoundSummary:
    """Put together what was found."""
    posterior, normal = solution.posterior, solution.laplace
    valid = np.asarray(posterior.misfit(jnp.asarray(plan.z)).valid)
    null = null_directions(solution)
    # the search's own optimum about the numbers taken for true: it lies a little off,
    # for a law's scatter in seconds grows with the travel time
    home = _climbed(posterior, plan.z, normal)
    doubles = other_modes(solution._replace(laplace=home), bool(valid.all()))
    help_, target = added_data(plan)
    return BoundSummary(
        at=dict(plan.values),
        law=law_names(plan.laws),
        law_reason=plan.laws,
        law_valid=bool(valid.all()),
        parameters=_parameters(solution),
        free=posterior.parameters.names,
        identifiable=not null and not doubles,
        null_directions=null,
        ambiguities=doubles,
        determined=estimable_combinations(solution),
        noise=posterior.noise,
        n_observations=len(plan.log),
        help=help_,
        leans_on=leans_on(plan, target),
        mass_exponents=mass_exponents(plan),
        warnings=tuple(_warnings(plan, solution, valid)),
    )


def _climbed(posterior: Posterior, z, normal: Laplace) -> Laplace:
    """Climb to the optimum about a place, each step as long as information says."""
    # readings without error curve Student-t densities more than they do on average
    nu = STUDENT_FREEDOM
    bend = 1.0 if posterior.noise == "gaussian" else (nu + 1) / nu
    length = information_of_row(posterior.noise) / bend
    there = z
    for _ in range(STEPS):
        _, slope = density_and_slope(posterior, jnp.asarray(there))
        there = there + length * normal.covariance @ np.asarray(slope)
    top, _ = density_and_slope(posterior, jnp.asarray(there))
    start, _ = density_and_slope(posterior, jnp.asarray(z))
    return replace(normal, z=there) if float(top) > float(start) else normal


def _parameters(solution: Solution) -> dict[str, Spread]:
    """Return the standard deviations; a number in a null direction has none."""
    parameters, normal = solution.posterior.parameters, solution.laplace
    bounds = marginals(parameters, normal)
    answer = {}
    for i, (name, determined_) in enumerate(
        zip(parameters.names, solution.identifiability.determined, strict=True)
    ):
        spread = bounds[name].spread
        if not np.isnan(spread.log_sd) and isinstance(parameters.beliefs[i], Free):
            log_sd = float(np.sqrt(normal.covariance[i, i]))
            spread = replace(spread, log_sd=log_sd)
        answer[name] = spread if determined_ else Spread()
    return answer


def _warnings(plan: Planned, solution: Solution, valid) -> list[Finding]:
    findings: list[Finding] = (
        [] if valid.all() else [outside(plan.log, solution, valid)]
    )
    scene = solution.posterior.parameters.scene_at(jnp.asarray(plan.z))
    for charge in scene.charges:
        findings += height_beside_the_curves(solution, charge)
    return findings
