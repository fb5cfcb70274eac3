"""An environment's path is that of the same flight by `simulate`."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.environments.core import in_blast, pushed_by
from jblast.environments.episode import vehicle_in
from jblast.environments.lanes import lane_keys
from jblast.environments.tasks import default_guidance
from jblast.missions import Guidance, MissionControl, Progress
from jblast.missions.guidance import FLYING
from jblast.scene import Charge, Scene
from jblast.vehicle import PositionHold, blast_load, named_gains, simulate
from jblast.vehicle.state import joined
from tests.environments.lanes_of_one_blast import (
    PARAMS,
    RESET,
    RESET_LANES,
    STEP,
    params_of,
)

ROUNDING = 1e-10
"""Both take the same operations in float64, compiled apart; a hold that is stable does
not let their roundings grow."""


def scene_of(state, air):
    """The scene of an episode's blasts."""
    (time,), (place,), (mass,) = state.episode.blasts
    return Scene(Charge(mass, tuple(place), time, burst="surface"), air=air)


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
def test_a_hover_without_actions_is_the_flight_of_the_hold_through_the_same_blast():
    steps = int(PARAMS.episode_steps)
    start, places, pushed = flown(PARAMS, steps)
    east, north, _ = start.episode.wind_m_s
    air = replace(PARAMS.air, wind_east=east, wind_north=north)
    wind = jnp.stack([east, north, 0.0 * east])
    flight = simulate(
        vehicle_in(PARAMS, start.episode),
        joined(start.now.motion),
        duration_s=0.01 * steps,
        step_s=0.01,
        control=PositionHold(PARAMS.target_m, named_gains("iris", integral=True)),
        wind=lambda time, place: wind,
        loads=[blast_load(scene_of(start, air))],
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
    east, north, _ = start.episode.wind_m_s
    air = replace(params.air, wind_east=east, wind_north=north)
    wind = jnp.stack([east, north, 0.0 * east])
    flight = simulate(
        params.vehicle,
        joined(start.now.motion),
        duration_s=0.01 * steps,
        step_s=0.01,
        control=MissionControl(begun, hold),
        wind=lambda time, place: wind,
        loads=[blast_load(scene_of(start, air))],
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


@pytest.mark.slow
def test_whoever_is_not_in_a_blast_is_not_pushed_wherever_it_has_gone():
    params = params_of(episode_s=2.0)
    assert lane_keys(jax.random.key(0), jnp.arange(2)).shape == (2,)
    states, _ = RESET_LANES(jax.random.key(1), jnp.arange(40), params)

    @jax.jit
    def ask(states, steps, off):
        east, north, up = states.now.motion.position
        moved = states.now.motion._replace(position=(east + off, north, up - off / 2))
        states = states._replace(
            now=states.now._replace(motion=moved), steps=jnp.full(40, steps)
        )

        def one(state):
            blast = jax.tree.map(lambda x: x[0], state.episode.blasts)
            force, moment = pushed_by(state, blast, params)
            return in_blast(state, params)[0], jnp.stack([*force, *moment])

        return jax.vmap(one)(states)

    pushed_ever = said = 0
    for off in (0.0, 3.0, -5.0):
        for steps in range(0, 80, 4):
            inside, wrench = ask(states, jnp.asarray(steps, jnp.int32), off)
            pushed = np.abs(np.array(wrench)).max(axis=1) > 0
            assert not (pushed & ~np.array(inside)).any()
            pushed_ever += int(pushed.sum())
            said += int(np.array(inside).sum())
    assert pushed_ever > 100
    assert said < 0.6 * 3 * 20 * 40  # and most of the time nobody needs to ask
