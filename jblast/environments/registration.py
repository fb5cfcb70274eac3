"""The registration of environments with Gymnasium, which loads it: no JAX here."""

from importlib import import_module

NAMES = ("Hover", "Rates", "Mission", "Detect")
VERSION = "v0"


def register_environments() -> None:
    """Register `jblast/Hover-v0` and the others; once, however often it is called.

    Gymnasium calls it by itself, where jblast is installed, and `jblast.environments`
    when it is imported. Where there is no Gymnasium nothing happens.
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
