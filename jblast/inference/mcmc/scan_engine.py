r"""The same moves as emcee's inside one `lax.scan`: no Python between the steps.

Half of the walkers, drawn anew each step, move by the other half, then those by them.
Each move is drawn for itself; `state.SHARES` says how often.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.inference.importance.whitening import Density, densities
from jblast.inference.mcmc.independence_move import Mixture, independence_move
from jblast.inference.mcmc.state import SHARES, Segment, WalkState

A = 2.0
"""Longest stretch; the shortest is its inverse."""
JITTER = 1e-5
"""Relative sd of the length of a difference, so that no lattice can be all there is."""
BLOCK = 100
"""Steps in one compiled call."""


class Scan:
    """An ensemble whose moves are compiled."""

    tick_steps = BLOCK

    def first_random(self, seed: int) -> dict[str, np.ndarray]:
        """Return what the random numbers start from, as arrays."""
        return {"seed": np.array(seed), "step": np.array(0)}

    def walk(
        self,
        density: Density,
        mixture: Mixture,
        state: WalkState,
        steps: int,
        tick: Callable[[], None],
    ) -> Segment:
        """Walk on; Ctrl-C loses the block it falls into."""
        w, value = jnp.asarray(state.walkers), jnp.asarray(state.log_density)
        key = jax.random.key(int(state.random["seed"]))
        first = int(state.random["step"])
        chain, log_density = [], []
        interrupted = False
        try:
            for start in range(first, first + steps, BLOCK):
                (w, value), (places, values) = _block(
                    density, mixture, w, value, key, jnp.asarray(start)
                )
                both = np.asarray(places), np.asarray(values)
                chain.append(both[0])
                log_density.append(both[1])
                tick()
        except KeyboardInterrupt:
            interrupted = True
        done = min(len(log_density) * BLOCK, steps)
        shape = state.walkers.shape
        return Segment(
            np.concatenate([np.zeros((0, *shape)), *chain])[:done],
            np.concatenate([np.zeros((0, shape[0])), *log_density])[:done],
            {**state.random, "step": np.array(first + done)},
            interrupted,
        )


@jax.jit
def _block(density, mixture, w, value, key, first):
    def step(carry, number):
        moved = _step(jax.random.fold_in(key, number), density, mixture, *carry)
        return moved, moved

    return lax.scan(step, (w, value), first + jnp.arange(BLOCK))


def _step(key: PRNGKeyArray, density, mixture, w: Float[Array, "walker free"], value):
    """Move every walker once."""
    shuffle_key, *keys = jax.random.split(key, 3)
    order = jax.random.permutation(shuffle_key, len(w))
    half = len(w) // 2
    for key, mine, others in (
        (keys[0], order[:half], order[half:]),
        (keys[1], order[half:], order[:half]),
    ):
        propose_key, accept_key = jax.random.split(key)
        there, factor = _proposal(propose_key, mixture, w[mine], w[others])
        found = densities(density, there)
        gain = factor + found - value[mine]
        accepted = gain > jnp.log(jax.random.uniform(accept_key, gain.shape))
        w = w.at[mine].set(jnp.where(accepted[:, None], there, w[mine]))
        value = value.at[mine].set(jnp.where(accepted, found, value[mine]))
    return w, value


def _proposal(key: PRNGKeyArray, mixture, mine, others):
    """Propose a place for each walker, and ln of what the density ratio is times."""
    count, free = mine.shape
    kind, one, two, long, far, which, where = jax.random.split(key, 7)
    first = jax.random.randint(one, (count,), 0, len(others))
    apart = jax.random.randint(two, (count,), 1, len(others))
    second = (first + apart) % len(others)
    jitter = 1 + JITTER * jax.random.normal(long, (count,), mine.dtype)
    stretch = jnp.square((A - 1) * jax.random.uniform(far, (count,), mine.dtype) + 1)
    stretch = (stretch / A)[:, None]

    u = jax.random.uniform(kind, (count, 1), mine.dtype)
    is_stretch = u < SHARES["stretch"]
    is_jump = u < SHARES["stretch"] + SHARES["jump"]
    is_independent = u > 1 - SHARES["independence"]
    length = jnp.where(is_jump, 1.0, 2.38 / (2 * free) ** 0.5) * jitter[:, None]
    by_difference = mine + length * (others[first] - others[second])
    by_stretch = others[first] + stretch * (mine - others[first])
    rank = jax.random.uniform(which, (count,), mine.dtype)
    unit = jax.random.normal(where, mine.shape, mine.dtype)
    there, of_mixture = independence_move(mixture, mine, rank, unit)
    there = jnp.where(
        is_independent, there, jnp.where(is_stretch, by_stretch, by_difference)
    )
    of_stretch = jnp.where(is_stretch, (free - 1) * jnp.log(stretch), 0.0)[:, 0]
    return there, jnp.where(is_independent[:, 0], of_mixture, of_stretch)
