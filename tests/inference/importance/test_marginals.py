import numpy as np
import pytest

from jblast.inference.importance import marginals_of_draws, weighted_quantiles
from jblast.inference.mode.laplace import marginals
from tests.inference.shots import five_solved


@pytest.mark.parametrize("count", [2, 3, 101])
def test_quantiles_of_equal_weights_are_those_of_numpy(count):
    x = np.random.default_rng(0).standard_normal(count)
    shares = (0.05, 0.5, 0.95)
    found = weighted_quantiles(x, np.full(count, 1 / count), shares)
    assert found == pytest.approx(np.quantile(x, shares), rel=1e-12)


def test_a_weight_of_three_counts_like_three_draws():
    rng = np.random.default_rng(0)
    x, weights = rng.standard_normal(2000), rng.integers(1, 4, 2000)
    one = weighted_quantiles(x, weights / weights.sum(), (0.05, 0.5, 0.95))
    other = np.quantile(np.repeat(x, weights), (0.05, 0.5, 0.95))
    assert one == pytest.approx(other, abs=0.01)  # one draw in 2000


def test_draws_of_a_normal_are_told_as_the_normal_is():
    posterior, normal, _, _ = five_solved()
    parameters = posterior.parameters
    z = normal.draws(100_000, np.random.default_rng(0))
    one, other = marginals(parameters, normal), marginals_of_draws(parameters, z)
    for name in parameters.names:
        sd = one[name].sd
        for key in ("value", "q05", "q50", "q95", "sd"):
            assert getattr(other[name], key) == pytest.approx(
                getattr(one[name], key), abs=0.02 * sd
            )
    assert other["charge_mass_kg"].log_sd == pytest.approx(
        one["charge_mass_kg"].log_sd, rel=0.01
    )
    assert np.isnan(other["charge_east_m"].log_sd)
