"""The curve sets of the blasts that vehicles fly through: as said, or by height."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jblast.scene import Charge, Scene, VehicleSpec
from jblast.vehicle.from_scene import free_air_at
from jblast.waves.height_of_burst import burst_notes, scaled_height


def with_bursts_at_start(
    scenes: Scene, vehicle: VehicleSpec
) -> tuple[Scene, tuple[str, ...]]:
    """Return scenes with the curve sets that hold where their vehicle starts.

    All vehicles of a batch fly through waves of one set: the free-air curves where the
    reflection from the ground comes after the positive phase for each, else the surface
    curves, which are the stronger.

    Args:
        scenes: One, or many with a leading axis in every array.
        vehicle: Where it starts.

    Returns:
        The scenes, and what there is to say of charges above the ground.
    """
    place = jnp.asarray(vehicle.position)[None, :]
    charges, notes = [], []
    for n, charge in enumerate(scenes.charges):
        free, height = np.zeros(1, bool), np.zeros(1)
        if np.any(np.asarray(charge.up) > 0.0):
            free, height = (np.ravel(x) for x in _each(scenes, n, place))
        if charge.burst is None:
            burst = "free-air" if free.all() else "surface"
            charge = replace(charge, burst=burst, by_height=True)
        if height.max() > 0.0:
            ends = float(height.min()), float(height.max())
            notes += burst_notes(charge, ends, free, "vehicle")
        charges.append(charge)
    scenes = replace(scenes, charge=charges[0], others=tuple(charges[1:]))
    return scenes, tuple(notes)


def _each(scenes: Scene, n: int, place: Array) -> tuple[Array, Array]:
    def one(scene: Scene) -> tuple[Array, Array]:
        charge: Charge = scene.charges[n]
        return free_air_at(scene, charge, place)[0], scaled_height(scene, charge)

    one = eqx.filter_jit(one)
    batched = jax.tree.leaves(scenes)[0].ndim > 0
    return eqx.filter_vmap(one)(scenes) if batched else one(scenes)
