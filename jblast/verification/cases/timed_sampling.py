"""How long a walk takes, and the 90 % intervals that draws give."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.fidelity.timing import best_of
from jblast.inference.importance.whitening import Density, densities
from jblast.inference.mcmc import (
    emcee_engine,
    scan_engine,
)
from jblast.inference.mcmc.independence_move import Mixture, mixture_of
from jblast.inference.mcmc.state import State, Stretch

WALKERS = 256
SHARES = (0.05, 0.95)
"""Ends of the 90 % interval."""
WARM_UP = 10
"""The first tenth of a walk is left out."""


class Sampler(NamedTuple):
    """What walks.

    Attributes:
        walk: As `scan_engine.walk`.
        first_random: What its random numbers start from, by a seed.
    """

    walk: Callable[..., Stretch]
    first_random: Callable[[int], Mapping[str, np.ndarray]]


EMCEE = Sampler(emcee_engine.walk, emcee_engine.first_random)
SCAN = Sampler(scan_engine.walk, scan_engine.first_random)


def unit_normal(free: int) -> Mixture:
    """Return the unit normal: the approximation of a posterior where it is round."""
    return mixture_of(np.zeros((1, free)), np.eye(free)[None], np.ones(1))


def timed_walk(
    sampler: Sampler,
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
    start = State(w, value, sampler.first_random(seed))
    about = unit_normal(free)

    def walk(steps: int) -> Float[np.ndarray, "step walker free"]:
        return sampler.walk(density, about, start, steps, lambda: None).chain

    seconds, chain = best_of(
        lambda: walk(steps), repeats, lambda: walk(scan_engine.BLOCK)
    )
    return chain[steps // WARM_UP :], seconds


def interval_ends(
    draws: Float[np.ndarray, "... free"],
) -> Float[np.ndarray, "2 free"]:
    """Return the ends of the 90 % interval of each unknown."""
    return np.quantile(draws.reshape(-1, draws.shape[-1]), SHARES, axis=0)
