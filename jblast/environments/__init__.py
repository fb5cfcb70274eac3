"""Environments for reinforcement learning: vehicles in blasts (Gymnasium)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from jblast.errors import InputError
from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.environments.core import (
        Step as Step,
        environment_params as environment_params,
        reset as reset,
        step as step,
    )
    from jblast.environments.episode import (
        COMMANDS as COMMANDS,
        EnvironmentParams as EnvironmentParams,
        EnvironmentState as EnvironmentState,
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

NAMES = ("Hover", "Rates", "Mission")
"""Tasks, registered with Gymnasium as `jblast/Hover-v0` and so on."""
_imported, __dir__ = lazy_face(__name__)


def _register() -> None:
    """Register the environments if Gymnasium is installed.

    Gymnasium imports this package for
    `gymnasium.make("jblast.environments:jblast/Hover-v0")`.
    """
    try:
        registration = import_module("gymnasium.envs.registration")
    except ModuleNotFoundError:
        return
    classes = "jblast.environments.gymnasium_classes:"
    for name in NAMES:
        # A repeated registration would warn.
        if f"jblast/{name}-v0" not in registration.registry:
            registration.register(
                f"jblast/{name}-v0",
                entry_point=classes + "QuadrotorEnv",
                vector_entry_point=classes + "QuadrotorBlast",
                kwargs={"task": name},
            )


_register()


def __getattr__(name: str) -> Any:
    """Import a name at its first use: Gymnasium imports this package without JAX.

    Raises:
        InputError: The name needs Gymnasium, which is not installed.
    """
    try:
        return _imported(name)
    except ModuleNotFoundError as error:
        # Other missing modules are faults of the installation, not of this extra.
        if (error.name or "").partition(".")[0] != "gymnasium":
            raise
        raise InputError(
            f"{name}: expected Gymnasium, an extra: pip install "
            "'jblast[environments]'; it is not installed"
        ) from None
