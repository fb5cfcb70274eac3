"""Scenes to fly: what they must say, and their draws from the priors."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.scene import Scene, UncertainScene, VehicleSpec, draw_scene, parameter_named
from jblast.scene.uncertain import leaf_of

MOST_VEHICLES = 10_000_000


def checked_scene(
    uncertain: UncertainScene, vehicles: int, by_profile: bool
) -> VehicleSpec:
    """Return the vehicle of a scene that can be flown.

    Args:
        uncertain: The scene.
        vehicles: How many are to fly.
        by_profile: Whether a custom profile takes the place of the laws.

    Raises:
        InputError: It has no vehicle, a charge without a place, a place below ground,
            several charges for one profile, or no prior to draw several from.
    """
    scene, source = uncertain.scene, uncertain.source or "scene"
    if scene.vehicle is None:
        raise InputError(
            f"{source}: [vehicle]: expected a vehicle with its model and position_m, "
            "got none"
        )
    if not 1 <= vehicles <= MOST_VEHICLES:
        raise InputError(
            f"vehicles: expected a whole number from 1 to {MOST_VEHICLES:,}, "
            f"got {vehicles}"
        )
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, from which the "
            "vehicle's own distance follows, got a range"
        )
    if by_profile and scene.others:
        raise InputError(
            f"{source}: [[charge]]: expected one charge for a custom profile, got "
            f"{len(scene.charges)}"
        )
    spec = scene.vehicle
    for key, place in (
        ("position_m", spec.position),
        ("control target_m", spec.target),
    ):
        if place is not None and float(place[2]) < 0:
            raise InputError(
                f"{source}: [vehicle] {key}: expected a place at or above the ground, "
                f"up 0 m, got {float(place[2]):g} m"
            )
    if vehicles > 1 and not uncertain.beliefs:
        raise InputError(
            f"{source}: expected a number with a prior to draw {vehicles} scenes from, "
            "got none: all vehicles would fly alike"
        )
    return spec


def drawn_scenes(uncertain: UncertainScene, vehicles: int, seed: int) -> Scene:
    """Draw scenes; several have a leading axis in every array.

    Raises:
        InputError: A number is free, or one was drawn that cannot be.
    """
    key = jax.random.key(seed)
    if vehicles == 1:
        scenes = draw_scene(key, uncertain)
    else:
        keys = jax.random.split(key, vehicles)
        scenes = eqx.filter_vmap(lambda key: draw_scene(key, uncertain))(keys)
    for name, values in drawn_values(uncertain, scenes).items():
        bounds = parameter_named(name).bounds
        refused = [v for v in values.ravel() if not bounds.allows(float(v))]
        if refused:
            raise InputError(
                f"{uncertain.source or 'scene'}: seed {seed} draws {name} "
                f"{refused[0]:g}, one of {len(refused)} such of {values.size}; "
                f"expected a prior of what is {bounds.words()}"
            )
    return scenes


def drawn_values(
    uncertain: UncertainScene, scenes: Scene
) -> dict[str, Float[np.ndarray, "..."]]:
    """Return what was drawn, by name."""
    return {name: np.asarray(leaf_of(scenes, name)) for name in uncertain.beliefs}
