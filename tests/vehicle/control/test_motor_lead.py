"""Motors that are led: as quick ones until they saturate, in loops as in flight."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.vehicle import Gust, PositionHold, named, named_gains, simulate
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


@pytest.mark.slow  # a flight of each; by default its loops alone
def test_near_hover_a_led_vehicle_flies_as_one_with_quick_motors():
    vehicle = named("crazyflie")
    quick = replace(vehicle, motor_lag_s=vehicle.motor_lag_s / LEAD)
    paths = {
        name: simulate(
            each,
            at_hover(vehicle),
            duration_s=1.0,
            step_s=5e-4,
            control=PositionHold([0.0, 0.0, 5.0], gains_with(jnp.asarray(lead))),
            wind=Gust(np.array([0.2, 0.1, 0.05]), 0.1),
            store_every=20,
        ).position_m
        for name, each, lead in (
            ("led", vehicle, LEAD),
            ("quick", quick, 1.0),
            ("slow", vehicle, 1.0),
        )
    }
    apart = jnp.abs(paths["led"] - paths["quick"]).max()
    slower = jnp.abs(paths["slow"] - paths["quick"]).max()
    # the speed fed back is held over a step, 2 % of the shortened lag
    assert float(apart) < 0.03 * float(slower)


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
