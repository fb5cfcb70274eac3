"""Random worlds of one blast, read with all errors and fitted by some of their senses.

Whoever asks many worlds something takes them from here: what was read of each, and the
posterior of a fit beside the truth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference import Posterior
from jblast.inference.identifiability.null_space import identifiability
from jblast.inference.importance.psis import Importance, importance
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.search import optima
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import Parameters, parameters_of
from jblast.observations import Observations
from jblast.observations.grouping import some_rows
from jblast.scene import UncertainScene, WorldSpec
from jblast.scene.parameters import value_of
from jblast.sensors import layout_of, resolve_laws
from jblast.sensors.bursts import settled
from jblast.sensors.law_choice import law_names
from jblast.sensors.record import to_error_scale
from jblast.world import arrivals_of, draw_world, readings_of


class Told(NamedTuple):
    """One world: its readings, and the numbers of its blast by name."""

    log: Observations
    truth: dict[str, float]


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
    uncertain: UncertainScene, spec: WorldSpec, names: Sequence[str], count: int
) -> list[Told]:
    """Draw worlds, one a seed, and read them."""
    found = []
    for seed in range(count):
        world = draw_world(uncertain, spec, seed)
        log, _ = readings_of(world, arrivals_of(world.scene), np.inf)
        assert log is not None
        truth = {name: float(np.asarray(value_of(world.scene, name))) for name in names}
        found.append(Told(replace(log, shot=("",) * len(log)), truth))
    return found


def fits(
    told: Sequence[Told], one: UncertainScene, quantities: tuple[str, ...]
) -> Iterator[Fitted]:
    """Fit some quantities of every world, with the priors of a scene."""
    rows = np.flatnonzero(np.isin(told[0].log.quantity, quantities))
    first = some_rows(told[0].log, rows)
    scene, layout = settled(one.scene, layout_of(first, one.scene))
    parameters = parameters_of(replace(one, scene=scene))
    laws = tuple(sorted(law_names(resolve_laws(scene, layout)).items()))
    for seed, (log, truth) in enumerate(told):
        some = some_rows(log, rows)
        posterior = Posterior(
            parameters,
            layout,
            to_error_scale(some.value, some.quantity),
            jnp.asarray(some.error_scale()),
            laws,
        )
        z = np.asarray(optima(jax.random.key(seed), posterior).z[0])
        normal = laplace(posterior, z, identifiability(posterior, z).identified_basis)
        at = np.array(
            [
                belief.unconstrain(truth[name])
                for name, belief in zip(
                    parameters.names, parameters.beliefs, strict=True
                )
            ]
        )
        least = np.linalg.inv(np.asarray(information(posterior, jnp.asarray(at))))
        yield Fitted(parameters, importance(posterior, normal, seed=seed), at, least)
