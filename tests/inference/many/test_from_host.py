"""Fits piece by piece, from host to host, are those of `fit_many`."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit_many
from jblast.inference.many.fit_many import KEPT, fit_from_host
from tests.inference.many.five_sensors import LAWS, problem

# where rounding leaves an optimum: 4e-8 of a standard deviation, by the solver's
# tolerance; covariances by the curvature there
ROUNDING = 1e-6


@pytest.fixture(scope="module")
def given():
    uncertain, layout, values, sigma, _ = problem(16)
    return uncertain, layout, values, sigma, LAWS


@pytest.fixture(scope="module")
def whole(given):
    return fit_many(*given, noise="gaussian")


def test_pieces_that_do_not_divide_the_logs_have_the_answers_of_all(given, whole):
    found = fit_from_host(*given, noise="gaussian", keep=tuple(KEPT), piece=5)
    sd = np.asarray(whole.sd())
    assert set(found) == set(KEPT)
    assert (np.abs(found["z"] - whole.z) < ROUNDING * sd).all()
    np.testing.assert_allclose(found["sd"], sd, rtol=ROUNDING)
    np.testing.assert_allclose(found["covariance"], whole.covariance, rtol=ROUNDING)
    np.testing.assert_allclose(found["cost"], whole.cost, rtol=ROUNDING)
    for name in ("converged", "doubtful", "bad"):
        np.testing.assert_array_equal(found[name], getattr(whole, name))


def test_no_logs_are_no_answers(given):
    uncertain, layout, values, sigma, laws = given
    found = fit_from_host(
        uncertain, layout, values[:0], sigma, laws, noise="gaussian", keep=("z", "sd")
    )
    assert {name: x.shape for name, x in found.items()} == {"z": (0, 4), "sd": (0, 4)}


def test_a_bad_log_fails_alone_in_its_own_place(given, whole):
    uncertain, layout, values, sigma, laws = given
    spoilt = values.copy()
    spoilt[7, 3] = np.nan
    found = fit_from_host(
        uncertain, layout, spoilt, sigma, laws, noise="gaussian", keep=("z", "bad"),
        piece=5,
    )  # fmt: skip
    assert np.flatnonzero(found["bad"]).tolist() == [7]
    assert np.isnan(found["z"][7]).all()
    others = np.arange(16) != 7
    sd = np.asarray(whole.sd())[others]
    assert (np.abs(found["z"] - whole.z)[others] < ROUNDING * sd).all()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda v, s: (v[:, :3], s),
            r"values: expected \(log, row\) with 12 rows, got",
        ),
        (lambda v, s: (v, s[:3]), r"relative_sigma: expected \(12,\)"),
        (lambda v, s: (v, np.tile(s, (15, 1))), r"relative_sigma: expected \(12,\)"),
    ],
)
def test_a_wrong_shape_is_named(given, spoil, message):
    uncertain, layout, values, sigma, laws = given
    values, sigma = spoil(values, sigma)
    with pytest.raises(InputError, match=message):
        fit_from_host(uncertain, layout, values, sigma, laws, noise="gaussian", piece=5)


def test_errors_of_each_log_go_with_their_piece(given, whole):
    uncertain, layout, values, sigma, laws = given
    each = np.tile(sigma, (16, 1)) * np.linspace(1.0, 2.0, 16)[:, None]
    found = fit_from_host(
        uncertain, layout, values, each, laws, noise="gaussian", keep=("sd",), piece=5
    )
    # a layout alike, and errors so many times as large
    ratio = found["sd"] / np.asarray(whole.sd())
    np.testing.assert_allclose(
        ratio, np.linspace(1, 2, 16)[:, None] + 0 * ratio, rtol=1e-2
    )


def test_what_cannot_be_kept_is_refused_with_the_nearest(given):
    with pytest.raises(InputError, match="did you mean converged"):
        fit_from_host(*given, keep=("convergd",))
    with pytest.raises(InputError, match="piece: expected a positive whole number"):
        fit_from_host(*given, piece=0)
