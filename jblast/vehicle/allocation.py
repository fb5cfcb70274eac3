"""Which rotor speeds make a thrust and a moment."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.motion import Four
from jblast.vehicle.parameters import Vehicle


def allocation(vehicle: Vehicle) -> Float[Array, "4 4"]:
    """Matrix that takes the four rotors' thrusts to total thrust and moment.

    Returns:
        Rows: thrust [N], moment about body x, y, z [N m], per newton of each rotor.
    """
    x, y, _ = vehicle.rotor_position_m.T
    reach = vehicle.moment_coefficient / vehicle.thrust_coefficient
    return jnp.stack([jnp.ones_like(x), y, -x, reach * vehicle.rotor_direction])


def rotor_speeds(vehicle: Vehicle, wanted: Four) -> Float[Array, "4"]:
    """Rotor speeds that make a thrust [N] and a moment [N m]; negative for a pull down.

    Args:
        vehicle: The vehicle, at rest in still air.
        wanted: Thrust and moments about body x, y and z.
    """
    return speeds_by(vehicle, jnp.linalg.inv(allocation(vehicle)), wanted)


def speeds_by(
    vehicle: Vehicle, inverse: Float[Array, "4 4"], wanted: Four
) -> Float[Array, "4"]:
    """Return the same by the inverse of the allocation."""
    speeds = []
    for row in inverse:
        a, b, c, d = row
        thrust = a * wanted[0] + b * wanted[1] + c * wanted[2] + d * wanted[3]
        square = jnp.abs(thrust) / vehicle.thrust_coefficient
        turns = square > 0
        speed = jnp.sqrt(jnp.where(turns, square, 1))
        speeds.append(jnp.where(turns, jnp.sign(thrust) * speed, 0))
    return jnp.stack(speeds)
