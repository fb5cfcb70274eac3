"""Many lanes as one `gymnasium.vector.VectorEnv`."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from jblast.environments.gymnasium.spaces import (
    action_space,
    checked_actions,
    observation_space,
    params_of,
)
from jblast.environments.lanes import reset_lanes, step_lanes
from jblast.environments.params import EnvironmentParams
from jblast.errors import InputError, shown

_RESET, _STEP = eqx.filter_jit(reset_lanes), eqx.filter_jit(step_lanes)


class QuadrotorBlast(VectorEnv):
    """Lanes of quadrotors in blasts, stepped at once; `AutoresetMode.NEXT_STEP`.

    What lane `n` does depends on seed, `n` and its actions, and not on how many there
    are. An action that is no number ends its lane's episode: `infos["bad_action"]` says
    which. `infos["peak_deviation_m"]` is the farthest so far of each episode.

    Args:
        num_envs: How many lanes.
        task: "Hover", "Rates", "Mission" or "Detect".
        params: Of the environment, in place of all that follows.
        options: As in `environment_params`.

    Raises:
        InputError: There are no lanes, or as in `environment_params`.

    Example:
        `QuadrotorBlast(4096, task="Hover", command="velocity")`
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "Hover",
        params: EnvironmentParams | None = None,
        **options: Any,
    ):
        whole = isinstance(num_envs, int | np.integer) and not isinstance(
            num_envs, bool
        )
        if not (whole and num_envs > 0):
            raise InputError(
                f"num_envs: expected a whole number, 1 or more, got {shown(num_envs)}"
            )
        self.num_envs = int(num_envs)
        self.params = params_of(task, params, options)
        self.metadata = {
            "autoreset_mode": AutoresetMode.NEXT_STEP,
            "render_modes": [],
            "render_fps": round(1.0 / float(self.params.step_s)),
        }
        lanes = jax.ShapeDtypeStruct((1,), jnp.int32)
        _, seen = jax.eval_shape(
            lambda lanes: reset_lanes(jax.random.key(0), lanes, self.params), lanes
        )
        self.single_action_space = action_space(self.params)
        self.single_observation_space = observation_space(seen.shape[-1])
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )
        self._states = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin the first episodes of all lanes.

        Args:
            seed: Of all draws; None: another one each time.
            options: None is known.
        """
        super().reset(seed=seed)
        if seed is None:
            seed = int(self.np_random.integers(2**31))
        lanes = jnp.arange(self.num_envs)
        self._states, seen = _RESET(jax.random.key(seed), lanes, self.params)
        return np.asarray(seen, np.float32), {}

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take a step of every lane.

        Raises:
            InputError: The actions have another shape, or nothing was reset.
        """
        if self._states is None:
            raise InputError("step: expected a reset before it, got none")
        taken = checked_actions(actions, self.action_space.shape or ())
        found = _STEP(self._states, jnp.asarray(taken), self.params)
        self._states = found.state
        infos = {name: np.asarray(value) for name, value in found.info.items()}
        return (
            np.asarray(found.observation, np.float32),
            np.asarray(found.reward, np.float64),
            np.asarray(found.terminated),
            np.asarray(found.truncated),
            infos,
        )
