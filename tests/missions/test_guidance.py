"""The set point along its legs, for a vehicle that is always where it should be."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.missions import planned_seconds
from jblast.missions.guidance import CALIBRATE_S, ENDED, FLYING, IDLE_S, point_on
from jblast.vehicle import State
from tests.missions.missions import LAND, UP, mission

PERIOD = 0.004
ROWS = 20_000
CORNERS = (
    UP,
    (16, (30, 0, 6), {}),
    (16, (30, 20, 9), {}),
    (16, (10, 25, 9), {"p1": 1.5}),
    (16, (30, 25.5, 9), {}),
    (18, (0, 20, 9), {"p1": 1.25, "p3": 8}),
    (16, (0, 0, 9), {"p4": 90}),
    LAND,
)


@jax.jit
def ideal(guidance, period):
    """Phase, leg, set point, velocity, acceleration, heading at each turn."""

    def turn(now, _):
        place = guidance.set_point(now)
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


def test_legs_follow_each_other_without_a_gap():
    legs = mission(*CORNERS).guidance.legs
    ends = [
        point_on(legs, jnp.asarray(n), legs.length_m[n]) for n in range(legs.count - 1)
    ]
    for n, (place, way, _) in enumerate(ends):
        begin, onward, _ = point_on(legs, jnp.asarray(n + 1), jnp.asarray(0.0))
        np.testing.assert_allclose(place, begin, atol=1e-9)
        if not legs.waits[n] and legs.end_speed_m_s[n] > 0.01:
            np.testing.assert_allclose(way, onward, atol=1e-9)


def test_phases_come_in_order_and_the_mission_ends_when_it_was_planned_to(flown):
    one, (phase, leg, *_) = flown
    assert phase[0] == 0
    assert (np.diff(phase) >= 0).all()
    assert (np.diff(leg) >= 0).all()
    begin = np.argmax(phase == FLYING) * PERIOD
    assert math.isclose(begin, CALIBRATE_S + IDLE_S, abs_tol=3 * PERIOD)
    end = np.argmax(phase == ENDED) * PERIOD
    # the plan counts the landing down to where the set point would stop, 3 m deeper
    planned = planned_seconds(one.guidance.legs, 2.0)
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
    # along and across together, sqrt(2) of the limit at most
    assert np.linalg.norm(acceleration, axis=1).max() < 2.0 * math.sqrt(2) + 1e-6
    # what is said of the velocity is what the place does
    mean = (velocity[1:] + velocity[:-1])[flies[:-1] & flies[1:]] / 2
    np.testing.assert_allclose(step, mean, atol=3.0 * PERIOD)


def test_each_waypoint_is_passed_within_its_radius_and_holds_are_kept(flown):
    one, (_, _, place, *_) = flown
    for n, stop in enumerate(one.stops[:4]):
        off = np.linalg.norm(place - stop.goal_m, axis=1).min()
        assert off < (1e-6 if n in (0, 3) else 0.55 * stop.acceptance_m)
    held = np.linalg.norm(place - one.stops[3].goal_m, axis=1) < 1e-4
    assert math.isclose(held.sum() * PERIOD, 1.5, abs_tol=0.05)


def test_turns_are_clockwise_about_their_middle(flown):
    one, (_, leg, place, *_) = flown
    legs = one.guidance.legs
    circle = int(np.argmax(np.asarray(legs.visit) == 5)) + 1
    around = place[leg == circle] - one.stops[5].goal_m
    np.testing.assert_allclose(np.linalg.norm(around[:, :2], axis=1), 8, atol=1e-6)
    angle = np.unwrap(np.arctan2(around[:, 1], around[:, 0]))
    assert math.isclose(angle[-1] - angle[0], -2.5 * math.pi, abs_tol=1e-3)


def test_the_heading_turns_to_what_a_waypoint_says(flown):
    yaw = flown[1][-1]
    assert (np.abs(np.diff(yaw)) <= math.radians(45) * PERIOD + 1e-12).all()
    assert yaw[0] == 0.0
    north = mission(UP, (16, (9, 0, 6), {"p4": 0}), LAND)
    turned = ideal(north.guidance, jnp.asarray(PERIOD))[-1]
    assert float(turned[-1]) == pytest.approx(math.pi / 2)
