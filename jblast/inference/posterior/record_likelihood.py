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
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.likelihood import (
    log_noise,
    log_rows,
    noise_slopes,
    reweighted,
    row_slopes,
)
from jblast.sensors.simulated_readings import Noise

Terms = Callable[[Float[Array, " asked"], Float[Array, " nuisance"], Any], Array]
Trials = Callable[
    [Float[Array, " asked"], Float[Array, " nuisance"], Any],
    Float[Array, "search trial nuisance"],
]
ROUNDS = 50
"""Of the search, at most."""
SETTLED = 1e-6
"""A step that promises to gain less, in ln-density, ends it; the steps that are
differentiated leave the square of what is left."""
CARRIERS = 5
"""Steps that are differentiated: at SNR 20 slopes are off by 2 % with 3, 0.3 % with 5,
0.003 % with 9."""
FIRST_DAMPING, LEAST_DAMPING = 1e-3, 1e-9


def evidence(
    terms: Terms, nuisance: Float[Array, " nuisance"], case: Any, asked: int
) -> Float[Array, ""]:
    """Return ln of the integral over a record's unknowns, by Laplace at its pick.

    As `record_log_likelihood` counts: nuisances without the roots of two pi.
    """
    at = jnp.concatenate([jnp.zeros(asked), nuisance])

    def whole(x):
        return terms(x[:asked], x[asked:], case)

    jacobian, apart = jax.jacfwd(whole)(at), whole(at)
    spread = jnp.linalg.slogdet(jacobian.T @ jacobian)[1]
    return 0.5 * (asked * np.log(2 * np.pi) - apart @ apart - spread)


class SampledRecords(eqx.Module):
    """Records whose samples are in the likelihood, in place of what was read off them.

    Attributes:
        terms: From what is asked for, as moved from the pick, and the nuisances, to a
            vector of which half the square is minus ln of the probability of a record's
            samples and of the nuisances.
        trials: From the same to nuisances that each of several searches may begin at.
        rows: Rows of the log that a pick of each record fills: what is asked for.
        case: What `terms` takes of each record; arrays have a first axis of records.
        picked: What the picks read, on the scale of errors.
        nuisance: The nuisances of the picks.
        jitter: Errors that samples do not constrain, as of a front between two of them.
        evidence: ln of the integral of the probability over all that is unknown.
        error_columns: Of the errors that rows share, those that other rows have.
    """

    terms: Terms = eqx.field(static=True)
    trials: Trials = eqx.field(static=True)
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    case: Any
    picked: Float[Array, "record asked"]
    nuisance: Float[Array, "record nuisance"]
    jitter: Float[Array, "record asked"]
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
        rows: Those that are no samples.
        away: Predictions of the laws less the picked values.
        sd: Their scatter, and `jitter`.
        loading: What one standard deviation of each shared effect adds.
    """

    rows: ResidualRows
    away: Float[Array, "record asked"]
    sd: Float[Array, "record asked"]
    loading: Float[Array, "record asked effect"]


def record_log_likelihood(
    rows: ResidualRows,
    predicted: Float[Array, "record asked"],
    scatter: Float[Array, "record asked"],
    loading: Float[Array, "record asked effect"],
    records: SampledRecords,
    noise: Noise,
) -> Float[Array, ""]:
    """Return ln of the probability of samples, and of rows that are none.

    Args:
        rows: Those that are none.
        predicted: Predictions of the laws, on the scale of errors.
        scatter: Of the laws, of each record alone.
        loading: What one standard deviation of each effect adds to it.
        records: The samples.
        noise: Distribution of the independent errors, and of the laws' scatter.
    """
    away = predicted - records.picked
    sd = jnp.hypot(scatter, records.jitter)
    given = Given(rows, away, sd, loading)

    def expand(place: EffectValues, given: Given, exact: bool = True) -> Expansion:
        return _expansion(place, given, records, noise, exact)

    still = lax.stop_gradient(given)
    starts = _starts(still, records, noise)
    ends = jax.vmap(lambda start: mode_of(lambda x: expand(x, still, False), start))
    place = lax.stop_gradient(weightiest(*ends(starts)))
    cost, spread = settled(lambda place: expand(place, given), place)
    known = -cost - 0.5 * spread - jnp.sum(records.evidence)
    # e has a density of one at its mode in units in which a normal has this
    units = log_noise(jnp.zeros(()), noise) + 0.5 * np.log(2 * np.pi)
    return known + records.picked.size * units


class EffectValues(NamedTuple):
    """Effects: those that rows share, and of each record its own and its nuisances."""

    shared: Float[Array, " effect"]
    own: Float[Array, "record own"]


def _starts(given: Given, records: SampledRecords, noise: Noise) -> EffectValues:
    """Return where searches begin: each record at the best of its trials.

    Each is tried as picked, if its law scatters, and as predicted by the law.
    """
    some = given.sd > 0
    picked = jnp.where(some, -given.away / jnp.where(some, given.sd, 1.0), 0.0)

    def of_record(picked, away, sd, nuisance, case):
        asked = jnp.stack([picked, jnp.zeros_like(picked)])
        moved = away[None, :] + sd[None, :] * asked
        tried = jax.vmap(lambda m: records.trials(m, nuisance, case))(moved)

        def cost(own, moved, nuisance):
            apart = records.terms(moved, nuisance, case)
            return 0.5 * apart @ apart + _own_error(own, noise, exact=True)[0]

        over = jax.vmap(jax.vmap(cost, (None, None, 0)), (None, None, 0))
        costs = jax.vmap(over)(asked, moved, tried)  # by asked, search, trial
        costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)

        def best(costs, tried):
            row, trial = jnp.unravel_index(jnp.argmin(costs), costs.shape)
            return jnp.concatenate([asked[row], tried[row, trial]])

        return jax.vmap(best, (1, 1))(costs, tried)

    own = jax.vmap(of_record, out_axes=1)(
        picked, given.away, given.sd, records.nuisance, records.case
    )
    return EffectValues(jnp.zeros((own.shape[0], given.loading.shape[2])), own)


class Expansion(NamedTuple):
    """Minus ln of the joint density about a place, to second order (Gauss, Newton).

    Attributes:
        cost: There.
        slope: To shared effects, and to each record's own.
        curvature: Of shared effects, of each record's own, and between them.
        of_records: Of the cost, what each record has of it.
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
    """Expand about a place; not `exact`: with curvatures that are positive."""
    rows, v, asked = given.rows, place.shared, given.away.shape[1]

    def of_record(own, away, sd, loading, case):
        def twice(x):
            terms = records.terms(x[:asked], x[asked:], case)
            return terms, terms

        moved = away + loading @ v + sd * own[:asked]
        at = jnp.concatenate([moved, own[asked:]])
        jacobian, apart = jax.jacfwd(twice, has_aux=True)(at)
        size = jnp.concatenate([sd, jnp.ones(own.size - asked)])
        to_own, to_shared = jacobian * size[None, :], jacobian[:, :asked] @ loading
        error, slope, curvature = _own_error(own[:asked], noise, exact)
        pad = (0, own.size - asked)
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
    """Return minus ln of the density of errors over that of none, and its slopes."""
    slope, curvature = noise_slopes(e, noise)
    if not exact:
        curvature = reweighted(e, curvature, noise, None)
    cost = log_noise(jnp.zeros(()), noise) - log_noise(e, noise)
    return jnp.sum(cost), slope, curvature


def newton_step(here: Expansion, damping) -> tuple[EffectValues, Array]:
    """Return a step downhill, and ln of the curvature's determinant.

    Each record's own unknowns are eliminated, then those that are shared are solved
    for (an arrowhead matrix).
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
    # expanded in one place of the program alone: it takes long to compile
    blank = jax.tree.map(
        lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(expand, start)
    )
    here = blank._replace(cost=jnp.asarray(jnp.inf, blank.cost.dtype))

    def again(state):
        rounds, place, here, tried, damping, _ = state
        there = expand(tried)
        better = there.cost < here.cost  # not so where it is no number
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
    """Return of some modes the one of most weight, record by record.

    Records' own unknowns meet by way of the shared effects alone, which are the best
    mode's. By weight, and not by height: where a low and wide mode takes over from a
    high and narrow one, what Laplace's method makes of them goes on without a step.

    Args:
        places: Modes, along a first axis.
        about: And what is about them.
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

    Steps that are differentiated carry the slopes of the mode, which the search does
    not: by Gauss and Newton, each of them brings these nearer. The last is taken that
    does not go uphill: at the mode all have one cost, and the first of them no slopes.
    """

    def step(place, _):
        here = expand(place)
        fixed = lax.stop_gradient(here.curvature)
        move, _ = newton_step(here._replace(curvature=fixed), 0.0)
        _, spread = newton_step(here, 0.0)
        return jax.tree.map(jnp.add, place, move), (here.cost, spread)

    _, (cost, spread) = lax.scan(step, place, length=CARRIERS)
    downhill = lax.stop_gradient(cost <= cost[0] + SETTLED)  # not so of no number
    best = jnp.max(jnp.where(downhill, jnp.arange(cost.size), 0))
    return cost[best], spread[best]
