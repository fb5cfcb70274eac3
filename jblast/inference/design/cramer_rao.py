r"""The Cramer-Rao bound of a planned layout of sensors, before any shot.

No unbiased estimate has a covariance below the inverse of the Fisher information $F$
(see `fisher_information`), and a fit of a log with few wild readings comes close to it.
Where $F$ is singular the null direction is reported instead, with data that would
resolve it.

The bound holds at the assumed values of the parameters. It is also computed with each
reading that could be added to the layout, which ranks them, and with each prior dropped
or each other unknown given, which shows what the answer is sensitive to. The slopes
$d \ln y / d \ln W$ of the laws limit any estimate of the mass.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError
from jblast.inference.answer import constrained
from jblast.inference.design.added_data import (
    AddedDatum,
    Sensitivity,
    added_data,
    leans_on,
)
from jblast.inference.design.plan import Planned
from jblast.inference.design.planned_log import planned
from jblast.inference.fitting.warnings import height_beside_the_curves, outside
from jblast.inference.identify import (
    EstimableCombination,
    Identified,
    NullDirection,
    OtherMode,
    identified,
)
from jblast.inference.posterior.parameters import Spread
from jblast.inference.sample import solve as drawn
from jblast.kept_programs import kept_between_runs
from jblast.observations import Observations
from jblast.progress import Progress, reported, stages
from jblast.quantities import ADDITIVE
from jblast.results import Note, plain
from jblast.scene import Scene, UncertainScene, scene_of
from jblast.sensors.forward_model import clock_offsets
from jblast.sensors.law_choice import law_names
from jblast.sensors.layout import check_scene
from jblast.sensors.simulated_readings import Noise
from jblast.waves.choice import TakenLaw

STAGES = {
    "computing the bound": 2.0,
    "searching for a second optimum": 4.0,
    "ranking further data": 2.0,
}
"""Stages of a bound with their approximate duration [s], most of it compilation."""


@dataclass(frozen=True)
class BoundSummary:
    """Results of the bound of a layout, as values.

    Attributes:
        at: Assumed values of the numbers.
        law: Name of the law of each quantity.
        law_reason: Reason for its choice; `report.law_reason` formats it as text.
        law_valid: True if every row is within the range of its law.
        parameters: Standard deviations of each uncertain number.
        free: Names of the uncertain numbers.
        identifiable: True if the readings would determine a single answer.
        null_directions: Directions in which no datum changes.
        ambiguities: Other optima that the data could not rule out.
        determined: Combinations of unidentified numbers that are identified.
        noise: Distribution of the independent errors.
        n_observations: Rows of the planned log.
        help: Rows that could be added, the most helpful first.
        leans_on: Numbers to which the least certain number is sensitive, the most
            first.
        mass_exponents: Smallest and largest slope of ln of each quantity in ln mass.
        warnings: Warnings.
    """

    at: Mapping[str, float]
    law: Mapping[str, str]
    law_reason: Mapping[str, TakenLaw]
    law_valid: bool
    parameters: Mapping[str, Spread]
    free: tuple[str, ...]
    identifiable: bool
    null_directions: tuple[NullDirection, ...]
    ambiguities: tuple[OtherMode, ...]
    determined: tuple[EstimableCombination, ...]
    noise: str
    n_observations: int
    help: tuple[AddedDatum, ...]
    leans_on: tuple[Sensitivity, ...]
    mass_exponents: Mapping[str, tuple[float, float]]
    warnings: tuple[Note, ...]

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Names of the uncertain numbers that would not be identified."""
        return tuple(n for n, s in self.parameters.items() if not s.is_known)

    def to_dict(self) -> dict[str, Any]:
        """Return the summary for JSON; numbers that are not finite become null."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}


@dataclass(frozen=True)
class Bound:
    """The Cramer-Rao bound of a layout.

    Attributes:
        summary: Standard deviations and further results.
        plan: The planned log, with its information.
        covariance: Inverse of the information, without null directions.
        log: The readings without error.
        exit_code: 0 answered, 4 not identifiable.
    """

    summary: BoundSummary
    plan: Planned
    covariance: Float[np.ndarray, "free free"]

    @property
    def log(self) -> Observations:
        """The readings without error."""
        return self.plan.log

    @property
    def exit_code(self) -> int:
        """Return the exit code: 0 answered, 4 not identifiable."""
        return 0 if self.summary.identifiable else 4

    def to_dict(self) -> dict[str, Any]:
        """Return the summary with values that JSON can represent."""
        return self.summary.to_dict()


@kept_between_runs()
@reported("bound")
def bound(
    uncertain: UncertainScene | Scene | str | os.PathLike[str],
    at: Mapping[str, ArrayLike] | None = None,
    *,
    noise: Noise = "student",
    seed: int = 0,
    progress: Progress = False,
) -> Bound:
    """Return the Cramer-Rao bound of the uncertain numbers of a scene with sensors.

    Args:
        uncertain: The scene, or its file; its sensors have the quantities that they
            record.
        at: Assumed values, required for each free number. The default is the median of
            the prior.
        noise: Distribution of the independent errors.
        seed: Seed of the search for a second optimum.
        progress: As for `jblast.fit`.

    Returns:
        The smallest standard deviation of each unknown (Cramer-Rao), its limitations,
        and the data that would reduce it most.

    Raises:
        InputError: Scene and arguments do not match; the message states the remedy.

    Example:
        `jblast.bound("scene.toml", {"charge_mass_kg": 15.0})`
    """
    uncertain = scene_of(uncertain)
    check_scene(uncertain.scene)
    taken: dict[str, float] = {}
    for name, value in (at or {}).items():
        if np.shape(value) != ():
            raise InputError(f"at[{name!r}]: expected shape (), got {np.shape(value)}")
        taken[name] = np.asarray(value, float).item()
    begin = stages(STAGES)
    begin("computing the bound")
    plan = planned(uncertain, taken, noise)
    begin("searching for a second optimum")
    # the assumed values are the answer by construction; draws show where else the log
    # could come from
    density, draws = drawn(plan.density, seed)
    found = identified(density, draws, constrained(density, plan.z[None])[0])
    begin("ranking further data")
    return _bound(plan, found)


def _bound(plan: Planned, found: Identified) -> Bound:
    """Return the results of the bound."""
    names, valid = plan.parameters.names, np.asarray(plan.misfit.valid)
    covariance = cramer_rao(plan, found)
    pairs = enumerate(zip(names, found.determined, strict=True))
    parameters = {
        name: plan.spreads(i, covariance[[i], i])[0] if is_known else Spread()
        for i, (name, is_known) in pairs
    }
    warnings: list[Note] = []
    if not valid.all():
        warnings.append(outside(plan.log, plan.laws, valid, valid))
    for charge in found.answer.scene.charges:
        warnings += height_beside_the_curves(found.answer, plan.laws, charge)
    summary = BoundSummary(
        at=dict(plan.values),
        law=law_names(plan.laws),
        law_reason=plan.laws,
        law_valid=bool(valid.all()),
        parameters=parameters,
        free=names,
        identifiable=not found.null_directions and not found.other_modes,
        null_directions=found.null_directions,
        ambiguities=found.other_modes,
        determined=found.combinations,
        noise=plan.posterior.noise,
        n_observations=len(plan.log),
        help=added_data(plan),
        leans_on=leans_on(plan),
        mass_exponents=mass_exponents(plan),
        warnings=tuple(warnings),
    )
    return Bound(summary, plan, covariance)


def cramer_rao(plan: Planned, found: Identified) -> Float[np.ndarray, "free free"]:
    """Return the inverse of the information along the identified directions.

    Along a direction whose slopes vanish by symmetry alone (the height of a charge
    among sensors at its own height) the information is zero. There the width is that of
    the draws.

    Args:
        plan: The planned log.
        found: What it identifies.
    """
    covariance, null, size = plan.inverse(plan.information)
    for vector in null.T:
        if vector.any() and not found.is_left_open(vector):
            axis, along = vector / size, vector * size
            covariance += np.outer(axis, axis) * (along @ found.covariance @ along)
    return covariance


def mass_exponents(plan: Planned) -> dict[str, tuple[float, float]]:
    r"""Return the smallest and largest $d \ln y / d \ln W$ of each quantity.

    For an air arrival $y$ is the travel time; other times hardly depend on the mass. A
    scene with several charges or a fixed mass has no exponents.
    """
    parameters, layout = plan.parameters, plan.posterior.layout
    if "charge_mass_kg" not in parameters.names:
        return {}
    i = parameters.names.index("charge_mass_kg")
    mass, grown = jax.jvp(parameters.beliefs[i].constrain, (plan.z[i],), (1.0,))
    there = parameters.scene_at(jnp.asarray(plan.z))
    quantity = np.array(layout.quantity)
    # clock time at the explosion: exponents are those of the travel time
    start = np.asarray(clock_offsets(there, layout) + there.charge.time_s)
    # slopes of other quantities are those of their ln
    size = np.where(quantity == "air_arrival_s", plan.misfit.predicted - start, 1.0)
    exponents = plan.slopes[:, i] / size / float(grown / mass)
    return {
        name: (float(of_rows.min()), float(of_rows.max()))
        for name in dict.fromkeys(layout.quantity)
        if name == "air_arrival_s" or name not in ADDITIVE
        for of_rows in [exponents[quantity == name]]
    }
