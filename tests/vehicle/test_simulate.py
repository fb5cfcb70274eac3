"""Batches, precision, loads and rows of a flight; metrics; what cannot be flown."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Commands,
    Gust,
    PositionHold,
    Trajectory,
    blast_load,
    named,
    named_gains,
    rollout,
    simulate,
)
from jblast.vehicle.metrics import flight_metrics
from jblast.vehicle.rollout import over_lanes, tick_of
from tests.vehicle.flights import at_hover, by_hand, tumbling

VEHICLE = named("crazyflie")
SHORT = {"duration_s": 0.05, "store_every": 10}


def batch_of(count):
    """Tumbling states side by side, each a little different."""
    one = tumbling(VEHICLE)
    rng = np.random.default_rng(3)
    return jax.tree.map(
        lambda x: jnp.asarray(x + 0.1 * rng.normal(size=(count, x.size))),
        jax.tree.map(np.asarray, one),
    )


def lane(state, *place):
    return jax.tree.map(lambda x: x[place], state)


@pytest.mark.slow
def test_axes_of_a_batch_stay_and_each_may_have_its_own_wind_and_vehicle():
    states = jax.tree.map(lambda x: x.reshape(2, 3, -1), batch_of(6))
    heavier = jax.vmap(jax.vmap(lambda m: dataclasses.replace(VEHICLE, mass_kg=m)))(
        0.03 + 0.001 * jnp.arange(6.0).reshape(2, 3)
    )
    blows = jnp.arange(18.0).reshape(2, 3, 3)
    gusts = jax.vmap(jax.vmap(lambda blow: Gust(blow, 0.01)))(blows)
    together = simulate(heavier, states, wind=gusts, **SHORT)
    assert together.position_m.shape == (2, 3, 11, 3)
    assert together.lost.shape == (2, 3)
    alone = simulate(
        lane(heavier, 1, 2),
        lane(states, 1, 2),
        wind=Gust(blows[1, 2], 0.01),
        **SHORT,
    )
    np.testing.assert_allclose(alone.position_m, together.position_m[1, 2], atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["jax", "warp:cpu"])
def test_a_vehicle_that_diverges_ends_its_own_flight_and_is_named(backend):
    states = batch_of(3)
    fast = states.velocity_m_s.at[1].set(1e200)
    states = eqx.tree_at(lambda s: s.velocity_m_s, states, fast)
    vehicle = named("hummingbird")  # quadratic drag: 1e400
    answer = simulate(vehicle, states, backend=backend, **SHORT)
    assert answer.lost.tolist() == [False, True, False]
    assert np.isfinite(answer.position_m[np.array([0, 2])]).all()
    assert np.isnan(answer.position_m[1, -1]).all()


@pytest.mark.slow
def test_rows_are_the_start_every_so_many_steps_and_the_end():
    state = tumbling(VEHICLE)
    every = simulate(VEHICLE, state, duration_s=0.0123, step_s=1e-3)
    assert every.time_s.size == 14  # twelve steps and a shorter one
    np.testing.assert_allclose(np.diff(every.time_s)[:-1], 1e-3)
    assert float(every.time_s[-1]) == 0.0123
    some = simulate(VEHICLE, state, duration_s=0.0123, step_s=1e-3, store_every=5)
    np.testing.assert_allclose(some.time_s, [0, 0.005, 0.01, 0.0123])
    np.testing.assert_array_equal(every.position_m[0], state.position_m)
    np.testing.assert_allclose(
        some.position_m, every.position_m[np.array([0, 5, 10, 13])], atol=1e-15
    )


class Kick(eqx.Module):
    """A push of a microsecond, which says that it is quiet before."""

    at_s: jax.Array

    def quiet_until(self, start_s, state, vehicle):
        return jnp.where(start_s > self.at_s, jnp.inf, self.at_s)

    def impulse(self, start_s, end_s, state, vehicle):
        inside = (self.at_s >= start_s) & (self.at_s < end_s)
        give = jnp.where(inside, jnp.array([0.003, 0, 0]), 0)
        return give, 1e-3 * give


@pytest.mark.parametrize("at_s", [0.0, 0.0207, 0.0499])
def test_a_pulse_in_whichever_step_gives_its_whole_impulse(at_s):
    state, step = at_hover(VEHICLE, rotor_speed_rad_s=np.zeros(4)), 1e-3

    def steady_push(time_s, state, vehicle):
        return vehicle.mass_kg * jnp.array([0.0, 2.0, 0]), 0 * state.position_m

    answer = simulate(
        VEHICLE,
        state,
        duration_s=0.05,
        step_s=step,
        loads=(Kick(jnp.asarray(at_s)), steady_push),
        store_every=100,
    )
    np.testing.assert_allclose(answer.velocity_m_s[-1, 0], 0.1, rtol=1e-9)
    # the row has the force of its strongest step, which is not its last
    np.testing.assert_allclose(answer.force_n[-1, 0], 0.003 / step, rtol=1e-9)
    spin = 3e-6 / float(VEHICLE.inertia_kg_m2[0, 0])
    np.testing.assert_allclose(answer.body_rate_rad_s[-1, 0], spin, rtol=1e-9)
    np.testing.assert_allclose(answer.position_m[-1, 1], 0.05**2, rtol=1e-9)


def test_the_clock_of_a_flight_in_single_precision_does_not_drift():
    step, n = 5e-4, np.arange(120_000)
    ticks = jax.vmap(tick_of, (0, None))(jnp.asarray(n), jnp.float32(step))
    late = np.abs(np.asarray(ticks.start, float) - n * step)
    # two roundings below 64 s; a sum of steps would be 0.02 s off
    assert late.max() <= 1.5 * np.spacing(np.float32(59.0))
    # those at the ends are inside the true step, so that a jump there is on its side
    first, middle, last = (np.asarray(stage, float) for stage in ticks.stages)
    assert ((first < middle) & (middle < last)).all()
    assert (first >= n * step).all()
    assert (last <= (n + 1) * step).all()


@pytest.mark.parametrize("count", [1, 4, 5, 7, 8])
def test_lanes_that_do_not_fill_their_chunks_come_back_once_each(monkeypatch, count):
    monkeypatch.setattr(rollout, "CHUNK_BYTES", 3 * 8)  # three lanes of float64

    def one(lane):
        return {"square": lane["x"] ** 2, "pair": jnp.stack([lane["y"], lane["x"]])}

    x, y = jnp.arange(1.0, count + 1.0), jnp.arange(0.5, count)
    found = jax.jit(lambda lanes: over_lanes(one, lanes, 1))({"x": x, "y": y})
    np.testing.assert_array_equal(found["square"], x**2)
    np.testing.assert_array_equal(found["pair"], np.stack([y, x], axis=1))


HOLD = PositionHold(np.array([0.0, 0.0, 5.0]), named_gains("crazyflie"))
REFUSED = {
    "duration_s: expected a positive": {"duration_s": 0.0},
    "backend: expected auto, jax, warp or warp:DEVICE": {"backend": "cuda"},
    "store_every: expected 1 or more": {"store_every": 0},
    "step_s: expected at most 0.2005 s, up to which RK4 is stable": {"step_s": 0.21},
    "at most 0.02106 s.* position controller": {"step_s": 0.022, "control": HOLD},
    "control: expected 4 numbers": {"control": Commands(np.zeros((9, 3)), 0.1)},
    "whole number of steps": {"control": HOLD, "control_period_s": 7e-4},
    "at or above the ground, 6 m, got 5 m": {"ground_up_m": 6.0},
    "wind: expected 3 numbers": {"wind": lambda time_s, position_m: time_s},
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_flown_is_refused(message):
    options: dict[str, Any] = {"duration_s": 0.1, **REFUSED[message]}
    with pytest.raises(InputError, match=message):
        simulate(VEHICLE, at_hover(VEHICLE), **options)


CRAFT = named("hummingbird")
ALONE = at_hover(CRAFT)
FIVE = jax.tree.map(lambda x: jnp.broadcast_to(x, (5, *x.shape)), ALONE)
NONE = jax.tree.map(lambda x: x[:0], FIVE)
TWO = jax.vmap(lambda m: dataclasses.replace(CRAFT, mass_kg=m))(jnp.ones(2))


def gust(count: int) -> Gust:
    return Gust(np.ones((count, 3)), np.zeros(count))


def hold(count: int) -> PositionHold:
    """Holds of as many places, which share their gains."""
    return PositionHold(np.ones((count, 3)), named_gains("hummingbird"))


def load(count: int):
    def of(mass):
        return blast_load(Scene(Charge(mass_kg=mass)))

    return jax.vmap(of)(jnp.ones(count))


WRONG = {
    "winds for 3 of 5": (FIVE, {"wind": gust(3)}, "shape"),
    "loads for 3 of 5": (FIVE, {"loads": (load(3),)}, "shape"),
    "gains for all": (FIVE, {"control": hold(5)}, "numbers of a vehicle"),
    "no vehicle": (NONE, {}, "expected one vehicle or more"),
    "vehicles for 2 of 5": (FIVE, {"vehicle": TWO}, r"expected one, or a batch of"),
    "ground that is nan": (FIVE, {"ground_up_m": np.nan}, "ground_up_m: .*got nan"),
}


@pytest.mark.parametrize(("state", "options", "said"), WRONG.values(), ids=WRONG)
def test_what_is_for_other_vehicles_is_refused(state, options, said):
    given: dict[str, Any] = {"vehicle": CRAFT, **options}
    for backend in ("jax", "warp:cpu"):
        with pytest.raises(ValueError, match=said):
            simulate(state=state, duration_s=0.01, backend=backend, **given)


TARGET = np.array([1.0, 0.0, 5.0])


def flight(east, *, up=None, speed=0.0, **parts) -> Trajectory:
    """A flight with a row each 0.5 s, so far east of its target."""
    east = np.asarray(east, float)
    position = np.zeros((*east.shape, 3))
    position[..., 0] = TARGET[0] + east
    position[..., 2] = TARGET[2] if up is None else up
    velocity = np.zeros_like(position)
    velocity[..., 1] = speed
    times = 0.5 * np.arange(east.shape[-1])
    return by_hand(times, position, velocity_m_s=velocity, **parts)


def test_errors_before_and_after_are_root_mean_squares():
    found = flight_metrics(flight([0.03, 0.04, 0.3, 0.4, 0.0]), TARGET, 1.0)
    np.testing.assert_allclose(found.error_before_m, np.sqrt((9 + 16) / 2) / 100)
    np.testing.assert_allclose(found.error_after_m, np.sqrt((9 + 16) / 3) / 10)


def test_peak_is_the_greatest_after_the_blast_not_before():
    found = flight_metrics(flight([9.0, 0.0, 0.3, -0.4, 0.0]), TARGET, 0.75)
    np.testing.assert_allclose(found.peak_deviation_m, 0.4)
    np.testing.assert_allclose(found.peak_time_s, 1.5 - 0.75)


def test_recovery_is_the_last_way_in_between_rows():
    """Inside at 1.5 s, out again at 2.0, and for good halfway from there to 2.5."""
    east = [0.0, 0.0, 0.3, 0.02, 0.08, 0.02, 0.0, 0.0]
    found = flight_metrics(flight(east), TARGET, 0.6, tolerance_m=0.05)
    np.testing.assert_allclose(found.recovery_time_s, 2.25 - 0.6)


def test_recovery_is_zero_if_it_never_leaves_and_infinite_if_it_ends_outside():
    never = flight_metrics(flight([0.0, 0.01, 0.02]), TARGET, 0.5)
    assert never.recovery_time_s == 0
    outside = flight_metrics(flight([0.0, 0.01, 0.2]), TARGET, 0.5)
    assert outside.recovery_time_s == np.inf
    assert not outside.settled


def test_without_rows_after_the_blast_there_is_nothing_to_say():
    found = flight_metrics(flight([0.0, 0.3, 0.0]), TARGET, 9.0)
    for value in (found.error_after_m, found.peak_deviation_m, found.recovery_time_s):
        assert np.isnan(value)
    assert np.isnan(flight_metrics(flight([0.1]), TARGET, 0.0).error_before_m)


def test_settled_needs_place_and_rest_over_the_whole_end():
    still = [0.3, 0.3, 0.0, 0.0, 0.0]
    assert flight_metrics(flight(still), TARGET, 0.0, rest_s=1.0).settled
    assert not flight_metrics(flight(still), TARGET, 0.0, rest_s=1.5).settled
    assert not flight_metrics(flight(still, speed=0.2), TARGET, 0.0).settled


def test_ground_and_turning_over_are_crashes():
    up = np.array([5.0, 2.0, 0.0])
    assert flight_metrics(
        flight([0.0] * 3, up=up), TARGET, 0.0, ground_up_m=0.0
    ).crashed
    assert not flight_metrics(flight([0.0] * 3, up=up), TARGET, 0.0).crashed
    # a start from the ground is none
    rise = flight([0.0] * 3, up=up[::-1].copy())
    assert not flight_metrics(rise, TARGET, 0.0, ground_up_m=0.0).crashed
    for degrees, crashed in ((80.0, False), (100.0, True)):
        half = np.radians(degrees / 2)
        tilted = np.array([[0, 0, 0, 1.0], [np.sin(half), 0, 0, np.cos(half)]])
        found = flight_metrics(flight([0.0, 0.0], quaternion=tilted), TARGET, 0.0)
        assert bool(found.crashed) == crashed


def test_a_lost_lane_keeps_its_rows_never_recovers_and_leaves_the_others_alone():
    nan = np.nan
    east = np.array([[0.0, 0.3, nan, nan], [0.0, 0.3, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    rows = flight(east, lost=np.array([True, False, False]))
    found = flight_metrics(rows, TARGET, np.array([0.5, 0.5, 0.5]))
    np.testing.assert_allclose(found.peak_deviation_m, [0.3, 0.3, 0.0])
    np.testing.assert_allclose(found.error_after_m, [0.3, np.sqrt(0.03), 0.0])
    np.testing.assert_array_equal(found.crashed, [True, False, False])
    np.testing.assert_array_equal(found.settled, [False, True, True])
    assert found.recovery_time_s[0] == np.inf
    np.testing.assert_allclose(found.recovery_time_s[1:], [0.5 * 0.25 / 0.3, 0.0])
