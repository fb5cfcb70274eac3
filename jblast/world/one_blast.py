"""What is known of one blast of a world before anything was measured of it."""

import os
from dataclasses import replace

import jax.numpy as jnp

from jblast.errors import InputError
from jblast.parameter_table import CHARGE_POSITION
from jblast.scene import (
    Box,
    ByCount,
    Charge,
    Free,
    UncertainScene,
    Uniform,
    WorldSpec,
    read_scene_or_world,
)
from jblast.scene.priors import Belief, Prior
from jblast.sensors import record_laws


def scene_of_one_blast(uncertain: UncertainScene, world: WorldSpec) -> UncertainScene:
    """Return a scene to fit one of a world's blasts in.

    Its mass has the prior that it was drawn by, and so has its place in a box about the
    origin. In a ring, or about a vehicle, place is free (of a ring, on the ground).
    Time is free, unless it is said or a prior without gaps: that of one among several
    depends on the others. Laws are those that the world is made by, unless the scene
    names others.

    Args:
        uncertain: The scene besides.
        world: What blasts are drawn by.

    Raises:
        InputError: The scene has a charge of its own beside the random ones.
    """
    scene = uncertain.scene
    if not bool(scene.charge.never):
        raise InputError(
            f"{uncertain.source or 'scene'}: [charge]: expected none beside [world] "
            "in a scene to fit with, which leaves open what is known of which shot; "
            "got one"
        )
    beliefs: dict[str, Belief] = {}
    region, place = world.region, [0.0, 0.0, 0.0]
    for axis, name in enumerate(CHARGE_POSITION):
        if isinstance(region, Box) and world.about == "world":
            low, high = region.low[axis], region.high[axis]
            place[axis] = float(0.5 * (low + high))
            if float(low) < float(high):
                beliefs[name] = Uniform(low, high)
        elif isinstance(region, Box) or axis < 2:
            beliefs[name] = Free(positive=False)
    mass, time = world.mass, world.time
    if isinstance(mass, Prior):
        beliefs["charge_mass_kg"] = mass
        mass = mass.constrain(jnp.zeros(()))
    independent = isinstance(world.occurrence, ByCount) and world.occurrence.count == 1
    if isinstance(time, Prior):
        beliefs["origin_time_s"] = time if independent else Free(positive=False)
        time = time.constrain(jnp.zeros(()))
    charge = Charge(mass, tuple(place), time)
    laws = dict(scene.law) | record_laws(scene, ground=True)
    scene = replace(scene, charge=charge, law=tuple(laws.items()))
    return replace(uncertain, scene=scene, beliefs={**uncertain.beliefs, **beliefs})


def scene_to_fit(path: str | os.PathLike[str]) -> UncertainScene:
    """Read a scene to fit logs in: of random blasts, that of any one of them.

    Raises:
        InputError: As in `read_scene` and `scene_of_one_blast`.
    """
    uncertain, world = read_scene_or_world(path)
    return uncertain if world is None else scene_of_one_blast(uncertain, world)
