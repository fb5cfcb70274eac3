"""Numbers that a log does not identify, fitted or planned.

A number in a null direction has no estimate. One whose 90 % interval is wider than
`widest` has an interval and no value, and so has a number of the charge that its prior
alone constrains.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.fitting.solution import Solution
from jblast.inference.identifiability import (
    EstimableCombination,
    NullDirection,
    OtherMode,
    combination,
    cure_of_ambiguity,
    cure_of_null,
    estimable_forms,
)
from jblast.inference.mode.laplace import NORMAL_Q95, laplace
from jblast.inference.mode.search import SEPARATE
from jblast.inference.mode.starts import layout_size, typical_step
from jblast.inference.posterior.fisher_information import (
    NULL,
    information,
    unit_diagonal,
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.inference.posterior.posterior import Posterior
from jblast.scene import Free, parameter_named

AMBIGUITY = 6.0
"""Another optimum within this of the best, in -2 ln density, is an ambiguity: its
probability is 5 % of the best or more."""

WIDEST_FACTOR = 30.0
"""A positive number whose 90 % interval spans a larger factor is not identified.

A factor of 30 is 1.5 decades, an sd of 1.03 in ln: beyond it not even the order of
magnitude is known. Of a mass it is a factor of 3.1 in every distance (Hopkinson
scaling: distances go as the cube root), so of about 3 to 10 in a peak overpressure.
"""

UNLEARNED = 0.95
"""Ratio of a number's sd to that of its prior above which the log adds nothing: the
data then contain less than a tenth of the information of the prior."""

OF_CHARGE = (
    *("charge_mass_kg", "charge_range_m", "charge_east_m", "charge_north_m"),
    "origin_time_s",
)
"""The requested numbers of a fit. Others (height, air, ground, clocks) are conditions:
if the data add nothing to a prior on one of them, the prior is the answer."""


def requested(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the requested numbers among the fitted ones.

    These are mass, position and time of the charges; all numbers if none of these was
    fitted.
    """
    of_charge = tuple(n for n in names if n.partition(".")[0] in OF_CHARGE)
    return of_charge or names


def unlearned(solution: Solution) -> tuple[str, ...]:
    """Return the numbers to whose priors the log adds nothing."""
    parameters = solution.posterior.parameters
    sds = np.sqrt(np.diag(solution.laplace.covariance))
    priors = np.asarray(parameters.has_prior())
    return tuple(
        name
        for name, prior, sd in zip(parameters.names, priors, sds, strict=True)
        if prior and sd > UNLEARNED
    )


def widest(posterior: Posterior, z: Float[np.ndarray, " free"], name: str) -> float:
    """Return the widest 90 % interval with which a number counts as identified.

    For a positive number it is a factor, for others a difference in their unit. A
    coordinate is compared with the larger of the extent of the layout and the range of
    the charge at the answer, a time with the travel time of sound over that, any other
    number with the width of its allowed range.

    Args:
        posterior: Posterior with the layout.
        z: The answer.
        name: Name of the number.
    """
    parameter = parameter_named(name)
    if parameter.positive:
        return WIDEST_FACTOR
    length = _reach(posterior, z)
    possible = parameter.bounds.at_most - parameter.bounds.at_least
    scales = {"layout": length, "travel": length / STANDARD_SOUND_SPEED}
    # numbers like temperatures have no scale of the layout
    return scales.get(parameter.spread.of, possible)


def identified_estimates(
    solution: Solution, marginals: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Return the estimate of every free number, without a value if not identified.

    Args:
        solution: Result of the inference.
        marginals: Summary of each number's posterior.
    """
    posterior, z = solution.posterior, solution.laplace.z
    parameters = posterior.parameters
    by_prior = {n for n in unlearned(solution) if n.partition(".")[0] in OF_CHARGE}
    answer = {}
    for name, belief, is_determined in zip(
        parameters.names,
        parameters.beliefs,
        solution.identifiability.determined,
        strict=True,
    ):
        if not is_determined:
            answer[name] = Estimate()
            continue
        found = marginals[name]
        is_condition = (
            not isinstance(belief, Free) and name.partition(".")[0] not in OF_CHARGE
        )
        too_wide = not is_condition and width(name, found) > widest(posterior, z, name)
        # an interval of the prior alone is reported, but its middle is no estimate
        unknown = too_wide or name in by_prior
        answer[name] = found.interval_alone() if unknown else found
    return answer


def width(name: str, estimate: Estimate) -> float:
    """Return the width of a 90 % interval, as `widest` counts it."""
    if not parameter_named(name).positive:
        return estimate.q95 - estimate.q05
    return estimate.q95 / estimate.q05 if estimate.q05 > 0 else np.inf


def resting_on(
    solution: Solution,
    columns: Float[np.ndarray, "row unknown"],
    estimates: Mapping[str, Estimate],
) -> tuple[str, ...]:
    r"""Return the numbers that are identified only while some unknowns are held fixed.

    The information of the fitted numbers, the unknowns integrated out over a flat
    prior, is $J'^T J'$ with $J' = (1 - W W^+) J$: $J$ holds the slopes of the data by
    the fitted numbers, $W$ those by the unknowns, in standard deviations.

    Args:
        solution: Solution with the unknowns fixed.
        columns: Slopes of the readings by each unknown, in units of their residuals.
        estimates: Estimates of the fitted numbers.
    """
    posterior, z = solution.posterior, solution.laplace.z
    misfit = posterior.misfit(jnp.asarray(z))
    jacobian = np.asarray(whitened_jacobian(posterior, jnp.asarray(z)))
    unknown = np.asarray(whitened_rows(posterior, misfit, jnp.asarray(columns)))
    unknown = np.pad(unknown, ((0, len(jacobian) - len(unknown)), (0, 0)))
    if not (np.isfinite(jacobian).all() and np.isfinite(unknown).all()):
        return ()
    # a pseudo-inverse: unknown clocks of the same rows are linearly dependent
    left = jacobian - unknown @ (np.linalg.pinv(unknown) @ jacobian)
    size, values, vectors = map(
        np.asarray, unit_diagonal(jnp.asarray(left.T @ left), typical_step(posterior))
    )
    # null directions get a huge but finite variance
    sds = np.sqrt((vectors**2 / np.maximum(values, NULL)).sum(axis=1)) / size
    answer = []
    for name, sd in zip(posterior.parameters.names, sds, strict=True):
        wide = 2 * NORMAL_Q95 * sd
        if parameter_named(name).positive:
            wide = np.exp(min(wide, 700.0))  # exp(709) is the largest double
        if estimates[name].identified and wide > widest(posterior, z, name):
            answer.append(name)
    return tuple(answer)


def _reach(posterior: Posterior, z: Float[np.ndarray, " free"]) -> float:
    """Return the larger of the layout's extent and the largest slant range [m]."""
    slant_range = np.asarray(posterior.misfit(jnp.asarray(z)).slant_range)
    return max(float(layout_size(posterior)), float(np.nan_to_num(slant_range).max()))


def null_directions(solution: Solution) -> tuple[NullDirection, ...]:
    """Return every null direction with its remedies."""
    parameters = solution.posterior.parameters
    found = []
    for direction in solution.identifiability.null:
        triples = zip(parameters.names, parameters.space(), direction, strict=True)
        used = [(name, space, float(w)) for name, space, w in triples if w != 0]
        spaces = {space for _, space, _ in used}
        found.append(
            NullDirection(
                parameters={name: weight for name, _, weight in used},
                space=spaces.pop() if len(spaces) == 1 else "mixed",
                cure=cure_of_null(solution.posterior, solution.laplace.z, direction),
            )
        )
    return tuple(found)


def estimable_combinations(solution: Solution) -> tuple[EstimableCombination, ...]:
    """Return the estimable combinations of unidentified parameters."""
    parameters, normal = solution.posterior.parameters, solution.laplace
    answer = []
    for form in estimable_forms(solution.identifiability):
        text, is_product = combination(parameters.names, parameters.space(), form)
        value = float(form @ normal.z)
        sd = float(np.sqrt(form @ normal.covariance @ form))
        # along a curved invariance the combination changes at a finite distance: it is
        # then valid near the answer only
        moved = solution.identifiability.followed @ form - value
        is_global = np.all(np.abs(moved) < max(sd, 1e-6 * abs(value)))
        if is_product:
            # a form of many powers may overflow: it is then omitted
            with np.errstate(over="ignore"):
                value = float(np.exp(value))
            sd = value * sd
        if not np.isfinite([value, sd]).all():
            continue
        answer.append(EstimableCombination(text, value, sd, not is_global))
    return tuple(answer)


def other_modes(solution: Solution, valid: bool) -> tuple[OtherMode, ...]:
    """Return every other optimum that the data cannot rule out.

    An optimum that differs in unidentified numbers only is not returned. If all laws
    are valid at the best optimum, those where a law is not valid are not returned
    either.
    """
    found, posterior = solution.optima, solution.posterior
    best = solution.laplace.z
    answers: list[np.ndarray] = [best]
    answer = []
    highest = float(found.log_density[0])
    for z, density in zip(*map(np.asarray, found), strict=True):
        if 2 * (highest - density) > AMBIGUITY:
            continue
        # repeated optima, also of one that was accepted before
        if min(_apart(solution, other, z) for other in answers) < SEPARATE:
            continue
        if valid and not np.asarray(posterior.misfit(jnp.asarray(z)).valid).all():
            continue
        # saddles and ends of unfinished searches are no answers
        if not laplace(
            posterior, z, solution.identifiability.identified_basis
        ).converged:
            continue
        answers.append(z)
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
            OtherMode(
                parameters={name: float(value) for name, value in values.items()},
                differ=tuple(differ),
                delta_chi2=2 * float(found.log_density[0] - density),
                cure=cure_of_ambiguity(posterior, best, z),
            )
        )
    return tuple(answer)


def _apart(solution: Solution, one, other) -> float:
    """Distance of two places in standard deviations of the identified numbers."""
    away = (one - other)[list(solution.identifiability.determined)]
    # the information is singular along null directions: compare number by number
    if len(solution.identifiability.null):
        kept = np.flatnonzero(solution.identifiability.determined)
        sds = np.sqrt(np.diag(solution.laplace.covariance))[kept]
        return float(np.max(np.abs(away) / sds, initial=0.0))
    metric = np.asarray(information(solution.posterior, jnp.asarray(one)))
    return float(np.sqrt(away @ metric @ away))
