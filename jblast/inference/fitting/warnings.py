"""What the reader of an answer has to be told beside the numbers."""

import inspect
from collections.abc import Collection, Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.fitting.goodness_of_fit import POOR, chance
from jblast.inference.fitting.prior_conflict import against_priors
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.still_air import still_air
from jblast.observations import Observations
from jblast.parameter_table import CLOCK_OFFSET
from jblast.registry import law_for
from jblast.scene import Charge, UncertainScene
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors.bursts import height_notes
from jblast.sensors.layout import components
from jblast.waves.burst_and_height import scaled_height

FAR = 4.0
"""A shared effect larger than this many standard deviations is told of."""
UNLEARNED = 0.95
"""A number whose sd is more than this much of its prior's has not been learned."""

POINT_SOURCES = ("sedov_taylor", "point_source")
"""Laws of energy let go at a point, by which chemical charges cannot be weighed near
them: of TNT radius and time give 5 % of the energy at Z = 0.2, the peak 37 % at 0.3."""


def cautions_of(
    observations: Observations,
    uncertain: UncertainScene,
    solution: Solution,
    valid: Bool[np.ndarray, " row"],
    chi2: float,
    dof: int,
    effects: Float[np.ndarray, " effect"],
) -> list[str]:
    """Collect the warnings of an answer, the gravest first."""
    told = []
    against: Mapping[str, float] = {}
    p = chance(chi2, dof)
    if p is not None and p < POOR:
        told.append(_poor_fit(observations, uncertain, chi2, dof, p))
        against = against_priors(solution)
    if against:
        at = ", ".join(f"{name} = {value:.4g}" for name, value in against.items())
        told.append(
            f"without priors the log fits well, at {at}: a prior rules that out; widen "
            "or correct it, or the readings"
        )
    if not valid.all():
        told.append(outside(observations, solution, valid))
    if not solution.laplace.converged:
        told.append(
            "the search did not arrive at an optimum: the answer is where it ended"
        )
    if not solution.laws_settled:
        told.append(
            "the automatic choice of law at the answer differs from the one it was "
            "fitted with; name one with --law"
        )
    if not solution.bursts_settled:
        told.append(
            "the curve sets that the height leaves at the answer differ from those it "
            'was fitted with; say burst = "surface" or "free-air" of the charge'
        )
    if uncertain.source == NO_SCENE:
        told.append(
            "no scene was given: a surface charge of TNT at the origin at time 0, in "
            "sea-level air"
        )
    told += _unlearned(solution, against)
    if np.abs(effects).max(initial=0.0) > FAR:
        told.append(
            f"the whole shot, or a path, departs from its law by "
            f"{np.abs(effects).max():.1f} times the scatter expected of it: the law "
            "may not suit this setting"
        )
    scene = solution.posterior.parameters.scene_at(jnp.asarray(solution.laplace.z))
    for charge in scene.charges:
        told += height_beside_the_curves(solution, charge)
        told += charge_is_no_point([name for name, _ in solution.laws.values()], charge)
    told += _clocks_taken_as_right(observations, uncertain)
    if still := still_air(solution):
        told.append(still)
    return told


def _poor_fit(observations, uncertain, chi2, dof, p) -> str:
    text = (
        f"poor fit: chi squared {chi2:.1f} with {dof} degrees of freedom has a chance "
        f"of {p:.1g}"
    )
    if uncertain.source != NO_SCENE:
        return text
    log = observations.source or "OBSERVATIONS.csv"
    return (
        f"{text}; `jblast scene {log}` writes a scene that says more about the setting"
    )


def outside(observations, solution: Solution, valid) -> str:
    """Say how many rows lie where their laws do not hold, and where these do."""
    rows = np.flatnonzero(~valid)
    quantities = dict.fromkeys(observations.quantity[row] for row in rows)
    limits = [
        f"{solution.laws[part][0]} holds for "
        f"{law_for(part, solution.laws[part][0]).range}"
        for quantity in quantities
        for part, _ in components(quantity)
    ]
    posterior = solution.posterior
    at = np.asarray(posterior.misfit(jnp.asarray(solution.laplace.z)).valid)
    deeper = " as deep as the 90 % interval reaches" if at[rows].any() else ""
    return (
        f"{len(rows)} of {len(valid)} rows lie outside their law's range{deeper} "
        f"({', '.join(quantities)}); {'; '.join(dict.fromkeys(limits))}"
    )


def _unlearned(solution: Solution, against: Collection[str]) -> list[str]:
    """Name the numbers that are as uncertain as their priors, log or no log."""
    parameters = solution.posterior.parameters
    sds = np.sqrt(np.diag(solution.laplace.covariance))
    same = [
        name
        for name, prior, sd in zip(
            parameters.names, np.asarray(parameters.has_prior()), sds, strict=True
        )
        if prior and sd > UNLEARNED and name not in against
    ]
    if not same:
        return []
    return [f"the log tells nothing of {', '.join(same)} beyond the prior"]


def height_beside_the_curves(solution: Solution, charge: Charge) -> list[str]:
    """Say by which curves a charge off the ground is taken, and what they leave out."""
    laws = [law_for(quantity, name) for quantity, (name, _) in solution.laws.items()]
    asks = any("burst" in law.arguments() for law in laws)
    if not charge.by_height:  # one law, of one set, holds or not as the user said
        asks |= any("burst" in inspect.signature(law.valid).parameters for law in laws)
    if not asks:
        return []
    scene = solution.posterior.parameters.scene_at(jnp.asarray(solution.laplace.z))
    shot = [each.name for each in scene.charges].index(charge.name)
    told = height_notes(scene, solution.posterior.layout, shot)
    height = float(scaled_height(scene, charge))
    if height < 0:
        which = f"the charge {charge.name}" if charge.name else "the charge"
        told.append(
            f"{which} lay {-height:.2g} m/kg^(1/3) deep, of which the laws used "
            "know nothing but the longer way"
        )
    return told


def charge_is_no_point(laws: Collection[str], charge: Charge) -> list[str]:
    """Say that a law of a point source weighed a chemical charge."""
    used = [name for name in POINT_SOURCES if name in laws]
    if not used or charge.explosive == "nuclear":
        return []
    return [
        f"{' and '.join(used)} is the law of a point source, which a charge of "
        f"{charge.explosive} is not: near it the mass can come out many times too "
        'small; a nuclear burst is explosive = "nuclear"'
    ]


def _clocks_taken_as_right(
    observations: Observations, uncertain: UncertainScene
) -> list[str]:
    """Name the recorders of a log whose clocks nobody left open."""
    clocks = list(dict.fromkeys(clock for clock in observations.clock if clock))
    known = uncertain.scene.clock_offsets()
    unsaid = [clock for clock in clocks[1:] if clock not in known]
    if not unsaid:
        return []
    free = ",".join(f"{CLOCK_OFFSET}.{clock}" for clock in unsaid)
    return [
        f"the clocks {', '.join(clocks)} were taken to agree; "
        f"--free {free} fits what they differ by"
    ]
