"""Margins of the hold: closed forms, polynomials, and flights at their edge."""

import dataclasses
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import Gains, PositionHold, named, named_gains
from jblast.vehicle.control.allocation import lead_compensated
from jblast.vehicle.control.stability import LOOPS, chains, growth, hold_margins
from tests.vehicle.flights import at_hover

HEADING = LOOPS.index("heading")


def simple(rate):
    none = jnp.zeros(3)
    return Gains(none, none, attitude=0.0, body_rate=rate, integral=none)


def test_an_integral_with_a_lag_has_the_phase_margin_of_the_closed_form():
    # |k / w| = sqrt(1 + (w tau)^2)
    k, tau, late = 20.0, 0.05, 0.003
    squared = (-1 + np.sqrt(1 + 4 * (k * tau) ** 2)) / (2 * tau**2)
    w = np.sqrt(squared)
    expected = np.degrees(np.pi / 2 - np.arctan(w * tau) - w * late)
    margins = hold_margins(simple(k), tau, late)
    assert float(margins.phase_deg[HEADING]) == pytest.approx(expected, abs=1e-3)


def test_an_integral_that_is_late_has_the_gain_margin_of_the_closed_form():
    # of k e^{-sT} / s: pi / (2 k T)
    margins = hold_margins(simple(20.0), 1e-9, 0.01)
    expected = 20 * np.log10(np.pi / (2 * 20.0 * 0.01))
    assert float(margins.up_db[HEADING]) == pytest.approx(expected, abs=1e-4)
    assert np.isinf(margins.down_db[HEADING])


def test_a_loop_whose_answer_shrinks_by_its_margin_has_a_root_on_the_axis():
    gains, lag = named_gains("iris", integral=True), 0.0125
    margins = hold_margins(gains, lag, 0.0)
    k_r, k_w = float(gains.attitude), float(gains.body_rate)
    k_p, k_d, k_i = (
        float(x[0]) for x in (gains.position, gains.velocity, gains.integral)
    )
    share = 10 ** (-float(margins.down_db[0]) / 20)
    back = share * np.array([k_w, k_r, k_r * k_d, k_r * k_p, k_r * k_i])
    roots = np.roots([lag, 1.0, *back])
    # the pair nearest to swinging for ever
    slowest = roots[np.argmax(roots.real)]
    assert abs(slowest.real) < 1e-4 * abs(slowest)


def test_distance_is_what_one_plus_the_loop_is_at_its_least():
    lag, late = 0.0125, 0.002
    gains = named_gains("iris", integral=True)
    s = 1j * np.geomspace(0.1, 1e3, 200_001)
    loop = np.exp(-late * s) / (lag * s + 1) * (20 / s + 150 / s**2)
    distance = hold_margins(gains, lag, late).distance[HEADING]
    assert float(distance) == pytest.approx(np.abs(1 + loop).min(), rel=1e-5)


def test_margins_have_the_slopes_of_differences():
    gains = named_gains("iris", integral=True)

    def of(by):
        changed = dataclasses.replace(
            gains,
            position=gains.position * by[0],
            velocity=gains.velocity * by[1],
            integral=gains.integral * by[2],
            attitude=gains.attitude * by[3],
            body_rate=gains.body_rate * by[4],
        )
        margins = hold_margins(changed, 0.0125, 0.004)
        return jnp.stack([margins.up_db[0], margins.down_db[0], margins.phase_deg[0]])

    slopes = jax.jit(jax.jacfwd(of))(jnp.ones(5))
    of, width = jax.jit(of), 0.02
    for n, step in enumerate(width * np.eye(5)):
        difference = (of(1 + step) - of(1 - step)) / (2 * width)
        np.testing.assert_allclose(slopes[:, n], difference, rtol=0.02, atol=0.02)


LEAD = 3.0


def gains_with(lead):
    return replace(named_gains("crazyflie", integral=True), motor_lead=lead)


def test_a_hold_with_a_lead_asks_for_what_it_would_without_one_led():
    vehicle = named("crazyflie")
    state = at_hover(vehicle, velocity_m_s=np.array([0.2, 0.1, -0.1]))

    def asked(lead):
        hold = PositionHold([0.0, 0.0, 5.0], gains_with(lead))
        return hold(jnp.zeros(()), state, vehicle, jnp.zeros(3), jnp.asarray(0.01))[0]

    lead, turns = jnp.asarray(LEAD), state.rotor_speed_rad_s
    expected = lead_compensated(vehicle, lead, turns, asked(None))
    np.testing.assert_allclose(asked(lead), expected, rtol=1e-12)
    assert float(jnp.abs(expected - asked(None)).max()) > 1.0


def test_a_led_loop_grows_as_one_with_quick_motors():
    lag, step = 0.072, 1e-5
    found = growth(chains(gains_with(LEAD), lag)[1:], step, 1)
    expected = growth(chains(gains_with(None), lag / LEAD)[1:], step, 1)
    assert found < 1
    # the rest is of the second order in the step over the lag
    assert np.log(found) == pytest.approx(np.log(expected), rel=1e-3)


def test_the_inner_loop_alone_has_the_phase_margin_of_its_closed_form():
    # (lead - 1) / (tau s + 1): |L| = 1 at tau w = sqrt((lead - 1)^2 - 1)
    gains = jax.tree.map(jnp.zeros_like, gains_with(jnp.asarray(LEAD)))
    gains = replace(gains, motor_lead=jnp.asarray(LEAD))
    crossing = np.sqrt((LEAD - 1) ** 2 - 1)
    late = 0.004
    expected = 180 - np.degrees(np.arctan(crossing) + crossing / 0.072 * late)
    margins = hold_margins(gains, 0.072, late)
    np.testing.assert_allclose(margins.phase_deg, expected, atol=1e-3)
