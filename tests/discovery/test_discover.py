import numpy as np
import pytest
from scipy.integrate import solve_ivp

from calibration.discovery import drag_case, motor_case, noisy_states
from jblast.discovery.equations import (
    basic_interval,
    discover,
    interval_level,
    misfit,
)
from jblast.discovery.prediction import flow, restarts
from jblast.discovery.record import half_width, smoothed, trajectory_record, windows
from jblast.discovery.sparse_regression import polynomial
from jblast.errors import InputError
from jblast.report.discovery import discovery_view
from jblast.report.view import terminal

TIME = np.linspace(0.0, 10.0, 401)
ALL = slice(0, 401)


@pytest.fixture(scope="module")
def drag():
    return drag_case()


def pendulum(noise: float = 0.0, damping: float = 0.2) -> np.ndarray:
    """Return angle and rate of x'' = -4 x - damping x'."""
    flow = solve_ivp(
        lambda t, y: [y[1], -4.0 * y[0] - damping * y[1]],
        (0.0, 10.0),
        [1.0, 0.0],
        t_eval=TIME,
        rtol=1e-9,
        atol=1e-9,
    )
    drawn = np.random.default_rng(0).standard_normal(flow.y.T.shape)
    return flow.y.T + noise * drawn


def found_in_case(case, noise: float, seed: int = 0, members: int = 12):
    return discover(
        case.time_s,
        noisy_states(case, noise, seed),
        case.inputs,
        names=case.names,
        candidates=case.candidates,
        held=case.held,
        members=members,
    )


def test_a_window_integrates_by_parts():
    time = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 60))
    cut = windows(time, 0.4)
    left = cut.derivative @ cut.time**3
    # three nodes a piece, eight pieces a window, whose ends cut pieces in two
    np.testing.assert_allclose(left, cut.integral @ (3.0 * cut.time**2), rtol=5e-4)


def test_windows_are_as_wide_as_the_motion_asks():
    angle = TIME * 2.0 * np.pi / 2.0  # five periods of 2 s
    value, slope = np.sin(angle)[:, None], np.pi * np.cos(angle)[:, None]
    assert half_width(TIME, value, slope) == pytest.approx(1.0 / np.pi, rel=0.01)


def test_smoothing_tells_the_noise():
    noise = 0.05 * np.random.default_rng(2).standard_normal(TIME.shape)
    sd = smoothed(TIME, (np.sin(TIME) + noise)[:, None]).noise_sd[0]
    assert sd == pytest.approx(0.05, rel=0.12)  # three standard errors of 401 rows


def test_products_and_signed_squares_of_columns():
    candidates = polynomial(("x", "y"), 2, signed_squares=True)
    assert candidates.names == (
        *("1", "x", "y", "x^2", "x y", "y^2"),
        *("|x| x", "|y| y"),
    )
    values = candidates.evaluate(np.array([[-2.0, 3.0]]))
    np.testing.assert_array_equal(values, [[1, -2, 3, 4, -6, 9, -4, 9]])


def test_a_damped_pendulum_is_found():
    found = discover(TIME, pendulum(0.01), names=("x", "rate"), members=15)
    assert found.terms(0) == ("rate",)
    assert found.terms(1) == ("x", "rate")
    # noise of 1 % over 100 windows that do not overlap much
    assert found.coefficients[1, 1] == pytest.approx(-4.0, rel=0.01)
    assert found.coefficients[1, 2] == pytest.approx(-0.2, rel=0.1)
    assert np.all(found.low <= found.coefficients)
    assert np.all(found.coefficients <= found.high)
    np.testing.assert_allclose(found.noise_sd, 0.01, rtol=0.15)
    text = terminal(discovery_view(found))
    assert "88 % interval" in text  # the least and the greatest of 15: 14/16


@pytest.mark.parametrize("members", [4, 9, 18, 19, 100])
def test_an_interval_holds_one_more_number_as_often_as_its_level_says(members):
    drawn = np.random.default_rng(0).standard_normal((members + 1, 20_000))
    low, high = basic_interval(np.zeros(20_000), drawn[1:])
    held = np.mean((low <= -drawn[0]) & (-drawn[0] <= high))
    level = interval_level(members)
    assert level == (0.9 if members >= 19 else (members - 1) / (members + 1))
    # binomial, four standard errors
    assert held == pytest.approx(level, abs=4.0 * np.sqrt(level * (1 - level) / 20_000))


@pytest.mark.slow
def test_the_drag_of_a_vehicle_is_found(drag):
    case = drag
    found = found_in_case(case, 0.01)
    for state, (name, truth) in enumerate(case.truth.items()):
        assert set(found.terms(state)) == set(truth), name
        for term, value in truth.items():
            place = found.candidates.names.index(term)
            # the frame's drag is a fifth of the rotors': 1 % of noise makes it 3 %
            assert found.coefficients[state, place] == pytest.approx(value, rel=0.05)
    assert found.reproduced == (True, True)
    assert found.exchangeable == ((), ())


@pytest.mark.slow
def test_held_inputs_need_to_be_said():
    case = motor_case()
    held = found_in_case(case, 0.0)
    linear = discover(
        case.time_s,
        case.states,
        case.inputs,
        names=case.names,
        candidates=case.candidates,
        members=5,
    )
    truth = 1.0 / 0.072
    error = [abs(f.coefficients[0, 2] / truth - 1.0) for f in (held, linear)]
    assert error[0] < 1e-3 < error[1]
    assert held.terms(0) == ("speed", "command")


def test_so_much_noise_that_terms_are_lost_is_no_certainty(drag):
    found = found_in_case(drag, 0.3)
    assert "|U| u" not in found.terms(0)
    assert np.any((found.inclusion > 0.0) & (found.inclusion < 1.0))


def test_a_term_that_repeats_another_is_left_out_and_named():
    time = np.linspace(0.0, 3.0, 201)
    falling = (10.0 * np.exp(-0.5 * time))[:, None]
    names = ("u",)
    found = discover(
        time,
        falling,
        names=names,
        candidates=polynomial(names, 2, signed_squares=True),
        members=5,
    )
    assert found.repeated == ("|u| u",)
    assert found.terms(0) == ("u",)


def test_a_candidate_that_overflows_is_named():
    names = ("x", "rate")
    with pytest.raises(InputError, match=r"term x\^3"):
        discover(
            TIME,
            1e120 * pendulum(),
            names=names,
            candidates=polynomial(names, 3),
            members=5,
        )


def test_equations_that_run_away_are_given_up():
    states = np.exp(0.3 * TIME)[:, None]
    record = trajectory_record(TIME, states, np.empty((401, 0)))
    made = flow(record, polynomial(("x",), 1).evaluate, np.array([[0.0, 12.0]]), ALL)
    assert made[0] == pytest.approx(1.0, rel=1e-3)
    assert np.isnan(made[-1, 0])
    assert misfit(made, states, 0.0) == np.inf


def test_errors_grow_tenfold_where_they_should():
    record = trajectory_record(TIME, np.sin(TIME)[:, None], np.empty((401, 0)))
    # x' = a (x - 1): an error grows as exp(a t)
    for rate, every in ((0.5, np.log(10.0) / 0.5), (-0.5, None)):
        equation = np.array([[-rate, rate]])
        rows = restarts(record, polynomial(("x",), 1).evaluate, equation, ALL)
        expected = [] if every is None else [every, 2.0 * every]
        assert TIME[rows] == pytest.approx(expected, abs=0.06)


def driven() -> tuple[np.ndarray, np.ndarray]:
    """Return x of x' = -x / 2 + u, and u."""
    push = np.sin(1.3 * TIME) + 0.5 * np.cos(2.9 * TIME)
    flow = solve_ivp(
        lambda t, x: -0.5 * x + np.interp(t, TIME, push),
        (0.0, 10.0),
        [1.0],
        t_eval=TIME,
        rtol=1e-9,
        atol=1e-9,
    )
    return flow.y[0], push


def discovered(states, inputs, names):
    return discover(TIME, states, inputs, names=names, members=12)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.001, 0.03])
def test_collinear_states_are_exchangeable(noise):
    state, push = driven()
    both = np.stack([state, 2.0 * state], axis=1)
    both += noise * both.std(axis=0) * np.random.default_rng(5).normal(size=both.shape)
    found = discovered(both, push[:, None], ("x", "y", "push"))
    for pairs in found.exchangeable:
        assert {frozenset(pair) for pair in pairs} == {frozenset(("x", "y"))}
    assert not found.certain
    assert "x and y are exchangeable" in terminal(discovery_view(found)).replace(
        "y and x", "x and y"
    )


def test_collinear_inputs_are_exchangeable_unless_the_record_distinguishes_them():
    state, push = driven()
    noisy = state[:, None] + 0.01 * np.random.default_rng(6).normal(size=(401, 1))
    near, far = (1.5 * push + by * np.sin(7.0 * TIME) for by in (0.002, 0.3))
    found = discovered(noisy, np.stack([push, near], axis=1), ("x", "push", "pull"))
    assert {frozenset(pair) for pair in found.exchangeable[0]} == {
        frozenset(("push", "pull"))
    }
    apart = discovered(noisy, np.stack([push, far], axis=1), ("x", "push", "pull"))
    assert apart.terms(0) == ("x", "push")
    assert apart.exchangeable == ((),)
