"""An autopilot for testing a simulator: a position controller with a MAVLink link.

It has the vehicle's parameters, reads the state from HIL_STATE_QUATERNION and arms
immediately. `RoundedHold` is the same controller without a network, with the same
rounded numbers.
"""

from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jblast.autopilot.lockstep import ARMED, LOCKSTEP, PERIOD_S, state_message
from jblast.autopilot.mavlink import dialect, down, message, right, scalar_first
from jblast.missions.route import level
from jblast.observations.places import Frame
from jblast.vehicle import State, Vehicle


class RoundedHold(eqx.Module):
    """A controller with inputs and outputs rounded as in MAVLink's messages.

    Attributes:
        control: The controller.
        frame: Geodetic frame of the scene.
        of_motor: Index of the rotor of each motor.
    """

    control: Any
    frame: Frame = eqx.field(static=True)
    of_motor: Int[np.ndarray, "4"]

    @property
    def gains(self) -> Any:
        """Gains of the controller; the step limit depends on them."""
        return self.control.gains

    def start(self) -> PyTree[Array]:
        """Return the controller's state at the start."""
        return self.control.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: PyTree[Array],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], PyTree[Array]]:
        """Return rotor speed commands [rad/s], shape (4,), and the next state."""
        heard = jax.pure_callback(partial(rounded, self.frame), state, state)
        controls, memory = self.answer(heard, vehicle, memory, time_s)
        turned = jnp.zeros(4).at[self.of_motor].set(controls)
        return turned * vehicle.rotor_speed_max_rad_s, memory

    def answer(
        self, state: State, vehicle: Vehicle, memory: PyTree[Array], time_s: Any
    ) -> tuple[Float[Array, "4"], PyTree[Array]]:
        """Return motor controls, and the controller's next state."""
        period = jnp.asarray(PERIOD_S, float)
        speeds, memory = self.control(time_s, state, vehicle, memory, period)
        share = speeds[self.of_motor] / vehicle.rotor_speed_max_rad_s
        # Controls are single-precision fields of the message.
        return share.astype(jnp.float32).astype(float), memory


def received(sent: Any, system: int = 1, component: int = 1) -> Any:
    """Return a message as it is received, with the digits of its fields."""
    coder = dialect().MAVLink(None, system, component)
    return coder.parse_char(sent.pack(coder))


def state_heard(frame: Frame, heard: Any) -> State:
    """Return the state in HIL_STATE_QUATERNION, which lacks rotor speeds."""
    moves = np.array([heard.vx, heard.vy, heard.vz]) / 100
    rate = np.array([heard.rollspeed, heard.pitchspeed, heard.yawspeed])
    # Two half turns are their own inverses, up to the sign.
    turned = scalar_first(np.roll(np.array(heard.attitude_quaternion), -1))
    attitude = np.roll(turned, -1)
    place = level(frame, heard.lat * 1e-7, heard.lon * 1e-7, heard.alt * 1e-3)
    return State(
        *map(jnp.asarray, (place, down(moves), attitude, right(rate), np.zeros(4)))
    )


def rounded(frame: Frame, state: State) -> State:
    """Return the state that its message contains."""
    state = jax.tree.map(np.asarray, state)
    return state_heard(frame, received(state_message(frame, state, 0)))


def fly_mock(address: str, hold: RoundedHold, vehicle: Vehicle, turns: int) -> None:
    """Connect by TCP, answer a number of samples and disconnect.

    Args:
        address: Address of the simulator.
        hold: The controller.
        vehicle: The controller's model of the vehicle.
        turns: Number of samples to answer.
    """
    from pymavlink import mavutil

    control = eqx.filter_jit(RoundedHold.answer)
    memory: Any = hold.start()
    zero = np.zeros(3)
    at_rest = (zero, zero, np.array([0.0, 0.0, 0.0, 1.0]), zero, np.zeros(4))
    state = State(*map(jnp.asarray, at_rest))
    # Compiled before the simulator waits for an answer.
    control(hold, state, vehicle, memory, jnp.asarray(0.0))
    with mavutil.mavlink_connection(address, source_system=1, dialect="common") as end:
        while turns:
            came = end.recv_match(
                type=["HIL_STATE_QUATERNION", "HIL_SENSOR"], blocking=True, timeout=60
            )
            if came.get_type() == "HIL_STATE_QUATERNION":
                state = state_heard(hold.frame, came)
                continue
            stamp = came.time_usec
            time_s = jnp.asarray(stamp * 1e-6 - PERIOD_S)
            controls, memory = control(hold, state, vehicle, memory, time_s)
            end.mav.send(
                message(
                    "HIL_ACTUATOR_CONTROLS",
                    time_usec=stamp,
                    controls=[*np.asarray(controls).tolist(), *[0.0] * 12],
                    mode=ARMED | 1,
                    flags=LOCKSTEP,
                )
            )
            turns -= 1
