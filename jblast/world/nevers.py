"""Charges that never happen, for programs that worlds of many sizes share."""

from dataclasses import replace

import jax.numpy as jnp

from jblast.scene import Scene


def with_nevers(scene: Scene) -> Scene:
    """Return a scene with charges that never happen, to a power of two of them.

    A flight is compiled for a number of blasts. So five blasts fly by the program of
    eight. The charges are like the first one, on the ground.

    Args:
        scene: What is there.
    """
    count = len(scene.charges)
    missing = 2 ** (count - 1).bit_length() - count
    east, north, _ = scene.charge.position_m
    place = east, north, jnp.zeros_like(east)
    never = replace(
        scene.charge, time_s=jnp.full_like(east, jnp.inf), position_m=place, name=""
    )
    return replace(scene, others=(*scene.others, *(never,) * missing))
