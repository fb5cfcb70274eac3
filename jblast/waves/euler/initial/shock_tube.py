"""A straight tube with rigid ends: Sod's start, or any profile given by its cells."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError
from jblast.types import as_float_array
from jblast.waves.euler.gas import Gas, IdealGas
from jblast.waves.euler.mesh import SlidingMesh
from jblast.waves.euler.state import Flow, FlowState, Primitives

SOD_LEFT = (1.0, 0.0, 1.0)
SOD_RIGHT = (0.125, 0.0, 0.1)
"""Density, velocity, pressure; G. A. Sod (1978), J. Comput. Phys. 27:1."""


def start_tube(
    faces: Float[Array, " face"],
    cells: Primitives,
    gas: Gas,
    *,
    rate: Float[Array, " face"] | None = None,
    limited: bool = True,
) -> tuple[Flow, FlowState]:
    """Return a tube filled cell by cell.

    Args:
        faces: Of the cells, ascending [m].
        cells: What is in them: mean density, momentum over mass, and the pressure of
            the mean internal energy.
        gas: What it is.
        rate: Mass that each face overtakes [kg/s]; none if not given.
        limited: Whether slopes are limited.

    Raises:
        InputError: There are fewer than three cells.
    """
    if faces.shape[0] < 4:
        raise InputError(f"faces: expected at least 4, got {faces.shape[0]}")
    volume = jnp.diff(faces)
    internal = gas.energy(cells.density, cells.pressure)
    mass = cells.density * volume
    state = FlowState(
        radius=faces,
        mass=mass,
        volume=volume,
        momentum=mass * cells.velocity,
        energy=internal * volume + 0.5 * mass * cells.velocity**2,
        clock=jnp.zeros_like(faces[0]),
        time=jnp.zeros_like(faces[0]),
        alive=jnp.isfinite(faces[0]),
    )
    mesh = SlidingMesh(jnp.zeros_like(faces) if rate is None else rate)
    return Flow(mesh, gas, None, "planar", limited), state


def start_sod(
    cells: int, length: Float[ArrayLike, ""] = 1.0, *, limited: bool = True
) -> tuple[Flow, FlowState]:
    """Return Sod's shock tube, the diaphragm in its middle.

    Args:
        cells: How many, even.
        length: Of the tube [m].
        limited: Whether slopes are limited.

    Raises:
        InputError: The number of cells is odd, so the diaphragm would be inside one.
    """
    if cells % 2:
        raise InputError(f"cells: expected an even number, got {cells}")
    length = as_float_array(length)
    faces = length * jnp.linspace(-0.5, 0.5, cells + 1, dtype=length.dtype)
    at_left = jnp.arange(cells) < cells // 2
    filled = Primitives(
        *(
            jnp.where(at_left, a, b).astype(length.dtype)
            for a, b in zip(SOD_LEFT, SOD_RIGHT, strict=True)
        )
    )
    gas = IdealGas(jnp.asarray(1.4, length.dtype))
    return start_tube(faces, filled, gas, limited=limited)
