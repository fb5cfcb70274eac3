"""Registration with Gymnasium, which imports this module: it must not import JAX."""

from importlib import import_module

NAMES = ("Hover", "Rates", "Mission")
VERSION = "v0"


def register_environments() -> None:
    """Register `jblast/Hover-v0` and the other environments; repeated calls are safe.

    `jblast.environments` calls it at import, and Gymnasium imports that for
    `gymnasium.make("jblast.environments:jblast/Hover-v0")`. Without Gymnasium it does
    nothing.
    """
    try:
        registration = import_module("gymnasium.envs.registration")
    except ModuleNotFoundError:
        return
    for name in NAMES:
        identifier = f"jblast/{name}-{VERSION}"
        if identifier not in registration.registry:
            registration.register(
                identifier,
                entry_point="jblast.environments.gymnasium_classes:QuadrotorEnv",
                vector_entry_point="jblast.environments.gymnasium_classes:QuadrotorBlast",
                kwargs={"task": name},
            )
