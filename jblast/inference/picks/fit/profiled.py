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
from jax import lax
from jax.scipy.linalg import cho_solve
from jaxtyping import Array, Float

from jblast.inference.picks.fit.means import mean_columns
from jblast.inference.picks.fit.model import low_passed
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.ready.noise import whitened_means
from jblast.inference.picks.single_precision import in_single
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
    trials = lax.stop_gradient(trials)
    x = (jnp.asarray(bins.middle, kind) - case.middle) / case.span
    drift = _whitened(bins, case, jnp.stack([x**k for k in range(DRIFTS)]))
    fixed = jnp.concatenate([drift, case.white[None, :]])
    rows = jax.vmap(partial(_pulse_rows, bins, in_single(case)))(in_single(trials))
    # rounded as they are, what follows is exact for them
    rows = rows.astype(kind)
    own, across = rows @ jnp.swapaxes(rows, 1, 2), rows @ fixed.T
    among = fixed @ fixed.T
    spread = jnp.asarray(SPREAD, kind)
    wide = jnp.diag(jnp.square(1.0 / spread[PULSE_UNKNOWNS:]))

    def one(y, own, across):
        # the suction is believed to be a share of the peak, whatever that is
        sure = 1.0 / (spread[5] * jnp.maximum(jnp.exp(y[1]), LEAST_PEAK))
        share = jnp.stack([-case.centre[5] * sure, sure])
        mixed = across[:, :DRIFTS]
        information = jnp.block(
            [
                [own + share[:, None] * share[None, :], mixed],
                [mixed.T, among[:DRIFTS, :DRIFTS] + wide],
            ]
        )
        slope = jnp.concatenate([across[:, DRIFTS], among[:DRIFTS, DRIFTS]])
        root = jnp.linalg.cholesky(information, symmetrize_input=False)
        best = cho_solve((root, True), slope)
        peak = jnp.maximum(best[0], LEAST_PEAK)
        best = best.at[0].set(peak)
        square = among[DRIFTS, DRIFTS] + best @ (information @ best - 2.0 * slope)
        other = ((y - case.centre[: y.size]) / spread)[jnp.asarray([3, 4, 6])]
        cost = 0.5 * (square + other @ other)
        found = y.at[1].set(jnp.log(peak)).at[5].set(best[1] / peak)
        found = found.at[PULSE_UNKNOWNS:].set(best[2:])
        width = -jnp.sum(jnp.log(jnp.diagonal(root)))
        good = jnp.isfinite(cost)
        return Profiled(found, jnp.where(good, cost, jnp.inf), width)

    return lax.stop_gradient(jax.vmap(one)(trials, own, across))


def _pulse_rows(bins: Bins, case: Case, y: Float[Array, " unknown"]):
    """Return what a peak and a suction of 1 put into the bins, whitened."""
    rows = mean_columns(bins, pulse_by(natural_of(y)))
    if case.high_pass is not None:
        passed = jax.vmap(partial(low_passed, bins), in_axes=(0, None))
        rows = rows - passed(rows, case.high_pass)
    return _whitened(bins, case, rows)


def _whitened(bins: Bins, case: Case, rows: Float[Array, "row bin"]):
    """Return means over bins, whitened and weighed."""
    white = jax.vmap(partial(whitened_means, case.noise, bins))(rows)
    return case.weight[None, :] * white
