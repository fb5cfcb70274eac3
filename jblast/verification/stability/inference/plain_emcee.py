"""emcee as it comes: its stretch move alone, and its own word on how long is enough."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.importance.whitening import Density, densities
from jblast.inference.mcmc.convergence import Convergence, convergence

WALKERS = 64


class BareWalk(NamedTuple):
    """A walk by the stretch move alone.

    Attributes:
        chain: Every step.
        own_tau: emcee's autocorrelation time of the first coordinate [steps]: each
            walker beside its own mean.
        judged: How jblast judges it: all walkers beside one mean.
    """

    chain: Float[np.ndarray, "step walker free"]
    own_tau: float
    judged: Convergence

    def kept(self) -> Float[np.ndarray, "step walker free"]:
        """Return the steps after the first quarter."""
        return self.chain[len(self.chain) // 4 :]


def bare_walk(
    density: Density,
    start: Float[np.ndarray, "walker free"],
    steps: int,
    seed: int = 0,
) -> BareWalk:
    """Walk from given places.

    Args:
        density: Where to walk.
        start: Where the walkers stand.
        steps: How many steps.
        seed: Of the moves.
    """
    import emcee

    walkers, free = start.shape
    sampler = emcee.EnsembleSampler(
        walkers,
        free,
        lambda w: np.asarray(densities(density, jnp.asarray(w)), float),
        vectorize=True,
    )
    random = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random), steps)
    chain = np.asarray(sampler.get_chain())
    own = emcee.autocorr.integrated_time(chain[..., :1], quiet=True, tol=0)
    return BareWalk(chain, float(own[0]), convergence(chain))


def unit_normals(free: int, seed: int = 0) -> Float[np.ndarray, "walker free"]:
    """Draw walkers from a unit normal."""
    return np.random.default_rng(seed).standard_normal((WALKERS, free))
