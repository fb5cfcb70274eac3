"""What a run carries along, and what stays the same throughout it."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.waves.euler.gas import Gas, IdealGas
from jblast.waves.euler.geometry import Geometry
from jblast.waves.euler.mesh import Mesh


class FlowState(eqx.Module):
    """The flow at one instant; masses, volumes and energies a steradian (or m2).

    Attributes:
        radius: Of the faces [m].
        mass: In each cell [kg].
        volume: Of the cells [m3]. The faces give it too, but with few digits in float32
            where a cell is thin.
        momentum: In each cell, outward [kg m/s].
        energy: In each cell, kinetic and internal [J].
        clock: Radius of the fitted shock [m], or time [s] where none is fitted.
        time: [s].
        alive: Whether all densities and pressures are positive, looked at as a step
            begins and at the end of a run; without, the state stays as it is.
    """

    radius: Float[Array, "face ..."]
    mass: Float[Array, "cell ..."]
    volume: Float[Array, "cell ..."]
    momentum: Float[Array, "cell ..."]
    energy: Float[Array, "cell ..."]
    clock: Float[Array, "..."]
    time: Float[Array, "..."]
    alive: Bool[Array, "..."]


class Ambient(eqx.Module):
    """The still air that a fitted shock runs into.

    Attributes:
        pressure: [Pa].
        density: [kg/m3].
        gas: An ideal one, for its jump has a closed form.
    """

    pressure: Float[Array, "..."]
    density: Float[Array, "..."]
    gas: IdealGas


class Flow(eqx.Module):
    """What stays the same throughout a run.

    Attributes:
        mesh: The masses of the cells.
        gas: What is in them.
        ambient: What a fitted shock runs into; None for a rigid wall at the outer end.
            The inner end is a rigid wall, or the centre.
        geometry: "planar" or "spherical".
        limited: Whether slopes are limited; without, only smooth flow stays smooth.
    """

    mesh: Mesh
    gas: Gas
    ambient: Ambient | None
    geometry: Geometry = eqx.field(static=True, default="spherical")
    limited: bool = eqx.field(static=True, default=True)


class Primitives(NamedTuple):
    """Means over cells, or values at faces.

    Attributes:
        density: [kg/m3].
        velocity: Outward [m/s].
        pressure: [Pa].
    """

    density: Float[Array, "..."]
    velocity: Float[Array, "..."]
    pressure: Float[Array, "..."]


def primitives(state: FlowState, gas: Gas) -> Primitives:
    """Return what is in each cell."""
    density = state.mass / state.volume
    velocity = state.momentum / state.mass
    internal = (state.energy - 0.5 * velocity * state.momentum) / state.volume
    return Primitives(density, velocity, gas.pressure(density, internal))


def is_positive(state: FlowState, gas: Gas) -> Bool[Array, "..."]:
    """Return whether all densities and pressures are positive."""
    cells = primitives(state, gas)
    least = jnp.minimum(cells.density, cells.pressure)
    return jnp.all(least > 0.0, axis=0)
