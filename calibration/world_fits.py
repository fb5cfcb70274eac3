"""Random worlds of one blast, read with all errors and fitted by some of their senses.

Whoever asks many worlds something takes them from here: what was read of each, and the
posterior of a fit beside the truth.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference import Posterior
from jblast.inference.identifiability import (
    Identifiability,
    identifiability,
)
from jblast.inference.importance import Importance, pareto_smoothed, reaching
from jblast.inference.mode.laplace import Laplace, laplace
from jblast.inference.mode.search import Optima, optima
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import Parameters, parameters_of
from jblast.inference.whitening import Whitened, densities, root_of
from jblast.observations import Observations
from jblast.observations.grouping import some_rows
from jblast.scene import UncertainScene, WorldSpec
from jblast.scene.uncertain import value_of
from jblast.sensors import layout_of, resolve_laws
from jblast.sensors.law_choice import law_names, settled
from jblast.sensors.record import to_error_scale
from jblast.world import arrivals_of, draw_world, readings_of

DRAWS = 16_000
_information = eqx.filter_jit(information)


class Told(NamedTuple):
    """One world: its seed, its readings, and the numbers of its blast by name."""

    seed: int
    log: Observations
    truth: dict[str, float]


class Solved(NamedTuple):
    """The posterior of a world's blast by some of its readings, and its optima.

    Attributes:
        seed: Of the world, and of all that is random about its fit.
        posterior: Its density.
        found: Where searches ended.
        identified: What the readings tell.
        normal: The normal approximation about the best of them.
        truth: Where the truth lies, in the same coordinates.
    """

    seed: int
    posterior: Posterior
    found: Optima
    identified: Identifiability
    normal: Laplace
    truth: Float[np.ndarray, " free"]


class Fitted(NamedTuple):
    """What some readings of a world say of its blast.

    Attributes:
        parameters: What was unknown.
        drawn: Weighted draws of the posterior.
        truth: Where the truth lies, in the coordinates of the draws.
        covariance: The least that data and priors allow at the truth (Cramer and Rao).
    """

    parameters: Parameters
    drawn: Importance
    truth: Float[np.ndarray, " free"]
    covariance: Float[np.ndarray, "free free"]


def worlds(
    uncertain: UncertainScene,
    spec: WorldSpec,
    names: Sequence[str],
    seeds: Iterable[int],
) -> list[Told]:
    """Draw worlds, one a seed, and read them."""
    found = []
    for seed in seeds:
        world = draw_world(uncertain, spec, seed)
        log, _ = readings_of(world, arrivals_of(world.scene), np.inf)
        assert log is not None
        truth = {name: float(np.asarray(value_of(world.scene, name))) for name in names}
        found.append(Told(seed, replace(log, shot=("",) * len(log)), truth))
    return found


def truth_of(parameters: Parameters, truth: dict[str, float]) -> np.ndarray:
    """Return where numbers lie, in the coordinates of a fit."""
    both = zip(parameters.names, parameters.beliefs, strict=True)
    return np.array([belief.unconstrain(truth[name]) for name, belief in both])


def posteriors(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Posterior]:
    """Return the posterior by some quantities of every world, with a scene's priors.

    One program does for all.
    """
    rows = np.flatnonzero(np.isin(told[0].log.quantity, quantities))
    first = some_rows(told[0].log, rows)
    scene, layout = settled(one.scene, layout_of(first, one.scene))
    parameters = parameters_of(replace(one, scene=scene))
    laws = tuple(sorted(law_names(resolve_laws(scene, layout)).items()))
    for world in told:
        some = some_rows(world.log, rows)
        yield Posterior(
            parameters,
            layout,
            to_error_scale(some.value, some.quantity),
            jnp.asarray(some.error_scale()),
            laws,
        )


def solutions(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Solved]:
    """Search the posteriors by some quantities of every world."""
    densities_of = posteriors(told, one, quantities)
    for world, posterior in zip(told, densities_of, strict=True):
        found = optima(jax.random.key(world.seed), posterior)
        z = np.asarray(found.z[0])
        identified = identifiability(posterior, z)
        normal = laplace(posterior, z, identified.identified_basis)
        at = truth_of(posterior.parameters, world.truth)
        yield Solved(world.seed, posterior, found, identified, normal, at)


def least_at(
    posterior: Posterior, truth: Float[np.ndarray, " free"]
) -> Float[np.ndarray, "free free"]:
    """Return the least covariance that data and priors allow at the truth."""
    return np.linalg.inv(np.asarray(_information(posterior, jnp.asarray(truth))))


def weighted(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    root: Float[np.ndarray, "free free"],
    seed: int,
) -> Importance:
    """Weight draws about an optimum so that they follow the posterior.

    Half of them are Student-t, which reach as far as one reading's errors do.

    Args:
        posterior: The posterior.
        z: The optimum.
        root: Of the covariance of its normal approximation.
        seed: Of the draws.
    """
    w, log_drawn, _ = reaching(DRAWS, z.size, np.random.default_rng(seed))
    density = Whitened(posterior, jnp.asarray(z), jnp.asarray(root))
    value = np.asarray(densities(density, jnp.asarray(w)))
    log_weights, k_hat = pareto_smoothed(value - log_drawn)
    weights = np.exp(log_weights)
    return Importance(z + w @ root.T, weights, k_hat, float(1 / np.sum(weights**2)))


def fits(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Fitted]:
    """Fit some quantities of every world: draws about the optimum, weighted."""
    for world in solutions(told, one, quantities):
        drawn = weighted(
            world.posterior, world.normal.z, root_of(world.normal), world.seed
        )
        least = least_at(world.posterior, world.truth)
        yield Fitted(world.posterior.parameters, drawn, world.truth, least)
