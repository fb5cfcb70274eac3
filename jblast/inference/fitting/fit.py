"""Fit a blast to a log: the main job."""

import os
from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError, argument
from jblast.inference.fitting.burial import valid_at_depth
from jblast.inference.fitting.goodness_of_fit import left_of
from jblast.inference.fitting.predictive_bands import bands
from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.summary import summary_of
from jblast.inference.fitting.uncertainty import Method, how_sure
from jblast.inference.identifiability.null_space import identifiability
from jblast.inference.importance.whitening import non_finite_rows
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.search import likeliest_start, optima
from jblast.inference.mode.starts import starts
from jblast.inference.posterior.fireball_growth import as_seen
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import posterior_of
from jblast.observations import Observations, resolve_positions
from jblast.progress import stages
from jblast.scene import UncertainScene, default_scene
from jblast.sensors import layout_of, resolve_laws
from jblast.sensors.bursts import settled, with_bursts
from jblast.sensors.law_choice import law_names
from jblast.sensors.observe import Noise

DRAWS_IN_BANDS = 200
STAGES = {
    "choosing laws": 1.5,
    "searching": 4.0,
    "what can be told": 0.5,
    "how sure": 2.0,
    "the answer": 1.0,
}
"""Of a fit, and about how many seconds each takes, most of them compiling."""


def fit(
    observations: Observations,
    uncertain: UncertainScene | None = None,
    *,
    noise: Noise = "student",
    posterior: Method = "weighted",
    seed: int = 0,
    store: str | os.PathLike[str] | None = None,
) -> Fit:
    """Find out what a log says of a blast.

    Args:
        observations: The log.
        uncertain: The scene and what is not known of it; without one, a surface charge
            of unknown mass at the origin at time 0, in sea-level air. A fireball's
            growth time is free unless the scene says otherwise.
        noise: Distribution of the independent errors.
        posterior: How intervals are found: "weighted" (draws of a normal approximation,
            weighted by the posterior), "laplace" (that approximation alone), "emcee"
            (walkers), or "auto": walkers where the approximation is found wanting.
        seed: Of the starts of the search and the draws of the posterior.
        store: Folder in which a walk is kept, to be gone on with if it is cut short.

    Returns:
        Estimates with their intervals, the law they rest on and where it ends, and
        what the data cannot tell; `jblast.report.summary` puts it in words.

    Raises:
        ValueError: The log and the scene do not go together; the message says how.

    Example:
        `jblast.fit(jblast.read("log.csv"), jblast.read_scene("scene.toml"))`
    """
    uncertain = uncertain or default_scene()
    uncertain = as_seen(uncertain, observations.quantity, observations.time)
    observations = resolve_positions(observations, uncertain.scene, uncertain.beliefs)
    begin = stages(STAGES)
    solution = solve(observations, uncertain, noise=noise, seed=seed)
    begin("how sure")
    density, z = solution.posterior, solution.laplace.z
    misfit = density.misfit(jnp.asarray(z))
    left = left_of(density, z)
    parameters = density.parameters
    names = [
        f"{sensor}, {quantity}"
        for sensor, quantity in zip(
            observations.sensor, observations.quantity, strict=True
        )
    ]
    sure = how_sure(solution, posterior, seed=seed, rows=names, store=store)
    begin("the answer")
    draws = sure.z
    values = parameters.values_of_each(jnp.asarray(draws))
    distance = np.asarray(misfit.slant_range)
    return Fit(
        summary=summary_of(
            observations,
            uncertain,
            solution,
            sure,
            np.asarray(misfit.valid),
            valid_at_depth(solution, draws),
            left.residual,
            left.effects,
            lambda log: solve(log, uncertain, noise=noise, seed=seed),
        ),
        observations=observations,
        scene=parameters.scene_at(jnp.asarray(z)),
        predicted=np.asarray(misfit.predicted),
        distance=distance,
        residual=left.residual,
        sd=np.asarray(misfit.sd),
        shared=left.shared,
        shot=density.layout.shot,
        draws={
            name: np.asarray(values[name])
            for name, told in zip(
                parameters.names, solution.identifiability.determined, strict=True
            )
            if told
        },
        posterior_reason=sure.reason,
        weighted=sure.weighted,
        ensemble=sure.ensemble,
        density=density,
        bands=bands(
            parameters,
            z,
            draws[:: max(len(draws) // DRAWS_IN_BANDS, 1)],
            observations,
            density.layout,
            distance,
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

    Laws left to us are chosen at the likeliest start, and once more at the answer; so
    are the curve sets of charges whose `burst` is left to their height.
    """
    if not parameters_of(uncertain).names:
        raise InputError(
            "nothing to fit: every number of the scene is fixed; expected at least one "
            'that is "free", has a prior, or is named by ' + argument("freed")
        )
    begin = stages(STAGES)
    begin("choosing laws")
    rows = layout_of(observations, uncertain.scene)
    sigma = observations.error_scale()
    scene, layout = settled(uncertain.scene, rows)
    parameters = parameters_of(replace(uncertain, scene=scene))
    laws = resolve_laws(scene, layout, sigma)
    key = jax.random.key(seed)
    said = dict(uncertain.scene.law)
    lifted = any(charge.by_height and charge.up > 0.0 for charge in scene.charges)
    if lifted or any(said.get(q, "auto") == "auto" for q in layout.quantities()):
        first = posterior_of(parameters, layout, observations, law_names(laws), noise)
        near = parameters.scene_at(likeliest_start(key, first))
        near, layout = settled(near, rows)
        laws = resolve_laws(near, layout, sigma)
        scene = with_bursts(scene, near)
        parameters = parameters_of(replace(uncertain, scene=scene))
    for last in (False, True):
        posterior = posterior_of(
            parameters, layout, observations, law_names(laws), noise
        )
        begin("searching")
        found = optima(key, posterior)
        if not np.isfinite(found.log_density[0]):
            start = np.asarray(starts(key, posterior, 1)[0])
            wrong = non_finite_rows(posterior, start)
            where = [observations.where(row) for row in wrong]
            raise InputError(
                f"{observations.source or 'observations'}: no value of "
                f"{', '.join(parameters.names)} gives the log a probability; expected "
                "readings, sigmas and a scene that one charge could explain"
                + (f", got no number for {_shortly(where)}" if where else "")
            )
        end, layout_there = settled(parameters.scene_at(found.z[0]), rows)
        there = resolve_laws(end, layout_there, sigma)
        same_laws = law_names(there) == law_names(laws)
        bursts = [charge.burst for charge in scene.charges]
        same_bursts = [charge.burst for charge in end.charges] == bursts
        same_bursts &= layout_there.free_air == layout.free_air
        if (same_laws and same_bursts) or last:
            break
        laws, layout, scene = there, layout_there, with_bursts(scene, end)
        parameters = parameters_of(replace(uncertain, scene=scene))
    z = np.asarray(found.z[0])
    begin("what can be told")
    told = identifiability(posterior, z)
    normal = laplace(posterior, z, told.told)
    laws = {
        quantity: (name, of_answer(name, *there[quantity]))
        for quantity, (name, _) in laws.items()
    }
    return Solution(posterior, laws, same_laws, found, told, normal, same_bursts)


def of_answer(used: str, chosen: str, reason: str) -> str:
    """Return why a law was used, judged at the answer."""
    if used == chosen:
        return reason
    return (
        f"chosen before the answer was known, at which it would be {chosen}: {reason}"
    )


def _shortly(names: Sequence[str], most: int = 5) -> str:
    """Join names, the first few of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
