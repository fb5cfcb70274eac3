"""State of a vehicle: as arrays, along a flight, and as single components.

Flights are computed with one array for each component. Under `vmap` every component is
an array over the vehicles, which XLA turns into vector instructions; rows of three
would leave most of each register empty.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int

from jblast.errors import InputError, require
from jblast.vehicle.quadrotor import floats

LENGTHS = {
    "position_m": 3,
    "velocity_m_s": 3,
    "quaternion": 4,
    "body_rate_rad_s": 3,
    "rotor_speed_rad_s": 4,
}
"""Length of each part of a state."""
Number = Float[Array, ""]
Vector = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]
MatrixRows = tuple[Vector, Vector, Vector]


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
        InputError: A shape is wrong, a number is not finite, or a quaternion is zero.
            Values are not checked inside jit or grad.
    """

    # Shapes are checked by __check_init__, which has a message for them.
    position_m: Float[Array, "..."] = eqx.field(converter=floats)
    velocity_m_s: Float[Array, "..."] = eqx.field(converter=floats)
    quaternion: Float[Array, "..."] = eqx.field(converter=floats)
    body_rate_rad_s: Float[Array, "..."] = eqx.field(converter=floats)
    rotor_speed_rad_s: Float[Array, "..."] = eqx.field(converter=floats)

    def __check_init__(self):
        batch = self.position_m.shape[:-1]
        for name, length in LENGTHS.items():
            value, shape = getattr(self, name), (*batch, length)
            require(value.shape == shape, name, f"the shape {shape}", f"{value.shape}")
            finite = isinstance(value, Tracer) or np.all(np.isfinite(value))
            require(finite, name, "finite numbers", "nan or inf")
        if not isinstance(self.quaternion, Tracer):
            _check_length(np.asarray(self.quaternion))


def _check_length(quaternion: Float[np.ndarray, "... 4"]) -> None:
    """Reject a quaternion that cannot be scaled to length 1.

    Raises:
        InputError: Its squared length is zero or infinite in its precision.
    """
    with np.errstate(over="ignore", under="ignore"):
        square = np.sum(np.square(quaternion), axis=-1)
    usable = (square > np.finfo(quaternion.dtype).tiny) & np.isfinite(square)
    wrong = np.asarray(quaternion, float)[~usable][:1].tolist()
    words = "one of length 1, or one that can be scaled to it"
    require(not wrong, "quaternion", words, f"{wrong} in {quaternion.dtype}")


class Trajectory(eqx.Module):
    """A flight, or a batch of them.

    Attributes:
        time_s: Times of the stored rows; the first is the start.
        position_m: East, north, up [m].
        velocity_m_s: East, north, up [m/s].
        quaternion: Body to world (x, y, z, w), scalar last, of length 1.
        body_rate_rad_s: About the body's axes [rad/s].
        rotor_speed_rad_s: Speeds of the four rotors [rad/s].
        force_n: Total force including weight, without that of the ground: mass times
            acceleration, east, north, up [N]. If a load jumps at a row, the force
            before the jump; at the first row, the force after it. A row of several
            steps has the strongest pulse of its steps; in a batch, that of the last.
        moment_n_m: Total moment about the centre of mass, body axes [N m].
        lost: True if a vehicle diverged; its rows are NaN from then on.
        set_point_m: Set point of the controller, east, north, up [m]; None: none known.
        estimate_m: Position that the controller uses [m].
        item: Index of the item of a mission that is flown, in the order of execution;
            -1 before the flight and after it.
        armed: True while the rotors are armed on a mission.
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
    set_point_m: Float[Array, "*batch time 3"] | None = None
    estimate_m: Float[Array, "*batch time 3"] | None = None
    item: Int[Array, "*batch time"] | None = None
    armed: Bool[Array, "*batch time"] | None = None

    def at(self, rows: Any) -> "Trajectory":
        """Return some rows of a single flight; also one of NumPy arrays."""
        return jax.tree.map(lambda x: x[rows] if np.ndim(x) else x, self)

    @property
    def path_error_m(self) -> Float[Array | np.ndarray, " time"]:
        """Distance from the set point at each row [m]; NaN after a divergence."""
        assert self.set_point_m is not None, "flights of a controller have set points"
        away = self.position_m - self.set_point_m
        return (away * away).sum(axis=-1) ** 0.5

    @property
    def states(self) -> State:
        """States of the stored rows."""
        return State(
            self.position_m,
            self.velocity_m_s,
            self.quaternion,
            self.body_rate_rad_s,
            self.rotor_speed_rad_s,
        )


class StateComponents(NamedTuple):
    """Components of a `State`, of its rates, or of a row of a trajectory."""

    position: Vector
    velocity: Vector
    quaternion: Four
    body_rate: Vector
    rotor_speed: Four


def three(array: Float[Array, "..."], name: str = "vector") -> Vector:
    """Return the components of a vector.

    Raises:
        InputError: It has another shape.
    """
    x, y, z = _numbers(array, 3, name)
    return x, y, z


def four(array: Float[Array, "..."], name: str = "vector") -> Four:
    """Return four components.

    Raises:
        InputError: The shape is another.
    """
    a, b, c, d = _numbers(array, 4, name)
    return a, b, c, d


def _numbers(array: Float[Array, "..."], count: int, name: str) -> Float[Array, " n"]:
    if array.shape != (count,):
        raise InputError(
            f"{name}: expected {count} numbers of a vehicle, got the shape "
            f"{array.shape}; a wind, load or controller is one of each vehicle if all "
            "of its arrays begin with the axes of the batch"
        )
    return array


def rows(matrix: Float[Array, "3 3"]) -> MatrixRows:
    """Return the components of a matrix."""
    # Indexed entry by entry: XLA would materialize a row sliced from many matrices.
    x, y, z = ((matrix[i, 0], matrix[i, 1], matrix[i, 2]) for i in range(3))
    return x, y, z


def components(state: State) -> StateComponents:
    """Return the components of a state."""
    return StateComponents(
        three(state.position_m),
        three(state.velocity_m_s),
        four(state.quaternion),
        three(state.body_rate_rad_s),
        four(state.rotor_speed_rad_s),
    )


def joined(motion: StateComponents) -> State:
    """Return the state of components."""
    return State(*(jnp.stack(part) for part in motion))


def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def dot(a: Vector, b: Vector) -> Number:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def root(square: Float[Array, "..."]) -> Float[Array, "..."]:
    """Square root with a gradient of 0 at 0, not of NaN; NaN stays NaN."""
    # The guard is on the input: masking the result would give 0 * inf.
    some = ~(square <= 0)
    return jnp.where(some, jnp.sqrt(jnp.where(some, square, 1)), 0)


def length_of(vector: Float[Array, "3"]) -> Float[Array, ""]:
    """Length of a vector, with a gradient of 0 at 0."""
    return root(jnp.sum(vector * vector))


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def times(matrix: MatrixRows, v: Vector) -> Vector:
    """Matrix times vector."""
    return dot(matrix[0], v), dot(matrix[1], v), dot(matrix[2], v)


def times_transposed(matrix: MatrixRows, v: Vector) -> Vector:
    """Transposed matrix times vector."""
    x, y, z = zip(*matrix, strict=True)
    return dot(x, v), dot(y, v), dot(z, v)


def rotation(q: Four) -> MatrixRows:
    """Matrix, body to world, of a quaternion (x, y, z, w) of any length but zero."""
    i, j, k, w = q
    # Divided entry by entry: XLA stores quotients, but recomputes products for every
    # number that uses them.
    half = (i * i + j * j + k * k + w * w) / 2
    return (
        (1 - (j * j + k * k) / half, (i * j - k * w) / half, (i * k + j * w) / half),
        ((i * j + k * w) / half, 1 - (i * i + k * k) / half, (j * k - i * w) / half),
        ((i * k - j * w) / half, (j * k + i * w) / half, 1 - (i * i + j * j) / half),
    )


def turned(q: Four, v: Vector) -> Vector:
    """Vector from body to world; the quaternion of any length but zero."""
    return _turned(q, v, 2 * q[3])


def turned_back(q: Four, v: Vector) -> Vector:
    """Vector from world to body; the quaternion of any length but zero."""
    return _turned(q, v, -2 * q[3])


def _turned(q: Four, v: Vector, twice: Number) -> Vector:
    i, j, k, w = q
    square = i * i + j * j + k * k
    along, (x, y, z) = 2 * (i * v[0] + j * v[1] + k * v[2]), cross((i, j, k), v)
    keeps, whole = w * w - square, w * w + square
    return (
        (keeps * v[0] + along * i + twice * x) / whole,
        (keeps * v[1] + along * j + twice * y) / whole,
        (keeps * v[2] + along * k + twice * z) / whole,
    )


def turning(q: Four, w: Vector) -> Four:
    r"""Rate of a quaternion, $\dot q = q \otimes (\omega, 0)/2$, scalar last."""
    i, j, k, s = q
    x, y, z = w
    return (
        (s * x + j * z - k * y) / 2,
        (s * y + k * x - i * z) / 2,
        (s * z + i * y - j * x) / 2,
        -(i * x + j * y + k * z) / 2,
    )


def unit(q: Four) -> Four:
    """Quaternion of length 1."""
    i, j, k, w = q
    scale = 1 / jnp.sqrt(i * i + j * j + k * k + w * w)
    return i * scale, j * scale, k * scale, w * scale
