"""Where a scene's sensors stand to its charges, as far as that is known."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import NormalDist

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jblast.errors import InputError, nearest
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES, components
from jblast.scene import (
    Charge,
    Scene,
    Sensor,
    UncertainScene,
    parameter_named,
    with_values,
)
from jblast.scene.uncertain import Free
from jblast.waves.paths import Path, path_between

SCORES = tuple(NormalDist().inv_cdf(p) for p in (0.05, 0.95))
"""Of the ends of a prior's 90 % interval."""


def sensors_for(scene: Scene, quantity: str) -> tuple[Sensor, ...]:
    """Return the sensors of a scene that measure a quantity.

    One that does not say what it records may measure anything, and what no sensor
    records (`shock_speed_m_s`) is asked for at all of them.

    Raises:
        InputError: There is no such quantity, or no such sensor.
    """
    known = (*QUANTITIES, *DERIVED_QUANTITIES)
    if quantity not in known:
        raise InputError(
            f"unknown quantity {quantity!r}{nearest(quantity, known)}; expected one of "
            f"{', '.join(known)}"
        )
    parts = [part for part, _ in components(quantity)]
    if parts != [quantity]:
        raise InputError(
            f"{quantity} is made of {' and '.join(parts)}: expected one of these"
        )
    found = tuple(
        sensor
        for sensor in scene.sensors
        if not sensor.records
        or quantity in DERIVED_QUANTITIES
        or any(quantity in dict(components(held)) for held, _ in sensor.records)
    )
    if not found:
        held = sorted({q for sensor in scene.sensors for q, _ in sensor.records})
        raise InputError(
            f"no sensor of the scene records {quantity}: expected a [[sensor]] with "
            f"records = {{ {quantity} = SIGMA }}, got "
            f"{', '.join(held) or 'no sensor at all'}"
        )
    return found


def paths_in(
    uncertain: UncertainScene, quantity: str, sensors: Sequence[Sensor]
) -> list[Path]:
    """Return the paths from every charge to some sensors; masses are those of TNT.

    Curve sets are not settled (see `by_curves`). A number with a prior is taken at both
    ends of its 90 % interval, one number at a time, the others at their medians; of the
    paths, the charges run fastest.

    Raises:
        InputError: A sensor has no place, or a number that decides is free.
    """
    scene = uncertain.scene
    cases = [scene]
    for name, belief in uncertain.beliefs.items():
        if not parameter_named(name).decides:
            continue
        if isinstance(belief, Free):
            raise InputError(
                f"{uncertain.source or 'scene'}: {name} is free: expected a value or a "
                "prior, as what suffices depends on it"
            )
        ends = [belief.constrain(score) for score in SCORES]
        cases += [with_values(scene, {name: end}) for end in ends]
    for sensor in sensors:
        placed = scene.charge.range_m is not None
        if not placed and not np.isfinite(sensor.position_m).all():
            raise InputError(
                f"sensor {sensor.name!r}: expected position_m = [east, north, up] in "
                "its [[sensor]], got nothing"
            )
    place = jnp.stack([sensor.position_m for sensor in sensors])
    return [
        tnt_path(case, charge, quantity, place)
        for case in cases
        for charge in case.charges
    ]


def by_curves(paths: Sequence[Path]) -> list[Path]:
    """Return paths whose curve set is said: the one that the height leaves.

    Where it leaves both, a method has to do for either at every place: the surface
    curves first, the free-air ones behind all others.
    """
    first, more = [], []
    for path in paths:
        if path.free_air is None:
            first.append(path)
            continue
        free = np.asarray(path.free_air)
        one = "free-air" if free.all() else "surface"
        first.append(replace(path, burst=one, free_air=None))
        if free.any() and not free.all():
            more.append(replace(path, burst="free-air", free_air=None))
    return first + more


def tnt_path(scene: Scene, charge: Charge, quantity: str, place: Array) -> Path:
    """Return the path from a charge to places; the mass is that of TNT."""
    nothing = jnp.full(len(place), jnp.nan)
    path = path_between(scene, charge, place, nothing, nothing)
    return replace(path, charge_mass=charge.tnt_mass(quantity))
