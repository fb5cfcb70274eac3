r"""Where a search begins: rise and arrival by trial.

A search that begins half a period of a ring off, or with a tenth of the rise, ends
beside the optimum. So each of some rises is tried with each of some places of its
middle, all else as the bank has it, and the search begins at the best.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jblast.inference.picks.fit.model import misfit
from jblast.inference.picks.fit.optimum import Optimum
from jblast.inference.picks.fit.profiled import profiled
from jblast.inference.picks.ready.bins import Bins
from jblast.inference.picks.ready.case import Case
from jblast.inference.picks.single_precision import in_single
from jblast.inference.picks.unknowns import CENTRE

RISES = np.array([0.5, 1.5, 3.0, 5.0, 8.0, 13.0])
"""Tried [samples], beside the one of the start."""

SHIFTS = np.array([-1.5, -0.7, 0.0, 0.7, 1.5])
"""Places of the middle of the rise, from where the front was seen [samples]."""

TURNS = np.array([0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 2.4])
"""How much later a ring shows it [radians of the ring]."""

HIDDEN = np.exp(np.linspace(np.log(0.7), np.log(2.4), 20))
"""Frequencies of rings that a slow front may hide [rad/sample]: it excites a sensor
little, and its rise is bent all the same."""

FASTER = 40.0
r"""A sensor at rest answers a slow rise with one whose mean square about its middle,
$\tau^2/20$, is less by $2/\omega^2$: so $\tau^2$ passes for less by this over
$\omega^2$."""

SLOWER = 1.8
"""Rises tried about the end of a search, over the one there, are larger than this."""

OMEGA = CENTRE.size
"""Place of ln omega among the unknowns."""


def best_pulse(
    bins: Bins, start: Float[Array, " unknown"], case: Case
) -> Float[Array, " unknown"]:
    """Return where to begin with a pulse.

    Args:
        bins: Where the record is looked at.
        start: By the bank.
        case: The record.
    """
    return _best(bins, _about(start, jnp.asarray(SHIFTS, start.dtype)), case)


def best_ring(
    bins: Bins, start: Float[Array, " unknown"], case: Case
) -> Float[Array, " unknown"]:
    """Return where to begin with a pulse through a sensor that rings.

    Args:
        bins: Where the record is looked at.
        start: A pulse; frequency and damping by what one pulse left over.
        case: The record.
    """
    late = jnp.asarray(TURNS, start.dtype) * jnp.exp(-start[OMEGA])
    trials = jnp.concatenate([_about(start, -late), _hidden(start)])
    return _best(bins, trials, case)


class Closer(NamedTuple):
    """A pulse that rises more slowly, about the end of a search.

    Attributes:
        start: Its unknowns.
        gain: By how much its ln posterior is higher than there.
    """

    start: Float[Array, " unknown"]
    gain: Float[Array, ""]


def closer(bins: Bins, y: Float[Array, " unknown"], case: Case) -> Closer:
    """Return the best pulse that rises more slowly, about the end of a search.

    A sharp front has its least cost at the edge of a sample, far from that of a slower
    one: a search may end there.

    Args:
        bins: Where the record is looked at.
        y: The end of a search.
        case: The record.
    """
    made = profiled(bins, _about(y, jnp.asarray(SHIFTS, y.dtype)), case)
    # the first of them is the end itself
    slower = made.y[:, 4] > y[4] + np.log(SLOWER)
    best = jnp.argmin(jnp.where(slower, made.cost, jnp.inf))
    return Closer(made.y[best], made.cost[0] - made.cost[best])


class Hidden(NamedTuple):
    """The ring that would explain most of what one pulse leaves over.

    Attributes:
        gain: How much ln posterior it gains, as far as that is square.
        start: Unknowns to begin a search with.
    """

    gain: Float[Array, ""]
    start: Float[Array, " unknown"]


def hidden_ring(
    bins: Bins, one: Optimum, start: Float[Array, " unknown"], case: Case
) -> Hidden:
    r"""Return the ring that a slow front may hide.

    What a ring adds to the pulse is looked at across all that the pulse's own unknowns
    do: with the misfit $r$, its slopes $J$ and the change $\Delta$ by a trial, the gain
    is $-r^T P \Delta - |P \Delta|^2/2$, where $P = 1 - J (J^T J)^{-1} J^T$.

    Args:
        bins: Where the record is looked at.
        one: Optimum of one pulse.
        start: That, with the further unknowns.
        case: The record, with a ring.
    """
    plain = CENTRE.size
    alone = case._replace(centre=case.centre[:plain], rings=jnp.zeros_like(case.rings))
    still = lax.stop_gradient((alone, case, one.y, one.covariance, start))
    alone, case, y, covariance, start = still

    def twice(y):
        apart = misfit(bins, y, alone)
        return apart, apart

    slopes, apart = jax.jacfwd(twice, has_aux=True)(y)
    trials = _hidden(start)
    coarse = in_single(case)

    def gain(trial):
        with_ring = misfit(bins, in_single(trial), coarse)[: apart.size]
        across = with_ring.astype(apart.dtype) - apart
        across = across - slopes @ (covariance @ (slopes.T @ across))
        return -(apart @ across) - 0.5 * across @ across

    gains = jax.vmap(gain)(trials)
    gains = jnp.where(jnp.isfinite(gains), gains, -jnp.inf)
    best = jnp.argmax(gains)
    return Hidden(gains[best], trials[best])


def _hidden(start):
    """Return trials of rings that a front may hide: of slower rises."""
    kind = start.dtype
    longest = 0.5 * jnp.exp(start[2])
    rise = jnp.exp(start[4]) / (1.0 + jnp.exp(start[4] - start[2]))
    slower = jnp.sqrt(rise * rise + (FASTER / HIDDEN**2).astype(kind))
    slower = jnp.minimum(slower, longest)
    trials = jnp.tile(start, (HIDDEN.size, 1))
    trials = trials.at[:, 0].add(0.5 * (rise - slower))
    free = slower / (1.0 - slower * jnp.exp(-start[2]))
    trials = trials.at[:, 4].set(jnp.log(free))
    return trials.at[:, OMEGA].set(np.log(HIDDEN).astype(kind))


def _about(start, shifts):
    """Return a start, and those of other rises and places about it."""
    # the bank has the arrival of its own rise
    middle = start[0] + 0.5 * jnp.exp(start[4])
    longest = 0.5 * jnp.exp(start[2])
    rises = jnp.minimum(jnp.asarray(RISES, start.dtype), longest)
    rises = jnp.concatenate([rises, jnp.exp(start[4:5])])
    rise, shift = (x.ravel() for x in jnp.meshgrid(rises, shifts))
    trials = jnp.tile(start, (rise.size, 1))
    trials = trials.at[:, 0].set(middle + shift - 0.5 * rise)
    trials = trials.at[:, 4].set(jnp.log(rise))
    return jnp.concatenate([start[None, :], trials])


def _best(bins: Bins, trials, case: Case):
    """Return what of the trials fits best."""
    trials = lax.stop_gradient(trials)
    still = in_single(lax.stop_gradient(case))

    def cost(y):
        return jnp.sum(jnp.square(misfit(bins, y, still)))

    costs = jax.vmap(cost)(in_single(trials))
    costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
    return trials[jnp.argmin(costs)]
