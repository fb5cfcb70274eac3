"""Where a vehicle is and how it moves: at one time, and along a flight."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.vehicle.quadrotor.numbers import floats

LENGTHS = {
    "position_m": 3,
    "velocity_m_s": 3,
    "quaternion": 4,
    "body_rate_rad_s": 3,
    "rotor_speed_rad_s": 4,
}
"""Numbers in each part of a state."""


class State(eqx.Module):
    """State of a vehicle, or of a batch: the same leading axes in every array.

    Attributes:
        position_m: East, north, up, (..., 3) [m].
        velocity_m_s: East, north, up, (..., 3) [m/s].
        quaternion: Body to world, (..., 4): (x, y, z, w), scalar last, of any length
            but zero.
        body_rate_rad_s: About the body's axes, (..., 3) [rad/s].
        rotor_speed_rad_s: (..., 4) [rad/s].

    Raises:
        InputError: A shape is wrong, a number is not finite, a quaternion is zero. The
            values are not looked at inside jit or grad.
    """

    # Shapes are held by __check_init__, which has a message for them.
    position_m: Float[Array, "..."] = eqx.field(converter=floats)
    velocity_m_s: Float[Array, "..."] = eqx.field(converter=floats)
    quaternion: Float[Array, "..."] = eqx.field(converter=floats)
    body_rate_rad_s: Float[Array, "..."] = eqx.field(converter=floats)
    rotor_speed_rad_s: Float[Array, "..."] = eqx.field(converter=floats)

    def __check_init__(self):
        batch = self.position_m.shape[:-1]
        for name, length in LENGTHS.items():
            value = getattr(self, name)
            if value.shape != (*batch, length):
                raise InputError(
                    f"{name}: expected the shape {(*batch, length)}, got {value.shape}"
                )
            if isinstance(value, Tracer):
                continue
            if not np.all(np.isfinite(value)):
                raise InputError(f"{name}: expected finite numbers, got nan or inf")
        if not isinstance(self.quaternion, Tracer):
            _check_length(np.asarray(self.quaternion))


def _check_length(quaternion: Float[np.ndarray, "... 4"]) -> None:
    """Refuse a quaternion that cannot be scaled to length 1.

    Raises:
        InputError: The square of its length is zero, or infinite, in its precision.
    """
    with np.errstate(over="ignore", under="ignore"):
        square = np.sum(np.square(quaternion), axis=-1)
    held = (square > np.finfo(quaternion.dtype).tiny) & np.isfinite(square)
    if not np.all(held):
        wrong = np.asarray(quaternion, float)[~held][0]
        size = np.abs(wrong).max()  # the square may be zero in float64 too
        got = "zero"
        if size > 0:
            length = size * np.linalg.norm(wrong / size)
            got = f"one of {length:.3g} in {quaternion.dtype}"
        raise InputError(f"quaternion: expected one of length 1, got {got}")


class Trajectory(eqx.Module):
    """A flight, or a batch of them.

    Attributes:
        time_s: Of the stored rows; the first is the start.
        position_m: East, north, up [m].
        velocity_m_s: East, north, up [m/s].
        quaternion: Body to world (x, y, z, w), scalar last, of length 1.
        body_rate_rad_s: About the body's axes [rad/s].
        rotor_speed_rad_s: Of the four rotors [rad/s].
        force_n: All forces on the vehicle, its weight among them, that of the ground
            not: mass times acceleration, east, north, up [N]. Where a load jumps at a
            row, the force before the jump; at the first row after it.
        moment_n_m: All moments about the centre of mass, body axes [N m].
        lost: Whether a vehicle diverged; its rows are NaN from then on.
    """

    time_s: Float[Array, " time"]
    position_m: Float[Array, "*batch time 3"]
    velocity_m_s: Float[Array, "*batch time 3"]
    quaternion: Float[Array, "*batch time 4"]
    body_rate_rad_s: Float[Array, "*batch time 3"]
    rotor_speed_rad_s: Float[Array, "*batch time 4"]
    force_n: Float[Array, "*batch time 3"]
    moment_n_m: Float[Array, "*batch time 3"]
    lost: Bool[Array, "*batch"]

    @property
    def states(self) -> State:
        """The states of its rows."""
        return State(
            self.position_m,
            self.velocity_m_s,
            self.quaternion,
            self.body_rate_rad_s,
            self.rotor_speed_rad_s,
        )

    def lost_places(self) -> list[tuple[int, ...]]:
        """Return the indices of the vehicles that diverged, along the batch's axes."""
        return [tuple(map(int, place)) for place in np.argwhere(np.asarray(self.lost))]

    def lost_time_s(self) -> Float[Array, "*batch"]:
        """Return the time of the first row of NaN [s]; infinite where there is none."""
        gone = jnp.isnan(self.position_m[..., 0])
        return jnp.min(jnp.where(gone, self.time_s, jnp.inf), axis=-1)
