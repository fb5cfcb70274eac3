"""Results of a fit as values: estimates, what they leave open, warnings."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.inference.fitting.assumptions import (
    extrapolated,
    valid_at_depth,
)
from jblast.inference.fitting.goodness_of_fit import (
    FITS,
    POOR,
    goodness,
    p_value,
    suspected_outliers,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.suspects import (
    Refit,
    accused_sensors,
    explained_by,
    lies_far,
    more_to_free,
    other_explanations,
)
from jblast.inference.fitting.warnings import notes_of
from jblast.inference.fitting.wrong import (
    ExchangedSensors,
    SuspectedOutlier,
    WrongClock,
    WrongSensor,
)
from jblast.inference.identify import (
    BearingArc,
    EstimableCombination,
    Identified,
    NullDirection,
    OtherMode,
    PlaceRegion,
    requested,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.observations import Observations
from jblast.parameters import CHARGE_POSITION
from jblast.results import Note, plain, problem
from jblast.scene import UncertainScene
from jblast.sensors.law_choice import law_names
from jblast.waves.choice import TakenLaw

TNT_MASS_BY = {
    "pressure": "peak_overpressure_pa",
    "impulse": "positive_impulse_pa_s",
    "energy": "shock_radius_m",
}
"""A quantity of each kind for which explosives have a separate TNT factor."""


@dataclass(frozen=True)
class Summary:
    """Results of a fit, as values.

    Attributes:
        law: Name of the law that read each quantity.
        law_reason: Reason for its choice; `report.law_reason` formats it as text.
        law_valid: True if every row is within the range of its law.
        law_valid_rows: Number of these rows.
        estimates: Estimate of every free number; an unidentified one has no value.
        derived: TNT mass and energy of each mass. If the position of a charge is not
            identified, its bearing and range, by the two arcs with the
            largest shares.
        free: Names of the fitted numbers.
        identifiable: True if the data determine a single answer.
        null_directions: Directions in which no datum changes.
        ambiguities: Other modes that the data cannot rule out.
        determined: Combinations of unidentified numbers that are identified.
        posterior: Method of the intervals: "weighted" or "emcee".
        converged: True if search and sampler converged.
        unchecked: True if the weights of the draws are unreliable.
        chi2: Chi squared.
        dof: Its degrees of freedom.
        n_observations: Rows of the log.
        n_lower_bounds: Rows of the log that are lower bounds.
        suspected_outliers: Readings too far off, worst first.
        explained_by: Clocks and sensors without one of which the log fits, and pairs of
            sensors with whose positions exchanged it fits.
        problems: What forbids using the answer or a part of it, the most serious first;
            the exit code is then 4.
        warnings: Warnings, the most serious first.
        assumptions: Assumptions of the answer with their effect.
        extrapolated: Requested numbers with more than half of their information from
            rows outside the range of their laws.
        understood: Conversions, skipped rows and supplied values when the log was read.
        bearing_arcs: Arcs of the bearing, where the position is not identified.
        regions: Regions of the position if there are several, the most probable first.
            `estimates` are those of the first.
    """

    law: Mapping[str, str]
    law_reason: Mapping[str, TakenLaw]
    law_valid: bool
    law_valid_rows: int
    estimates: Mapping[str, Estimate]
    derived: Mapping[str, Estimate]
    free: tuple[str, ...]
    identifiable: bool
    null_directions: tuple[NullDirection, ...]
    ambiguities: tuple[OtherMode, ...]
    determined: tuple[EstimableCombination, ...]
    posterior: str
    converged: bool
    chi2: float
    dof: int
    n_observations: int
    n_lower_bounds: int = field(default=0, kw_only=True)
    suspected_outliers: tuple[SuspectedOutlier, ...]
    explained_by: tuple[WrongClock | ExchangedSensors | WrongSensor, ...]
    problems: tuple[Note, ...] = field(init=False)
    warnings: tuple[Note, ...]
    assumptions: tuple[Note, ...] = ()
    extrapolated: tuple[str, ...] = ()
    understood: tuple[Note, ...] = ()
    bearing_arcs: tuple[BearingArc, ...] = ()
    regions: tuple[PlaceRegion, ...] = ()
    unchecked: bool = False

    def __post_init__(self) -> None:
        # a frozen dataclass sets its derived fields this way
        object.__setattr__(self, "problems", tuple(_problems(self)))

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Names of the free numbers that have no value."""
        return tuple(n for n, e in self.estimates.items() if not e.identified)

    @property
    def identifies_nothing(self) -> bool:
        """True if no requested number is identified."""
        names = requested(self.free)
        return bool(names) and not any(self.estimates[n].identified for n in names)

    def to_dict(self) -> dict[str, Any]:
        """Return the summary for JSON; numbers that are not finite become null."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}


def _problems(found: Summary) -> Iterator[Note]:
    """Yield what forbids using an answer, the most serious first."""
    # without convergence nothing else can be relied on
    if not found.converged:
        yield problem("not_converged")
    p = p_value(found.chi2, found.dof)
    if p is not None and p < POOR:
        yield problem("poor_fit", chi2=found.chi2, dof=found.dof, p_value=p)
    if not found.law_valid_rows:
        yield problem("no_law_applies")
    elif found.extrapolated:
        yield problem("extrapolated", parameters=found.extrapolated)
    if found.explained_by:
        yield problem("wrong_sensor", wrong=found.explained_by)
    if found.unchecked:
        yield problem("uncertain_intervals")
    if not found.identifiable or found.identifies_nothing:
        several = (mode.differ for mode in found.ambiguities)
        curves = (direction.parameters for direction in found.null_directions)
        # of several regions the estimates are those of one
        place = [n for n in found.free if n.partition(".")[0] in CHARGE_POSITION]
        places = place if found.regions else ()
        open_ones = (found.unidentified, *several, *curves, places)
        names = dict.fromkeys(name for names in open_ones for name in names)
        yield problem("not_identifiable", parameters=tuple(names))


def summary_of(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    refit: Refit,
    *,
    method: str = "weighted",
    of_sampler: tuple[Note, ...] = (),
    found_before: tuple[Note, ...] = (),
) -> Summary:
    """Return the summary of a fit.

    Args:
        observations: The log.
        uncertain: The scene with its uncertain numbers.
        solution: Result of the inference.
        refit: Function that solves for a log of the same rows with more numbers free;
            used if no scene fits this one.
        method: Method of the intervals.
        of_sampler: Shortfalls of the convergence of walkers.
        found_before: Warnings about the log from before the search.
    """
    answer, found = solution.answer, solution.identified
    valid, deep = answer.valid, valid_at_depth(solution)
    chi2, dof = goodness(solution)
    p = p_value(chi2, dof)
    converged = solution.converged and not of_sampler
    poor = p is not None and p < POOR
    has_place = all(place.has_place for place in found.places)
    answered = converged and not len(found.null) and bool(valid.any()) and not poor
    wrong: tuple[WrongSensor, ...] = ()
    # Rows left out do not identify what all rows leave open: null directions, or a
    # bearing without a range, are no reason to search for a wrong sensor.
    is_far = has_place and lies_far(solution)
    # A wrong sensor shows in three ways: no convergence, a charge far away, where laws
    # scatter more than the error, or a poor fit.
    is_solved = converged and bool(valid.any())
    if not is_solved or is_far or (p is not None and p < FITS):
        wrong = explained_by(observations, solution, answered, refit)
    suspected = suspected_outliers(observations, answer.residual, answer.density.noise)
    several: list[Note] = []
    if wrong:  # other residuals may be large because of it
        accused = accused_sensors(observations, wrong)
        suspected = tuple(of for of in suspected if of.sensor in accused)
    else:
        # without an accused sensor the largest outlier may be one of several
        # explanations
        several = other_explanations(observations, solution, suspected)
    more: list[Note] = []
    if (poor or not has_place) and not wrong:
        fits = not poor
        more = more_to_free(observations, uncertain, solution, refit, fits=fits)
    estimates = found.estimates
    notes = [
        *more,
        *found_before,
        *several,
        *notes_of(observations, uncertain, solution, valid & deep, poor, estimates),
        *of_sampler,
    ]
    return Summary(
        law=law_names(solution.laws),
        law_reason=solution.laws,
        law_valid=bool((valid & deep).all()),
        law_valid_rows=int(valid.sum()),
        estimates=estimates,
        derived=_derived(estimates, solution) | _directions(found),
        free=found.names,
        identifiable=found.is_identifiable,
        null_directions=found.null_directions,
        ambiguities=found.other_modes,
        determined=found.combinations,
        posterior=method,
        converged=converged,
        chi2=chi2,
        dof=dof,
        n_observations=len(observations),
        suspected_outliers=suspected,
        explained_by=wrong,
        warnings=tuple(note for note in notes if note.level == "warning"),
        n_lower_bounds=int(observations.bounds().sum()),
        understood=observations.understood,
        assumptions=tuple(note for note in notes if note.level == "assumption"),
        extrapolated=extrapolated(solution, valid),
        bearing_arcs=found.bearings,
        regions=found.regions,
        unchecked=not found.is_reliable,
    )


def _directions(found: Identified) -> dict[str, Estimate]:
    """Return bearings and range of a charge whose place is not identified."""
    if found.range_m is None:
        return {}
    names = ("bearing_deg", "other_bearing_deg")
    bearings = zip(names, (arc.bearing_deg for arc in found.bearings), strict=False)
    return {"range_m": found.range_m, **dict(bearings)}


def _derived(
    estimates: Mapping[str, Estimate], solution: Solution
) -> dict[str, Estimate]:
    """Return TNT mass (by pressure) and energy of each mass.

    The TNT mass by impulse is reported if it differs. A log of the shock front alone
    identifies the energy: the TNT mass is then by energy.
    """
    scene, density = solution.answer.scene, solution.density
    derived = {}
    for charge in scene.charges:
        label = scene.label(charge)
        mass, factor = f"charge_mass_kg{label}", f"tnt_factor{label}"
        if mass not in estimates:
            continue
        if (
            factor in density.coordinates.names
        ):  # the product is not normal in one coordinate
            continue
        per_kg = {
            what: float(charge.tnt_factor_for(quantity))
            for what, quantity in TNT_MASS_BY.items()
        }
        front_alone = set(density.layout.quantity) == {"shock_radius_m"}
        # a shock front depends on the energy; its TNT mass follows from that
        first = per_kg["energy" if front_alone else "pressure"]
        derived[f"charge_tnt_mass_kg{label}"] = estimates[mass].times(first)
        if per_kg["impulse"] != per_kg["pressure"] and not front_alone:
            derived[f"charge_tnt_mass_by_impulse_kg{label}"] = estimates[mass].times(
                per_kg["impulse"]
            )
        derived[f"charge_energy_j{label}"] = estimates[mass].times(
            per_kg["energy"] * TNT_SPECIFIC_ENERGY
        )
    return derived
