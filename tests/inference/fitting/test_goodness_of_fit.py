import numpy as np
import pytest
from scipy import stats

from jblast.inference.fitting.goodness_of_fit import (
    normal_scores,
    p_value,
    suspected_outliers,
    tail_probability,
)
from tests.inference.logs import log


@pytest.mark.parametrize(
    ("noise", "reference"), [("gaussian", stats.norm), ("student", stats.t(df=4))]
)
def test_the_chance_beyond_a_residual_is_that_of_scipy(noise, reference):
    u = np.array([0.0, 0.3, -1.0, 4.0, -25.0])
    np.testing.assert_allclose(
        tail_probability(u, noise), 2 * reference.sf(np.abs(u)), rtol=1e-10
    )


@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_honest_errors_of_either_kind_seldom_look_poor(noise):
    rng = np.random.default_rng(0)
    draw = (
        rng.standard_normal if noise == "gaussian" else lambda n: rng.standard_t(4, n)
    )
    chi2 = np.sum(
        normal_scores(draw((4000, 20)).ravel(), noise).reshape(4000, 20) ** 2, 1
    )
    poor = np.mean([(p_value(c, 20) or 0.0) < 0.05 for c in chi2])
    # a share of 0.05 in 4000 has a standard error of 0.0035
    assert poor == pytest.approx(0.05, abs=0.012)


def test_chance_is_the_survival_of_chi_squared():
    assert p_value(9.1, 9) == pytest.approx(stats.chi2.sf(9.1, 9), rel=1e-10)
    assert p_value(1.0, 0) is None


def named(residual):
    rows = [(f"s{i}", "air_arrival_s", 1.0, 0.1, 10.0) for i in range(len(residual))]
    return [
        found.sensor
        for found in suspected_outliers(
            log(*rows, at_range=True), np.array(residual, float), "student"
        )
    ]


def test_a_wild_reading_is_named_and_honest_ones_are_not():
    assert named([0.1, -1.0, 8.0, 0.5, 0.0, 2.0, -2.0, 1.0, 0.3, 0.2]) == ["s2"]
    assert named([0.1, -1.0, 3.0, 0.5, 0.0, 2.0, -2.0, 1.0, 0.3, 0.2]) == []


def test_when_most_readings_are_wild_the_law_is_wrong_and_none_is_named():
    assert named([50.0, -60.0, 0.0]) == []
