"""What a plan asks for, in the order in which it is flown; what cannot be."""

import dataclasses
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.missions import (
    Item,
    Mission,
    MissionControl,
    Plan,
    grid_plan,
    mission_of,
    orbit_plan,
)
from jblast.missions.route import geodetic, level
from jblast.observations.places import Frame
from jblast.scene import Place
from jblast.vehicle import (
    PositionHold,
    State,
    named,
    named_gains,
    simulate,
)
from tests.missions.missions import HOME, LAND, UP, item, mission, plan


def goals(one):
    return [tuple(np.round(stop.goal_m, 3) + 0.0) for stop in one.stops]


def test_a_return_climbs_flies_home_and_lands_slowly():
    one = mission(UP, (16, (40, 0, 6), {}), (20,))
    assert goals(one) == [
        *((0, 0, 6), (40, 0, 6)),
        *((40, 0, 30), (0, 0, 30), (0, 0, 5), (0, 0, 0)),
    ]
    assert [stop.lands for stop in one.stops] == [False] * 5 + [True]
    assert [stop.limits.descent_m_s for stop in one.stops[-2:]] == [1.5, 0.7]


def test_jumps_are_unrolled_and_speeds_are_carried_along():
    one = mission(
        UP,
        (178, None, {"p1": 1, "p2": 3.0}),
        (16, (10, 0, 6), {}),
        (16, (10, 10, 6), {"p2": 2.5}),
        (178, None, {"p1": 1, "p2": 8.0}),
        (177, None, {"p1": 3, "p2": 2}),
        LAND,
    )
    stops = one.stops
    assert [s.item for s in stops] == [0, 2, 3, 2, 3, 2, 3, 6, 6, 6]
    assert [s.limits.speed_m_s for s in stops[:4]] == [5.0, 3.0, 3.0, 8.0]
    assert [s.limits.acceptance_m for s in stops[:3]] == [1.0, 1.0, 2.5]


def test_heights_above_the_sea_and_above_home_are_told_apart():
    # 10: above the terrain, which is level
    low = replace(item(2, 16, (20, 0, 6)), frame=10)
    high = item(3, 16, (0, 20, 6))
    high = type(high)(3, 16, 0, (*high.params[:6], 215.0))
    items = (plan(UP).items[0], low, high, item(4, 20))
    assert [stop[2] for stop in goals(mission_of(Plan(items, HOME)))[1:3]] == [6, 15]
    # of a scene with a place of its own, home lies elsewhere
    other = mission_of(Plan(items, HOME), place=Place(35.3075, -80.7364, 200.0))
    np.testing.assert_allclose(other.home_m, (100, 0, 0), atol=0.2)
    assert [stop[2] for stop in goals(other)[1:3]] == [6, 15]


def here(number: int, command: int, up: float = 0.0, **params: float) -> Item:
    """An item at latitude and longitude 0."""
    one = item(number, command, (0, 0, up), params)
    return replace(one, params=(*one.params[:4], 0.0, 0.0, float(up)))


def test_zero_latitude_and_longitude_are_the_present_position():
    items = (
        here(1, 22, 20),
        item(2, 16, (40, 0, 25)),
        here(3, 16, 0),
        here(4, 19, 30, p1=2),
        here(5, 18, p1=0.5, p3=5),
        here(6, 21),
    )
    one = mission_of(Plan(items, HOME))
    assert goals(one)[:4] == [(0, 0, 20), (40, 0, 25), (40, 0, 25), (40, 0, 30)]
    # half a turn begins at the northernmost point of its circle, ends at the opposite
    # one, and the vehicle lands there
    turn = [
        goal for goal, stop in zip(goals(one), one.stops, strict=True) if stop.item == 4
    ]
    assert (turn[0], turn[-1]) == ((40, 5, 30), (40, -5, 30))
    assert goals(one)[-2:] == [(40, -5, 5), (40, -5, 0)]


def test_delays_and_turns_are_flown_and_ignored_commands_are_not():
    one = mission(
        (115, None, {"p1": 90}),
        (2000, None, {}),
        UP,
        (93, None, {"p1": 7.5, "p2": -1, "p3": -1, "p4": -1}),
        (115, None, {"p1": 180, "p2": 30, "p3": 1, "p4": 1}),
        (16, (20, 0, 6), {"p4": 0}),
        (115, None, {"p1": 30, "p3": -1, "p4": 1}),
        LAND,
        (2001, None, {}),
    )
    assert [stop.item for stop in one.stops] == [2, 3, 5, 7, 7, 7]
    assert (one.stops[1].hold_s, goals(one)[1]) == (7.5, (0, 0, 6))
    yaws = np.degrees([stop.yaw_rad for stop in one.stops])
    # from east, counter-clockwise: 0 is east, 180 west, 210 is 30 left of it
    np.testing.assert_allclose(yaws % 360, [0, 0, 180, 210, 210, 210], atol=1e-9)


FAR = (16, (30e3, 0, 6), {})
REFUSED = {
    "empty": ([], "nothing to fly"),
    "in the air": ([(16, (9, 0, 6), {}), LAND], "item 1, waypoint.*starts in the air"),
    "no end": ([UP, (16, (9, 0, 6), {})], "landing .21. or a return .20."),
    "after the end": (
        [UP, LAND, (16, (9, 0, 6), {})],
        "item 3, waypoint.*expected no item",
    ),
    "far": ([UP, FAR, LAND], "item 2, waypoint.*within 20 km.*one 30 km away"),
    "below": ([UP, (16, (9, 0, -6), {}), LAND], "-6 m above the ground: unreachable"),
    "high": (
        [UP, (16, (9, 0, 5e3), {}), LAND],
        "item 2.*at most 4000 m.* 5000 m above the ground",
    ),
    "jump to nowhere": ([UP, (177, None, {"p1": 9, "p2": 1}), LAND], "1 to 3, got 9"),
    "jumps for ever": ([UP, (177, None, {"p1": 1, "p2": -1}), LAND], "without end"),
    "nothing but jumps": (
        [UP, (177, None, {"p1": 2, "p2": 10**6}), LAND],
        "at most 5,000 items",
    ),
    "no speed": ([UP, (178, None, {"p1": 1, "p2": 0}), LAND], "0.05 to 60 m/s"),
    "time of day": ([UP, (93, None, {"p1": -1, "p2": 9}), LAND], "a time of day"),
    "sense": ([UP, (115, None, {"p1": 9, "p3": 2}), LAND], "parameter 3.*-1, 0, 1"),
    "hold": ([UP, (16, (9, 0, 6), {"p1": -2}), LAND], "parameter 1: expected 0 or"),
}


@pytest.mark.parametrize(("rows", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_flown_says_why(rows, said):
    with pytest.raises(InputError, match=said):
        mission(*rows)


def test_a_home_or_a_start_above_the_ground_is_refused():
    with pytest.raises(InputError, match=r"alt_m 150, got one 50 m.*in the air"):
        mission(UP, LAND, place=Place(35.3075, -80.7353, 150.0))
    with pytest.raises(InputError, match=r"one 3 m above.*in the air"):
        mission(UP, LAND, position_m=np.array([0, 0, 3.0]))
    items = plan(UP, LAND).items
    stays = type(items[0])(1, 22, 3, items[0].params, auto_continue=False)
    with pytest.raises(InputError, match="autoContinue"):
        mission_of(Plan((stays, items[1]), HOME))


def places(plan):
    frame = Frame(*plan.home)
    points = [one for one in plan.items if one.command in (16, 18)]
    return np.array(
        [
            level(frame, one.number_of(5), one.number_of(6), HOME.alt_m + one.params[6])
            for one in points
        ]
    )


def test_lanes_cover_a_field_and_turn_about():
    plan = grid_plan(HOME, width_m=60.0, depth_m=20.0, spacing_m=10.0, up_m=15.0)
    want = [(-30, -10), (30, -10), (30, 0), (-30, 0), (-30, 10), (30, 10)]
    assert [one.command for one in plan.items] == [22, *[16] * 6, 20]
    np.testing.assert_allclose(places(plan)[:, :2], want, atol=2e-4)  # 1e-9 degree
    np.testing.assert_allclose(places(plan)[:, 2], 15)


def test_an_orbit_is_about_its_middle():
    plan = orbit_plan(HOME, radius_m=-20.0, turns=2.0, up_m=15.0, centre_m=(50.0, 5.0))
    np.testing.assert_allclose(places(plan)[0], (50, 5, 15), atol=2e-4)
    assert plan.items[1].params[:3] == (2, 0, -20)


def test_places_on_earth_and_level_places_are_each_others_inverse():
    frame = Frame(*HOME)
    there = np.array([[0.0, 0, 0], [3000, -4000, 120], [-15000, 9000, 40]])
    earth = geodetic(frame, there)
    np.testing.assert_allclose(earth[:, 2], there[:, 2] + 200)
    np.testing.assert_allclose(level(frame, *earth.T), there, atol=1e-3)
    # a degree of latitude on the meridian, WGS84 at 35.3 degrees: 110.95 km
    north = level(frame, HOME.lat_deg + 0.01, HOME.lon_deg, 200.0)
    assert math.isclose(north[1], 1109.5, abs_tol=0.5)


STEP, SECONDS = 0.002, 40.0
ROWS = (UP, (16, (6, 0, 6), {}), (16, (6, 5, 6), {"p1": 1.0}), LAND)


def control_of(one: Mission, model: str) -> MissionControl:
    return MissionControl(
        one.guidance, PositionHold(jnp.zeros(3), named_gains(model, integral=True))
    )


def standing(*batch: int) -> State:
    def none(size: int):
        return jnp.zeros((*batch, size))

    return State(none(3), none(3), none(4).at[..., 3].set(1.0), none(3), none(4))


def flown(control, model="iris", state=None, **options):
    return simulate(
        named(model),
        standing() if state is None else state,
        duration_s=SECONDS,
        step_s=STEP,
        control=control,
        ground_up_m=0.0,
        **options,
    )


@pytest.mark.slow
def test_a_batch_flies_plans_of_different_lengths_as_each_alone():
    many = [mission(*ROWS), mission(UP, LAND)]
    count = max(one.guidance.legs.count for one in many)
    alike = [
        dataclasses.replace(one.guidance, legs=one.guidance.legs.padded(count))
        for one in many
    ]

    guidance = jax.tree.map(lambda *x: jnp.stack(x), *alike)
    hold = control_of(many[0], "iris").hold
    holds = jax.tree.map(lambda x: jnp.stack([x, x]), hold)
    together = flown(
        MissionControl(guidance, holds), state=standing(2), store_every=500
    )
    for n, one in enumerate(many):
        alone = flown(control_of(one, "iris"), store_every=500)
        np.testing.assert_allclose(together.position_m[n], alone.position_m, atol=1e-6)
        # it stands where it landed, and its rotors stand
        np.testing.assert_allclose(alone.position_m[-1], (0, 0, 0), atol=0.05)
        assert np.abs(alone.rotor_speed_rad_s[-1]).max() < 1.0
