"""Spaces of an environment, and the actions that come from outside."""

from typing import Any

import numpy as np
from gymnasium.spaces import Box

from jblast.environments.build import environment_params
from jblast.environments.core import actions_of
from jblast.environments.params import EnvironmentParams
from jblast.environments.tasks.mission import default_guidance
from jblast.errors import InputError, shown


def params_of(task: str, params: EnvironmentParams | None, options: dict) -> Any:
    """Return the params that are given, or those of names and numbers.

    Raises:
        InputError: Both are given, or as in `environment_params`.
    """
    if params is not None:
        if options:
            raise InputError(
                f"params: expected them alone, got {', '.join(options)} beside them"
            )
        return params
    if task == "Mission" and "guidance" not in options:
        options = {**options, "guidance": default_guidance()}
    return environment_params(task, **options)


def action_space(params: EnvironmentParams) -> Box:
    """Return the actions of one lane."""
    return Box(-1.0, 1.0, (actions_of(params),), np.float32)


def observation_space(seen: int) -> Box:
    """Return what one lane may show."""
    return Box(-np.inf, np.inf, (seen,), np.float32)


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions as an array.

    Raises:
        InputError: They are no numbers, or of another shape.
    """
    try:
        array = np.asarray(actions, np.float32)
    except (TypeError, ValueError):
        raise InputError(f"action: expected numbers, got {shown(actions)}") from None
    if array.shape != shape:
        raise InputError(f"action: expected the shape {shape}, got {array.shape}")
    return array
