r"""The probability of the samples of pressure records, all that is not asked for out.

Of each record the pulse has an arrival, ln peak, ln duration and ln impulse
$q = q_\mathrm{law} + L v + s e$: what the laws say of the scene, effects $v$ that rows
share, and the laws' scatter $s$ of this record. Beside them it has nuisances $n$ (rise,
suction, baseline), believed about what a pick says, widely. Samples are normal about
the pulse once they are made white. All of $v$, $e$ and $n$ are integrated out by
Laplace's method at their own mode, which Gauss-Newton finds from the pick, damped; a
record's $e$ and $n$ meet those of another by way of $v$ alone, so they are eliminated
record by record. A front that laws move by a sample rises otherwise than the pick's,
within a sample or over several, and may do either: so there are several searches, each
from the best of some trials, and of each record the end of most weight is taken. Rows
that are no samples count as in `likelihood`.

The density is counted per unit of what a pick of the record reads, so where samples
are normal in $q$ it is that of the pick with its covariance.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.inference.posterior.error_density import log_noise, noise_slopes
from jblast.inference.posterior.likelihood import log_rows, reweighted, row_slopes
from jblast.inference.posterior.record_effects import (
    EffectValues,
    Expansion,
    mode_of,
    settled,
    weightiest,
)
from jblast.sensors.simulate import Noise

Terms = Callable[[Float[Array, " asked"], Float[Array, " nuisance"], Any], Array]
Trials = Callable[
    [Float[Array, " asked"], Float[Array, " nuisance"], Any],
    Float[Array, "search trial nuisance"],
]


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
        nuisance: And what they say of the rest.
        jitter: Errors that samples do not tell of, as of a front between two of them.
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
    """What is missed, row by row; see `posterior.Misfit`."""

    residual: Float[Array, " row"]
    sd: Float[Array, " row"]
    loading: Float[Array, "row effect"]
    lower_bound: Bool[Array, " row"] | None


class Given(NamedTuple):
    """What a scene says: of rows, and of each record.

    Attributes:
        rows: Those that are no samples.
        away: What laws say of what is asked for, less what was picked.
        sd: Their scatter, and what samples do not tell.
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
        predicted: What laws say of what is asked for, on the scale of errors.
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


def _starts(given: Given, records: SampledRecords, noise: Noise) -> EffectValues:
    """Return where searches begin: each record at the best of its trials.

    Each is tried as picked, if its law scatters, and as the law says.
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
