import numpy as np
import pytest

from calibration.sbc import DRAWS, away, band, chance, holm, inside, rank_truths


def test_holm_corrects_each_p_by_how_many_are_no_smaller():
    # Holm (1979): 0.01 x 4, 0.02 x 3, 0.03 x 2, 0.04 x 1, and never below one before
    p = np.array([0.04, 0.01, 0.03, 0.02])
    np.testing.assert_allclose(holm(p), [0.06, 0.04, 0.06, 0.06])
    np.testing.assert_allclose(holm(np.array([0.9, 0.8])), [1.0, 1.0])


def test_uniform_ranks_pass_and_those_of_too_narrow_intervals_do_not():
    rng = np.random.default_rng(0)
    uniform = rng.integers(0, DRAWS + 1, 500)
    assert chance(uniform) > 0.01
    truth, drawn = rng.standard_normal(500), 0.8 * rng.standard_normal((DRAWS, 500))
    narrow = np.sum(drawn < truth, axis=0)
    assert chance(narrow) < 1e-3
    # 2 Phi(0.8 x 1.645) - 1 = 0.81, and the sd of a share of 500 is 0.018
    assert inside(narrow) == pytest.approx(0.81, abs=0.06)
    assert np.isnan(chance(uniform[:49]))


def test_the_band_holds_19_of_20_uniform_curves():
    ranks = np.random.default_rng(1).integers(0, DRAWS + 1, (400, 500))
    within = np.all(np.abs(away(ranks)) <= band(500), axis=1)
    assert np.mean(within) == pytest.approx(0.95, abs=0.045)  # 4 sd of 400


@pytest.mark.slow  # a case is fitted
def test_ranks_of_one_case_are_of_its_unknowns_and_the_same_again():
    once, again = (rank_truths("pressure", range(7, 9)) for _ in range(2))
    assert once.names == ("charge_mass_kg",)
    assert once.emcee.shape == (2, 1)
    assert once.converged.all()
    np.testing.assert_array_equal(once.emcee, again.emcee)
