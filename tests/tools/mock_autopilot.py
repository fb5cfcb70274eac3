"""An autopilot for testing a simulator: a position controller with a MAVLink link.

It has the vehicle's parameters, reads the state from HIL_STATE_QUATERNION and arms
immediately. `RoundedHold` is the same controller without a network, with the same
rounded numbers.
"""

import socket
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jblast.autopilot.lockstep import (
    ARMED,
    ECCENTRICITY_SQUARED,
    FLIP,
    LOCKSTEP,
    PERIOD_S,
    RADIUS_M,
    STATE,
    TURN,
    Origin,
    body,
    state_reported,
    world,
)
from jblast.autopilot.mavlink import Message, Receiver, Sender
from jblast.scene.camera import quaternion_product
from jblast.vehicle import Controller, State, Vehicle


class RoundedHold(eqx.Module):
    """A controller with inputs and outputs rounded as in MAVLink's messages.

    Attributes:
        control: The controller.
        origin: Geodetic origin of the scene.
        of_motor: Index of the rotor of each motor.
    """

    control: Any
    origin: Origin
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
        still = jnp.zeros(3)
        reported = state_reported(self.origin, state, still, still)
        controls, memory = self.answer(reported, vehicle, memory, time_s)
        turned = jnp.zeros(4).at[self.of_motor].set(controls)
        return turned * vehicle.rotor_speed_max_rad_s, memory

    def answer(
        self,
        reported: Float[Array, "18"],
        vehicle: Vehicle,
        memory: PyTree[Array],
        time_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], PyTree[Array]]:
        """Return motor controls for a message, and the controller's next state."""
        state = state_heard(self.origin, reported, jnp.zeros(4))
        control: Controller = self.control
        period = jnp.asarray(PERIOD_S, float)
        speeds, memory = control(time_s, state, vehicle, memory, period)
        share = speeds[self.of_motor] / vehicle.rotor_speed_max_rad_s
        # Controls are single-precision fields of the message.
        return share.astype(jnp.float32).astype(float), memory


class Mock:
    """Autopilot that maps received messages to answers, without a link.

    Args:
        hold: The controller.
        vehicle: The controller's model of the vehicle.
    """

    def __init__(self, hold: RoundedHold, vehicle: Vehicle):
        arrays, rest = eqx.partition((hold, vehicle), eqx.is_array)

        def control(arrays: Any, *reported: Any) -> tuple[Array, PyTree[Array]]:
            own, known = eqx.combine(arrays, rest)
            return own.answer(reported[0], known, *reported[1:])

        self._control = partial(jax.jit(control), arrays)
        self._memory, self._sender = hold.start(), Sender(1, 1)
        still = jnp.zeros(3)
        level = jnp.array([0.0, 0.0, 0.0, 1.0])
        at_rest = State(still, still, level, still, jnp.zeros(4))
        self._reported: Any = state_reported(hold.origin, at_rest, still, still)
        # Compiled before the simulator waits for an answer.
        self._control(self._reported, self._memory, 0.0)

    def answer(self, message: Message) -> bytes | None:
        """Return the answer to a message; None if the message needs none."""
        if message.name == "HIL_STATE_QUATERNION":
            values = message.values
            rest = (values[name] for name in STATE[4:])
            self._reported = np.array([*values["attitude_quaternion"], *rest])
        if message.name != "HIL_SENSOR":
            return None
        stamp = message.values["time_usec"]
        time_s = stamp * 1e-6 - PERIOD_S
        controls, self._memory = self._control(self._reported, self._memory, time_s)
        return self._sender.pack(
            "HIL_ACTUATOR_CONTROLS",
            time_usec=stamp,
            controls=[*np.asarray(controls).tolist(), *[0.0] * 12],
            mode=ARMED | 1,
            flags=LOCKSTEP,
        )


def fly_mock(address: tuple[str, int], mock: Mock, turns: int) -> int:
    """Connect by TCP, answer a number of samples and disconnect.

    Args:
        address: Address of the simulator.
        mock: The autopilot.
        turns: Number of samples to answer.

    Returns:
        Number of answered samples; fewer if the simulator disconnected.
    """
    receiver, answered = Receiver(), 0
    with socket.create_connection(address, timeout=60.0) as link:
        # Small answers must not wait for more data (Nagle's algorithm).
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while answered < turns and (data := link.recv(65536)):
            for message in receiver.feed(data):
                answer = mock.answer(message)
                if answer is not None and answered < turns:
                    link.sendall(answer)
                    answered += 1
    return answered


def state_heard(
    origin: Origin, reported: Float[Array, "18"], rotor_speed_rad_s: Float[Array, "4"]
) -> State:
    """Return the state in the numbers of HIL_STATE_QUATERNION.

    Args:
        origin: Geodetic origin of the scene.
        reported: Fields of the message.
        rotor_speed_rad_s: Rotor speeds, which the message lacks.
    """
    lat_lon_alt = reported[7:10] * jnp.array([1e-7, 1e-7, 1e-3])
    return State(
        level_of(origin, lat_lon_alt),
        world(reported[10:13] / 100),
        attitude_in(reported[:4]),
        body(reported[4:7]),
        rotor_speed_rad_s,
    )


def attitude_in(quaternion: Float[Array, "4"]) -> Float[Array, "4"]:
    """Return an attitude (x, y, z, w) from the autopilot's form (w, x, y, z)."""
    ours = jnp.roll(quaternion, -1)
    return quaternion_product(
        quaternion_product(jnp.asarray(TURN), ours), jnp.asarray(FLIP)
    )


def level_of(origin: Origin, geodetic: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return the position of a latitude, longitude [degree] and height [m]."""
    lat, lon = jnp.radians(geodetic[0]), jnp.radians(geodetic[1])
    out = jnp.stack(
        [jnp.cos(lat) * jnp.cos(lon), jnp.cos(lat) * jnp.sin(lon), jnp.sin(lat)]
    )
    normal = RADIUS_M / jnp.sqrt(1 - ECCENTRICITY_SQUARED * out[2] * out[2])
    stretch = jnp.array([1.0, 1.0, 1 - ECCENTRICITY_SQUARED])
    centred = (normal * stretch + origin.height_m) * out
    flat = jnp.asarray(origin.axes) @ (centred - origin.centred_m)
    return flat.at[2].set(geodetic[2] - origin.height_m)
