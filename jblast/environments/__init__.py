"""Vehicles in blasts as environments for reinforcement learning (Gymnasium)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from jblast.environments import registration
from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.environments.build import environment_params as environment_params
    from jblast.environments.core import Step as Step, reset as reset, step as step
    from jblast.environments.episode import (
        COMMANDS as COMMANDS,
        EnvironmentParams as EnvironmentParams,
        EnvironmentState as EnvironmentState,
        Imu as Imu,
        Randomisation as Randomisation,
    )
    from jblast.environments.gymnasium_classes import (
        QuadrotorBlast as QuadrotorBlast,
        QuadrotorEnv as QuadrotorEnv,
    )
    from jblast.environments.lanes import (
        reset_lanes as reset_lanes,
        step_lanes as step_lanes,
    )

_HOMES = {
    "COMMANDS": "episode",
    "EnvironmentParams": "episode",
    "EnvironmentState": "episode",
    "Imu": "episode",
    "QuadrotorBlast": "gymnasium_classes",
    "QuadrotorEnv": "gymnasium_classes",
    "Randomisation": "episode",
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
