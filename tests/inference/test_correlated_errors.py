from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import stats

from jblast.errors import InputError
from jblast.inference.answer import Answer
from jblast.inference.density import density_of
from jblast.inference.fitting.goodness_of_fit import chi_squared
from jblast.inference.many.fit_many import batch_of
from jblast.inference.posterior.posterior import own_and_shared_errors
from jblast.observations.table import RecordCovariance
from jblast.scene import with_laws
from jblast.sensors.simulated_readings import Noise
from tests.catalogue import MASS_FREE
from tests.inference.logs import log

LAWS = {
    "peak_overpressure_pa": "kingery_bulmash",
    "positive_impulse_pa_s": "kingery_bulmash",
}
SD = np.array([0.04, 0.02])
MATRIX = np.array([[1.0, 0.8], [0.8, 1.0]]) * SD * SD[:, None]


def picks():
    """Peak and impulse of two records, errors of the first correlated, and a third."""
    rows = [
        (name, quantity, value, sd * value, at)
        for name, at, values in (
            ("g1", 20.0, (19e3, 90.0)),
            ("g2", 30.0, (11.9e3, 65.0)),
            ("g3", 40.0, (7.6e3, 47.0)),
        )
        for quantity, value, sd in zip(LAWS, values, SD, strict=True)
    ]
    return replace(
        log(*rows, at_range=True),
        record=("a", "a", "b", "b", "", ""),
        covariances=tuple(RecordCovariance(n, tuple(LAWS), MATRIX) for n in "ab"),
    )


def of(table, noise: Noise = "gaussian", scatter=False):
    uncertain = with_laws(MASS_FREE, LAWS)
    uncertain = replace(uncertain, scene=replace(uncertain.scene, scatter=scatter))
    return Answer(density_of(table, uncertain, noise), np.array([15.0]), np.ones(1))


def full_covariance():
    covariance = np.diag(np.tile(SD**2, 3))
    covariance[:2, :2] = covariance[2:4, 2:4] = MATRIX
    return covariance


@settings(deadline=None, max_examples=50)
@given(st.integers(2, 4), st.integers(0, 2**31))
def test_own_and_shared_errors_add_up_to_the_covariance(count, seed):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((count, count))
    matrix = root @ root.T + 1e-3 * np.eye(count)
    names = ("air_arrival_s", *LAWS, "positive_duration_s")[:count]
    value = rng.uniform(1.0, 5.0, count)
    sd = np.sqrt(np.diag(matrix))
    timed = np.isin(names, "air_arrival_s")
    rows = zip(names, value, np.where(timed, sd, sd * value), strict=True)
    table = replace(
        log(*(("g", n, v, s, 20.0) for n, v, s in rows), at_range=True),
        record=("a",) * count,
        covariances=(RecordCovariance("a", names, matrix),),
    )
    own, shared = own_and_shared_errors(table)
    assert shared.shape[1] < count
    assert np.ptp(own / sd) < 1e-9  # the same share of each
    np.testing.assert_allclose(
        np.diag(own**2) + shared @ shared.T, matrix, atol=1e-9 * sd.max() ** 2
    )


def test_normal_errors_have_the_density_of_scipys_multivariate_normal():
    answer = of(picks())
    value = answer.density.of_readings(answer.values[None])[0]
    normal = stats.multivariate_normal(cov=full_covariance())  # type: ignore  SciPy's stub says int
    np.testing.assert_allclose(value, normal.logpdf(answer.missed), rtol=1e-10)


def test_information_and_chi_squared_are_those_of_the_full_covariance():
    answer = of(picks())
    precision = np.linalg.inv(full_covariance())
    told = answer.weigh(np.eye(6))
    np.testing.assert_allclose(told, precision, rtol=1e-10, atol=1e-8)
    chi2, dof = chi_squared(answer, 1)
    expected = answer.missed @ precision @ answer.missed
    np.testing.assert_allclose(chi2, expected, rtol=1e-10)
    assert dof == 5


def test_residuals_of_a_table_are_in_the_sigma_of_the_log():
    answer = of(picks(), scatter=True)
    independent = of(replace(picks(), covariances=()), scatter=True)
    np.testing.assert_allclose(answer.sd, independent.sd, rtol=1e-12)
    missed = answer.missed - answer.shared
    np.testing.assert_allclose(answer.residual * answer.sd, missed, rtol=1e-9)


def test_a_sigma_changed_after_the_pick_is_refused():
    table = picks()
    with pytest.raises(
        InputError, match="as the covariance of peak_overpressure_pa in record"
    ):
        of(replace(table, sigma=2 * table.sigma))


def test_lanes_refuse_logs_whose_readings_share_errors():
    with pytest.raises(InputError, match="share errors with fit_each"):
        batch_of([picks()], with_laws(MASS_FREE, LAWS))
