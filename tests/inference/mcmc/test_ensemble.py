import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.importance import importance, marginals_of_draws
from jblast.inference.mcmc.ensemble import ensemble
from tests.catalogue import BOTH
from tests.inference.shots import five_solved, shot, solved

pytestmark = pytest.mark.slow  # each layout compiles its own search


def test_a_normal_posterior_is_met_and_both_samplers_agree():
    posterior, normal, told, found = five_solved("gaussian")
    for sampler in ("emcee", "scan"):
        walked = ensemble(posterior, normal, told, found, sampler=sampler)
        assert walked.converged
        assert walked.findings == ()
        assert len(walked.modes) == 1
        assert walked.ridge is None
        assert 0.2 < walked.acceptance < 0.5
        z = walked.draws()
        sds = np.sqrt(np.diag(normal.covariance))
        # four standard errors, and a tenth of an sd for what is not normal
        error = 4 / np.sqrt(walked.convergence.ess) + 0.1
        assert np.all(np.abs(z.mean(axis=0) - normal.z) < error * sds)
        np.testing.assert_allclose(z.std(axis=0), sds, rtol=0.15)


def test_intervals_agree_with_importance_sampling():
    posterior, normal, told, _ = five_solved()
    walked = ensemble(posterior, normal, told)
    weighted = importance(posterior, normal, draws=8000)
    assert weighted.k_hat < 0.7
    one = marginals_of_draws(posterior.parameters, walked.draws())
    other = marginals_of_draws(posterior.parameters, weighted.z, weighted.weights)
    for name in posterior.parameters.names:
        sd = one[name].sd
        for key in ("q05", "q50", "q95"):  # Monte Carlo errors of about 0.04 sd
            assert getattr(one[name], key) == pytest.approx(
                getattr(other[name], key), abs=0.15 * sd
            )


def test_a_null_direction_is_refused_by_name():
    free = ("charge_mass_kg", "charge_east_m", "charge_north_m")
    posterior, normal, told, _ = solved(shot([(60.0, 0.0)], BOTH, free))
    with pytest.raises(InputError, match=r"improper along charge_.*expected a prior"):
        ensemble(posterior, normal, told)


def test_a_density_that_is_no_number_names_the_observation():
    posterior, normal, told, _ = five_solved()
    measured = posterior.measured.at[3].set(jnp.nan)
    broken = eqx.tree_at(lambda p: p.measured, posterior, measured)
    with pytest.raises(InputError, match=r"got NaN for row 4 \(peak_overpressure_pa\)"):
        ensemble(broken, normal, told)
    with pytest.raises(InputError, match=r"got NaN for m1, pressure"):
        ensemble(broken, normal, told, rows=["", "", "", "m1, pressure"])
