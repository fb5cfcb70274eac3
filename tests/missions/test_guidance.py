"""The set point along its legs, for a vehicle that is always where it should be."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.missions import planned_seconds
from jblast.missions.guidance import CALIBRATE_S, ENDED, FLYING, IDLE_S
from jblast.vehicle import State
from tests.missions.missions import LAND, UP, mission

PERIOD = 0.004
ROWS = 20_000
CORNERS = (
    UP,
    (16, (30, 0, 6), {}),
    (16, (30, 20, 9), {}),
    (16, (10, 25, 9), {"p1": 1.5}),
    # a reversal in the air, with and without a stop
    (16, (30, 25.5, 9), {}),
    (16, (20, 25.25, 9), {}),
    (18, (0, 20, 9), {"p1": 1.25, "p3": 8}),
    (16, (0, 0, 9), {"p4": 90}),
    LAND,
)


@jax.jit
def ideal(guidance, period):
    """Phase, leg, set point, velocity, acceleration, heading at each turn."""

    def turn(now, _):
        place = guidance.legs.at(now.leg, now.along_m)[0]
        there = State(
            # it rests on the ground as soon as it is there
            place.at[2].max(0.0),
            jnp.zeros(3),
            jnp.array([0, 0, 0, 1.0]),
            jnp.zeros(3),
            jnp.zeros(4),
        )
        aim, after = guidance(there, now, period)
        return after, (now.phase, now.leg, *aim, now.yaw_rad)

    return jax.lax.scan(turn, guidance.start(), length=ROWS)[1]


@pytest.fixture(scope="module")
def flown():
    one = mission(*CORNERS)
    told = ideal(one.guidance, jnp.asarray(PERIOD))
    return one, [np.asarray(x) for x in told]


def test_legs_follow_each_other_without_a_gap_and_without_a_kink_but_at_stops():
    legs = mission(*CORNERS).guidance.legs
    number = jnp.arange(legs.count - 1)
    at = jax.vmap(legs.at)
    place, way, _ = at(number, legs.length_m[:-1])
    begin, onward, _ = at(number + 1, jnp.zeros(legs.count - 1))
    np.testing.assert_allclose(place, begin, atol=1e-9)
    kinks = np.linalg.norm(way - onward, axis=1) > 1e-9
    assert kinks.any()
    assert (np.asarray(legs.end_speed_m_s)[:-1][kinks] == 0).all()


def test_phases_come_in_order_and_the_mission_ends_when_it_was_planned_to(flown):
    one, (phase, leg, *_) = flown
    assert phase[0] == 0
    assert (np.diff(phase) >= 0).all()
    assert (np.diff(leg) >= 0).all()
    begin = np.argmax(phase == FLYING) * PERIOD
    assert math.isclose(begin, CALIBRATE_S + IDLE_S, abs_tol=3 * PERIOD)
    end = np.argmax(phase == ENDED) * PERIOD
    # the plan counts the landing down to where the set point would stop, 3 m deeper
    planned = planned_seconds(one.guidance)
    assert planned - 3.0 / 0.7 - 1.0 < end < planned + 0.1


def test_the_set_point_keeps_its_limits(flown):
    _, (phase, _, place, velocity, acceleration, _) = flown
    flies = phase == FLYING
    step = np.diff(place, axis=0)[flies[:-1] & flies[1:]] / PERIOD
    speed = np.hypot(*velocity.T[:2])
    assert np.hypot(*step.T[:2]).max() < 5.0 + 1e-6
    assert speed.max() == pytest.approx(5.0)
    assert step[:, 2].max() < 3.0 + 1e-6
    assert step[:, 2].min() > -1.5 - 1e-6
    # along and across together, twice the limit at most
    assert np.linalg.norm(acceleration, axis=1).max() < 4.0 + 1e-6
    # what is said of the velocity is what the place does
    mean = (velocity[1:] + velocity[:-1])[flies[:-1] & flies[1:]] / 2
    np.testing.assert_allclose(step, mean, atol=4.0 * PERIOD)


def test_each_waypoint_is_passed_within_its_radius_and_holds_are_kept(flown):
    one, (_, _, place, *_) = flown
    for n, stop in enumerate(one.stops[:5]):
        off = np.linalg.norm(place - stop.goal_m, axis=1).min()
        assert off < (1e-6 if n in (0, 3) else 0.51 * stop.limits.acceptance_m)
    held = np.linalg.norm(place - one.stops[3].goal_m, axis=1) < 1e-4
    assert math.isclose(held.sum() * PERIOD, 1.5, abs_tol=0.05)


def test_a_circle_is_round_clockwise_and_flown_at_the_speed_of_its_radius(flown):
    one, (_, leg, place, velocity, *_) = flown
    legs = one.guidance.legs
    own = np.flatnonzero(np.asarray(legs.visit) == 6)
    entry = own[np.argmax(np.asarray(legs.end_speed_m_s)[own] == 0)]
    rows = np.isin(leg, own[own > entry])
    around = place[rows] - (0, 20, 9)
    # corners of 10 degrees: 7e-6 of the radius
    np.testing.assert_allclose(np.linalg.norm(around[:, :2], axis=1), 8, rtol=1e-5)
    angle = np.unwrap(np.arctan2(around[:, 1], around[:, 0]))
    assert math.isclose(angle[-1] - angle[0], -2.5 * math.pi, abs_tol=1e-3)
    fastest = np.linalg.norm(velocity[rows], axis=1).max()
    assert math.isclose(fastest, math.sqrt(2 * 8), rel_tol=5e-3)


def test_the_heading_turns_to_what_a_waypoint_says(flown):
    yaw = flown[1][-1]
    assert (np.abs(np.diff(yaw)) <= math.radians(45) * PERIOD + 1e-12).all()
    assert yaw[0] == 0.0
    north = mission(UP, (16, (9, 0, 6), {"p4": 0}), LAND)
    turned = ideal(north.guidance, jnp.asarray(PERIOD))[-1]
    assert float(turned[-1]) == pytest.approx(math.pi / 2)


def test_the_place_of_the_set_point_has_a_gradient_by_the_acceleration(flown):
    one, _ = flown

    @jax.jit
    def place(rate):
        guidance = eqx.tree_at(lambda x: x.acceleration_m_s2, one.guidance, rate)
        return jnp.sum(ideal(guidance, jnp.asarray(PERIOD))[2][1000, 2])

    # it climbs for 1 s since the end of idling: half of it in metres
    assert float(jax.grad(place)(2.0)) == pytest.approx(0.5, abs=0.01)
