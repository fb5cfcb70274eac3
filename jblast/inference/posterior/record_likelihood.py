r"""The likelihood of the samples of pressure records.

The pulse in each record has an arrival, ln peak, ln duration and ln impulse
$q = q_\mathrm{law} + L v + s e$: the prediction of the laws for the scene, shared
effects $v$, and the laws' scatter $s$ of this record. In addition it has nuisance
parameters $n$ (rise, suction, baseline) with wide priors about the values of a pick.
Whitened samples are normal about the pulse. All of $v$, $e$ and $n$ are integrated out
by Laplace's method at their own mode, which damped Gauss-Newton finds from the pick.

The $e$ and $n$ of one record are coupled to those of another through $v$ alone. So the
curvature is an arrowhead matrix, and the part of each record is eliminated by itself.

A front that the laws move by a sample rises otherwise than the pick's, within one
sample or over several, and either may be right: there are several searches, each from
the best of some trials, and for each record the end of most weight is used. Rows
without samples enter as in `likelihood`.

The density is per unit of the values that a pick reads from the record, so where
samples are normal in $q$ it equals that of the pick with its covariance.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import logsumexp
from jaxtyping import Array, Bool, Float

from jblast.inference.noise import (
    log_noise,
    log_rows,
    noise_slopes,
    reweighted,
    row_slopes,
)
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.parameters import CHARGE_POSITION
from jblast.sensors.path_scatter import KERNELS, TYPICAL
from jblast.sensors.simulated_readings import Noise

Terms = Callable[[Float[Array, " primary"], Float[Array, " nuisance"], Any], Array]
Trials = Callable[
    [Float[Array, " primary"], Float[Array, " nuisance"], Any],
    Float[Array, "search trial nuisance"],
]
ROUNDS = 50
"""Largest number of steps of the search, which needs a few near a pick."""
SETTLED = 1e-6
"""The search ends if the expected gain of a step in ln-density is below this. The steps
that are differentiated then reduce the error to its square."""
DIFFERENTIATED_STEPS = 5
"""Steps that are differentiated: at SNR 20 slopes are off by 2 % with 3, 0.3 % with 5,
0.003 % with 9."""
# Relative to the diagonal of the curvature. The first suits a search that begins near
# its mode; with the smallest a step is Newton's but for 1e-9 of it.
FIRST_DAMPING, LEAST_DAMPING = 1e-3, 1e-9


def evidence(
    terms: Terms, nuisance: Float[Array, " nuisance"], case: Any, primary: int
) -> Float[Array, ""]:
    r"""Return ln of the integral over a record's unknowns, by Laplace at its pick.

    Like `record_log_likelihood`, it omits the factors $\sqrt{2\pi}$ of the nuisances.
    """
    at = jnp.concatenate([jnp.zeros(primary), nuisance])

    def whole(x):
        return terms(x[:primary], x[primary:], case)

    jacobian, apart = jax.jacfwd(whole)(at), whole(at)
    spread = jnp.linalg.slogdet(jacobian.T @ jacobian)[1]
    return 0.5 * (primary * np.log(2 * np.pi) - apart @ apart - spread)


class SampledRecords(eqx.Module):
    """Records whose samples replace the values of their picks in the likelihood.

    The primary parameters of a record are those that its rows of the log contain:
    arrival, ln peak, ln duration and ln impulse.

    Attributes:
        terms: Function of the primary parameters (relative to the pick), the nuisances
            and the case. Half the squared length of the result is minus ln of the
            probability of the samples and the nuisances.
        trials: Function of the same that returns starting nuisances for each search.
        rows: Rows of the log that the pick of each record fills.
        case: Argument of `terms` for each record; the first axis of arrays is records.
        picked: Primary parameters of the picks, on the scale of errors.
        nuisance: Nuisances of the picks.
        jitter: Errors that samples do not constrain: of a front between two samples.
        evidence: ln of the integral of the probability over all unknowns.
        error_columns: Columns of shared errors that rows without samples have.
    """

    terms: Terms = eqx.field(static=True)
    trials: Trials = eqx.field(static=True)
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    case: Any
    picked: Float[Array, "record primary"]
    nuisance: Float[Array, "record nuisance"]
    jitter: Float[Array, "record primary"]
    evidence: Float[Array, " record"]
    error_columns: tuple[int, ...] = eqx.field(static=True, default=())


class ResidualRows(NamedTuple):
    """Residuals, row by row; see `posterior.Misfit`."""

    residual: Float[Array, " row"]
    sd: Float[Array, " row"]
    loading: Float[Array, "row effect"]
    lower_bound: Bool[Array, " row"] | None


class Given(NamedTuple):
    """Predictions of a scene: of rows, and of each record.

    Attributes:
        rows: Rows without samples.
        away: Predictions of the laws minus the picked values.
        sd: Scatter of the laws and `jitter` in quadrature.
        loading: Change by one standard deviation of each shared effect.
    """

    rows: ResidualRows
    away: Float[Array, "record primary"]
    sd: Float[Array, "record primary"]
    loading: Float[Array, "record primary effect"]


def record_log_likelihood(
    rows: ResidualRows,
    predicted: Float[Array, "record primary"],
    scatter: Float[Array, "record primary"],
    loading: Float[Array, "record primary effect"],
    records: SampledRecords,
    noise: Noise,
) -> Float[Array, ""]:
    """Return ln of the probability of samples, and of rows without samples.

    Args:
        rows: Rows without samples.
        predicted: Predictions of the laws, on the scale of errors.
        scatter: Scatter of the laws from record to record.
        loading: Change by one standard deviation of each shared effect.
        records: The samples.
        noise: Distribution of the independent errors, and of the laws' scatter.
    """
    away = predicted - records.picked
    sd = jnp.hypot(scatter, records.jitter)
    given = Given(rows, away, sd, loading)

    def expand(place: EffectValues, given: Given, exact: bool = True) -> Expansion:
        return _expansion(place, given, records, noise, exact)

    # the searches are not differentiated; `settled` carries the derivatives of the mode
    still = lax.stop_gradient(given)
    starts = _starts(still, records, noise)
    ends = jax.vmap(lambda start: mode_of(lambda x: expand(x, still, False), start))
    place = lax.stop_gradient(weightiest(*ends(starts)))
    cost, spread = settled(lambda place: expand(place, given), place)
    known = -cost - 0.5 * spread - jnp.sum(records.evidence)
    # `_own_error` is relative to the density at e = 0. This is that density, in units
    # of the normal one, since the factors of 2 pi are omitted.
    units = log_noise(jnp.zeros(()), noise) + 0.5 * np.log(2 * np.pi)
    return known + records.picked.size * units


class EffectValues(NamedTuple):
    """Shared effects, and the own errors and nuisances of each record."""

    shared: Float[Array, " effect"]
    own: Float[Array, "record own"]


def _starts(given: Given, records: SampledRecords, noise: Noise) -> EffectValues:
    """Return starting points: each record at the best of its trials.

    A record is tried as picked, if its law scatters, and as predicted by the law.
    """
    some = given.sd > 0
    picked = jnp.where(some, -given.away / jnp.where(some, given.sd, 1.0), 0.0)

    def of_record(picked, away, sd, nuisance, case):
        errors = jnp.stack([picked, jnp.zeros_like(picked)])
        moved = away[None, :] + sd[None, :] * errors
        tried = jax.vmap(lambda m: records.trials(m, nuisance, case))(moved)

        def cost(own, moved, nuisance):
            apart = records.terms(moved, nuisance, case)
            return 0.5 * apart @ apart + _own_error(own, noise, exact=True)[0]

        over = jax.vmap(jax.vmap(cost, (None, None, 0)), (None, None, 0))
        costs = jax.vmap(over)(errors, moved, tried)  # by errors, search, trial
        costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)

        def best(costs, tried):
            row, trial = jnp.unravel_index(jnp.argmin(costs), costs.shape)
            return jnp.concatenate([errors[row], tried[row, trial]])

        return jax.vmap(best, (1, 1))(costs, tried)

    own = jax.vmap(of_record, out_axes=1)(
        picked, given.away, given.sd, records.nuisance, records.case
    )
    return EffectValues(jnp.zeros((own.shape[0], given.loading.shape[2])), own)


class Expansion(NamedTuple):
    """Minus ln of the joint density about a place, to second order (Gauss-Newton).

    Attributes:
        cost: Minus ln of the density.
        slope: Gradient by shared effects, and by the unknowns of each record.
        curvature: Blocks of shared effects, of each record, and between them.
        of_records: Contribution of each record to the cost.
    """

    cost: Float[Array, ""]
    slope: EffectValues
    curvature: tuple[Array, Array, Array]
    of_records: Float[Array, " record"]


def _expansion(
    place: EffectValues,
    given: Given,
    records: SampledRecords,
    noise: Noise,
    exact: bool,
) -> Expansion:
    """Expand about a place, with positive curvatures unless `exact`."""
    rows, v, primary = given.rows, place.shared, given.away.shape[1]

    def of_record(own, away, sd, loading, case):
        # value and derivative from one evaluation: the value is the auxiliary output
        def twice(x):
            terms = records.terms(x[:primary], x[primary:], case)
            return terms, terms

        moved = away + loading @ v + sd * own[:primary]
        at = jnp.concatenate([moved, own[primary:]])
        jacobian, apart = jax.jacfwd(twice, has_aux=True)(at)
        size = jnp.concatenate([sd, jnp.ones(own.size - primary)])
        to_own, to_shared = jacobian * size[None, :], jacobian[:, :primary] @ loading
        error, slope, curvature = _own_error(own[:primary], noise, exact)
        pad = (0, own.size - primary)
        cost = 0.5 * apart @ apart + error
        slopes = to_own.T @ apart + jnp.pad(slope, pad), to_shared.T @ apart
        inner = to_own.T @ to_own + jnp.diag(jnp.pad(curvature, pad))
        return cost, *slopes, inner, to_shared.T @ to_shared, to_own.T @ to_shared

    cost, to_own, to_shared, inner, outer, between = jax.vmap(of_record)(
        place.own, given.away, given.sd, given.loading, records.case
    )
    u = (rows.residual - rows.loading @ v) / rows.sd
    load = rows.loading / rows.sd[:, None]
    slope, curvature = row_slopes(u, noise, rows.lower_bound)
    if not exact:
        curvature = reweighted(u, curvature, noise, rows.lower_bound)
    plain = log_rows(u, rows.sd, noise, rows.lower_bound)
    shared = jnp.eye(v.size) + load.T @ (curvature[:, None] * load)
    return Expansion(
        jnp.sum(cost) - plain + 0.5 * v @ v,
        EffectValues(v - load.T @ slope + jnp.sum(to_shared, axis=0), to_own),
        (shared + jnp.sum(outer, axis=0), inner, between),
        cost,
    )


def _own_error(e, noise: Noise, exact: bool):
    """Return minus ln of the density of errors relative to zero, and derivatives."""
    slope, curvature = noise_slopes(e, noise)
    if not exact:
        curvature = reweighted(e, curvature, noise, None)
    cost = log_noise(jnp.zeros(()), noise) - log_noise(e, noise)
    return jnp.sum(cost), slope, curvature


def newton_step(here: Expansion, damping) -> tuple[EffectValues, Array]:
    """Return a step downhill, and ln of the curvature's determinant.

    The unknowns of each record are eliminated, then the shared effects are solved for
    (an arrowhead matrix).
    """
    shared, inner, between = here.curvature
    size = jnp.diagonal(inner, axis1=1, axis2=2)
    inner = inner + damping * size[:, :, None] * jnp.eye(inner.shape[1])[None]
    shared = shared + damping * jnp.diag(jnp.diagonal(shared))
    right = jnp.concatenate([here.slope.own[:, :, None], between], axis=2)
    solved = jnp.linalg.solve(inner, right)
    own, response = solved[:, :, 0], solved[:, :, 1:]
    left = shared - jnp.einsum("rok,rol->kl", between, response)
    slope = here.slope.shared - jnp.einsum("rok,ro->k", between, own)
    moved = -jnp.linalg.solve(left, slope)
    step = EffectValues(moved, -own - response @ moved)
    spread = jnp.sum(jnp.linalg.slogdet(inner)[1]) + jnp.linalg.slogdet(left)[1]
    return step, spread


def mode_of(
    expand: Callable[[EffectValues], Expansion], start: EffectValues
) -> tuple[EffectValues, Expansion]:
    """Return the mode of all effects, by damped steps downhill, and its expansion."""
    # The expansion appears once in the program, because it takes long to compile: the
    # loop begins with an infinite cost, so its first pass accepts the start.
    blank = jax.tree.map(
        lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(expand, start)
    )
    here = blank._replace(cost=jnp.asarray(jnp.inf, blank.cost.dtype))

    def again(state):
        rounds, place, here, tried, damping, _ = state
        there = expand(tried)
        better = there.cost < here.cost  # False for NaN
        place, here = jax.tree.map(
            lambda new, old: jnp.where(better, new, old), (tried, there), (place, here)
        )
        damping = jnp.where(better, 0.1 * damping, 10.0 * damping)
        damping = jnp.maximum(damping, LEAST_DAMPING)
        step, _ = newton_step(here, damping)
        promised = jnp.abs(
            jnp.sum(step.shared * here.slope.shared)
            + jnp.sum(step.own * here.slope.own)
        )
        tried = jax.tree.map(jnp.add, place, step)
        return rounds + 1, place, here, tried, damping, promised

    def unsettled(state):
        rounds, *_, promised = state
        return (rounds < ROUNDS) & (promised > SETTLED)

    most = jnp.asarray(jnp.inf, here.cost.dtype)
    first = jnp.asarray(10 * FIRST_DAMPING, here.cost.dtype)
    state = (0, start, here, start, first, most)
    _, place, here, *_ = lax.while_loop(unsettled, again, state)
    return place, here


def weightiest(places: EffectValues, about: Expansion) -> EffectValues:
    """Return the mode with the largest weight, record by record.

    The unknowns of different records are coupled by the shared effects alone, which are
    those of the best mode. Modes are compared by weight, not by height. Where a low and
    wide mode replaces a high and narrow one, Laplace's approximation is then
    continuous.

    Args:
        places: Modes, along a first axis.
        about: Expansion about each.
    """
    spread = jnp.linalg.slogdet(about.curvature[1])[1]
    lost = about.of_records + 0.5 * spread
    lost = jnp.where(jnp.isfinite(lost), lost, jnp.inf)
    best = jnp.argmin(jnp.where(jnp.isnan(about.cost), jnp.inf, about.cost))
    chosen = jnp.argmin(lost, axis=0)
    own = jnp.take_along_axis(places.own, chosen[None, :, None], axis=0)[0]
    return EffectValues(places.shared[best], own)


def settled(
    expand: Callable[[EffectValues], Expansion], place: EffectValues
) -> tuple[Array, Array]:
    """Return cost and ln of the curvature's determinant at the mode.

    The derivatives of the mode come from steps that are differentiated: each
    Gauss-Newton step reduces their error. The last step that does not increase the cost
    is used. At the mode all steps have the same cost, and the first has no derivatives.
    """

    def step(place, _):
        here = expand(place)
        fixed = lax.stop_gradient(here.curvature)
        move, _ = newton_step(here._replace(curvature=fixed), 0.0)
        _, spread = newton_step(here, 0.0)
        return jax.tree.map(jnp.add, place, move), (here.cost, spread)

    _, (cost, spread) = lax.scan(step, place, length=DIFFERENTIATED_STEPS)
    downhill = lax.stop_gradient(cost <= cost[0] + SETTLED)  # False for NaN
    best = jnp.max(jnp.where(downhill, jnp.arange(cost.size), 0))
    return cost[best], spread[best]


@kept
def densities_of_samples(
    readings: Posterior, records: SampledRecords, z: Float[Array, "place free"]
) -> Float[Array, " place"]:
    """Return ln of the likelihood of samples, and of rows without samples.

    It is the mean over the correlation functions of neighbouring paths, if the data
    weigh them.

    Args:
        readings: The readings of the log.
        records: The samples.
        z: Places.
    """
    free = {*CHARGE_POSITION} & {*readings.parameters.names}
    weights = jnp.eye(len(KERNELS)) if free and readings.neighbours else TYPICAL[None]

    def at(z):
        each = jax.vmap(
            lambda kernels: _of_samples(replace(readings, kernels=kernels), records, z)
        )(jnp.asarray(weights))
        return logsumexp(each) - np.log(len(weights))

    return lax.map(at, z)


def _of_samples(readings: Posterior, records: SampledRecords, z) -> Float[Array, ""]:
    misfit = readings.misfit(z)
    sampled = np.array(records.rows)
    others = np.setdiff1d(np.arange(len(readings.layout.quantity)), sampled)
    effects, errors = misfit.loading.shape[1], 0
    if readings.shared_error is not None:
        errors = readings.shared_error.shape[1]
    kept = [effects - errors + column for column in records.error_columns]
    columns = np.array([*range(effects - errors), *kept], int)
    loading = misfit.loading[:, columns]
    bounds = readings.lower_bound
    return record_log_likelihood(
        ResidualRows(
            misfit.residual[others],
            misfit.sd[others],
            loading[others],
            None if bounds is None else bounds[others],
        ),
        readings.measured[sampled] - misfit.residual[sampled],
        misfit.record_sd[sampled],
        # errors that rows of a record share are in its samples
        loading[sampled].at[:, :, effects - errors :].set(0.0),
        records,
        readings.noise,
    )
