from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import integrate, stats

from jblast.errors import InputError
from jblast.inference.fitting.goodness_of_fit import chi_squared, standardised_residuals
from jblast.inference.many.fit_many import batch_of
from jblast.inference.posterior.fisher_information import whitened_rows
from jblast.inference.posterior.likelihood import (
    blocks_of,
    joined_blocks,
    log_likelihood,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import own_and_shared_errors, posterior_of
from jblast.observations.table import RecordCovariance
from jblast.scene import with_laws
from jblast.sensors import layout_of
from jblast.sensors.simulated_readings import Noise
from tests.catalogue import MASS_FREE
from tests.inference.logs import log

LAWS = {
    "peak_overpressure_pa": "kingery_bulmash",
    "positive_impulse_pa_s": "kingery_bulmash",
}
SD = np.array([0.04, 0.02])
MATRIX = np.array([[1.0, 0.8], [0.8, 1.0]]) * SD * SD[:, None]
Z = np.array([np.log(15.0)])


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
    layout = layout_of(table, uncertain.scene)
    return posterior_of(parameters_of(uncertain), layout, table, LAWS, noise)


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
    posterior = of(picks())
    misfit = posterior.misfit(jnp.asarray(Z))
    value, _ = posterior.likelihood(misfit)
    normal = stats.multivariate_normal(cov=full_covariance())  # pyright: ignore[reportArgumentType]  SciPy's stub says int
    expected = normal.logpdf(np.asarray(misfit.residual))
    np.testing.assert_allclose(float(value), expected, rtol=1e-10)


def test_student_errors_are_near_the_integral_over_what_records_share():
    posterior = of(picks(), "student")
    misfit = posterior.misfit(jnp.asarray(Z))
    sd, load = np.asarray(misfit.sd), np.asarray(misfit.loading)
    assert load.shape == (6, 2)
    misses = []
    for shift in (0.0, 0.02, 0.05):
        residual = np.asarray(misfit.residual) + shift
        exact = stats.t.logpdf(residual[4:], df=4, scale=sd[4:]).sum()
        for record, rows in enumerate((slice(0, 2), slice(2, 4))):
            # effects of different records share no row: the integral is a product

            def density(v, r=residual[rows], k=record, rows=rows):
                u = r - load[rows, k] * v
                own = stats.t.logpdf(u, df=4, scale=sd[rows]).sum()
                return np.exp(own + stats.norm.logpdf(v))

            exact += np.log(integrate.quad(density, -12, 12, limit=500)[0])
        value, _ = log_likelihood(
            jnp.asarray(residual), misfit.sd, misfit.loading, "student"
        )
        misses.append(float(value) - exact)
    # Laplace's method is off for two rows by some 0.1 (see test_likelihood); a fit sees
    # only how that changes
    assert np.max(np.abs(misses)) < 0.25
    assert np.ptp(misses) < 0.1


def test_information_and_chi_squared_are_those_of_the_full_covariance():
    posterior = of(picks())
    misfit = posterior.misfit(jnp.asarray(Z))
    column = jnp.ones((6, 1))
    told = np.asarray(whitened_rows(posterior, misfit, column))
    precision = np.linalg.inv(full_covariance())
    np.testing.assert_allclose(np.sum(told**2), precision.sum(), rtol=1e-10)
    left = standardised_residuals(posterior, Z)
    chi2, dof = chi_squared(posterior, Z, left, 1)
    residual = np.asarray(misfit.residual)
    np.testing.assert_allclose(chi2, residual @ precision @ residual, rtol=1e-10)
    assert dof == 5


@pytest.mark.slow
def test_residuals_of_a_table_are_in_the_sigma_of_the_log():
    posterior = of(picks(), scatter=True)
    left = standardised_residuals(posterior, Z)
    independent = of(replace(picks(), covariances=()), scatter=True)
    misfit = independent.misfit(jnp.asarray(Z))
    np.testing.assert_allclose(left.sd, misfit.sd, rtol=1e-12)
    missed = np.asarray(misfit.residual) - left.shared
    np.testing.assert_allclose(left.residual * left.sd, missed, rtol=1e-9)
    assert left.of_laws.size == misfit.loading.shape[1]


def test_a_sigma_changed_after_the_pick_is_refused():
    table = picks()
    with pytest.raises(
        InputError, match="as the covariance of peak_overpressure_pa in record"
    ):
        of(replace(table, sigma=2 * table.sigma))


def test_lanes_refuse_logs_whose_readings_share_errors():
    with pytest.raises(InputError, match="share errors with fit_each"):
        batch_of([picks()], with_laws(MASS_FREE, LAWS))


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_errors_of_records_are_integrated_out_by_blocks_as_all_with_all(noise: Noise):
    """Rounding alone differs; records of three, two and one error, and rows of none."""
    rng = np.random.default_rng(5)
    shared = np.zeros((13, 6))
    for rows, columns in ((slice(0, 4), 3), (slice(5, 8), 2), (slice(10, 12), 1)):
        first = int(np.count_nonzero(shared.any(axis=0)))
        part = shared[rows, first : first + columns]
        part += rng.normal(size=part.shape)
    loading = 0.3 * np.concatenate([rng.normal(size=(13, 2)), shared], axis=1)
    residual, sd = rng.normal(size=13), rng.uniform(0.1, 0.5, 13)
    blocks = tuple((r, tuple(2 + k for k in c)) for r, c in blocks_of(shared))

    def found(residual, blocks):
        return log_likelihood(residual, sd, loading, noise, None, blocks)

    assert [len(columns) for _, columns in blocks] == [3, 2, 1]
    slope = jax.grad(lambda r, blocks: found(r, blocks)[0])
    for together, apart in (
        *zip(found(residual, ()), found(residual, blocks), strict=True),
        (slope(residual, ()), slope(residual, blocks)),
    ):
        np.testing.assert_allclose(apart, together, rtol=1e-11, atol=1e-12)


def test_effects_of_a_path_and_errors_of_its_record_are_one_block():
    """Records of four rows on a path each; what the shot shares is in no block."""
    paths = [(tuple(range(4 * k, 4 * k + 4)), (2 + k, 5 + k)) for k in range(3)]
    errors = [((4, 6), (8,)), ((5, 6), (9,))]
    blocks = joined_blocks([*paths, *errors])
    assert [columns for _, columns in blocks] == [(2, 5), (3, 6, 8, 9), (4, 7)]
    assert [rows for rows, _ in blocks] == [rows for rows, _ in paths]
