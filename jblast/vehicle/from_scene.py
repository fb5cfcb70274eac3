"""What a scene says of its vehicle, as what flies: vehicle, start, controller."""

from collections.abc import Callable

import jax.numpy as jnp

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError, nearest
from jblast.scene import VehicleSpec
from jblast.vehicle.control.allocation import rotor_speeds
from jblast.vehicle.control.cascade import Cascade
from jblast.vehicle.control.gains import NAMED, gains_from_parameters
from jblast.vehicle.control.observed_hold import ObservedHold
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


def cascade_of(spec: VehicleSpec) -> Cascade:
    """Return PX4's cascade for its target and yaw, with the hold's gain of body rates.

    Raises:
        InputError: As `hold_of`.
    """
    hold = hold_of(spec, integral=False)
    return Cascade(hold.target_m, hold.gains.body_rate, hold.yaw_rad)


Holds = PositionHold | ObservedHold | Cascade

CONTROLLERS: dict[str, Callable[[VehicleSpec], Holds]] = {
    "with_integral": lambda spec: hold_of(spec, integral=True),
    "without_integral": lambda spec: hold_of(spec, integral=False),
    "cascade": cascade_of,
    "observer": lambda spec: ObservedHold(hold_of(spec, integral=False)),
}
"""What may hold a vehicle in its place: the SE(3) hold with its integral or without,
PX4's cascade, the SE(3) hold with a disturbance observer."""


def controller_of(spec: VehicleSpec, name: str) -> Holds:
    """Return a controller for its target and yaw.

    Args:
        spec: The vehicle.
        name: Of `CONTROLLERS`.

    Raises:
        InputError: There is none of that name, or as `hold_of`.
    """
    if name not in CONTROLLERS:
        raise InputError(
            f"controller {name!r}: expected one of {', '.join(CONTROLLERS)}"
            f"{nearest(name, CONTROLLERS)}"
        )
    return CONTROLLERS[name](spec)
