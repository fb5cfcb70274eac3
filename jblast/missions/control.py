r"""A controller that flies a mission: guidance says where to be, a position hold goes.

The hold is told of a target that moves: its velocity and acceleration come in by the
velocity that it is shown, $v - v_{sp} - a/k_d$, so that what it asks for is
$-k_p e_x - k_d (v - v_{sp}) + a$ and its integral sees places alone. In $a$ is, beside
the set point's acceleration, what its own rotors' drag at hover takes from the vehicle
at that velocity in still air, $(k_d, k_d, k_z) \sum \Omega_i v_{sp} / m$: without it
an Iris trails 0.2 m behind at 5 m/s for as long as its integral needs.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.missions.guidance import ARMED, FLYING, Guidance, Progress, SetPoint
from jblast.vehicle import Controller, Gains, PositionHold, State, Vehicle
from jblast.vehicle.control.position_hold import Readied
from jblast.vehicle.dynamics.components import three

IDLE_SHARE = 0.2
"""Of the speed at which the rotors carry the weight; declared."""

Memory = tuple[Float[Array, "3"], Progress]


class MissionControl(Readied):
    """Flies a mission unattended.

    Attributes:
        guidance: The mission.
        hold: Who follows the set point; its target and heading are not used.

    Example:
        `simulate(vehicle, start, control=MissionControl(guidance, hold), ...)`
    """

    guidance: Guidance
    hold: PositionHold

    @property
    def gains(self) -> Gains:
        """Of the hold: by them the step is checked."""
        return self.hold.gains

    def start(self) -> Memory:
        """Return the hold's integral and the mission's progress."""
        return self.hold.start(), self.guidance.start()

    def ready(self, vehicle: Vehicle) -> Controller:
        """Return the same with its allocation inverted, once for a flight."""
        return _Ready(self, self.hold.ready(vehicle))


class _Ready(eqx.Module):
    """A mission's control that need not invert its allocation at every turn."""

    control: MissionControl
    hold: Any

    def start(self) -> Memory:
        return self.control.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Memory,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Memory]:
        integral, now = memory
        aim, after = self.control.guidance(state, now, period_s)
        moved = as_if_at_rest(vehicle, self.control.gains, state, aim)
        hold = eqx.tree_at(
            lambda ready: (ready.hold.target_m, ready.hold.yaw_rad),
            self.hold,
            (aim.position_m, now.yaw_rad),
        )
        speeds, gained = hold(time_s, moved, vehicle, integral, period_s)
        idle = IDLE_SHARE * _hover_speed(vehicle)
        idle = jnp.where(now.phase == ARMED, idle, 0.0)
        flies = now.phase == FLYING
        speeds = jnp.where(flies, speeds, idle)
        return speeds, (jnp.where(flies, gained, 0.0), after)


def as_if_at_rest(vehicle: Vehicle, gains: Gains, state: State, aim: SetPoint) -> State:
    """Return what a hold is shown, so that it follows an aim that moves.

    Args:
        vehicle: As the hold knows it.
        gains: Of the hold.
        state: Of the vehicle.
        aim: Where it should be.
    """
    drag = 4 * _hover_speed(vehicle) * vehicle.rotor_drag / vehicle.mass_kg

    def along(
        speed: Array, wanted: Array, gained: Array, gain: Array, pull: Array
    ) -> Array:
        lead = gained + pull * wanted
        some = gain > 0
        lead = jnp.where(some, lead / jnp.where(some, gain, 1.0), 0.0)
        return speed - wanted - lead

    # axis by axis: a step of many vehicles has no arrays but theirs
    axes = map(
        three,
        (
            state.velocity_m_s,
            aim.velocity_m_s,
            aim.acceleration_m_s2,
            gains.velocity,
            drag,
        ),
    )
    shown = jnp.stack([along(*axis) for axis in zip(*axes, strict=True)])
    return dataclasses.replace(state, velocity_m_s=shown)


def _hover_speed(vehicle: Vehicle) -> Float[Array, ""]:
    """Return the speed at which the rotors carry the weight [rad/s]."""
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return jnp.sqrt(weight / (4 * vehicle.thrust_coefficient))
