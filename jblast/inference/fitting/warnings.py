"""Warnings and assumptions of an answer.

They concern fit, priors, laws, clocks, and the height, shape and surroundings of the
charge. The most serious warning is the first; each is a `Finding`, without text.
"""

import inspect
from collections.abc import Collection, Mapping

import numpy as np
from jaxtyping import Bool, Float

from jblast.fidelity import TakenLaw
from jblast.inference.answer import Answer
from jblast.inference.fitting.assumptions import (
    flat_ground,
    slower_than_sound,
    still_air,
)
from jblast.inference.fitting.findings import (
    BurstsUnsettled,
    ClocksTakenToAgree,
    DeepCharge,
    FarFromItsLaw,
    HeightOfBurst,
    LawOutOfRange,
    LawsUnsettled,
    ModeFoundOnce,
    NoPointSource,
    NoScene,
    NothingLearned,
    PathsTakenAsIndependent,
    PoorFit,
    PriorConflict,
    WeightsUnreliable,
)
from jblast.inference.fitting.goodness_of_fit import POOR, against_priors, p_value
from jblast.inference.fitting.solution import SamplesRoughlyCounted, Solution
from jblast.inference.posterior.fisher_information import NULL, unit_diagonal
from jblast.inference.posterior.parameters import NORMAL_Q95, Estimate, Finding
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.clocks import clocks_apart, has_common_clock
from jblast.parameters import CLOCK_OFFSET
from jblast.registry import law_for
from jblast.scene import Charge, UncertainScene, parameter_named
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors.law_choice import height_notes
from jblast.sensors.layout import components
from jblast.waves.height_of_burst import scaled_height

LARGE_EFFECT_SD = 4.0
"""A shared effect larger than this many standard deviations is reported: one in 16,000
by chance."""
ROUGH = 0.2
"""Error of the log-density of samples above which it is reported: weights of draws are
then off by a fifth."""

POINT_SOURCES = ("sedov_taylor", "point_source")
"""Laws of energy released at a point. They do not give the energy of a chemical charge
near it: for TNT, radius and time give 5 % of it at Z = 0.2, the peak 37 % at Z =
0.3."""


def warnings_of(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    valid: Bool[np.ndarray, " row"],
    chi2: float,
    dof: int,
    estimates: Mapping[str, Estimate],
    independent: PathsTakenAsIndependent | None,
) -> list[Finding]:
    """Return the warnings of an answer, the most serious first."""
    findings: list[Finding] = []
    against: Mapping[str, float] = {}
    blind = uncertain.source == NO_SCENE
    p = p_value(chi2, dof)
    if p is not None and p < POOR:
        log = (observations.source or "OBSERVATIONS.csv") if blind else ""
        findings.append(PoorFit(chi2, dof, p, log))
        against = against_priors(solution)
    # also for a good fit: free clocks can absorb a wrong speed
    slow = slower_than_sound(observations, solution.answer)
    if slow is not None:
        findings.append(slow)
    if independent is not None and independent.beyond_array:
        findings.append(independent)
    if against:
        findings.append(PriorConflict(against))
    if not valid.all():
        there = solution.answer.valid
        findings.append(outside(observations, solution.laws, valid, there))
    if not solution.converged:
        findings.append(ModeFoundOnce())
    if not solution.identified.is_reliable:
        draws = solution.draws
        findings.append(WeightsUnreliable(draws.k_hat, draws.effective))
    # None: no samples
    if (known := solution.samples_known or 0.0) > ROUGH:
        findings.append(SamplesRoughlyCounted(known, ROUGH))
    if solution.other_laws:
        others = tuple(f"{k}={name}" for k, name in solution.other_laws.items())
        findings.append(LawsUnsettled(others))
    if not solution.bursts_settled:
        findings.append(BurstsUnsettled())
    if blind:
        frame = observations.frame
        known = ("charge_mass_kg", "fireball_growth_s")  # free in any default scene
        free = tuple(name for name in uncertain.beliefs if name not in known)
        findings.append(NoScene(free, frame.alt_m if frame else 0.0))
    # a number in conflict with its prior is reported already
    unlearned = solution.identified.unlearned
    if same := tuple(name for name in unlearned if name not in against):
        findings.append(NothingLearned(same))
    if solution.answer.largest_effect > LARGE_EFFECT_SD:
        findings.append(FarFromItsLaw(solution.answer.largest_effect))
    for charge in solution.answer.scene.charges:
        findings += height_beside_the_curves(solution.answer, solution.laws, charge)
        findings += charge_is_no_point(
            [law.name for law in solution.laws.values()], charge
        )
    findings += clocks_taken_to_agree(observations, uncertain, solution, estimates)
    findings += _round_earth(observations, solution)
    return findings


def assumptions_of(
    solution: Solution, independent: PathsTakenAsIndependent | None
) -> tuple[Finding, ...]:
    """Return the assumptions of an answer with their effect."""
    if independent is not None and independent.beyond_array:
        independent = None  # reported as a warning
    return tuple(found for found in (still_air(solution.answer), independent) if found)


def _round_earth(observations: Observations, solution: Solution) -> list[Finding]:
    """Return the largest error by flat ground, if it is not negligible."""
    if observations.frame is None:
        return []
    answer = solution.answer
    charges = answer.scene.charges
    places = np.array([[float(x) for x in charge.position_m] for charge in charges])
    shot = list(answer.density.layout.shot)
    found = flat_ground(observations, places[shot], answer.slant_range)
    return [found] if found else []


def outside(
    observations: Observations,
    laws: Mapping[str, TakenLaw],
    valid: Bool[np.ndarray, " row"],
    valid_at_answer: Bool[np.ndarray, " row"],
) -> LawOutOfRange:
    """Return the number of rows outside their laws, and the ranges of these laws.

    Args:
        observations: The log.
        laws: The law of each quantity.
        valid: False for rows outside.
        valid_at_answer: False for those outside at the answer; the others are outside
            by the depth of the interval only.
    """
    rows = np.flatnonzero(~valid)
    quantities = dict.fromkeys(observations.quantity[row] for row in rows)
    ranges = {
        (law, law_for(part, law).range): None
        for quantity in quantities
        for part, _ in components(quantity)
        for law in (laws[part].name,)
    }
    return LawOutOfRange(
        rows=len(rows),
        of=len(valid),
        quantities=tuple(quantities),
        ranges=tuple(ranges),
        is_deeper=bool(valid_at_answer[rows].any()),
    )


def height_beside_the_curves(
    answer: Answer, taken: Mapping[str, TakenLaw], charge: Charge
) -> list[Finding]:
    """Return the curves used for a charge off the ground, and their limitations."""
    laws = [law_for(quantity, law.name) for quantity, law in taken.items()]
    depends = any("burst" in law.arguments() for law in laws)
    # with a stated burst there is one curve set, whose laws are valid for it or not
    if not charge.by_height:
        depends |= any(
            "burst" in inspect.signature(law.valid).parameters for law in laws
        )
    if not depends:
        return []
    scene = answer.scene
    shot = [each.name for each in scene.charges].index(charge.name)
    notes = height_notes(scene, answer.density.layout, shot)
    findings: list[Finding] = [HeightOfBurst(note) for note in notes]
    height = float(scaled_height(scene, charge))
    if height < 0:
        findings.append(DeepCharge(charge.name, -height))
    return findings


def charge_is_no_point(laws: Collection[str], charge: Charge) -> list[Finding]:
    """Return a finding if a law of a point source was used for a chemical charge."""
    used = tuple(name for name in POINT_SOURCES if name in laws)
    if not used or charge.explosive == "nuclear":
        return []
    return [NoPointSource(used, charge.explosive)]


def clocks_taken_to_agree(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    estimates: Mapping[str, Estimate],
) -> list[Finding]:
    """Return the clocks of a log that are neither fitted nor given in the scene.

    The first of them is the reference clock.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    clocks = np.array(observations.clocks(), object)
    known = uncertain.scene.clock_offsets()
    read = set(clocks[timed])
    assumed = [n for n in clocks_apart(observations) if n in read and n not in known]
    if not assumed:
        return []
    # an offset adds the same time to every reading of its clock
    columns = np.stack([timed & (clocks == name) for name in assumed], axis=1)
    first = next((clock for clock in observations.clock if clock), "")
    common = () if has_common_clock(observations) else (first,)
    return [
        ClocksTakenToAgree(
            clocks=(*common, *assumed),
            parameters=tuple(f"{CLOCK_OFFSET}.{name}" for name in assumed),
            resting=resting_on(solution, columns.astype(float), estimates),
        )
    ]


def resting_on(
    solution: Solution,
    columns: Float[np.ndarray, "row unknown"],
    estimates: Mapping[str, Estimate],
) -> tuple[str, ...]:
    r"""Return the numbers that are identified only while some unknowns are held fixed.

    The information of the fitted numbers, the unknowns integrated out over a flat
    prior, is $J^T P J - J^T P W (W^T P W)^+ W^T P J$: $J$ holds the slopes of the data
    by the fitted numbers, $W$ those by the unknowns.

    Args:
        solution: Solution with the unknowns fixed.
        columns: Slopes of the readings by each unknown.
        estimates: Estimates of the fitted numbers.
    """
    answer, found = solution.answer, solution.identified
    weighted = answer.weigh(columns)
    across = answer.slopes.T @ weighted
    known = answer.information + np.diag(answer.has_prior)
    # a pseudo-inverse: unknown clocks of the same rows are linearly dependent
    inner = np.linalg.pinv(columns.T @ weighted, rcond=1e-10, hermitian=True)
    left = known - across @ inner @ across.T
    if not np.isfinite(left).all():
        return ()
    # what rounding leaves of the information of a number that is lost
    left = left + 1e-13 * np.diag(np.diag(known))
    size, values, vectors = unit_diagonal(left, answer.steps)
    # null directions get a huge but finite variance
    sds = np.sqrt((vectors**2 / np.maximum(values, NULL)).sum(axis=1)) / size
    lost = []
    for name, sd in zip(answer.names, sds, strict=True):
        wide = 2 * NORMAL_Q95 * sd
        if parameter_named(name).positive:
            wide = np.exp(min(wide, 700.0))  # exp(709) is the largest double
        if estimates[name].identified and wide > found.widest(name):
            lost.append(name)
    return tuple(lost)
