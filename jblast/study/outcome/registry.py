"""Registry of outcomes by name, and functions of the user as outcomes.

`python:MODULE.FUNCTION` is called with a sample's key and scene and returns a number,
or what its decorator `own_outcome` describes. It must be pure, because JAX compiles it
for whole blocks of samples, and the user has to allow it.
"""

# Importing a module of outcomes registers them.
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp

import jblast.study.outcome.detection as _detection
import jblast.study.outcome.fit as _fit
import jblast.study.outcome.quantities as _quantities
import jblast.study.outcome.vehicle as _vehicle
from jblast.errors import InputError, argument, require, shown
from jblast.scene.uncertain import with_values
from jblast.scene.values import known
from jblast.study.outcome.family import (
    DESCRIBED,
    FAMILIES,
    Answers,
    Family,
    Outcome,
    Prepared,
    Setting,
    family,
    yes_no,
)

LISTED = (_detection, _fit, _quantities, _vehicle)
CODE = "python:"
"""Prefix of the name of a user's function."""


def known_outcomes() -> dict[str, Outcome]:
    """Return the outcomes of the package by name."""
    return {one.name: one for each in FAMILIES.values() for one in each.outcomes}


def outcomes_named(
    names: Sequence[str], source: str, *, allow_code: bool = False
) -> tuple[Outcome, ...]:
    """Return outcomes by name.

    Args:
        names: Names in the study file.
        source: Name of the study file, for messages.
        allow_code: Whether functions of the user may be run.

    Raises:
        InputError: An outcome is unknown; the message has the nearest name.
    """
    found, there, where = [], known_outcomes(), f"{source}: outcomes"
    for name in names:
        if name.startswith(CODE):
            words = f"{argument('allow_code')} with the Python function {shown(name)}"
            require(allow_code, where, words, "none")
            found.append(_own(name))  # fails here, before the first sample
        else:
            known(name, there, f"{where}:", "outcome")
            found.append(there[name])
    return tuple(found)


def families_of(outcomes: Sequence[Outcome]) -> dict[str, tuple[Family, list[str]]]:
    """Return families by name, with their requested outcomes."""
    found: dict[str, tuple[Family, list[str]]] = {}
    for outcome in outcomes:
        of = FAMILIES[outcome.family]
        found.setdefault(of.name, (of, []))[1].append(outcome.name)
    return found


@family("own", 5, {})
def prepare(setting: Setting) -> Prepared:
    """Return the prepared functions of the user for a scene."""
    functions = {name: (_own(name), _function(name)) for name in setting.names}
    scene = setting.uncertain.scene

    def one(key, numbers) -> Answers:
        drawn = with_values(scene, numbers)
        found = {}
        for name, (outcome, function) in functions.items():
            value = jnp.asarray(function(key, drawn))
            shape = (len(drawn.sensors),) if outcome.per_sensor else ()
            words = f"the shape {shape} for a sample"
            require(value.shape == shape, name, words, f"{value.shape}")
            number = outcome.kind == "number"
            found[name] = (
                value.astype(float) if number else yes_no(value, value == value)
            )
        return found

    return Prepared(
        jax.vmap(one),
        notes=tuple(f"{name}: a function of the user" for name in functions),
    )


def _own(name: str) -> Outcome:
    """Return a function of the user as an outcome."""
    plain = Outcome(name, "1", "", "own")
    about = getattr(_function(name), DESCRIBED, plain)
    words = about.long_name or f"{name.removeprefix(CODE)} of each sample"
    return replace(about, name=name, long_name=words)


def _function(name: str) -> Callable[..., Any]:
    module, _, function = name.removeprefix(CODE).rpartition(".")
    try:
        found = getattr(import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"{shown(name)}: cannot be imported: {error}") from None
    require(callable(found), shown(name), "a function", shown(found))
    return found
