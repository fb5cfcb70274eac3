"""What a scene says of its vehicle, as what flies: vehicle, start, position hold."""

import jax.numpy as jnp

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.scene import VehicleSpec
from jblast.vehicle.control.allocation import rotor_speeds
from jblast.vehicle.control.gains import NAMED, gains_from_parameters
from jblast.vehicle.control.position_hold import PositionHold
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.quadrotor.models import named
from jblast.vehicle.quadrotor.parameters import Vehicle


def vehicle_of(spec: VehicleSpec) -> Vehicle:
    """Return the vehicle.

    Raises:
        InputError: There is no such model.
    """
    return named(spec.model)


def start_of(spec: VehicleSpec) -> State:
    """Return the start: level, turned to its yaw, rotors that carry its weight."""
    vehicle = vehicle_of(spec)
    zero = jnp.zeros_like(spec.yaw)
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return State(
        position_m=spec.position,
        velocity_m_s=spec.velocity,
        quaternion=jnp.stack(
            [zero, zero, jnp.sin(spec.yaw / 2), jnp.cos(spec.yaw / 2)]
        ),
        body_rate_rad_s=jnp.zeros(3),
        rotor_speed_rad_s=rotor_speeds(vehicle, (weight, zero, zero, zero)),
    )


def hold_of(spec: VehicleSpec, *, integral: bool) -> PositionHold:
    """Return the hold of its target and yaw.

    Args:
        spec: The vehicle; gains it does not name are its model's.
        integral: Whether the hold has integral action, whatever the scene says.

    Raises:
        InputError: A gain cannot be used, or the vehicle flies a mission.
    """
    if spec.mission is not None:
        raise InputError(
            f"[vehicle] mission: {spec.mission}: expected a vehicle that holds its "
            "place, got one with a mission, which jblast fly flies and nothing else "
            "does yet"
        )
    gains = NAMED[spec.model] | spec.gains
    if not integral:
        gains = {name: value for name, value in gains.items() if name != "ki_pos"}
    return PositionHold(
        target_m=spec.held,
        gains=gains_from_parameters(gains),
        yaw_rad=spec.yaw,
    )
