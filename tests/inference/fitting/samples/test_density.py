"""The density of samples by a spline, against samples counted at every place."""

from dataclasses import replace

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
from jblast.inference.fitting.fit import solve
from jblast.inference.fitting.solution import densities_of_samples
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
    assert found.laplace.converged
    assert found.samples_known is not None
    assert found.samples_known < 0.1
    sd = float(np.sqrt(found.laplace.covariance[0, 0]))
    z = found.laplace.z + sd * np.linspace(-2.5, 2.5, 11)[:, None]
    read = replace(found.posterior, correction=None)
    exact, of_picks = densities_of_samples(read, samples, jnp.asarray(z))
    spline = [float(found.posterior.log_density(jnp.asarray(one))) for one in z]
    # this density falls by 11 in ln to the lower end and by 5 to the upper: what lies
    # lower by more than 8 holds less than a thousandth of the mass, whatever is read
    counts = exact > exact.max() - 8.0
    assert counts.sum() >= 9
    off = (np.asarray(spline) - exact)[counts]
    # a weight that is off by a tenth at 2.5 sd moves no end by 2 % of a sd
    np.testing.assert_allclose(off, 0.0, atol=0.1)
    assert np.ptp((of_picks - exact)[counts]) > 3 * np.ptp(off)
