"""No blast pushes a vehicle at a time at which it is said not to."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.environments.core import in_blast, pushed_by
from jblast.environments.lanes import lane_keys
from tests.environments.lanes_of_one_blast import RESET_LANES, params_of


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
