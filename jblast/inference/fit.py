"""Fit a blast to a log: the main job."""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.inference.answer import answer_of
from jblast.inference.bands import bands
from jblast.inference.fit_result import Fit
from jblast.inference.identifiability import identifiability
from jblast.inference.laplace import laplace
from jblast.inference.optimum import optima
from jblast.inference.parameters import parameters_of
from jblast.inference.posterior import posterior_of
from jblast.inference.solution import Solution
from jblast.observations import Observations, place
from jblast.scene import UncertainScene, default_scene
from jblast.sensors import layout_of, resolve_laws
from jblast.sensors.laws import law_names
from jblast.sensors.observe import Noise

DRAWS = 8000
DRAWS_IN_BANDS = 200


def fit(
    observations: Observations,
    uncertain: UncertainScene | None = None,
    *,
    noise: Noise = "student",
    seed: int = 0,
) -> Fit:
    """Find out what a log says of a blast.

    Args:
        observations: The log.
        uncertain: The scene and what is not known of it; without one, a surface charge
            of unknown mass at the origin at time 0, in sea-level air.
        noise: Distribution of the independent errors.
        seed: Of the starts of the search and the draws of the posterior.

    Raises:
        ValueError: The log and the scene do not go together; the message says how.
    """
    uncertain = uncertain or default_scene()
    observations = place(observations, uncertain.scene, uncertain.beliefs)
    solution = solve(observations, uncertain, noise=noise, seed=seed)
    posterior, z = solution.posterior, solution.laplace.z
    misfit = posterior.misfit(jnp.asarray(z))
    effects = np.asarray(posterior.effects(jnp.asarray(z)))
    shared = np.asarray(misfit.loading) @ effects
    residual = (np.asarray(misfit.residual) - shared) / np.asarray(misfit.sd)
    parameters = posterior.parameters
    draws = solution.laplace.draws(DRAWS, np.random.default_rng(seed))
    values = parameters.values_of_each(jnp.asarray(draws))
    distance = np.asarray(misfit.slant_range)
    return Fit(
        answer=answer_of(
            observations,
            uncertain,
            solution,
            np.asarray(misfit.valid),
            residual,
            effects,
        ),
        observations=observations,
        scene=parameters.scene_at(jnp.asarray(z)),
        predicted=np.asarray(misfit.predicted),
        distance=distance,
        residual=residual,
        sd=np.asarray(misfit.sd),
        shared=shared,
        shot=posterior.layout.shot,
        draws={
            name: np.asarray(values[name])
            for name, told in zip(
                parameters.names, solution.identifiability.determined, strict=True
            )
            if told
        },
        bands=bands(
            parameters,
            draws[:DRAWS_IN_BANDS],
            observations,
            distance,
            posterior.layout.shot,
            law_names(solution.laws),
        ),
    )


def solve(
    observations: Observations,
    uncertain: UncertainScene,
    *,
    noise: Noise = "student",
    seed: int = 0,
) -> Solution:
    """Find the posterior's optima, what is identifiable, and its normal approximation.

    Laws left to us are chosen at the start, and once more at the answer.
    """
    parameters = parameters_of(uncertain)
    if not parameters.names:
        raise InputError(
            "nothing to fit: every number of the scene is fixed; expected at least one "
            'that is "free", has a prior, or is named by --free'
        )
    layout = layout_of(observations, uncertain.scene)
    laws = resolve_laws(uncertain.scene, layout)
    key = jax.random.key(seed)
    for last in (False, True):
        posterior = posterior_of(
            parameters, layout, observations, law_names(laws), noise
        )
        found = optima(key, posterior)
        if not np.isfinite(found.log_density[0]):
            raise InputError(
                f"{observations.source or 'observations'}: no value of "
                f"{', '.join(parameters.names)} gives the log a probability; expected "
                "readings, sigmas and a scene that one charge could explain"
            )
        there = resolve_laws(parameters.scene_at(found.z[0]), layout)
        settled = law_names(there) == law_names(laws)
        if settled or last:
            break
        laws = there
    z = np.asarray(found.z[0])
    told = identifiability(posterior, z)
    normal = laplace(posterior, z, told.told)
    laws = {
        quantity: there[quantity] if there[quantity][0] == name else (name, reason)
        for quantity, (name, reason) in laws.items()
    }
    return Solution(posterior, laws, settled, found, told, normal)
