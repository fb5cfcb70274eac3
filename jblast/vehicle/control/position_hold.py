r"""Position hold by geometric control on SE(3), within what a vehicle can do.

Lee, Leok and McClamroch (2010), with a target at rest:

- pull $F/m = -k_p e_x - k_d e_v - k_i \int e_x\,dt + g z$, within the limits of
  `pull.py`; thrust $F \cdot R z$, at least its floor;
- $b_3 = F/|F|$, $b_2 = b_3 \times c/|b_3 \times c|$ with the heading
  $c = (\cos\psi, \sin\psi, 0)$, or 45 degrees from the vehicle's towards it,
  $b_1 = b_2 \times b_3$, $R_d = (b_1, b_2, b_3)$;
- $e_R = \frac12 (R_d^T R - R^T R_d)^\vee$;
- $M = J(-k_R e_R - k_\omega \omega) + \omega \times J\omega$;
- rotor speeds from thrust and moment by `allocation.py`: within their limits, roll and
  pitch before the thrust and that before yaw; by a lead (`motor_lead.py`) if the gains
  have one.

No limit is reached near hover. Without them the law by itself asks for less than no
thrust as soon as it climbs faster than $g/k_d$, 1.1 m/s: its rotors stand, and it can
neither right itself nor brake. Without the integral a steady wind leaves an offset for
ever; each axis of it is held within its limit.
"""

import abc
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.allocation import allocation, speeds_within
from jblast.vehicle.control.gains import Gains
from jblast.vehicle.control.motor_lead import led
from jblast.vehicle.control.pull import THRUST_FLOOR, pull_within
from jblast.vehicle.dynamics.components import (
    MatrixRows,
    Vector,
    add,
    cross,
    dot,
    four,
    rotation,
    rows,
    three,
    times,
)
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.quadrotor.numbers import floats
from jblast.vehicle.quadrotor.parameters import Vehicle


@runtime_checkable
class Controller(Protocol):
    """What commands the rotors: called at fixed times, its answer held in between.

    It may also have a method `ready(vehicle)` that returns a controller for a flight of
    that vehicle, with whatever does not change in flight calculated.
    """

    def start(self) -> PyTree[Array]:
        """Return its memory at the start."""
        ...

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: PyTree[Array],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], PyTree[Array]]:
        """Return rotor speeds to ask for [rad/s], and its memory afterwards."""
        ...


class Readied(eqx.Module):
    """A controller that is asked as what it is ready as, be it for one turn.

    Raises:
        TypeError: A class made of it has a `__call__` of its own, which no flight would
            ever ask.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        """Refuse a call that would not be heard."""
        super().__init_subclass__(**options)
        if "__call__" in vars(cls):
            message = (
                f"{cls.__name__}: a flight asks what ready() returns, never __call__: "
                "expected a ready() of its own, or a controller that has this one "
                "as a field"
            )
            raise TypeError(message)

    @abc.abstractmethod
    def ready(self, vehicle: Vehicle) -> Controller:
        """Return a controller for a flight of a vehicle."""

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Any,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Any]:
        """Return rotor speeds to ask for [rad/s], and its memory afterwards."""
        return self.ready(vehicle)(time_s, state, vehicle, memory, period_s)


class PositionHold(Readied):
    """Holds a place and a heading.

    Attributes:
        target_m: East, north, up [m].
        gains: How hard.
        yaw_rad: Heading of body x, from east to north [rad].
    """

    target_m: Float[Array, "3"] = eqx.field(converter=floats)
    gains: Gains
    yaw_rad: Float[Array, ""] = eqx.field(converter=floats, default=0.0)

    def start(self) -> Float[Array, "3"]:
        """Return the integral at the start: the acceleration it asks for [m/s2]."""
        return jnp.zeros_like(self.target_m)

    def ready(self, vehicle: Vehicle) -> Controller:
        """Return the same hold with its allocation inverted, once for a flight."""
        return _ReadyHold(self, jnp.linalg.inv(allocation(vehicle)))

    def _answer(
        self,
        state: State,
        vehicle: Vehicle,
        inverse: Float[Array, "4 4"],
        memory: Float[Array, "3"],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
        gains = self.gains
        here, there = three(state.position_m), three(self.target_m)
        away = (here[0] - there[0], here[1] - there[1], here[2] - there[2])
        pull, integral = pull_within(
            vehicle, gains, away, three(state.velocity_m_s), memory, period_s
        )
        attitude = rotation(four(state.quaternion))
        upward = (attitude[0][2], attitude[1][2], attitude[2][2])
        along = jnp.maximum(dot(pull, upward), THRUST_FLOOR * FLIGHT_GRAVITY)
        thrust = vehicle.mass_kg * along
        heading = _heading((jnp.cos(self.yaw_rad), jnp.sin(self.yaw_rad)), attitude)
        wanted = _attitude(pull, heading)
        error, w = _error(wanted, attitude), three(state.body_rate_rad_s)
        inertia = rows(vehicle.inertia_kg_m2)
        turn = (
            -gains.attitude * error[0] - gains.body_rate * w[0],
            -gains.attitude * error[1] - gains.body_rate * w[1],
            -gains.attitude * error[2] - gains.body_rate * w[2],
        )
        moment = add(times(inertia, turn), cross(w, times(inertia, w)))
        speeds = speeds_within(vehicle, inverse, (thrust, *moment))
        if gains.motor_lead is not None:
            speeds = led(vehicle, gains.motor_lead, state.rotor_speed_rad_s, speeds)
        return speeds, jnp.stack(integral)


class _ReadyHold(eqx.Module):
    """A hold that need not invert its allocation at every turn."""

    hold: PositionHold
    inverse: Float[Array, "4 4"]

    def start(self) -> Float[Array, "3"]:
        return self.hold.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Float[Array, "3"],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
        return self.hold._answer(state, vehicle, self.inverse, memory, period_s)


def _heading(aim: tuple[Array, Array], attitude: MatrixRows) -> tuple[Array, Array]:
    """Return a heading within 45 degrees of the vehicle's; the aim if that is.

    The further off the heading, the less $e_R$ sees of a tilt: half a turn off nothing,
    and a vehicle that spins falls over.
    """
    x, y = attitude[0][0], attitude[1][0]
    along, across = aim[0] * x + aim[1] * y, aim[1] * x - aim[0] * y
    far, side = along < jnp.abs(across), jnp.where(across < 0, -1, 1)
    return jnp.where(far, x - side * y, aim[0]), jnp.where(far, y + side * x, aim[1])


def _attitude(pull: Vector, heading: tuple[Array, Array]) -> MatrixRows:
    """Columns of the attitude whose z is along a pull; x looks along a heading."""
    b_3 = _unit(pull)
    b_2 = _unit(cross(b_3, (*heading, jnp.zeros_like(heading[0]))))
    return cross(b_2, b_3), b_2, b_3


def _error(wanted: MatrixRows, attitude: MatrixRows) -> Vector:
    """Attitude error from the columns wanted and the rows of the attitude."""
    x, y, z = zip(*attitude, strict=True)
    b_1, b_2, b_3 = wanted
    return (
        (dot(b_3, y) - dot(b_2, z)) / 2,
        (dot(b_1, z) - dot(b_3, x)) / 2,
        (dot(b_2, x) - dot(b_1, y)) / 2,
    )


def _unit(v: Vector) -> Vector:
    """Vector of length 1; zero has no direction and gives NaN."""
    scale = 1 / jnp.sqrt(dot(v, v))
    return v[0] * scale, v[1] * scale, v[2] * scale
