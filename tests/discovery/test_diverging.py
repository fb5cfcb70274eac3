"""Laws whose trajectories diverge: unstable limit cycles and chaos."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jblast.discovery.equations import discover
from jblast.discovery.sparse_regression import polynomial
from jblast.report.discovery import discovery_view
from jblast.report.view import terminal


def noisy(slope, start, length: float, rows: int, noise: float, *, back=False):
    """Return times and a noisy trajectory, in reversed order if `back`."""
    time = np.linspace(0.0, length, rows)
    states = solve_ivp(
        lambda _, x: slope(*x), time[[0, -1]], start, t_eval=time, rtol=1e-9, atol=1e-9
    ).y.T
    states = states[::-1] if back else states
    drawn = np.random.default_rng(0).standard_normal(states.shape)
    return time, states + noise * np.std(states, axis=0) * drawn


def van_der_pol(x, y):
    return [y, (1.0 - x**2) * y - x]


def lorenz(x, y, z):
    return [10.0 * (y - x), x * (28.0 - z) - y, x * y - 8.0 / 3.0 * z]


def found_in(time, states, degree: int):
    names = tuple("xyz"[: states.shape[1]])
    candidates, outside = (polynomial(names, n) for n in (degree, degree + 1))
    return discover(
        time, states, names=names, candidates=candidates, outside=outside, members=5
    )


def near(found, state: int, truth: dict[str, float], rel: float) -> None:
    assert set(found.terms(state)) == set(truth)
    for term, value in truth.items():
        place = found.candidates.names.index(term)
        assert found.coefficients[state, place] == pytest.approx(value, rel=rel)


@pytest.mark.slow
def test_equations_of_an_unstable_limit_cycle_are_certain():
    # three turns of the limit cycle in reversed time, which is unstable
    time, states = noisy(van_der_pol, [2.0, 0.0], 18.0, 240, 0.01, back=True)
    found = found_in(time, states, 3)
    near(found, 0, {"y": -1.0}, 0.02)
    near(found, 1, {"x": 1.0, "y": -1.0, "x^2 y": 1.0}, 0.03)
    # an error grows by exp(2 pi) in a turn of 6.7 s
    assert found.growth_s == pytest.approx(6.66 * np.log(10.0) / 6.3, rel=0.5)
    assert found.certain
    text = terminal(discovery_view(found))
    assert "restarted as errors grow tenfold in " in text


def test_a_decay_from_an_unstable_limit_cycle_is_certain():
    time, states = noisy(van_der_pol, [0.003, 0.0], 15.0, 300, 0.02, back=True)
    found = found_in(time, states, 3)
    near(found, 1, {"x": 1.0, "y": -1.0, "x^2 y": 1.0}, 0.05)
    assert found.certain


@pytest.mark.slow
def test_equations_of_chaos_are_certain():
    time, states = noisy(lorenz, [1.0, 1.0, 20.0], 4.0, 480, 0.01)
    found = found_in(time, states, 2)
    near(found, 0, {"x": -10.0, "y": 10.0}, 0.03)
    near(found, 1, {"x": 28.0, "y": -1.0, "x z": -1.0}, 0.15)
    near(found, 2, {"z": -8.0 / 3.0, "x y": 1.0}, 0.03)
    assert found.certain


@pytest.mark.slow
def test_chaos_with_a_hidden_state_is_no_law():
    time, states = noisy(lorenz, [1.0, 1.0, 20.0], 4.0, 480, 0.01)
    assert not found_in(time, states[:, :2], 2).certain
