"""Whether what was found is a law: by rows not seen, and by what is left over."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_smoothing_spline

from calibration.discovery import held
from jblast.discovery.equations import (
    discover,
    outside_share,
    unlikely,
)
from jblast.discovery.record import smoothed
from jblast.discovery.sparse_regression import polynomial

TIME = np.linspace(0.0, 20.0, 401)
PUSH = 2.0 * np.sin(1.3 * TIME) + 1.2 * np.sin(0.47 * TIME + 1.0)


def pushed(square: float, cube: float, noise: float = 0.01, seed: int = 0):
    """Return a body with drag of three kinds, pushed to and fro."""
    clean = solve_ivp(
        lambda t, u: (
            np.interp(t, TIME, PUSH) - 0.2 * u - square * np.abs(u) * u - cube * u**3
        ),
        (0.0, 20.0),
        [3.0],
        t_eval=TIME,
        rtol=1e-9,
        atol=1e-9,
        max_step=0.05,
    ).y[0]
    drawn = np.random.default_rng(seed).standard_normal(TIME.shape)
    return (clean + noise * np.std(clean) * drawn)[:, None]


def found_in(states: np.ndarray, degree: int = 2, seed: int = 0, members: int = 20):
    names = ("u", "push")
    candidates, outside = (
        polynomial(names, n, signed_squares=True) for n in (degree, degree + 1)
    )
    return discover(
        TIME,
        states,
        PUSH[:, None],
        names=names,
        candidates=candidates,
        outside=outside,
        members=members,
        seed=seed,
    )


def test_a_law_that_is_not_among_the_candidates_is_not_the_whole_of_it():
    found = found_in(pushed(square=0.0, cube=0.05))
    assert found.judged[0].law  # |u| u comes near: it foretells
    assert not found.judged[0].whole
    assert found.judged[0].outside_term == "u^3"


def test_one_degree_more_is_the_whole_of_it():
    found = found_in(pushed(square=0.0, cube=0.05), degree=3)
    assert set(found.terms(0)) == {"u", "push", "u^3"}
    assert found.judged[0].law
    assert found.judged[0].whole


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_true_law_is_not_doubted(noise):
    found = found_in(pushed(square=0.08, cube=0.0, noise=noise))
    assert set(found.terms(0)) == {"u", "push", "|u| u"}
    assert found.judged[0].law
    assert found.judged[0].whole


def test_residuals_are_tested_with_much_noise_and_not_without_terms_outside():
    # half as much noise as motion
    states = pushed(square=0.0, cube=0.05, noise=0.5, seed=2)
    (judged,) = found_in(states, members=10).judged
    assert 0.0 <= judged.outside <= 1.0
    one = polynomial(("u",))
    untested = discover(TIME, states, names=("u",), candidates=one, members=5)
    assert np.isnan(untested.judged[0].outside)
    assert not untested.judged[0].whole


@pytest.mark.parametrize("memory", [0.0, 1.0])
def test_there_is_no_law_in_noise_or_in_a_walk(memory):
    steps = np.random.default_rng(0).standard_normal(TIME.shape)
    states = np.cumsum(steps) if memory else steps
    found = found_in(states[:, None])
    assert not (found.terms(0) and found.judged[0].law)


def test_a_decay_without_a_push_is_foretold_better_than_by_its_start():
    drawn = np.random.default_rng(0).standard_normal(TIME.shape)
    states = 3.0 * np.exp(-0.3 * TIME) + 0.01 * drawn
    found = discover(TIME, states[:, None], names=("u",), members=20)
    assert found.terms(0) == ("u",)
    # noise and coefficient are 1 % and less: next to nothing of the miss stays
    assert found.judged[0].skill > 0.99


def test_the_share_of_residuals_that_terms_outside_explain_is_counted_as_by_hand():
    rng = np.random.default_rng(0)
    terms, outside = rng.standard_normal((40, 2)), rng.standard_normal((40, 3))
    left = terms @ [1.0, -2.0] + 0.1 * rng.standard_normal(40) + 0.2 * outside[:, 1]
    kept = np.ones((1, 2), bool)
    (share,), likest = outside_share(terms, left[:, None], kept, outside)
    over, rest = (
        np.sum((left - by @ np.linalg.lstsq(by, left)[0]) ** 2)
        for by in (terms, np.column_stack([terms, outside]))
    )
    assert share == pytest.approx(np.log((over - rest) / np.sum(left**2)))
    assert likest == [1]


def test_one_more_of_the_members_is_unlikely_as_often_as_said():
    rng = np.random.default_rng(0)
    p = np.array(
        [unlikely(drawn[0], drawn[1:]) for drawn in rng.standard_normal((2000, 11, 3))]
    )
    # binomial: 6000 numbers, p = 0.05, three standard errors
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=3.0 * 0.0028)


def test_smoothing_is_the_natural_spline_that_scipy_finds():
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.5, 1.5, 90))
    states = (np.sin(time / 9.0) + 0.1 * rng.standard_normal(90))[:, None]
    curve = smoothed(time, states)
    unit = np.mean(np.diff(time))
    between = np.linspace(time[0], time[-1], 400)
    misses = [
        np.max(
            np.abs(
                make_smoothing_spline(time / unit, states[:, 0], lam=penalty)(
                    between / unit
                )
                - curve.curves.at(between)[:, 0]
            )
        )
        for penalty in np.logspace(-1.0, 12.0, 27)
    ]
    assert min(misses) < 1e-8  # one of the penalties tried is the one it took


@pytest.mark.slow
def test_intervals_hold_the_truth_in_nine_of_ten_noisy_records():
    rows = [held(("motor", 0.03, seed)).values() for seed in range(30)]
    inside = [within for row in rows for one in row for within in one.values()]
    # 30 records of two numbers that move together: three standard errors of 0.9
    assert np.mean(inside) >= 0.9 - 3.0 * np.sqrt(0.09 / 30)
