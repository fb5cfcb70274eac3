"""The density of a log whose neighbouring paths share scatter."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from jblast import read, read_scene
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import posterior_of
from jblast.sensors import layout_of
from jblast.sensors.path_scatter import KERNELS, correlations
from jblast.sensors.record import record
from tests.tools.slopes import check_slopes

CASES = Path(__file__).parents[1] / "fitting" / "arrays"
LAWS = {"air_arrival_s": "kingery_bulmash"}
TRUE = {
    "charge_mass_kg": np.log(1.0),
    "charge_east_m": 33.0,
    "charge_north_m": 22.0,
    "origin_time_s": 1.0,
}
NEAR = (
    TRUE
    | {"charge_mass_kg": np.log(0.017), "charge_east_m": 4.1}
    | {"charge_north_m": 2.7, "origin_time_s": 1.1042}
)
"""What was answered while neighbouring paths were taken as independent."""


def ring(noise):
    uncertain, log = read_scene(CASES / "free.toml"), read(CASES / "ring_40m.csv")
    layout = layout_of(log, uncertain.scene)
    return posterior_of(parameters_of(uncertain), layout, log, LAWS, noise)


def at(posterior, values):
    """Coordinates of a place, its origin time moved so that rows agree on average."""
    z = jnp.array([values[name] for name in posterior.parameters.names])
    time = posterior.parameters.names.index("origin_time_s")
    return z.at[time].add(jnp.mean(posterior.misfit(z).residual))


@pytest.mark.slow
def test_the_density_is_the_mean_of_normal_ones_over_the_correlations():
    posterior = ring("gaussian")
    z = at(posterior, TRUE)
    scene = posterior.parameters.scene_at(z)
    found = record(scene, posterior.layout, LAWS)
    left = np.asarray(posterior.misfit(z).residual)
    sd = np.asarray(found.arrival_sd["air_arrival_s"])
    shot = np.asarray(found.shot_loading["air_arrival_s"])
    each = []
    for weights in jnp.eye(len(KERNELS)):
        rho = np.array(correlations(found.place, found.place, weights))
        np.fill_diagonal(rho, 1.0)
        covariance = np.outer(sd, sd) * rho + np.outer(shot, shot)
        covariance += np.diag(np.square(np.asarray(posterior.sigma)))
        normal: Any = multivariate_normal
        each.append(normal.logpdf(left, cov=covariance))
    expected = np.logaddexp.reduce(each) - np.log(len(KERNELS))
    got = posterior.log_density(z) - posterior.parameters.log_prior(z)
    np.testing.assert_allclose(got, expected, atol=1e-3)  # the nugget
    weighed = np.asarray(posterior.weighed(z).kernels)
    np.testing.assert_allclose(
        weighed, np.exp(np.array(each) - np.logaddexp.reduce(each)), atol=1e-3
    )


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_a_small_array_does_not_pull_the_charge_towards_itself(noise):
    posterior = ring(noise)
    density = posterior.log_density
    assert density(at(posterior, TRUE)) > density(at(posterior, NEAR)) + 2.0


@pytest.mark.slow
def test_the_density_has_the_slopes_of_its_differences():
    posterior = ring("gaussian")
    scale = jnp.array([1.0, 1.0, 1.0, 1e-3])
    z = at(posterior, TRUE)
    check_slopes(
        lambda w: posterior.log_density(z + scale * w), (jnp.zeros(4),), 2, rtol=1e-4
    )
