"""Lanes do what they would alone, end one by one, and begin again."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.environments.lanes import in_chunks
from jblast.errors import InputError
from tests.environments.lanes_of_one_blast import (
    PARAMS,
    RESET,
    RESET_LANES,
    STEP,
    STEP_LANES,
    keys,
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
