"""Gymnasium classes of the environments; Gymnasium is an optional extra."""

from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from jblast.environments.core import environment_params
from jblast.environments.episode import COMMANDS, EnvironmentParams
from jblast.environments.lanes import reset_lanes, step_lanes
from jblast.errors import InputError, require, shown
from jblast.kept_programs import kept, kept_between_runs
from jblast.progress import Progress, in_words, shown_by

PROGRAMS = {"reset": kept(reset_lanes), "step": kept(step_lanes)}


class QuadrotorBlast(VectorEnv):
    """Lanes of quadrotors in blasts, stepped together; `AutoresetMode.NEXT_STEP`.

    Lane `n` depends on the seed, `n` and its actions only, not on the number of lanes.
    An action of NaN or infinity ends its lane's episode and sets
    `infos["bad_action"]`. `infos["peak_deviation_m"]` is the maximum distance from the
    target in each episode so far.

    Args:
        num_envs: Number of environments, the lanes of a batch.
        task: "Hover", "Rates" or "Mission".
        params: Parameters of the environment; they replace `task` and `options`.
        render_mode: None: the environments are not rendered.
        progress: True prints on stderr while the first `reset` and `step` compile; or
            as for `jblast.fit`.
        options: As in `environment_params`.

    Raises:
        InputError: There are no lanes, or as in `environment_params`, or a render mode
            was requested.

    Example:
        `QuadrotorBlast(4096, task="Hover", command="velocity")`
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "Hover",
        params: EnvironmentParams | None = None,
        render_mode: str | None = None,
        progress: Progress = True,
        **options: Any,
    ):
        words, got = "None (the environments are not rendered)", shown(render_mode)
        require(render_mode is None, "render_mode", words, got)
        whole = type(num_envs) is int or isinstance(num_envs, np.integer)
        words, got = "a whole number, 1 or more", shown(num_envs)
        require(whole and num_envs > 0, "num_envs", words, got)
        self.num_envs = int(num_envs)
        self.params = params_of(task, params, options)
        self.metadata = {
            "autoreset_mode": AutoresetMode.NEXT_STEP,
            "render_modes": [],
            "render_fps": round(1.0 / float(self.params.step_s)),
        }
        # Only shapes are evaluated; a reset would compile its program.
        _, seen = jax.eval_shape(
            lambda: reset_lanes(jax.random.key(0), jnp.arange(1), self.params)
        )
        self.single_action_space = Box(-1.0, 1.0, (COMMANDS[self.params.command],))
        # No bounds: a displaced vehicle has any distance and speed.
        self.single_observation_space = Box(-np.inf, np.inf, (seen.shape[-1],))
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )
        self._states = None
        self._progress, self._compiled = progress, set()

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
        self._states, seen = self._run(
            "reset", jax.random.key(seed), lanes, self.params
        )
        return np.asarray(seen, np.float32), {}

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take a step of every lane.

        Raises:
            InputError: The actions have another shape, or nothing was reset.
        """
        require(self._states is not None, "step", "a reset before it", "none")
        taken = checked_actions(actions, self.action_space.shape or ())
        found = self._run("step", self._states, jnp.asarray(taken), self.params)
        self._states = found.state
        infos = {name: np.asarray(value) for name, value in found.info.items()}
        return (
            np.asarray(found.observation, np.float32),
            np.asarray(found.reward, np.float64),
            np.asarray(found.terminated),
            np.asarray(found.truncated),
            infos,
        )

    def _run(self, name: str, *arguments: Any) -> Any:
        """Run a program; the first call loads or compiles it, which is reported."""
        program = PROGRAMS[name]
        if name in self._compiled:
            return program(*arguments)
        with kept_between_runs(), shown_by(self._progress, self.params.task):
            in_words()(f"compiling {name}")
            answer = jax.block_until_ready(program(*arguments))
        self._compiled.add(name)
        return answer


class QuadrotorEnv(gymnasium.Env):
    """A single quadrotor in blasts: a `QuadrotorBlast` of one lane.

    Args:
        task: "Hover", "Rates" or "Mission".
        options: As in `QuadrotorBlast`.

    Raises:
        InputError: As in `QuadrotorBlast`.
    """

    def __init__(self, task: str = "Hover", **options: Any):
        self.lanes = QuadrotorBlast(1, task, **options)
        self.params = self.lanes.params
        self.metadata = {**self.lanes.metadata}
        del self.metadata["autoreset_mode"]
        self.action_space = self.lanes.single_action_space
        self.observation_space = self.lanes.single_observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Of all draws; None: another one each time.
            options: None is known.
        """
        super().reset(seed=seed)
        seen, info = self.lanes.reset(seed=seed)
        return seen[0], info

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Raises:
            InputError: The action has another shape, or nothing was reset.
        """
        taken = checked_actions(action, self.action_space.shape or ())
        seen, reward, terminated, truncated, infos = self.lanes.step(taken[None])
        info = {name: value[0].item() for name, value in infos.items()}
        return seen[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info


def params_of(task: str, params: EnvironmentParams | None, options: dict) -> Any:
    """Return given params, or those of `environment_params` from options.

    Raises:
        InputError: Both are given, or as in `environment_params`.
    """
    if params is None:
        return environment_params(task, **options)
    require(not options, "params", "no other options", ", ".join(options))
    return params


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions as an array.

    Raises:
        InputError: They are not numbers, or have another shape.
    """
    try:
        array = np.asarray(actions, np.float32)
    except (TypeError, ValueError):
        raise InputError(f"action: expected numbers, got {shown(actions)}") from None
    require(array.shape == shape, "action", f"the shape {shape}", f"{array.shape}")
    return array
