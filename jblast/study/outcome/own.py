"""Outcomes that are functions of the user's own, where the user says that they may be.

`python:MODULE.FUNCTION` is called with a sample's key and scene and returns a number:
pure, as JAX compiles it for whole blocks of samples.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp

from jblast.errors import InputError, shown
from jblast.scene.uncertain import with_values
from jblast.study.outcome.family import (
    Answers,
    Family,
    Outcome,
    Prepared,
    Setting,
    register_family,
)

CODE = "python:"
"""Begins the name of such an outcome."""


def own_outcome(name: str) -> Outcome:
    """Return the outcome of a name that begins with `CODE`.

    Raises:
        InputError: There is no such module or function.
    """
    _function(name)
    return Outcome(name, "1", f"{name.removeprefix(CODE)} of each sample", "own")


def prepare(setting: Setting) -> Prepared:
    """Make functions ready for a scene."""
    functions = {name: _function(name) for name in setting.names}
    scene = setting.uncertain.scene

    def one(key, numbers) -> Answers:
        drawn = with_values(scene, numbers)
        found = {}
        for name, function in functions.items():
            value = jnp.asarray(function(key, drawn))
            if value.shape:
                raise InputError(
                    f"{name}: expected one number a sample, got the shape {value.shape}"
                )
            found[name] = value.astype(float)
        return found

    return Prepared(
        jax.vmap(one), notes=tuple(f"{name}: not ours" for name in functions)
    )


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.removeprefix(CODE).rpartition(".")
    try:
        found = getattr(import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"{shown(name)}: cannot be imported: {error}") from None
    if not callable(found):
        raise InputError(f"{shown(name)}: expected a function, got {shown(found)}")
    return found


register_family(Family("own", 5, prepare))
