"""Gymnasium classes of the environments; Gymnasium is an optional extra."""

from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from jblast.environments.core import actions_of, environment_params, reset, step
from jblast.environments.episode import EnvironmentParams
from jblast.environments.lanes import reset_lanes, step_lanes
from jblast.environments.tasks import default_guidance
from jblast.errors import InputError, shown
from jblast.kept_programs import kept, kept_between_runs
from jblast.progress import Progress, in_words, shown_by

_RESET, _STEP = kept(reset), kept(step)
_RESET_LANES, _STEP_LANES = kept(reset_lanes), kept(step_lanes)


class _Programs:
    """Programs of an environment, kept between runs.

    Without a stored program the first step of `QuadrotorEnv` compiles for 17 s; that
    is reported.
    """

    def __init__(self, task: str, progress: Progress, **programs: Any) -> None:
        self._programs, self._waiting = programs, set(programs)
        self._task, self._progress = task, progress

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Run a program; the first call loads or compiles it."""
        program = self._programs[name]
        if name not in self._waiting:
            return program(*arguments)
        with kept_between_runs(), shown_by(self._progress, self._task):
            report = in_words()
            report(f"compiling {name}")
            answer = jax.block_until_ready(program(*arguments))
        self._waiting.remove(name)
        return answer


class QuadrotorEnv(gymnasium.Env):
    """A single quadrotor in blasts: lane 0 of a `QuadrotorBlast` of the same seed.

    Args:
        task: "Hover", "Rates" or "Mission".
        params: Parameters of the environment; they replace `task` and `options`.
        render_mode: None: the environments are not rendered.
        progress: True prints on stderr while the first `reset` and `step` compile; or
            as for `jblast.fit`.
        options: As in `environment_params`.

    Raises:
        InputError: As in `environment_params`, or a render mode was requested.
    """

    def __init__(
        self,
        task: str = "Hover",
        params: EnvironmentParams | None = None,
        render_mode: str | None = None,
        progress: Progress = True,
        **options: Any,
    ):
        _check_render_mode(render_mode)
        self.params = params_of(task, params, options)
        fps = round(1.0 / float(self.params.step_s))
        self.metadata = {"render_modes": [], "render_fps": fps}
        # Only shapes are evaluated; a reset would compile its program.
        _, seen = jax.eval_shape(lambda: reset(jax.random.key(0), self.params))
        self.action_space = action_space(self.params)
        self.observation_space = observation_space(seen.shape[-1])
        self._state = None
        self._run = _Programs(self.params.task, progress, reset=_RESET, step=_STEP)

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
        # Lane 0 of the batch with this seed, so that both classes give the same
        # episodes.
        key = jax.random.fold_in(jax.random.key(seed), 0)
        self._state, seen = self._run("reset", key, self.params)
        return np.asarray(seen, np.float32), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Raises:
            InputError: The action has another shape, or nothing was reset.
        """
        if self._state is None:
            raise InputError("step: expected a reset before it, got none")
        # A wrong shape would broadcast or compile another program.
        taken = checked_actions(action, self.action_space.shape or ())
        found = self._run("step", self._state, jnp.asarray(taken), self.params)
        self._state = found.state
        info = {name: value.item() for name, value in found.info.items()}
        return (
            np.asarray(found.observation, np.float32),
            float(found.reward),
            bool(found.terminated),
            bool(found.truncated),
            info,
        )


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
        _check_render_mode(render_mode)
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
        self._run = _Programs(
            self.params.task, progress, reset=_RESET_LANES, step=_STEP_LANES
        )

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
        if self._states is None:
            raise InputError("step: expected a reset before it, got none")
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


def params_of(task: str, params: EnvironmentParams | None, options: dict) -> Any:
    """Return given params, or those of `environment_params` from options.

    Raises:
        InputError: Both are given, or as in `environment_params`.
    """
    if params is not None:
        if options:
            raise InputError(
                f"params: expected no other options, got {', '.join(options)}"
            )
        return params
    if task == "Mission" and "guidance" not in options:
        options = {**options, "guidance": default_guidance()}
    return environment_params(task, **options)


def action_space(params: EnvironmentParams) -> Box:
    """Return the action space of one lane."""
    return Box(-1.0, 1.0, (actions_of(params),), np.float32)


def observation_space(seen: int) -> Box:
    """Return the observation space of one lane."""
    # No bounds: a displaced vehicle has any distance and speed.
    return Box(-np.inf, np.inf, (seen,), np.float32)


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions as an array.

    Raises:
        InputError: They are not numbers, or have another shape.
    """
    try:
        array = np.asarray(actions, np.float32)
    except (TypeError, ValueError):
        raise InputError(f"action: expected numbers, got {shown(actions)}") from None
    if array.shape != shape:
        raise InputError(f"action: expected the shape {shape}, got {array.shape}")
    return array


def _check_render_mode(render_mode: str | None) -> None:
    if render_mode is not None:
        raise InputError(
            f"render_mode: expected None, got {shown(render_mode)}: the environments "
            "are not rendered"
        )
