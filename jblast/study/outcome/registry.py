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
from jblast.errors import InputError, argument, nearest, shown
from jblast.scene.uncertain import with_values
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
    found, known = [], known_outcomes()
    for name in names:
        if name.startswith(CODE):
            if not allow_code:
                raise InputError(
                    f"{source}: outcomes: expected {argument('allow_code')} with "
                    f"the Python function {shown(name)}, got none"
                )
            found.append(_own(name))  # fails here, before the first sample
        elif name in known:
            found.append(known[name])
        else:
            raise InputError(
                f"{source}: outcomes: unknown outcome {shown(name)}"
                f"{nearest(name, known)}; expected one of {', '.join(known)}"
            )
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
            if value.shape != shape:
                raise InputError(
                    f"{name}: expected the shape {shape} for a sample, got "
                    f"{value.shape}"
                )
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
    if not callable(found):
        raise InputError(f"{shown(name)}: expected a function, got {shown(found)}")
    return found
