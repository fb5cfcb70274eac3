"""Uncertainty of an answer: normal approximation, weighted draws, or walkers.

By default draws of the normal approximation are weighted by the posterior (see
`importance`). Where the weights are unreliable or the effective sample size is below
`MIN_EFFECTIVE_DRAWS`, intervals are those of the normal approximation, with a finding.
Walkers run if they are requested, or with "auto" if the approximation fails its check.
For a charge beside a small array draws follow its range (see `mode.range_profile`).
Along null directions nothing is drawn: the normal approximation of the rest is all
there is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.findings import (
    AsAsked,
    DirectionUnidentified,
    NotAtOptimum,
)
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.unidentified import identified_estimates
from jblast.inference.importance import (
    GOOD_SHAPE,
    MAX_QUANTILE_ERROR,
    NARROW,
    DrawsWeighted,
    FewEffectiveDraws,
    ImportanceCannotTell,
    NormalIntervals,
    NormalJudged,
    RangeFollowed,
    check_intervals,
    importance,
    laplace_holds,
    largest_log_sd,
    largest_quantile_error,
    marginals_of_draws,
)
from jblast.inference.mcmc import WALKERS, Ensemble, ensemble
from jblast.inference.mode.laplace import marginals
from jblast.inference.mode.range_profile import DETERMINED, RangeProfile
from jblast.inference.posterior.parameters import Estimate, Finding
from jblast.parameters import CHARGE_POSITION

Method = Literal["weighted", "laplace", "emcee", "auto"]
# The 5 % quantile rests on 400 draws: its Monte Carlo error is 0.02 sd.
DRAWS = 8000
MIN_EFFECTIVE_DRAWS = 100
"""Smallest effective sample size of an interval: its bounds then have a Monte Carlo
error of 0.2 sd, which the check allows (`importance.MAX_QUANTILE_ERROR`)."""


@dataclass(frozen=True)
class Uncertainty:
    """Marginals and draws of a posterior, and their method.

    Attributes:
        method: "laplace" or "emcee".
        weighted: True if draws of the normal approximation were weighted by the
            posterior.
        reason: Reason for the method.
        z: Draws of the coordinates.
        marginals: Estimate of each number; its value is the most probable one.
        converged: True if the method converged.
        findings: Findings about convergence and inaccurate intervals.
        ensemble: The walkers' chain, if they ran.
        bearing: Bearing [degrees clockwise from north] and range [m], if arrival times
            determine the bearing of a charge but not its position.
    """

    method: str
    reason: Finding
    z: Float[np.ndarray, "draw free"]
    marginals: dict[str, Estimate]
    converged: bool
    findings: tuple[Finding, ...] = ()
    ensemble: Ensemble | None = None
    weighted: bool = False
    bearing: Mapping[str, Estimate] | None = None


def uncertainty(
    solution: Solution,
    method: Method,
    *,
    seed: int = 0,
    rows: Sequence[str] = (),
) -> Uncertainty:
    """Draw from the posterior by the requested method, or along the range of a charge.

    Draws follow the range if it has no upper bound, if the position is not identified,
    or if importance sampling fails for a charge outside a small array.

    Args:
        solution: Result of the search.
        method: "laplace": normal approximation, with a warning if the bounds of its
            intervals are inaccurate. "weighted": the bounds by importance sampling,
            where it is reliable. "auto": normal approximation if importance sampling
            confirms it and numbers are narrow, else walkers. "emcee": walkers.
        seed: Seed of the draws.
        rows: Name of each row of the log in messages.
    """
    sight = solution.sight
    if sight is None or len(solution.identifiability.null):
        return _by_method(solution, method, seed=seed, rows=rows)
    followed = _along_range(solution, sight, seed)
    # without an identified position no method about one optimum is valid
    if followed.bearing is not None:
        return followed
    found = _by_method(solution, method, seed=seed, rows=rows)
    if method != "weighted" or found.weighted:
        return found
    return replace(followed, findings=found.findings)


def _along_range(solution: Solution, sight: RangeProfile, seed: int) -> Uncertainty:
    """Draw along the range; report the bearing if the position is not identified."""
    parameters = solution.posterior.parameters
    z = sight.draws(DRAWS, np.random.default_rng(seed))
    # values are the most probable ones, as for every method
    by_name = _at_best(solution, marginals_of_draws(parameters, z))
    place = CHARGE_POSITION[:2]
    judged = identified_estimates(solution, by_name)
    bearing = None
    if sight.is_open or not all(judged[n].identified for n in place):
        unknown = {*place, "origin_time_s"}
        if sight.is_open:  # a larger charge farther away gives the same arrivals
            unknown |= {n for n in by_name if n.partition(".")[0] == "charge_mass_kg"}
        by_name = {n: Estimate() if n in unknown else by_name[n] for n in by_name}
        bearing = _bearing_and_range(sight, z)
    return Uncertainty(
        method="laplace",
        reason=RangeFollowed(len(sight.by_range()[0])),
        z=z,
        marginals=by_name,
        converged=True,
        bearing=bearing,
    )


def _bearing_and_range(
    sight: RangeProfile, z: Float[np.ndarray, "draw free"]
) -> dict[str, Estimate]:
    """Return the bearing, a second one if there is one, and bounds of the range."""
    ranges = np.linalg.norm(z[:, sight.at] - sight.middle, axis=1)
    q05, q95 = np.quantile(ranges, [0.05, 0.95])
    # draws end at the largest range of the profile, so their upper quantile is
    # arbitrary
    if sight.is_open:
        q05, q95 = sight.least_range_m, np.nan
    found = {"range_m": Estimate(q05=float(q05), q95=float(q95))}
    names = ("bearing_deg", "other_bearing_deg")
    for name, place in zip(names, (sight.best, *sight.others()), strict=False):
        off = np.degrees(sight.bearings(z, place))
        middle = np.degrees(sight.bearing[place])
        if not len(off) or not np.std(off) < np.degrees(DETERMINED):
            continue
        # quantiles of differences from the place, so that an interval across north is
        # one interval; the median is then put between 0 and 360 degrees
        ends = middle + np.quantile(off, [0.05, 0.5, 0.95])
        low, median, high = (ends - 360 * (ends[1] // 360)).tolist()
        found[name] = Estimate(
            value=median, sd=float(np.std(off)), q05=low, q50=median, q95=high
        )
    return found


def _by_method(
    solution: Solution,
    method: Method,
    *,
    seed: int = 0,
    rows: Sequence[str] = (),
) -> Uncertainty:
    """Draw from the posterior by the requested method; see `uncertainty`."""
    normal = solution.laplace
    if len(solution.identifiability.null):
        return _by_normal(solution, DirectionUnidentified(), seed)
    if method == "auto":
        weighted = importance(solution.posterior, normal, seed=seed)
        k_hat, off = weighted.k_hat, largest_quantile_error(weighted, normal)
        log_sd = largest_log_sd(solution.posterior, normal)
        reason = NormalJudged(
            holds=laplace_holds(k_hat, log_sd, off),
            k_hat=k_hat,
            log_sd=log_sd,
            off=off,
            most_k_hat=GOOD_SHAPE,
            most_log_sd=NARROW,
            most_off=MAX_QUANTILE_ERROR,
        )
        if reason.holds:
            return _by_normal(solution, reason, seed)
    elif method == "weighted":
        return _weighted(solution, seed)
    elif method == "laplace":
        return _by_normal(solution, AsAsked(), seed, _checked(solution, seed))
    else:
        reason = AsAsked()

    walkers = ensemble(
        solution.posterior,
        normal,
        solution.identifiability,
        solution.optima,
        seed=seed,
        # at least twice the unknowns; four times lets half of the walkers span them
        walkers=max(WALKERS, 4 * normal.z.size),
        rows=rows,
    )
    parameters = solution.posterior.parameters
    by_name = marginals_of_draws(parameters, walkers.draws())
    return Uncertainty(
        method="emcee",
        reason=reason,
        z=walkers.draws(DRAWS),
        marginals=_at_best(solution, by_name),
        converged=walkers.converged,
        findings=(reason, *walkers.findings) if method == "auto" else walkers.findings,
        ensemble=walkers,
    )


def _weighted(solution: Solution, seed: int) -> Uncertainty:
    """Return weighted draws, or the normal approximation if the weights fail."""
    normal, parameters = solution.laplace, solution.posterior.parameters
    if not normal.converged:
        return _by_normal(solution, NotAtOptimum(), seed)
    found = check_intervals(solution.posterior, normal, seed=seed)
    drawn = found.drawn
    effective = 0.0 if drawn is None else found.share * len(drawn.z)
    if drawn is None or not found.believed or effective < MIN_EFFECTIVE_DRAWS:
        finding = found.finding()
        if drawn is None or not found.believed:
            reason = ImportanceCannotTell(found.k_hat)
        else:
            reason = FewEffectiveDraws(effective, MIN_EFFECTIVE_DRAWS)
            finding = finding or NormalIntervals(reason)
        return _by_normal(solution, reason, seed, (finding,) if finding else ())
    by_name = marginals_of_draws(parameters, drawn.z, drawn.weights, drawn.quantiles)
    alone = marginals_of_draws(parameters, drawn.straight, drawn.of_normal)
    exact = marginals(parameters, normal)
    # The same draws give the sd of the normal approximation, which is known exactly:
    # the ratio corrects the Monte Carlo error that both share.
    for name, number in by_name.items():
        one, other = alone[name], exact[name]
        by_name[name] = replace(
            number,
            sd=_corrected(number.sd, one.sd, other.sd),
            log_sd=_corrected(number.log_sd, one.log_sd, other.log_sd),
        )
    # resampled by weight: figures and files need draws of equal weight
    picked = np.random.default_rng(seed).choice(len(drawn.z), DRAWS, p=drawn.weights)
    return Uncertainty(
        method="laplace",
        reason=DrawsWeighted(found.k_hat, effective),
        z=drawn.z[picked],
        marginals=_at_best(solution, by_name),
        converged=True,
        weighted=True,
    )


def _at_best(
    solution: Solution, by_name: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Return estimates with the most probable values instead of the medians."""
    best = solution.posterior.parameters.values(jnp.asarray(solution.laplace.z))
    return {n: replace(one, value=float(best[n])) for n, one in by_name.items()}


def _corrected(sd: float, by_draws: float, exact: float) -> float:
    """Return an sd of draws, corrected by the error of one that is known exactly."""
    known = by_draws and exact and np.isfinite([by_draws, exact]).all()
    return sd * exact / by_draws if known else sd


def _checked(solution: Solution, seed: int) -> tuple[Finding, ...]:
    """Return the finding about inaccurate intervals of the normal approximation."""
    if not solution.laplace.converged:
        return ()
    found = check_intervals(solution.posterior, solution.laplace, seed=seed).finding()
    return (found,) if found else ()


def _by_normal(
    solution: Solution, reason: Finding, seed: int, findings: tuple[Finding, ...] = ()
) -> Uncertainty:
    normal = solution.laplace
    return Uncertainty(
        method="laplace",
        reason=reason,
        z=normal.draws(DRAWS, np.random.default_rng(seed)),
        marginals=marginals(solution.posterior.parameters, normal),
        converged=normal.converged,
        findings=findings,
    )
