"""What is there to learn in the environments: rewards of three ways to fly.

    pip install --target FOLDER --no-deps rejax gymnax flax distrax chex toolz six
        msgpack tfp-nightly absl-py dm-tree orbax-checkpoint tensorstore rich seaborn
    PYTHONPATH=FOLDER:. python -m calibration.learned_policies
        > calibration/results/learned_policies.txt

A policy is trained by the PPO of rejax with its default networks; rejax is no
dependency of jblast. A row has the mean reward of a step, over the full duration of an
episode: the steps after an early end count as zero. All columns have the same episodes,
which no policy was trained on.

- nothing: every action is zero;
- SE(3): the position controller of `jblast fly` (`command="hold"` with actions of
  zero); for Rates its loop of body rates (`command="thrust_rates"`);
- trained: the mean action of the trained policy.
"""

import importlib
import importlib.metadata
import time
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.environments import (
    COMMANDS,
    EnvironmentParams,
    environment_params,
    reset_lanes,
    step_lanes,
)
from jblast.environments.tasks import TASKS

ROWS = (
    ("Hover", "velocity"),
    ("Hover", "thrust_rates"),
    ("Rates", "rotor_speeds"),
    ("Hover", "hold"),
    ("Mission", "hold"),
)
LANES, TRAINED_LANES, ROUND_STEPS = 128, 256, 64
ROUNDS, ROUND = 3, 3_000_000
"""Calls of one program, and the steps of each."""
START_LOG_STD = -1.5
"""Logarithm of the standard deviation of actions before the training.

With rejax's 0 the actions are noise, far from the target, where rewards are flat: after
3e6 steps of Hover by velocities the mean reward is 0.33 instead of 0.70.
"""
SETTINGS = {
    "num_envs": TRAINED_LANES,
    "num_steps": ROUND_STEPS,
    "num_minibatches": 16,
    "num_epochs": 4,
    "learning_rate": 1e-3,
    "ent_coef": 0.0,
    "max_grad_norm": 0.5,
    "total_timesteps": ROUND,
    "eval_freq": ROUND,
    "skip_initial_evaluation": True,
}
EVALUATED_SEED = 2**20


class Space(NamedTuple):
    """Space of actions or observations, with the names that rejax reads."""

    shape: tuple[int, ...]
    low: float
    high: float


class Lanes:
    """An environment as rejax reads it, except for its steps (`learner`)."""

    default_params = None

    def action_space(self, params: EnvironmentParams) -> Space:
        """Return the space of actions."""
        return Space((COMMANDS[params.command],), -1.0, 1.0)

    def observation_space(self, params: EnvironmentParams) -> Space:
        """Return the space of observations."""
        shapes = jax.eval_shape(
            lambda: reset_lanes(jax.random.key(0), jnp.arange(1), params)[1]
        )
        return Space(shapes.shape[1:], -jnp.inf, jnp.inf)


def learner(params: EnvironmentParams) -> Any:
    """Return rejax's PPO for an environment, stepped in lanes."""
    rejax = importlib.import_module("rejax")

    class Learner(rejax.PPO):
        @property
        def vmap_reset(self) -> Any:
            def begin(keys: Array, params: EnvironmentParams) -> Any:
                key = jax.random.wrap_key_data(keys[0])
                state, seen = reset_lanes(key, jnp.arange(self.num_envs), params)
                # Lanes all through their episodes, not all at the beginning.
                steps = jnp.arange(self.num_envs) * params.episode_steps
                return seen, state._replace(steps=steps // self.num_envs)

            return begin

        @property
        def vmap_step(self) -> Any:
            def step(keys: Array, states: Any, actions: Array, params: Any) -> Any:
                found = step_lanes(states, actions, params)
                ended = found.terminated | found.truncated
                return found.observation, found.state, found.reward, ended, {}

            return step

    made = Learner.create(env=Lanes(), env_params=params, **SETTINGS)
    return made.replace(eval_callback=lambda algorithm, state, key: ())


class Policy(NamedTuple):
    """A policy: a network's parameters, and a matrix from observation to action."""

    network: Any
    matrix: Float[Array, "action seen"]


class Trial(NamedTuple):
    """A task with a mode of command.

    Attributes:
        learner: PPO of rejax.
        start: Its state before the training.
        still: Policy of no action.
        reward: Program from a policy to its mean reward of a step.
    """

    learner: Any
    start: Any
    still: Policy
    reward: Callable[[Policy], Array]


@cache
def trial(task: str, command: str) -> Trial:
    """Return a trial; the programs of one are compiled once."""
    params = environment_params(task, command=command)
    made = learner(params)
    start = made.init_state(jax.random.PRNGKey(0))
    actions = start.actor_ts.params["params"]
    actions["action_log_std"] = jnp.full(COMMANDS[command], START_LOG_STD)
    network = jax.tree.map(jnp.zeros_like, start.actor_ts.params)
    matrix = jnp.zeros((COMMANDS[command], start.last_obs.shape[-1]))

    def mean_action(actor: Any, seen: Array) -> Array:
        return actor._action_dist(seen).loc

    @jax.jit
    def reward(policy: Policy, params: EnvironmentParams) -> Array:
        def step(carried: Any, _: None) -> Any:
            states, seen, flies, earned = carried
            action = made.actor.apply(policy.network, seen, method=mean_action)
            found = step_lanes(states, action + seen @ policy.matrix.T, params)
            earned = earned + jnp.where(flies, found.reward, 0.0)
            flies = flies & ~(found.terminated | found.truncated)
            return (found.state, found.observation, flies, earned), None

        key, lanes = jax.random.key(EVALUATED_SEED), jnp.arange(LANES)
        states, seen = reset_lanes(key, lanes, params)
        begun = states, seen, jnp.ones(LANES, bool), jnp.zeros(LANES)
        (*_, earned), _ = jax.lax.scan(step, begun, None, length=count)
        return jnp.mean(earned) / count

    count = int(params.episode_steps)
    return Trial(
        made, start, Policy(network, matrix), lambda policy: reward(policy, params)
    )


def controlled(task: str) -> float:
    """Return the mean reward of the SE(3) controller in a task."""
    if task != "Rates":
        held = trial(task, "hold")
        return float(held.reward(held.still))
    rates = trial(task, "thrust_rates")
    about = jnp.arange(3)
    # The requested rate is the error plus the actual rate.
    matrix = rates.still.matrix
    for first in (0, 3):
        matrix = matrix.at[about + 1, about + first].set(1.0)
    return float(rates.reward(rates.still._replace(matrix=matrix)))


def main() -> None:
    """Train a policy for each row and print the table."""
    print(
        f"Mean reward of a step: {LANES} episodes, PPO of rejax "
        f"{importlib.metadata.version('rejax')} with {ROUNDS * ROUND:,} steps\n"
        f"{'task':<10}{'command':<15}{'scale':>7}{'nothing':>9}{'SE(3)':>8}"
        f"{'trained':>9}{'core seconds':>14}",
        flush=True,
    )
    for task, command in ROWS:
        learner, start, still, reward = trial(task, command)
        begun = time.process_time()
        train = jax.jit(lambda algorithm, state: algorithm.train(train_state=state)[0])
        for _ in range(ROUNDS):
            start = train(learner, start)
        network = jax.block_until_ready(start.actor_ts.params)
        spent = time.process_time() - begun
        print(
            f"{task:<10}{command:<15}{TASKS[task].scale:>7g}{reward(still):>9.3f}"
            f"{controlled(task):>8.3f}{reward(still._replace(network=network)):>9.3f}"
            f"{spent:>14.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
