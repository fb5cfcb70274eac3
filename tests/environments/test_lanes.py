"""Lanes of short episodes: alone, in batches, and against flights."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.environments.episode import vehicle_in
from jblast.environments.lanes import in_chunks
from jblast.environments.tasks import default_guidance
from jblast.errors import InputError
from jblast.missions import Guidance, MissionControl, Progress
from jblast.missions.guidance import FLYING
from jblast.scene import Box, ByCount, Charge, Scene, Uniform, VehicleSpec, WorldSpec
from jblast.vehicle import PositionHold, blast_load, named_gains, simulate
from jblast.vehicle.state import joined
from tests.environments.lanes_of_one_blast import (
    PARAMS,
    RESET,
    RESET_LANES,
    STEP,
    STEP_LANES,
    keys,
    params_of,
)

STEPS = int(PARAMS.episode_steps)


def actions(lanes, step):
    """Actions that depend on lane and step alone."""
    return 0.3 * jnp.sin(
        float(step) + jnp.arange(float(lanes))[:, None] + jnp.arange(3.0)[None]
    )


def batch(lanes, steps):
    """Observations of a batch after each step, and the answers."""
    states, seen = RESET_LANES(jax.random.key(7), jnp.arange(lanes), PARAMS)
    rows, found = [seen], []
    for n in range(steps):
        found.append(STEP_LANES(states, actions(lanes, n), PARAMS))
        states = found[-1].state
        rows.append(found[-1].observation)
    return np.array(rows), found


@pytest.mark.slow
def test_a_lane_goes_the_same_way_alone_and_in_any_batch():
    many, few = batch(11, STEPS)[0], batch(3, STEPS)[0]
    np.testing.assert_allclose(many[:, :3], few, rtol=0, atol=1e-12)
    state, seen = RESET(keys(7, 3)[2], PARAMS)
    alone = [seen]
    for n in range(STEPS):
        found = STEP(state, actions(3, n)[2], PARAMS)
        state = found.state
        alone.append(found.observation)
    np.testing.assert_allclose(np.array(alone), few[:, 2], rtol=0, atol=1e-12)
    assert np.ptp(many[-1, :, 0]) > 1e-3  # lanes differ


@pytest.mark.slow
def test_the_last_observation_of_an_episode_is_shown_before_another_blast_is_drawn():
    rows, found = batch(3, STEPS + 2)
    assert np.array(found[STEPS - 1].truncated).all()
    assert not np.array(found[STEPS - 2].truncated).any()
    after = found[STEPS]
    assert not np.array(after.truncated | after.terminated).any()
    assert (np.array(after.reward) == 0).all()
    assert (np.array(after.state.steps) == 0).all()
    assert (np.array(after.state.episode.number) == 1).all()
    # the last of an episode is where it ended; the next is at rest at its start
    assert np.abs(rows[STEPS][:, 3:6]).max() > 0.05
    np.testing.assert_array_equal(rows[STEPS + 1][:, :6], 0.0)
    assert (np.array(found[STEPS + 1].state.steps) == 1).all()
    before, now = (found[n].state.episode.load.waves.mass_kg for n in (0, STEPS))
    assert (np.array(before) != np.array(now)).all()


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [jnp.nan, jnp.inf])
def test_an_action_that_is_no_number_ends_its_lane_alone_and_is_named(wrong):
    states, _ = RESET_LANES(jax.random.key(7), jnp.arange(3), PARAMS)
    asked = jnp.zeros((3, 3)).at[1, 2].set(wrong)
    found = STEP_LANES(states, asked, PARAMS)
    assert np.array(found.terminated).tolist() == [False, True, False]
    assert np.array(found.info["bad_action"]).tolist() == [False, True, False]
    assert np.isfinite(np.array(found.observation)).all()


def test_lanes_that_do_not_go_up_in_chunks_are_refused():
    with pytest.raises(InputError, match="multiple of 4 times 1 devices, got 6"):
        in_chunks(lambda x: x, jnp.zeros(6), 4, 1)


def test_chunks_give_what_all_lanes_at_once_give():
    numbers = jnp.arange(8.0)
    np.testing.assert_array_equal(in_chunks(jnp.sin, numbers, 2, 1), jnp.sin(numbers))


ROUNDING = 1e-10
"""Both take the same operations in float64, compiled apart; a hold that is stable does
not let their roundings grow."""


HIGH = WorldSpec(
    occurrence=ByCount(1),
    region=Box((7.0, -2.0, -2.0), (9.0, 2.0, -1.0)),
    about="vehicle",
    mass=Uniform(1.0, 2.0),
    time=Uniform(0.0, 0.05),
)
"""A blast 8 m from the vehicle at about its height, whose reflection comes later."""


def load_of(start, params):
    """The load of an episode's blast, as in `jblast fly`, and its wind."""
    blast, (east, north, _) = start.episode.load.blasts, start.episode.wind_m_s
    air = replace(params.air, wind_east=east, wind_north=north)
    charge = Charge(blast.mass_kg[0], tuple(blast.position_m[0]), blast.time_s[0])
    vehicle = VehicleSpec("iris", joined(start.now.motion).position_m)
    wind = jnp.stack([east, north, 0.0 * east])
    return blast_load(Scene(charge, air=air, vehicle=vehicle)), lambda time, at: wind


def flown(params, steps):
    """Places of a lane that is left to its hold."""
    state, _ = RESET(jax.random.key(3), params)
    places, pushed = [np.array(state.now.motion.position)], 0.0
    start, still = state, jnp.zeros(3)
    for _ in range(steps):
        found = STEP(state, still, params)
        state = found.state
        places.append(np.array(state.now.motion.position))
        pushed = max(pushed, float(np.abs(np.array(state.now.impulse_wrench[0])).max()))
    return start, np.array(places), pushed


@pytest.mark.slow
@pytest.mark.parametrize("high", [False, True])
def test_a_hover_without_actions_is_the_flight_of_the_hold_through_the_same_blast(high):
    params = params_of(world=HIGH) if high else PARAMS
    steps = int(params.episode_steps)
    start, places, pushed = flown(params, steps)
    load, wind = load_of(start, params)
    # a high charge has the curves of free air, and an image whose wave comes later
    assert load.waves.free_air.tolist() == ([1.0, 1.0] if high else [0.0])
    flight = simulate(
        vehicle_in(params, start.episode),
        joined(start.now.motion),
        duration_s=0.01 * steps,
        step_s=0.01,
        control=PositionHold(params.target_m, named_gains("iris", integral=True)),
        wind=wind,
        loads=[load],
        ground_up_m=0.0,
    )
    assert pushed > 5.0  # newtons: a blast came
    np.testing.assert_allclose(places, flight.position_m, rtol=0, atol=ROUNDING)


class Begun(Guidance):
    """A guidance that begins with its first leg."""

    def start(self) -> Progress:
        before = super().start()
        return before._replace(phase=before.phase + FLYING)


@pytest.mark.slow
def test_a_mission_without_actions_is_the_flight_of_its_control():
    guidance = default_guidance()
    params = params_of("Mission", guidance=guidance)
    steps = 150
    start, places, _ = flown(params, steps)
    begun = Begun(**{name: getattr(guidance, name) for name in vars(guidance)})
    hold = PositionHold(jnp.zeros(3), named_gains("iris", integral=True))
    load, wind = load_of(start, params)
    flight = simulate(
        params.vehicle,
        joined(start.now.motion),
        duration_s=0.01 * steps,
        step_s=0.01,
        control=MissionControl(begun, hold),
        wind=wind,
        loads=[load],
        ground_up_m=0.0,
    )
    assert places[-1, 2] > 0.5  # it has taken off
    np.testing.assert_allclose(places, flight.position_m, rtol=0, atol=ROUNDING)


@pytest.mark.slow
def test_gradients_by_the_action_are_those_of_differences():
    params = params_of(command="thrust_rates")
    state, _ = RESET(jax.random.key(0), params)

    def after(actions):
        def one(now, action):
            found = STEP(now, action, params)
            return found.state, found.reward

        return jnp.sum(jax.lax.scan(one, state, actions)[1])

    actions = 0.1 * jnp.sin(jnp.arange(24.0)).reshape(6, 4)
    value, slope = eqx.filter_jit(jax.value_and_grad(after))(actions)
    run, width = eqx.filter_jit(after), 1e-5
    for place in ((0, 0), (2, 1), (3, 3)):
        high, low = (run(actions.at[place].add(s * width)) for s in (1, -1))
        np.testing.assert_allclose(
            slope[place], (high - low) / (2 * width), rtol=1e-5, atol=1e-8
        )
    assert np.isfinite(value)
