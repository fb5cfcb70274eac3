"""Warnings and assumptions of an answer.

They concern fit, priors, laws, clocks, and the height, shape and surroundings of the
charge. The most serious warning is the first; each is a `Finding`, without text.
"""

import inspect
from collections.abc import Collection, Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

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
    NoPointSource,
    NoScene,
    NotAtOptimum,
    NothingLearned,
    PathsTakenAsIndependent,
    PoorFit,
    PriorConflict,
)
from jblast.inference.fitting.goodness_of_fit import POOR, against_priors, p_value
from jblast.inference.fitting.solution import SamplesRoughlyCounted, Solution
from jblast.inference.fitting.unidentified import resting_on, unlearned
from jblast.inference.posterior.parameters import Estimate, Finding
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.clocks import clocks_apart, has_common_clock
from jblast.parameters import CLOCK_OFFSET
from jblast.registry import law_for
from jblast.scene import Charge, UncertainScene
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
    at_optimum: bool,
    valid: Bool[np.ndarray, " row"],
    chi2: float,
    dof: int,
    effects: Float[np.ndarray, " effect"],
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
    slow = slower_than_sound(observations, solution)
    if slow is not None:
        findings.append(slow)
    if independent is not None and independent.beyond_array:
        findings.append(independent)
    if against:
        findings.append(PriorConflict(against))
    if not valid.all():
        findings.append(outside(observations, solution, valid))
    if not at_optimum:
        findings.append(NotAtOptimum())
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
    if same := tuple(name for name in unlearned(solution) if name not in against):
        findings.append(NothingLearned(same))
    if np.abs(effects).max(initial=0.0) > LARGE_EFFECT_SD:
        findings.append(FarFromItsLaw(float(np.abs(effects).max())))
    scene = solution.posterior.parameters.scene_at(jnp.asarray(solution.laplace.z))
    for charge in scene.charges:
        findings += height_beside_the_curves(solution, charge)
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
    return tuple(found for found in (still_air(solution), independent) if found)


def _round_earth(observations: Observations, solution: Solution) -> list[Finding]:
    """Return the largest error by flat ground, if it is not negligible."""
    if observations.frame is None:
        return []
    z, posterior = jnp.asarray(solution.laplace.z), solution.posterior
    charges = posterior.parameters.scene_at(z).charges
    places = np.array([[float(x) for x in charge.position_m] for charge in charges])
    ranges = np.asarray(posterior.misfit(z).slant_range)
    found = flat_ground(observations, places[list(posterior.layout.shot)], ranges)
    return [found] if found else []


def outside(observations, solution: Solution, valid) -> LawOutOfRange:
    """Return the number of rows outside their laws, and the ranges of these laws."""
    rows = np.flatnonzero(~valid)
    quantities = dict.fromkeys(observations.quantity[row] for row in rows)
    ranges = {
        (law, law_for(part, law).range): None
        for quantity in quantities
        for part, _ in components(quantity)
        for law in (solution.laws[part].name,)
    }
    posterior = solution.posterior
    # rows that are valid at the answer are outside by the depth of the interval only
    at = np.asarray(posterior.misfit(jnp.asarray(solution.laplace.z)).valid)
    return LawOutOfRange(
        rows=len(rows),
        of=len(valid),
        quantities=tuple(quantities),
        ranges=tuple(ranges),
        is_deeper=bool(at[rows].any()),
    )


def height_beside_the_curves(solution: Solution, charge: Charge) -> list[Finding]:
    """Return the curves used for a charge off the ground, and their limitations."""
    laws = [law_for(quantity, law.name) for quantity, law in solution.laws.items()]
    depends = any("burst" in law.arguments() for law in laws)
    # with a stated burst there is one curve set, whose laws are valid for it or not
    if not charge.by_height:
        depends |= any(
            "burst" in inspect.signature(law.valid).parameters for law in laws
        )
    if not depends:
        return []
    scene = solution.posterior.parameters.scene_at(jnp.asarray(solution.laplace.z))
    shot = [each.name for each in scene.charges].index(charge.name)
    notes = height_notes(scene, solution.posterior.layout, shot)
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
