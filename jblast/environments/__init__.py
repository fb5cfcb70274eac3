"""Vehicles in blasts behind the interface that learners expect (Gymnasium)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from jblast.environments import registration
from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.environments.build import environment_params as environment_params
    from jblast.environments.commands import COMMANDS as COMMANDS
    from jblast.environments.core import Step as Step, reset as reset, step as step
    from jblast.environments.gymnasium.single import QuadrotorEnv as QuadrotorEnv
    from jblast.environments.gymnasium.vector import QuadrotorBlast as QuadrotorBlast
    from jblast.environments.lanes import (
        reset_lanes as reset_lanes,
        step_lanes as step_lanes,
    )
    from jblast.environments.params import (
        EnvironmentParams as EnvironmentParams,
        Imu as Imu,
        Randomisation as Randomisation,
    )
    from jblast.environments.state import EnvironmentState as EnvironmentState

_HOMES = {
    "COMMANDS": "commands",
    "EnvironmentParams": "params",
    "EnvironmentState": "state",
    "Imu": "params",
    "QuadrotorBlast": "gymnasium.vector",
    "QuadrotorEnv": "gymnasium.single",
    "Randomisation": "params",
    "Step": "core",
    "environment_params": "build",
    "reset": "core",
    "reset_lanes": "lanes",
    "step": "core",
    "step_lanes": "lanes",
}

registration.register_environments()


def __getattr__(name: str) -> Any:
    """Import a name when it is first asked for: Gymnasium loads this room without JAX.

    Raises:
        InputError: It needs Gymnasium, which is not installed.
    """
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "gymnasium":
            raise
        raise InputError(
            f"{name}: expected Gymnasium, an extra: pip install "
            "'jblast[environments]'; it is not installed"
        ) from None
    globals()[name] = value
    return value
