"""One lane as a `gymnasium.Env`."""

from typing import Any

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

from jblast.environments.core import reset, step
from jblast.environments.gymnasium.spaces import (
    action_space,
    checked_actions,
    observation_space,
    params_of,
)
from jblast.environments.params import EnvironmentParams
from jblast.errors import InputError

_RESET, _STEP = eqx.filter_jit(reset), eqx.filter_jit(step)


class QuadrotorEnv(gymnasium.Env):
    """One quadrotor in blasts: the first lane of a `QuadrotorBlast` of the same seed.

    Args:
        task: "Hover", "Rates", "Mission" or "Detect".
        params: Of the environment, in place of all that follows.
        options: As in `environment_params`.

    Raises:
        InputError: As in `environment_params`.
    """

    def __init__(
        self,
        task: str = "Hover",
        params: EnvironmentParams | None = None,
        **options: Any,
    ):
        self.params = params_of(task, params, options)
        fps = round(1.0 / float(self.params.step_s))
        self.metadata = {"render_modes": [], "render_fps": fps}
        _, seen = jax.eval_shape(lambda: reset(jax.random.key(0), self.params))
        self.action_space = action_space(self.params)
        self.observation_space = observation_space(seen.shape[-1])
        self._state = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Of all draws; None: another one each time.
            options: None is known.
        """
        super().reset(seed=seed)
        if seed is None:
            seed = int(self.np_random.integers(2**31))
        key = jax.random.fold_in(jax.random.key(seed), 0)
        self._state, seen = _RESET(key, self.params)
        return np.asarray(seen, np.float32), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Raises:
            InputError: The action has another shape, or nothing was reset.
        """
        if self._state is None:
            raise InputError("step: expected a reset before it, got none")
        taken = checked_actions(action, self.action_space.shape or ())
        found = _STEP(self._state, jnp.asarray(taken), self.params)
        self._state = found.state
        info = {name: value.item() for name, value in found.info.items()}
        return (
            np.asarray(found.observation, np.float32),
            float(found.reward),
            bool(found.terminated),
            bool(found.truncated),
            info,
        )
