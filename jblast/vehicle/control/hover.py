"""How a vehicle hovers in a steady wind: tilted against it, at rest over ground."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.allocation import rotor_speeds
from jblast.vehicle.dynamics.components import components, three, turned
from jblast.vehicle.dynamics.equations import air_wrench
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.quadrotor.parameters import Vehicle

ROUNDS = 8
"""Of a fixed point: each is off by a tenth of the one before, or less, up to 10 m/s."""


def hover_in_wind(
    vehicle: Vehicle,
    position_m: Float[Array, "3"],
    yaw_rad: Float[Array, ""],
    wind_m_s: Float[Array, "3"],
) -> State:
    """Return the state in which a vehicle stays where it is.

    Thrust and the wind's drag and lift carry its weight; moments of the wind, which
    speeds of single rotors balance, are left out.

    Args:
        vehicle: The vehicle.
        position_m: Where.
        yaw_rad: Heading, from east to north.
        wind_m_s: Of the air.
    """
    still, wind = three(jnp.zeros(3)), three(wind_m_s)
    weight = vehicle.mass_kg * FLIGHT_GRAVITY * jnp.array([0.0, 0.0, 1.0])

    def balance(pull: Float[Array, "3"], _: None) -> tuple[Float[Array, "3"], None]:
        motion = components(_state(vehicle, position_m, yaw_rad, pull))
        blown, quiet = (
            jnp.stack(turned(motion.quaternion, air_wrench(vehicle, motion, air)[0]))
            for air in (wind, still)
        )
        return weight - (blown - quiet), None

    # one program for all rounds
    pull, _ = jax.lax.scan(balance, weight + 0 * wind_m_s, None, length=ROUNDS)
    return _state(vehicle, position_m, yaw_rad, pull)


def _state(
    vehicle: Vehicle,
    position_m: Float[Array, "3"],
    yaw_rad: Float[Array, ""],
    pull: Float[Array, "3"],
) -> State:
    """Return the state whose rotors pull so, at rest."""
    size = jnp.sqrt(jnp.sum(jnp.square(pull)))
    x, y, z = pull / size
    # the least turn from up to the pull, after the turn of the heading
    tilt = jnp.stack([-y, x, jnp.zeros_like(x), 1 + z])
    tilt = tilt / jnp.sqrt(jnp.sum(jnp.square(tilt)))
    sine, cosine = jnp.sin(yaw_rad / 2), jnp.cos(yaw_rad / 2)
    a, b, _, w = tilt
    quaternion = jnp.stack(
        [a * cosine + b * sine, b * cosine - a * sine, w * sine, w * cosine]
    )
    still, none = jnp.zeros(3), jnp.zeros_like(size)
    speeds = rotor_speeds(vehicle, (size, none, none, none))
    return State(position_m, still, quaternion, still, speeds)
