"""Fit a blast to a log: the main job."""

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError, argument
from jblast.fidelity import TakenLaw
from jblast.inference.fitting.burial import valid_at_depth
from jblast.inference.fitting.findings import FlashesSetAside
from jblast.inference.fitting.goodness_of_fit import standardised_residuals
from jblast.inference.fitting.predictive_bands import bands
from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.samples.density import room_for, with_sample_density
from jblast.inference.fitting.solution import (
    Choices,
    Solution,
    choices_for,
    settle_laws,
    with_samples,
)
from jblast.inference.fitting.summary import summary_of
from jblast.inference.fitting.uncertainty import Method, uncertainty
from jblast.inference.identifiability.null_space import identifiability
from jblast.inference.importance.whitening import refuse_without_density
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.mirror_images import with_mirror_images
from jblast.inference.mode.range_profile import range_profile, with_best_range
from jblast.inference.mode.search import Optima, likeliest_start, optima
from jblast.inference.posterior.fireball_growth import as_seen
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior, posterior_of
from jblast.inference.posterior.record_likelihood import SampledRecords
from jblast.observations import Observations, resolve_positions
from jblast.observations.clocks import (
    refuse_unsolvable_clocks,
    untied_flashes,
)
from jblast.observations.grouping import located, some_rows
from jblast.observations.records.formats import Scaling
from jblast.observations.scenes import for_log
from jblast.observations.table import SAMPLES
from jblast.progress import stages
from jblast.scene import UncertainScene, default_scene, freed
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors import layout_of
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulate import Noise

DRAWS_IN_BANDS = 200
STAGES = {
    "reading samples": 14.0,
    "choosing laws": 1.5,
    "searching": 4.0,
    "what can be told": 0.5,
    "counting samples": 8.0,
    "how sure": 2.0,
    "the answer": 1.0,
}
"""Of a fit, and about how many seconds each takes, most of them compiling."""
OF_SAMPLES = ("reading samples", "counting samples")
"""Those that only a log with records of samples has."""


def fit(
    observations: Observations,
    uncertain: UncertainScene | None = None,
    *,
    noise: Noise = "student",
    posterior: Method = "weighted",
    seed: int = 0,
    store: str | os.PathLike[str] | None = None,
    scaling: Scaling | None = None,
    high_pass_hz: float | None = None,
) -> Fit:
    """Find out what a log says of a blast.

    Args:
        observations: The log. The samples of a record that a row names count themselves
            (`inference.records`).
        uncertain: The scene and what is not known of it; without one, a surface charge
            of unknown mass at the origin at time 0, in sea-level air; of a log in
            degrees, or with dates, place and time are free (`scenes.for_log`). A
            fireball's growth time is free unless the scene says otherwise.
        noise: Distribution of the independent errors.
        posterior: How intervals are found: "weighted" (draws of a normal approximation,
            weighted by the posterior), "laplace" (that approximation alone), "emcee"
            (walkers), or "auto": walkers where the approximation is found wanting.
        seed: Of the starts of the search and the draws of the posterior.
        store: Folder in which a walk is kept, to be gone on with if it is cut short.
        scaling: Scale of the records that rows name, where files do not tell it.
        high_pass_hz: Corner of their recorders' first-order high-pass [Hz].

    Returns:
        Estimates with their intervals, the law they rest on and where it ends, and
        what the data cannot tell; `jblast.report.summary` puts it in words.

    Raises:
        ValueError: The log and the scene do not go together; the message says how.

    Example:
        `jblast.fit(jblast.read("log.csv"), jblast.read_scene("scene.toml"))`
    """
    begin = _stages(of_samples=SAMPLES in observations.quantity)
    if SAMPLES in observations.quantity:
        begin("reading samples")
    observations, sampled = with_samples(observations, scaling, high_pass_hz)
    uncertain = for_log(uncertain or default_scene(), observations)
    observations = located(observations, uncertain)
    uncertain = as_seen(uncertain, observations.quantity, observations.time)
    aside = untied_flashes(observations, uncertain.scene.clock_offsets())
    set_aside = tuple(dict.fromkeys(np.array(observations.clock, object)[aside]))
    if set_aside:
        observations = some_rows(observations, np.flatnonzero(~aside))
    observations = resolve_positions(
        observations,
        uncertain.scene,
        uncertain.beliefs,
        is_default=uncertain.source == NO_SCENE,
    )
    solution = solve(
        observations, uncertain, noise=noise, seed=seed, records=sampled, begin=begin
    )
    begin("how sure")
    density, z = solution.posterior, solution.laplace.z
    misfit = density.misfit(jax.device_put(z))
    left = standardised_residuals(density, z)
    parameters = density.parameters
    names = [
        f"{sensor}, {quantity}"
        for sensor, quantity in zip(
            observations.sensor, observations.quantity, strict=True
        )
    ]
    sure = uncertainty(solution, posterior, seed=seed, rows=names, store=store)
    begin("the answer")
    draws = sure.z
    values = parameters.values_of_each(jax.device_put(draws))
    distance = np.asarray(misfit.slant_range)
    return Fit(
        summary=summary_of(
            observations,
            uncertain,
            solution,
            sure,
            np.asarray(misfit.valid),
            valid_at_depth(solution, draws),
            left,
            lambda log, names: solve(
                log, freed(uncertain, names), noise=noise, seed=seed
            ),
            (FlashesSetAside(set_aside),) if set_aside else (),
        ),
        observations=observations,
        scene=parameters.scene_at(jnp.asarray(z)),
        predicted=np.asarray(misfit.predicted),
        distance=distance,
        residual=left.residual,
        sd=left.sd,
        shared=left.shared,
        shot=density.layout.shot,
        draws={
            name: np.asarray(values[name])
            for name, identified in zip(
                parameters.names, solution.identifiability.determined, strict=True
            )
            if identified
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
    records: SampledRecords | None = None,
    begin: Callable[[str], None] | None = None,
) -> Solution:
    """Find the posterior's optima, what is identifiable, and its normal approximation.

    Laws left to us are chosen at the likeliest start, and again at the answer until
    they settle (`settle_laws`); so are the curve sets of charges whose `burst` is left
    to their height. Samples of
    records, where there are any, count once the log of what was read off them is
    solved; `begin` tells of each stage.
    """
    if not parameters_of(uncertain).names:
        raise InputError(
            "nothing to fit: every number of the scene is fixed; expected at least one "
            'that is "free", has a prior, or is named by ' + argument("freed")
        )
    refuse_unsolvable_clocks(observations, uncertain)
    begin = begin or _stages(of_samples=records is not None)
    begin("choosing laws")
    rows = layout_of(observations, uncertain.scene)
    sigma = observations.error_scale()
    key = jax.random.key(seed)

    def posterior_by(choices: Choices) -> Posterior:
        parameters = parameters_of(replace(uncertain, scene=choices.scene))
        names = law_names(choices.laws)
        density = posterior_of(parameters, choices.layout, observations, names, noise)
        room = room_for(len(parameters.names)) if records is not None else None
        return replace(density, correction=room)

    def search(choices: Choices) -> tuple[Posterior, Optima, Choices]:
        posterior = posterior_by(choices)
        begin("searching")
        found = optima(key, posterior)
        refuse_without_density(key, posterior, found, observations)
        answer = posterior.parameters.scene_at(jax.device_put(np.asarray(found.z)[0]))
        return posterior, found, choices_for(answer, rows, sigma)

    choices = choices_for(uncertain.scene, rows, sigma)
    said = dict(uncertain.scene.law)
    charges, quantities = choices.scene.charges, choices.layout.quantities()
    lifted = any(charge.by_height and charge.up > 0.0 for charge in charges)
    if lifted or any(said.get(q, "auto") == "auto" for q in quantities):
        first = posterior_by(choices)
        near = first.parameters.scene_at(likeliest_start(key, first))
        choices = choices.as_for(choices_for(near, rows, sigma))
    (posterior, found, there), choices = settle_laws(choices, search)
    sight = range_profile(posterior, found)
    if sight is not None:
        found = with_best_range(posterior, found, sight)
    found = with_mirror_images(posterior, found)
    z = np.asarray(found.z)[0]
    begin("what can be told")
    posterior = posterior.weighed(jax.device_put(z))
    identified = identifiability(posterior, z)
    solution = Solution(
        posterior=posterior,
        laws={
            quantity: TakenLaw(law.name, there.laws[quantity].choice)
            for quantity, law in choices.laws.items()
        },
        laws_settled=choices.has_laws_of(there),
        optima=found,
        identifiability=identified,
        laplace=laplace(posterior, z, identified.identified_basis),
        bursts_settled=choices.has_bursts_of(there),
        sight=sight,
    )
    if records is None:
        return solution
    begin("counting samples")
    return with_sample_density(solution, records, partial(optima, key), seed=seed)


def _stages(*, of_samples: bool) -> Callable[[str], None]:
    """Return what is to be called with the name of each stage as it begins."""
    return stages(
        {k: v for k, v in STAGES.items() if of_samples or k not in OF_SAMPLES}
    )
