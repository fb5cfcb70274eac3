"""Warnings and assumptions of an answer.

They concern fit, priors, laws, clocks, and the height, shape and surroundings of the
charge. The most serious is the first.
"""

import inspect
from collections.abc import Collection, Mapping

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.answer import Answer
from jblast.inference.fitting.assumptions import (
    flat_ground,
    paths_taken_as_independent,
    slower_than_sound,
    still_air,
)
from jblast.inference.fitting.goodness_of_fit import against_priors
from jblast.inference.fitting.solution import Solution
from jblast.inference.posterior.parameters import NORMAL_Q95, Estimate
from jblast.observations import CLOCK_TIMES, Observations
from jblast.observations.clocks import clocks_apart, has_common_clock
from jblast.parameters import CLOCK_OFFSET
from jblast.registry import law_for
from jblast.results import Note, assumption, warning
from jblast.scene import Charge, UncertainScene, parameter_named
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors.law_choice import height_notes
from jblast.sensors.layout import components
from jblast.waves.choice import TakenLaw
from jblast.waves.height_of_burst import scaled_height

LARGE_EFFECT_SD = 4.0
"""A shared effect larger than this many standard deviations is reported: one in 16,000
by chance."""
POINT_SOURCES = ("sedov_taylor", "point_source")
"""Laws of energy released at a point. They do not give the energy of a chemical charge
near it: for TNT, radius and time give 5 % of it at Z = 0.2, the peak 37 % at Z =
0.3."""


def notes_of(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    valid: Bool[np.ndarray, " row"],
    is_poor: bool,
    estimates: Mapping[str, Estimate],
) -> list[Note]:
    """Return the warnings and assumptions of an answer, the most serious first."""
    answer, found = solution.answer, solution.identified
    notes: list[Note] = []
    against: Mapping[str, float] = {}
    blind = uncertain.source == NO_SCENE
    if is_poor:
        if blind:
            log = observations.source or "OBSERVATIONS.csv"
            notes.append(warning("look_closer", log=log))
        against = against_priors(solution)
    # also for a good fit: free clocks can absorb a wrong speed
    notes += slower_than_sound(observations, answer)
    notes += paths_taken_as_independent(solution)
    if against:
        notes.append(warning("prior_conflict", values=against))
    if not valid.all():
        notes.append(outside(observations, solution.laws, valid, answer.valid))
    if not solution.converged:
        notes.append(warning("mode_found_once"))
    if not found.is_reliable:
        k_hat, effective = solution.draws.k_hat, solution.draws.effective
        notes.append(warning("weights_unreliable", k_hat=k_hat, effective=effective))
    if solution.other_laws:
        others = tuple(f"{k}={name}" for k, name in solution.other_laws.items())
        notes.append(warning("laws_unsettled", laws=others))
    if blind:
        altitude = observations.frame.alt_m if observations.frame else 0.0
        known = ("charge_mass_kg", "fireball_growth_s")  # free in any default scene
        free = tuple(name for name in uncertain.beliefs if name not in known)
        kind = "no_scene" if free else "no_scene_nor_place"
        notes.append(assumption(kind, free=free, altitude_m=altitude))
    # a number in conflict with its prior is reported already
    if same := tuple(name for name in found.unlearned if name not in against):
        notes.append(assumption("nothing_learned", parameters=same))
    if answer.largest_effect > LARGE_EFFECT_SD:
        notes.append(warning("far_from_its_law", times=answer.largest_effect))
    for charge in answer.scene.charges:
        notes += height_beside_the_curves(answer, solution.laws, charge)
        notes += charge_is_no_point(
            [law.name for law in solution.laws.values()], charge
        )
    notes += clocks_taken_to_agree(observations, uncertain, solution, estimates)
    places = [[float(x) for x in one.position_m] for one in answer.scene.charges]
    shot = list(answer.density.layout.shot)
    notes += flat_ground(observations, np.array(places)[shot], answer.slant_range)
    return notes + still_air(answer)


def outside(
    observations: Observations,
    laws: Mapping[str, TakenLaw],
    valid: Bool[np.ndarray, " row"],
    valid_at_answer: Bool[np.ndarray, " row"],
) -> Note:
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
    ranges = dict.fromkeys(
        f"range of {law}: {law_for(part, law).range}"
        for quantity in quantities
        for part, _ in components(quantity)
        for law in (laws[part].name,)
    )
    below = "_below" if valid_at_answer[rows].any() else ""
    return warning(
        f"law_out_of_range{below}",
        rows=len(rows),
        of=len(valid),
        quantities=tuple(quantities),
        ranges=tuple(ranges),
    )


def height_beside_the_curves(
    answer: Answer, taken: Mapping[str, TakenLaw], charge: Charge
) -> list[Note]:
    """Return the curves used for a charge off the ground, and their limitations."""
    laws = [law_for(quantity, law.name) for quantity, law in taken.items()]
    depends = any("burst" in law.arguments() for law in laws)
    # with a stated burst there is one curve set, whose laws are valid for it or not
    if charge.burst is not None:
        depends |= any(
            "burst" in inspect.signature(law.valid).parameters for law in laws
        )
    if not depends:
        return []
    scene = answer.scene
    shot = [each.name for each in scene.charges].index(charge.name)
    notes = height_notes(scene, answer.density.layout, shot)
    found = [warning("height_of_burst", note=note) for note in notes]
    height = float(scaled_height(scene, charge))
    if height < 0:
        named = f"charge {charge.name}".rstrip()
        found.append(warning("deep_charge", charge=named, scaled_depth=-height))
    return found


def charge_is_no_point(laws: Collection[str], charge: Charge) -> list[Note]:
    """Return a warning if a law of a point source was used for a chemical charge."""
    used = tuple(name for name in POINT_SOURCES if name in laws)
    if not used or charge.explosive == "nuclear":
        return []
    return [warning("no_point_source", laws=used, explosive=charge.explosive)]


def clocks_taken_to_agree(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    estimates: Mapping[str, Estimate],
) -> list[Note]:
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
    common = ("the common clock",) if has_common_clock(observations) else (first,)
    clocks = common + tuple(assumed)
    offsets = tuple(f"{CLOCK_OFFSET}.{name}" for name in assumed)
    found = [warning("clocks_taken_to_agree", clocks=clocks, parameters=offsets)]
    if resting := resting_on(solution, columns.astype(float), estimates):
        found.append(warning("rests_on_clocks", parameters=resting))
    return found


def resting_on(
    solution: Solution,
    columns: Float[np.ndarray, "row unknown"],
    estimates: Mapping[str, Estimate],
) -> tuple[str, ...]:
    """Return the numbers that are identified only while some unknowns are held fixed.

    Args:
        solution: Solution with the unknowns fixed.
        columns: Slopes of the readings by each unknown.
        estimates: Estimates of the fitted numbers.
    """
    answer, found = solution.answer, solution.identified
    sds = np.sqrt(np.diag(answer.covariance(columns)))
    lost = []
    for name, sd in zip(answer.names, sds, strict=True):
        wide = 2 * NORMAL_Q95 * sd
        if parameter_named(name).positive:
            wide = np.exp(min(wide, 700.0))  # exp(709) is the largest double
        if estimates[name].identified and wide > found.widest(name):
            lost.append(name)
    return tuple(lost)
