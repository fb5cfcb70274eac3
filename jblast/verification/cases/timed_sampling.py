"""How long a walk takes, and the 90 % intervals that draws give."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.fidelity.timing import best_of
from jblast.inference.importance.whitening import Density, densities
from jblast.inference.mcmc.independence_move import Mixture, mixture_of
from jblast.inference.mcmc.scan_engine import BLOCK
from jblast.inference.mcmc.state import Engine, WalkState

WALKERS = 256
SHARES = (0.05, 0.95)
"""Ends of the 90 % interval."""
WARM_UP = 10
"""The first tenth of a walk is left out."""


def unit_normal(free: int) -> Mixture:
    """Return the unit normal: the approximation of a posterior where it is round."""
    return mixture_of(np.zeros((1, free)), np.eye(free)[None], np.ones(1))


def timed_walk(
    sampler: Engine,
    density: Density,
    free: int,
    steps: int,
    seed: int = 0,
    repeats: int = 1,
) -> tuple[Float[np.ndarray, "step walker free"], float]:
    """Walk from draws of a unit normal.

    Args:
        sampler: What walks.
        density: Where, in coordinates in which it is round.
        free: How many unknowns.
        steps: How many steps.
        seed: Of the start and of the moves.
        repeats: How often the same walk is timed.

    Returns:
        The chain without its warm-up, and the least seconds of the whole walk, once
        compiled.
    """
    w = np.random.default_rng(seed).standard_normal((WALKERS, free))
    value = np.array(densities(density, jnp.asarray(w)))
    start = WalkState(w, value, sampler.first_random(seed))
    about = unit_normal(free)

    def walk(steps: int) -> Float[np.ndarray, "step walker free"]:
        return sampler.walk(density, about, start, steps, lambda: None).chain

    seconds, chain = best_of(lambda: walk(steps), repeats, lambda: walk(BLOCK))
    return chain[steps // WARM_UP :], seconds


def interval_ends(
    draws: Float[np.ndarray, "... free"],
) -> Float[np.ndarray, "2 free"]:
    """Return the ends of the 90 % interval of each unknown."""
    return np.quantile(draws.reshape(-1, draws.shape[-1]), SHARES, axis=0)
