import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import posterior_of
from jblast.inference.identify import echelon, estimable_forms
from jblast.inference.posterior.fisher_information import (
    information_with_each,
    linearised,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Free, LogNormal, Scene, UncertainScene
from jblast.sensors import layout_of
from tests.inference.logs import log

LOG = log(
    ("a", "air_arrival_s", 0.1, 1e-3, 40.0),
    ("a", "peak_overpressure_pa", 2e4, 1e3, 40.0),
    ("b", "peak_overpressure_pa", 9e3, 5e2, 70.0),
    ("c", "positive_impulse_pa_s", 80.0, 5.0, 90.0),
    at_range=True,
)
LAWS = {
    "air_arrival_s": "kingery_bulmash",
    "peak_overpressure_pa": "kingery_bulmash",
    "positive_impulse_pa_s": "ford_2021",
}


def posterior(noise):
    beliefs = {
        "charge_mass_kg": Free(positive=True),
        "origin_time_s": Free(positive=False),
        "air_temperature_k": LogNormal(288.0, 1.02),
    }
    parameters = parameters_of(UncertainScene(Scene(), beliefs))
    layout = layout_of(LOG, parameters.scene)
    return posterior_of(parameters, layout, LOG, LAWS, noise)


Z = jnp.array([np.log(50.0), 0.01, 0.3])


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "weight"), [("gaussian", 1.0), ("student", 5 / 7)])
def test_information_is_that_of_the_whole_covariance(noise, weight):
    asked = posterior(noise)
    misfit = asked.misfit(Z)
    covariance = np.diag(np.asarray(misfit.sd) ** 2 / weight) + np.asarray(
        misfit.loading @ misfit.loading.T
    )
    slopes = np.asarray(jax.jacfwd(lambda z: asked.misfit(z).residual)(Z))
    expected = slopes.T @ np.linalg.solve(covariance, slopes) + np.diag([0, 0, 1])
    # routes through the same algebra: rounding only
    linear = linearised(asked, Z)
    (whole,) = information_with_each(asked, *linear, 4)
    np.testing.assert_allclose(whole, expected, rtol=1e-9)
    _, with_last = information_with_each(asked, *linear, 3)
    np.testing.assert_allclose(with_last, expected, rtol=1e-9)


def test_echelon_rows_lead_with_a_one_of_their_own():
    rows = np.array([[1.0, -0.2, 0.5], [2.0, -0.4, 3.0]])
    np.testing.assert_allclose(
        echelon(rows), [[1.0, -0.2, 0.0], [0.0, 0.0, 1.0]], atol=1e-12
    )


def test_told_combinations_stand_still_along_null_directions():
    null = np.array([[1.0, -0.2, 0.0, -0.02]])
    told = estimable_forms(null, (False, False, True, False))
    assert told.shape == (2, 4)
    np.testing.assert_allclose(told @ null.T, 0, atol=1e-12)
    np.testing.assert_allclose(told[:, 2], 0)
    for expected in ([0.2, 1, 0, 0], [0.02, 0, 0, 1]):
        assert any(np.allclose(row, expected) for row in told)
