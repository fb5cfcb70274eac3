r"""Logs of truths drawn from a prior, and where the truth ranks among posterior draws.

Simulation-based calibration (Talts, Betancourt, Simpson, Vehtari & Gelman 2018,
arXiv:1804.06788): a truth $\theta \sim p(\theta)$ and a log $y \sim p(y \mid \theta)$
are one draw of the joint density, and so is $\theta' \sim p(\theta \mid y)$ with the
same $y$. So among $L$ independent draws of the posterior the truth takes each of the
$L + 1$ ranks equally often: over all logs, and over those that anything about $y$
picks out, such as a diagnostic of the fit.
"""

from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.inference import Posterior
from jblast.inference.identifiability import identifiability
from jblast.inference.importance import (
    importance,
    laplace_holds,
    largest_log_sd,
    largest_quantile_error,
)
from jblast.inference.mcmc.ensemble import ensemble
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.search import optima
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import read_scene
from jblast.sensors import observe, planned_layout, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.record import to_error_scale

SCENES = Path(__file__).parent / "scenes"
DRAWS = 99
"""So many posterior draws a truth is ranked among: its rank is 0 to 99."""


class Ranked(NamedTuple):
    """What became of the logs of a scene.

    Attributes:
        names: What was unknown.
        emcee: Rank of the truth among the walkers' draws.
        laplace: Rank of the truth among draws of the normal approximation.
        holds: Whether the approximation's own diagnostic let it answer.
        converged: Whether the walk reached its precision.
        steps: Of the walk.
        tau: Its autocorrelation time, the longest [steps].
    """

    names: tuple[str, ...]
    emcee: Int[np.ndarray, "log free"]
    laplace: Int[np.ndarray, "log free"]
    holds: Bool[np.ndarray, " log"]
    converged: Bool[np.ndarray, " log"]
    steps: Int[np.ndarray, " log"]
    tau: Float[np.ndarray, " log"]


def rank_truths(scene: str, logs: range) -> Ranked:
    """Draw truths, simulate a log of each, and rank the truth by the posterior.

    Args:
        scene: Name of a file in `scenes/`; every uncertain number has a prior.
        logs: Their numbers; each is the seed of all that is random about its log.
    """
    uncertain = read_scene(SCENES / f"{scene}.toml")
    parameters = parameters_of(uncertain)
    layout, sigma, _ = planned_layout(uncertain.scene)
    laws = law_names(resolve_laws(uncertain.scene, layout))
    free = len(parameters.names)
    blank = Posterior(
        parameters, layout, jnp.zeros_like(sigma), sigma, tuple(sorted(laws.items()))
    )

    @eqx.filter_jit
    def simulated(key):
        of_truth, of_errors = jax.random.split(key)
        z = jax.random.normal(of_truth, (free,))  # every prior is so in its coordinate
        read = observe(of_errors, parameters.scene_at(z), layout, laws, sigma)
        return z, to_error_scale(read, layout.quantity)

    rows = []
    for log in logs:
        truth, measured = simulated(jax.random.key(log))
        posterior = eqx.tree_at(lambda p: p.measured, blank, measured)
        rows.append(_ranks(posterior, np.asarray(truth), log))
    return Ranked(parameters.names, *map(np.array, zip(*rows, strict=True)))


def _ranks(posterior: Posterior, truth: Float[np.ndarray, " free"], seed: int):
    """Return one row of `Ranked`."""
    found = optima(jax.random.key(seed), posterior)
    z = np.asarray(found.z[0])
    identified = identifiability(posterior, z)
    normal = laplace(posterior, z, identified.identified_basis)
    weighted = importance(posterior, normal, seed=seed)
    holds = laplace_holds(
        weighted.k_hat,
        largest_log_sd(posterior, normal),
        largest_quantile_error(weighted, normal),
    )
    walk = ensemble(posterior, normal, identified, found, seed=seed)
    by_normal = normal.draws(DRAWS, np.random.default_rng(seed))
    return (
        np.sum(walk.draws(DRAWS) < truth, axis=0),
        np.sum(by_normal < truth, axis=0),
        holds,
        walk.converged,
        walk.convergence.steps,
        float(np.max(walk.convergence.tau)),
    )
