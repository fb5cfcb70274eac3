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
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import InputError
from jblast.fidelity import TakenLaw
from jblast.inference.answer import Answer, constrained, unconstrained
from jblast.inference.design.covariance import (
    cramer_rao,
    spread_left,
    spreads,
    worst,
)
from jblast.inference.design.planned_log import Planned, planned
from jblast.inference.fitting.warnings import height_beside_the_curves, outside
from jblast.inference.identify import (
    EstimableCombination,
    Identified,
    NullDirection,
    OtherMode,
    aside,
    laws_beside,
)
from jblast.inference.posterior.fisher_information import information, whitened_rows
from jblast.inference.posterior.parameters import Spread
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.sample import solve as drawn
from jblast.kept_programs import kept, kept_between_runs
from jblast.observations import Observations
from jblast.progress import stages
from jblast.progress_line import Progress, reported
from jblast.quantities import ADDABLE, ADDITIVE, TIMES
from jblast.results import Note, plain
from jblast.scene import Free, Scene, UncertainScene, scene_of
from jblast.sensors import Layout
from jblast.sensors.law_choice import law_names
from jblast.sensors.layout import check_scene
from jblast.sensors.record import clock_offsets
from jblast.sensors.simulated_readings import Noise

STAGES = {
    "computing the bound": 2.0,
    "searching for a second optimum": 4.0,
    "ranking further data": 2.0,
}
"""Stages of a bound with their approximate duration [s], most of it compilation."""
DEFAULT_SIGMA = {"time": 1e-3, "relative": 0.05}
"""Assumed error of a quantity that the layout does not record: 1 ms of an arrival, or
the 5 % of a calibrated gauge."""
MAX_SENSORS = 12
"""Largest number of sensors at which data are added, evenly spaced from the nearest to
the farthest. Each adds a row for every quantity that can be added."""
KNOWN_GAIN = 1.5
"""Smallest factor by which an sd shrinks once another number is known, for a report:
less does not justify a measurement of that number."""
PRIOR_LOSS = 1.2
"""Smallest factor by which an sd grows without the prior of another number, for a
report: the prior then contributes 30 % of the information."""


@dataclass(frozen=True)
class AddedDatum:
    """One row that could be added to a layout, and the uncertainty with it.

    Attributes:
        quantity: Quantity to record.
        sensor: Sensor of the layout at that position; "" off the sensors' line.
        position: Position [m]; None in a scene without positions.
        charge: Name of the charge, or "".
        sigma: Its error: seconds, or relative.
        is_default: True if the error is `DEFAULT_SIGMA`.
        law: Name of its law.
        law_valid: True if the row is within the range of the law.
        parameter: Number whose uncertainty is reported.
        left: Standard deviations of that number with the row.
    """

    quantity: str
    sensor: str
    position: Float[np.ndarray, "3"] | None
    charge: str
    sigma: float
    is_default: bool
    law: str
    law_valid: bool
    parameter: str
    left: Spread


@dataclass(frozen=True)
class Sensitivity:
    """Sensitivity of the width of one number to knowledge of another.

    Attributes:
        parameter: Number whose width is reported.
        on: The other number.
        if_known: Standard deviations if the other number is known.
        without_prior: Standard deviations without the prior of the other number; None
            if it has none.
    """

    parameter: str
    on: str
    if_known: Spread
    without_prior: Spread | None


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
        log: The readings without error.
        posterior: Posterior of the log.
        z: Assumed values in the fitted coordinates.
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
    posterior, z = plan.posterior, plan.z
    known = np.asarray(information(posterior, jnp.asarray(z)))
    if not np.isfinite(known).all():
        raise InputError(
            f"{plan.log.source}: the information of the layout is not finite at "
            f"{', '.join(f'{n} = {v:g}' for n, v in plan.values.items())}; expected "
            "values within reach of the laws"
        )
    begin("searching for a second optimum")
    # the assumed values are the answer by construction; draws show where else the log
    # could come from
    density, draws = drawn(plan.density, seed)
    spread = unconstrained(density, draws.values)
    sds = np.sqrt(draws.weights @ (spread - draws.weights @ spread) ** 2)
    values = constrained(density, z[None])[0]
    found = Identified(Answer(density, values, sds), draws)
    covariance = cramer_rao(known, found)
    begin("ranking further data")
    return Bound(
        summary=_summary(plan, found, covariance),
        log=plan.log,
        posterior=posterior,
        z=z,
        information=known,
        covariance=covariance,
    )


def _summary(
    plan: Planned, found: Identified, covariance: Float[np.ndarray, "free free"]
) -> BoundSummary:
    """Return the results of the bound."""
    posterior = plan.posterior
    valid = np.asarray(posterior.misfit(jnp.asarray(plan.z)).valid)
    help_, target = added_data(plan, found)
    return BoundSummary(
        at=dict(plan.values),
        law=law_names(plan.laws),
        law_reason=plan.laws,
        law_valid=bool(valid.all()),
        parameters=_parameters(plan, found, covariance),
        free=posterior.parameters.names,
        identifiable=not found.null_directions and not found.other_modes,
        null_directions=found.null_directions,
        ambiguities=found.other_modes,
        determined=found.combinations,
        noise=posterior.noise,
        n_observations=len(plan.log),
        help=help_,
        leans_on=leans_on(plan, target),
        mass_exponents=mass_exponents(plan),
        warnings=tuple(_warnings(plan, found, valid)),
    )


def _parameters(
    plan: Planned, found: Identified, covariance: Float[np.ndarray, "free free"]
) -> dict[str, Spread]:
    """Return the standard deviations; a number in a null direction has none."""
    parameters = plan.posterior.parameters
    bounds = spreads(parameters, plan.z, covariance)
    answer = {}
    for i, name in enumerate(parameters.names):
        spread = bounds[name]
        # a free positive number is ln-normal: its sd in ln is that of the coordinate,
        # which needs no quadrature
        if not np.isnan(spread.log_sd) and isinstance(parameters.beliefs[i], Free):
            spread = replace(spread, log_sd=float(np.sqrt(covariance[i, i])))
        answer[name] = spread if found.determined[i] else Spread()
    return answer


def _warnings(plan: Planned, found: Identified, valid) -> list[Note]:
    notes = [] if valid.all() else [outside(plan.log, plan.laws, valid, valid)]
    for charge in found.answer.scene.charges:
        notes += height_beside_the_curves(found.answer, plan.laws, charge)
    return notes


class Datum(NamedTuple):
    """One row that could be added: quantity, position, sensor, charge and error."""

    quantity: str
    position: Float[np.ndarray, "3"]
    sensor: str
    group: int
    clock: str
    shot: int
    sigma: float
    is_default: bool


def added_data(plan: Planned, found: Identified) -> tuple[tuple[AddedDatum, ...], int]:
    """Rank rows that could be added by the resulting standard deviation.

    It is that of the charge mass; if no mass is fitted, of the number that is least
    certain relative to its typical step.

    Returns:
        An entry for each row, rows within their laws first, by increasing standard
        deviation, and the index of the number.
    """
    posterior, z = plan.posterior, plan.z
    target = worst(posterior, z)
    data = candidates(plan, found)
    more = Layout(
        quantity=tuple(d.quantity for d in data),
        position=jnp.asarray(np.array([d.position for d in data])),
        slant_range=jnp.full(len(data), jnp.nan),
        time=jnp.full(len(data), jnp.nan),
        group=tuple(d.group for d in data),
        shot=tuple(d.shot for d in data),
        clock=tuple(d.clock for d in data),
    )
    scene = posterior.parameters.scene_at(jnp.asarray(z))
    laws = dict(posterior.laws) | laws_beside(dict(posterior.laws), scene, more)
    # planned and additional rows in one layout, so that all share one program
    both = Posterior(
        posterior.parameters,
        posterior.layout.beside(more),
        jnp.zeros(len(plan.log) + len(data)),
        jnp.concatenate([posterior.sigma, jnp.asarray([d.sigma for d in data])]),
        tuple(sorted(laws.items())),
        posterior.noise,
    )
    known, valid = map(np.asarray, _with_each(both, jnp.asarray(z), len(plan.log)))
    entries = []
    for datum, matrix, holds in zip(data, known, valid, strict=True):
        left = spread_left(posterior, z, matrix, target)
        entries.append(_entry(datum, plan, laws, bool(holds), target, left))
    entries.sort(key=lambda e: (not e.law_valid, e.left.width))
    return tuple(entries), target


def _entry(datum: Datum, plan: Planned, laws, holds, target, left) -> AddedDatum:
    parameters = plan.posterior.parameters
    charge = parameters.scene.charges[datum.shot]
    return AddedDatum(
        quantity=datum.quantity,
        sensor=datum.sensor,
        position=datum.position if charge.range_m is None else None,
        charge=charge.name,
        sigma=datum.sigma,
        is_default=datum.is_default,
        law=laws[datum.quantity],
        law_valid=holds,
        parameter=parameters.names[target],
        left=left,
    )


def candidates(plan: Planned, found: Identified) -> list[Datum]:
    """Return the rows to try: each quantity at each sensor and at a new position."""
    posterior, log = plan.posterior, plan.log
    layout = posterior.layout
    position, distance = (
        np.asarray(x)
        for x in (layout.position, posterior.misfit(jnp.asarray(plan.z)).slant_range)
    )
    # reversed, so that the first row of a quantity gives its sigma
    sigmas = dict(
        zip(reversed(layout.quantity), np.asarray(posterior.sigma)[::-1], strict=True)
    )
    answer = []
    for shot, charge in enumerate(posterior.parameters.scene.charges):
        rows = {log.sensor[i]: i for i in np.flatnonzero(np.array(layout.shot) == shot)}
        ranked = sorted(rows, key=lambda name: distance[rows[name]])
        picked = np.unique(np.linspace(0, len(ranked) - 1, MAX_SENSORS).astype(int))
        places = [
            (position[i], name, layout.group[i], layout.clock[i])
            for name in (ranked[k] for k in picked)
            for i in (rows[name],)
        ]
        if charge.range_m is None:
            reach = float(np.median(distance))
            places.append(
                (aside(found.density, reach), "", max(layout.group) + 1 + shot, "")
            )
        for quantity in ADDABLE:
            timed = "time" if quantity in TIMES else "relative"
            sigma = float(sigmas.get(quantity, DEFAULT_SIGMA[timed]))
            answer += [
                Datum(quantity, at, name, group, clock, shot, sigma, is_default)
                for is_default in (quantity not in sigmas,)
                for at, name, group, clock in places
                if (name, quantity, shot)
                not in zip(log.sensor, log.quantity, layout.shot, strict=True)
            ]
    return answer


def leans_on(plan: Planned, target: int) -> tuple[Sensitivity, ...]:
    """Return the other numbers to which the width of one is sensitive.

    Args:
        plan: The layout.
        target: Index of the number.

    Returns:
        One entry for each sensitivity, the largest first.
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


def mass_exponents(plan: Planned) -> dict[str, tuple[float, float]]:
    r"""Return the smallest and largest $d \ln y / d \ln W$ of each quantity.

    For an air arrival $y$ is the travel time; other times hardly depend on the mass. A
    scene with several charges or a fixed mass has no exponents.
    """
    posterior, z = plan.posterior, jnp.asarray(plan.z)
    parameters, layout = posterior.parameters, posterior.layout
    if "charge_mass_kg" not in parameters.names:
        return {}
    i = parameters.names.index("charge_mass_kg")
    there = parameters.scene_at(z)
    # clock time at the explosion: exponents are those of the travel time
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
def _with_each(
    posterior: Posterior, z: Float[Array, " free"], planned: int
) -> tuple[Float[Array, "added free free"], Bool[Array, " added"]]:
    """Return the information of the planned rows with each further row added.

    One program computes all rows: only the index of the added row changes.
    """
    jacobian = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    misfit = posterior.misfit(z)
    prior = jnp.diag(posterior.parameters.has_prior())

    def with_row(row: Array) -> Float[Array, "free free"]:
        rows = jnp.append(jnp.arange(planned), row)
        of_rows = jax.tree.map(lambda x: x[rows], misfit)
        # shared effects of the new row and the planned ones are projected out together
        gained = whitened_rows(posterior, of_rows, jacobian[rows])
        return gained.T @ gained + prior

    rows = jnp.arange(planned, len(jacobian))
    return jax.lax.map(with_row, rows), misfit.valid[planned:]


def _ratio(wide: float, narrow: float) -> float:
    """Return the ratio of two widths; 1 if both are infinite."""
    if np.isinf(wide):
        return 1.0 if np.isinf(narrow) else np.inf
    return wide / narrow if narrow > 0 else np.inf


@kept
def _mass_slopes(posterior: Posterior, z: Float[Array, " free"], mass: int):
    """Return predictions, and the derivatives of these and ln mass by a coordinate."""

    def readings(step):
        there = z.at[mass].add(step)
        name = posterior.parameters.names[mass]
        grown = jnp.log(posterior.parameters.values(there)[name])
        return posterior.misfit(there).predicted, grown

    step = jnp.zeros((), z.dtype)
    (value, _), (moved, grown) = jax.jvp(readings, (step,), (jnp.ones_like(step),))
    return value, moved, grown
