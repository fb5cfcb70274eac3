"""The density of samples by a spline, against samples counted at every place."""

import jax.numpy as jnp
import numpy as np
import pytest

from calibration.cases import (
    Recorder,
    log_of_picks,
    readings,
    recorded,
    uncertain_scene,
)
from jblast.inference.fitting.solution import solve
from jblast.inference.posterior.posterior import posterior_of
from jblast.inference.posterior.record_likelihood import densities_of_samples
from jblast.inference.regions import quantiles
from jblast.inference.sampled_records import sampled_records
from jblast.signals.picks import pick_records


@pytest.mark.slow
def test_between_its_nodes_it_is_the_density_of_samples():
    # laws exact, a tenth of the peak as noise: as unlike its picks as a record gets
    rng = np.random.default_rng(7)
    made = recorded(rng, readings(rng, scatter=False), Recorder(snr=10.0))
    picks = pick_records(made)
    log = log_of_picks(picks)
    samples = sampled_records(log, [(one.record.name, one) for one in picks])
    found = solve(log, uncertain_scene(scatter=False), records=samples)
    assert found.samples_known is not None
    assert found.samples_known < 0.1
    weights, z = found.draws.weights, found.identified.z[:, 0]
    # the posterior of samples on a grid, against the weighted draws
    mean = weights @ z
    sd = float(np.sqrt(weights @ (z - mean) ** 2))
    grid = mean + sd * np.linspace(-4, 4, 33)
    density = found.density
    posterior = posterior_of(
        density.parameters, density.layout, log, density.laws, density.noise
    )
    height = densities_of_samples(posterior, samples, jnp.asarray(grid[:, None]))
    height = np.interp(np.linspace(-4, 4, 801), np.linspace(-4, 4, 33), height)
    below = np.cumsum(np.exp(height - height.max()))
    fine = mean + sd * np.linspace(-4, 4, 801)
    expected = np.interp([0.05, 0.5, 0.95], below / below[-1], fine)
    # quantiles of some thousand draws: 0.07 sd at the ends
    np.testing.assert_allclose(quantiles(z, weights), expected, atol=0.2 * sd)
