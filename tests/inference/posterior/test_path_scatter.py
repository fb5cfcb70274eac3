"""The density of a log whose neighbouring paths share scatter."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from jblast import read, read_scene
from jblast.inference.answer import unconstrained
from jblast.inference.density import density_of
from jblast.scene import with_laws
from jblast.sensors.path_scatter import KERNELS, correlations
from tests.tools.slopes import check_slopes

CASES = Path(__file__).parents[1] / "arrays"
LAWS = {"air_arrival_s": "kingery_bulmash"}
TRUE = {
    "charge_mass_kg": 1.0,
    "charge_east_m": 33.0,
    "charge_north_m": 22.0,
    "origin_time_s": 1.0,
}
NEAR = (
    TRUE
    | {"charge_mass_kg": 0.017, "charge_east_m": 4.1}
    | {"charge_north_m": 2.7, "origin_time_s": 1.1042}
)
"""What was answered while neighbouring paths were taken as independent."""


def ring(noise):
    uncertain, log = read_scene(CASES / "free.toml"), read(CASES / "ring_40m.csv")
    return density_of(log, with_laws(uncertain, LAWS), noise)


def at(density, values):
    """Numbers of a place, its origin time moved so that rows agree on average."""
    names = density.coordinates.names
    found = np.array([values[name] for name in names])
    missed = density.rows.measured - density.seen_with(found[None]).predicted[0]
    found[names.index("origin_time_s")] += missed.mean()
    return found


def test_the_density_is_the_mean_of_normal_ones_over_the_correlations():
    density = ring("gaussian")
    values = at(density, TRUE)
    seen = density.seen_with(values[None])
    left = density.rows.measured - seen.predicted[0]
    sd, shot = seen.arrival["air_arrival_s"][0], seen.shot["air_arrival_s"][0]
    each = []
    for weights in jnp.eye(len(KERNELS)):
        place = jnp.asarray(seen.place[0])
        rho = np.array(correlations(place, place, weights))
        np.fill_diagonal(rho, 1.0)
        covariance = np.outer(sd, sd) * rho + np.outer(shot, shot)
        covariance += np.diag(np.square(density.rows.sigma))
        normal: Any = multivariate_normal
        each.append(normal.logpdf(left, cov=covariance))
    expected = np.logaddexp.reduce(each) - np.log(len(KERNELS))
    got = density.of_readings(values[None])[0]
    np.testing.assert_allclose(got, expected, atol=1e-3)  # the nugget


@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_a_small_array_does_not_pull_the_charge_towards_itself(noise):
    density = ring(noise)
    there, near = density.of_readings(np.stack([at(density, TRUE), at(density, NEAR)]))
    assert there > near + 0.5


@pytest.mark.slow
def test_the_density_has_the_slopes_of_its_differences():
    density = ring("gaussian")
    scale = jnp.array([1.0, 1.0, 1.0, 1e-3])
    z = jnp.asarray(unconstrained(density, at(density, TRUE)[None])[0])
    check_slopes(
        lambda w: density.log_density(z + scale * w), (jnp.zeros(4),), 2, rtol=1e-4
    )
