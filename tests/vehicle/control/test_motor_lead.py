"""Motors that are led: as quick ones until they saturate, in loops as in flight."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import PositionHold, named, named_gains
from jblast.vehicle.control.allocation import lead_compensated
from jblast.vehicle.control.stability import chains, growth, hold_margins
from tests.vehicle.flights import at_hover

LEAD = 3.0


def gains_with(lead):
    return replace(named_gains("crazyflie", integral=True), motor_lead=lead)


def test_a_led_motor_is_asked_for_more_than_is_wanted_within_its_limits():
    vehicle = named("crazyflie")
    turns = jnp.array([1000.0, 1000.0, 2400.0, 100.0])
    wanted = jnp.array([1100.0, 900.0, 2500.0, 0.0])
    asked = lead_compensated(vehicle, jnp.asarray(LEAD), turns, wanted)
    fast = float(vehicle.rotor_speed_max_rad_s)
    np.testing.assert_allclose(asked, [1300.0, 700.0, fast, 0.0])


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
