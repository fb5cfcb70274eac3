r"""The inertial measurement unit of a vehicle: its true samples and their errors.

A sample is the mean over its time, from its time stamp on. With the velocity at the
instrument's position $r$, $v_p = v + R(\omega\times r)$,

$$\bar f = S^T R_m^T\,(\Delta v_p/\Delta t + g\,\hat z), \qquad
\bar\omega = S^T \ln(q_0^{-1} q_1)/\Delta t$$

in the instrument's axes ($S$ rotates them to the body's, $R_m$ the body's to the
world's in the middle of the sample). These are the specific force, which excludes
gravity, and the rate that turns the attitude at the start of the sample into that at
its end. The samples of a flight therefore sum to its change of velocity and attitude,
however short a blast's push is. The unit adds a bias with random walk, white noise, a
range and quantisation. These errors are the same in a record (`with_errors`) and in the
loop of an autopilot (`sensors.flight_sensors`), which draws sample by sample.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.sensors.instrument import quantised
from jblast.vehicle import State, Trajectory, Vehicle
from jblast.vehicle.loads.load import Pulse

ACTS_S = 0.5
"""Time after its arrival for which a wave may act [s]: both phases of charges up to
tonnes, and reflections."""


class Inertial(NamedTuple):
    """Samples of an inertial measurement unit, their biases, or their limits.

    Attributes:
        force: Specific force along its axes [m/s2].
        rate: Angular rate about its axes [rad/s].
    """

    force: Float[Array, "*sample 3"]
    rate: Float[Array, "*sample 3"]


def states_at(flight: Trajectory, times_s: Float[Array, " time"]) -> State:
    """Return the states of a flight at some times, linear between its rows.

    Outside the flight the vehicle keeps its first or last state.

    Args:
        flight: Flight of one vehicle, all rows finite.
        times_s: Times on the flight's clock [s].
    """
    at = jax.vmap(jnp.interp, (None, None, 1), 1)
    return jax.tree.map(lambda x: at(times_s, flight.time_s, x), flight.states)


def with_wave_rows(
    flight: Trajectory,
    load: Pulse,
    vehicle: Vehicle,
    comes_s: Float[np.ndarray, " wave"],
    period_s: float,
) -> Trajectory:
    r"""Return a flight with rows of a period while waves act on the vehicle.

    A step of a flight has the whole impulse $J(T)$ of a wave as a constant force. In
    its parts the velocity follows the impulse so far,

    $$v(t) = v_0 + \frac tT\,(v_T - v_0) + \frac1m\Big(J(t) - \frac tT J(T)\Big)$$

    and body rate and attitude follow the angular impulse likewise.

    Args:
        flight: Flight of one vehicle, all rows finite and at equal intervals.
        load: Load of the waves.
        vehicle: The vehicle.
        comes_s: Arrivals of the waves at it [s].
        period_s: Largest interval between the new rows [s].
    """
    times = np.asarray(flight.time_s)
    row_s = float(times[1] - times[0]) if times.size > 1 else 0.0
    parts = math.ceil(row_s / period_s - 1e-6)
    since = times[:-1, None] - comes_s
    acts = ((since > -2.0 * row_s) & (since < ACTS_S)).any(axis=1)
    # the ground takes up what a wave does to a vehicle that stands on it
    acts &= np.asarray(flight.position_m)[:-1, 2] > 0.0
    begins = np.flatnonzero(acts)
    if parts < 2 or not begins.size:
        return flight
    # padded to a power of two: few compiled programs serve all flights
    padded = np.pad(begins, (0, 2 ** (begins.size - 1).bit_length() - begins.size))
    share = np.arange(1, parts + 1) / parts
    states = jax.tree.map(lambda x: x[padded], flight.states)
    bows = _bows(
        load, vehicle, flight.time_s[padded], jnp.asarray(row_s * share), states
    )
    gained, spun, turned = (x[: begins.size, :-1].reshape(-1, 3) for x in bows)
    inner_s = np.add.outer(times[begins], row_s * share[:-1]).ravel()
    whole_s = np.sort(np.append(times, inner_s))
    inner = np.searchsorted(whole_s, inner_s)
    at = jax.vmap(jnp.interp, (None, None, 1), 1)
    whole_s = jnp.asarray(whole_s)
    # numbers only: a row between two has no item
    whole = jax.tree.map(
        lambda x: at(whole_s, flight.time_s, x) if x.ndim > 1 else x,
        replace(flight, item=None, armed=None),
    )
    whole = eqx.tree_at(lambda path: path.time_s, whole, whole_s)
    turns = jax.vmap(rotation_quaternion)(turned)
    attitude = jax.vmap(quaternion_product)(whole.quaternion[inner], turns)
    return replace(
        whole,
        velocity_m_s=whole.velocity_m_s.at[inner].add(gained),
        body_rate_rad_s=whole.body_rate_rad_s.at[inner].add(spun),
        quaternion=whole.quaternion.at[inner].set(attitude),
    )


@kept
def _bows(
    load: Pulse,
    vehicle: Vehicle,
    start_s: Float[Array, " row"],
    after_s: Float[Array, " part"],
    states: State,
) -> tuple[Float[Array, "row part 3"], ...]:
    """Return the deviations from a constant force of velocity, rate and attitude."""

    def of(start_s: Array, state: State) -> tuple[Array, Array]:
        return jax.vmap(lambda s: load.impulse(start_s, start_s + s, state, vehicle))(
            after_s
        )

    push, turn = jax.vmap(of)(start_s, states)
    share = (after_s / after_s[-1])[None, :, None]

    def bow(x: Array) -> Array:
        return x - share * x[:, -1:]

    spun = turn @ jnp.linalg.inv(vehicle.inertia_kg_m2).T
    turned = after_s[0] * (jnp.cumsum(spun, axis=1) - spun / 2)  # trapezoids
    return bow(push / vehicle.mass_kg), bow(spun), bow(turned)


def inertial_between(before: State, now: State, period_s: Float[Array, ""]) -> Inertial:
    """Return the mean specific force and rate between two states, body axes."""
    turn = rotation_between(before.quaternion, now.quaternion)
    # the mean force is resolved at the attitude halfway through the period
    middle = quaternion_product(before.quaternion, rotation_quaternion(turn / 2))
    gained = (now.velocity_m_s - before.velocity_m_s) / period_s
    gained = gained + jnp.array([0.0, 0.0, FLIGHT_GRAVITY])
    return Inertial(quaternion_matrix(middle).T @ gained, turn / period_s)


@kept
def inertial_of(
    flight: Trajectory,
    edges_s: Float[Array, " edge"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
) -> Inertial:
    """Return error-free samples of a flight in the instrument's axes.

    Args:
        flight: Flight of one vehicle, all rows finite.
        edges_s: Bounds of the samples on the flight's clock; one more than samples.
        offset_m: Position of the instrument from the centre of mass, body axes.
        quaternion: Rotation from instrument to body (x, y, z, w).
    """
    states = states_at(flight, edges_s)
    arm = jnp.cross(states.body_rate_rad_s, offset_m[None])
    arm_velocity = jax.vmap(jnp.matmul)(
        jax.vmap(quaternion_matrix)(states.quaternion), arm
    )
    states = eqx.tree_at(
        lambda s: s.velocity_m_s, states, states.velocity_m_s + arm_velocity
    )
    before, now = (
        jax.tree.map(lambda x, part=part: x[part], states)
        for part in (slice(None, -1), slice(1, None))
    )
    true = jax.vmap(inertial_between)(before, now, jnp.diff(edges_s))
    to_body = quaternion_matrix(quaternion)
    return Inertial(*(column @ to_body for column in true))


def rotation_between(
    first: Float[Array, "4"], last: Float[Array, "4"]
) -> Float[Array, "3"]:
    """Return the rotation vector, body axes, from one attitude to another [rad]."""
    back = first * jnp.array([-1.0, -1.0, -1.0, 1.0])
    q = quaternion_product(back, last)
    q = jnp.where(q[3] < 0, -q, q)  # q and -q are the same rotation: the shorter path
    square = jnp.sum(jnp.square(q[:3]))
    turns = square > 0
    sine = jnp.sqrt(jnp.where(turns, square, 1.0))
    scale = jnp.where(turns, 2 * jnp.arctan2(sine, q[3]) / sine, 2.0)
    return scale * q[:3]


def rotation_quaternion(vector: Float[Array, "3"]) -> Float[Array, "4"]:
    """Return the quaternion (x, y, z, w) of a rotation vector [rad]."""
    square = jnp.sum(jnp.square(vector))
    turns = square > 0
    angle = jnp.sqrt(jnp.where(turns, square, 1.0))
    scale = jnp.where(turns, jnp.sin(angle / 2) / angle, 0.5)
    cosine = jnp.where(turns, jnp.cos(angle / 2), 1.0)
    return jnp.append(scale * vector, cosine)


@kept
def with_errors(key: PRNGKeyArray, imu: Imu, true: Inertial) -> Inertial:
    """Return the samples of a record with the errors of the instrument.

    Args:
        key: Random key of bias, walk and noise.
        imu: Errors of the instrument.
        true: Error-free samples.
    """
    of_each = [jax.random.split(each, 3) for each in jax.random.split(key)]
    of_bias, of_walk, of_noise = zip(*of_each, strict=True)
    # independent steps of a walk are summed before their scale is applied
    walk = jnp.cumsum(_normals(of_walk, true.force.shape), axis=0)
    start = jax.tree.map(lambda bias: bias[None], _biases(of_bias, imu))
    bias = walked(walk, imu, start, jnp.asarray(1 / imu.rate))
    return sampled(_normals(of_noise, true.force.shape), imu, bias, true)


def power_on_bias(key: PRNGKeyArray, imu: Imu, share: float) -> Inertial:
    """Return the biases at power-on.

    Args:
        key: Random key.
        imu: Standard deviations of the biases.
        share: Share of the biases that a calibration on the ground leaves.
    """
    return Inertial(*(share * bias for bias in _biases(jax.random.split(key), imu)))


def walked(
    noise: Float[Array, "*sample 6"],
    imu: Imu,
    bias: Inertial,
    period_s: Float[Array, ""],
) -> Inertial:
    """Return the biases after a period of random walk.

    Args:
        noise: Standard normal numbers of force and rate.
        imu: Random walk of the biases.
        bias: Biases at the beginning.
        period_s: Length of the period [s].
    """
    step = jnp.sqrt(period_s)
    return Inertial(
        bias.force + step * imu.accelerometer_walk * noise[..., :3],
        bias.rate + step * imu.gyroscope_walk * noise[..., 3:],
    )


def sampled(
    noise: Float[Array, "*sample 6"], imu: Imu, bias: Inertial, true: Inertial
) -> Inertial:
    """Return samples with bias, white noise, quantisation and range.

    Args:
        noise: Standard normal numbers of force and rate.
        imu: Noise, rate, range and bits.
        bias: Biases of the instruments.
        true: Error-free samples.
    """
    force_noise, rate_noise = imu.sample_noise()
    read = (
        true.force + bias.force + force_noise * noise[..., :3],
        true.rate + bias.rate + rate_noise * noise[..., 3:],
    )
    return Inertial(
        quantised(read[0], imu.accelerometer_range, imu.bits),
        quantised(read[1], imu.gyroscope_range, imu.bits),
    )


def clipped(samples: Inertial, imu: Imu) -> Bool[Array, "sample 2"]:
    """Return where accelerometer and gyroscope are at a limit of their range."""
    ranges = imu.accelerometer_range, imu.gyroscope_range
    sizes = [jnp.max(jnp.abs(column), axis=-1) for column in samples]
    # 1e-6: rounding of float32
    tops = [quantised(most, most, imu.bits) * (1 - 1e-6) for most in ranges]
    return jnp.stack(
        [size >= top for size, top in zip(sizes, tops, strict=True)], axis=-1
    )


def _biases(keys: Iterable[PRNGKeyArray], imu: Imu) -> Inertial:
    force, rate = (jax.random.normal(key, (3,)) for key in keys)
    return Inertial(imu.accelerometer_bias * force, imu.gyroscope_bias * rate)


def _normals(
    keys: Iterable[PRNGKeyArray], shape: tuple[int, ...]
) -> Float[Array, "*sample 6"]:
    """Return standard normal numbers of force and rate, each from its own key."""
    return jnp.concatenate([jax.random.normal(key, shape) for key in keys], axis=-1)
