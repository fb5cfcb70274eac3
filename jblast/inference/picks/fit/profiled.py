r"""Pulses tried with all that is linear in them at its best.

With arrival, rise, durations and decay held, a record is linear in the peak, in the
suction and in the drift: six numbers, whose best, and how wide they are, are one small
system of equations (variable projection; Golub and Pereyra 1973). So hundreds of
arrivals and rises are tried for what one search costs, and none is passed over because
its peak was not the right one.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.means import mean_slopes
from jblast.inference.picks.fit.model import low_passed
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.ready.noise import whitened_means
from jblast.inference.picks.unknowns import (
    CENTRE,
    PULSE_UNKNOWNS,
    SPREAD,
    natural_of,
    pulse_by,
)

LEAST_PEAK = 0.02
"""A pulse that is tried has a peak [share of the largest sample]."""

DRIFTS = CENTRE.size - PULSE_UNKNOWNS


class Profiled(NamedTuple):
    """Pulses with their best peak, suction and drift.

    Attributes:
        y: The unknowns.
        cost: Minus ln posterior.
        width: ln of the volume that the linear ones have about their best.
    """

    y: Float[Array, "trial unknown"]
    cost: Float[Array, " trial"]
    width: Float[Array, " trial"]


def profiled(bins: Bins, trials: Float[Array, "trial unknown"], case: Case) -> Profiled:
    """Return pulses with peak, suction and drift at their best.

    Of clipped bins nothing is asked: what they bound is looked at by the search.

    Args:
        bins: Where the record is looked at.
        trials: Unknowns; their peak, suction and drift are a first guess.
        case: The record.
    """
    kind = trials.dtype
    x = (jnp.asarray(bins.middle, kind) - case.middle) / case.span
    drift = jnp.stack([x**k for k in range(DRIFTS)])
    drift = jax.vmap(lambda row: whitened_means(case.noise, bins, row))(drift)
    drift = case.weight[None, :] * drift
    spread = jnp.asarray(SPREAD, kind)
    corner = case.high_pass

    def one(y):
        none = jnp.zeros_like(y[0])
        unit = pulse_by(natural_of(y))._replace(peak=1.0 + none, suction=none)
        slopes = mean_slopes(bins, jnp.stack(unit[:7]))
        columns = slopes[:, jnp.asarray([1, 5])].T
        if corner is not None:
            passed = jax.vmap(partial(low_passed, bins), in_axes=(0, None))
            columns = columns - passed(columns, corner)
        pulse = jax.vmap(lambda row: whitened_means(case.noise, bins, row))(columns)
        rows = jnp.concatenate([case.weight[None, :] * pulse, drift])
        # the suction is believed to be a share of the peak, whatever that is
        sure = 1.0 / (spread[5] * jnp.maximum(jnp.exp(y[1]), LEAST_PEAK))
        believed = jnp.zeros((1 + DRIFTS, rows.shape[0]), kind)
        believed = believed.at[0, :2].set(jnp.stack([-case.centre[5] * sure, sure]))
        places = np.arange(DRIFTS)
        believed = believed.at[1 + places, 2 + places].set(
            1.0 / spread[PULSE_UNKNOWNS:]
        )
        information = rows @ rows.T + believed.T @ believed
        best = jnp.linalg.solve(information, (rows @ case.white)[:, None])[:, 0]
        peak = jnp.maximum(best[0], LEAST_PEAK)
        best = best.at[0].set(peak)
        apart = case.white - best @ rows
        off = believed @ best
        other = ((y - case.centre[: y.size]) / spread)[jnp.asarray([3, 4, 6])]
        cost = 0.5 * (apart @ apart + off @ off + other @ other)
        found = y.at[1].set(jnp.log(peak)).at[5].set(best[1] / peak)
        found = found.at[PULSE_UNKNOWNS:].set(best[2:])
        width = -0.5 * jnp.linalg.slogdet(information)[1]
        good = jnp.isfinite(cost)
        return Profiled(found, jnp.where(good, cost, jnp.inf), width)

    still = lax.stop_gradient(trials)
    return lax.stop_gradient(jax.vmap(one)(still))
