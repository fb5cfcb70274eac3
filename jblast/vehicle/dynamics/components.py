"""A state as single numbers, one array for each component.

Under `vmap` every component is an array over the vehicles, which XLA turns into vector
instructions; rows of three would leave most of each register empty.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.dynamics.state import State

Number = Float[Array, ""]
Vector = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]
MatrixRows = tuple[Vector, Vector, Vector]


class StateComponents(NamedTuple):
    """The parts of a `State`, or their rates, or of a row of a trajectory."""

    position: Vector
    velocity: Vector
    quaternion: Four
    body_rate: Vector
    rotor_speed: Four


def three(array: Float[Array, "3"]) -> Vector:
    """Return the components of a vector."""
    x, y, z = array
    return x, y, z


def four(array: Float[Array, "4"]) -> Four:
    """Return four components."""
    a, b, c, d = array
    return a, b, c, d


def rows(matrix: Float[Array, "3 3"]) -> MatrixRows:
    """Return the components of a matrix."""
    # each at once: of a row that is cut from many vehicles' matrices XLA makes an array
    x, y, z = ((matrix[i, 0], matrix[i, 1], matrix[i, 2]) for i in range(3))
    return x, y, z


def components(state: State) -> StateComponents:
    """Take a state apart."""
    return StateComponents(
        three(state.position_m),
        three(state.velocity_m_s),
        four(state.quaternion),
        three(state.body_rate_rad_s),
        four(state.rotor_speed_rad_s),
    )


def joined(motion: StateComponents) -> State:
    """Put a state together."""
    return State(*(jnp.stack(part) for part in motion))


def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def dot(a: Vector, b: Vector) -> Number:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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
    # Divided entry by entry: XLA keeps a quotient, and calculates products again for
    # each number that needs them.
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
