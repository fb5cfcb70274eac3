r"""The inertial measurement unit of a vehicle: its samples, and a jolt in them.

A sample is the mean over its time, from its time stamp on. With the velocity at the
instrument's position $r$, $v_p = v + R(\omega\times r)$,

$$\bar f = S^T R_m^T\,(\Delta v_p/\Delta t + g\,\hat z), \qquad
\bar\omega = S^T \ln(q_0^{-1} q_1)/\Delta t$$

in the instrument's axes ($S$ rotates them to the body's, $R_m$ the body's to the
world's in the middle of the sample). These are the specific force, which excludes
gravity, and the rate that turns the attitude at the start of the sample into that at
its end. The samples of a flight therefore sum to its change of velocity, whatever
happens within one. The unit adds a bias with random walk, white noise, a range and
quantisation.

A jolt is found in the part of the specific force that the vehicle's own aerodynamic
force does not explain. That force follows from the attitude by the gyroscope, the
velocity by the accelerometer, the rotor speeds from telemetry, and the equations of
flight. The residual,

$$r = f - \tfrac1m F_{air}(v, q, \omega, \Omega) - b,$$

is due to the blast, with the bias $b$ estimated from the first tenth of the samples.
The jolt is $\int R\,r\,dt$ from the sample at which $r$ leaves the noise to that from
which it stays within it for some time. The position controller's reaction to the jolt
is part of $F_{air}$ and so is removed.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.vehicle import State, Trajectory, Vehicle
from jblast.vehicle.dynamics import air_wrench
from jblast.vehicle.state import components

BASE, FEWEST = 0.1, 20
"""Share of the samples before a jolt, and their minimum number, for the bias. The mean
of 20 samples has a fifth of the noise of one."""
FOUND, OVER = 6.0, 4.0
"""Residual, in standard deviations of the noise, at which a jolt begins (6: false
starts in 7e-8 of normal samples), and below which its mean over `SMOOTH_S` is quiet."""
SMOOTH_S, QUIET_S = 0.005, 0.03
"""Averaging time of the residual at the end of a jolt, and time for which it has to
stay quiet [s]: longer than the zero crossing between pressure and suction."""
CLIPPED_SHARE = 0.02
"""Share of the largest residual below which a clipped jolt is over: its velocity
afterwards is unknown, and the drag of an unknown velocity is no jolt."""
FLOOR_M_S2 = 1e-3
"""Minimum noise [m/s2]: the error of linear interpolation between rows of a flight."""
MODEL_SHARE = 0.03
"""Relative standard error of the forward model over the jolt: `calibration.jolts`."""
ATTITUDE_RAD = 0.01
"""Standard error of the attitude at the start of the samples: `calibration.jolts`."""


class Felt(NamedTuple):
    """Samples of an inertial measurement unit.

    Attributes:
        force: Specific force along its axes [m/s2].
        rate: Angular rate about its axes [rad/s].
    """

    force: Float[Array, "sample 3"]
    rate: Float[Array, "sample 3"]


def felt(
    flight: Trajectory,
    edges_s: Float[Array, " edge"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
) -> Felt:
    """Return error-free samples of a flight, linear between its rows.

    Outside the flight the vehicle keeps its first or last state.

    Args:
        flight: Flight of one vehicle, all rows finite.
        edges_s: Bounds of the samples on the flight's clock; one more than samples.
        offset_m: Position of the instrument from the centre of mass, body axes.
        quaternion: Rotation from instrument to body (x, y, z, w).
    """
    velocity, rate, attitude = (
        jax.vmap(jnp.interp, (None, None, 1), 1)(edges_s, flight.time_s, rows)
        for rows in (flight.velocity_m_s, flight.body_rate_rad_s, flight.quaternion)
    )
    turned = jax.vmap(quaternion_matrix)(attitude)
    arm = jnp.broadcast_to(offset_m, rate.shape)
    place_velocity = velocity + jnp.einsum("nij,nj->ni", turned, jnp.cross(rate, arm))

    step = jnp.diff(edges_s)[:, None]
    gained = jnp.diff(place_velocity, axis=0) / step
    gained = gained + jnp.array([[0.0, 0.0, FLIGHT_GRAVITY]])
    turn = jax.vmap(rotation_between)(attitude[:-1], attitude[1:])
    # attitude in the middle of a sample: the first one turned by half
    halves = jax.vmap(rotation_quaternion)(turn / 2)
    middle = jax.vmap(quaternion_product)(attitude[:-1], halves)
    to_world = jax.vmap(quaternion_matrix)(middle)
    force = jnp.einsum("nji,nj->ni", to_world, gained)
    to_body = quaternion_matrix(quaternion)
    return Felt(force @ to_body, turn / step @ to_body)


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


def read(key: PRNGKeyArray, imu: Imu, true: Felt) -> Felt:
    """Return samples with the errors of the instrument.

    Args:
        key: Random key of bias, walk and noise.
        imu: Errors of the instrument.
        true: Error-free samples.
    """
    noise = imu.sample_noise()
    force, rate = jax.random.split(key)
    return Felt(
        _axes(
            *(force, true.force, imu, noise[0]),
            *(imu.accelerometer_bias, imu.accelerometer_walk, imu.accelerometer_range),
        ),
        _axes(
            *(rate, true.rate, imu, noise[1]),
            *(imu.gyroscope_bias, imu.gyroscope_walk, imu.gyroscope_range),
        ),
    )


def _axes(
    key: PRNGKeyArray,
    true: Float[Array, "sample 3"],
    imu: Imu,
    noise: Float[Array, ""],
    bias: Float[Array, ""],
    walk: Float[Array, ""],
    full_scale: Float[Array, ""],
) -> Float[Array, "sample 3"]:
    """Return the samples of an accelerometer or gyroscope."""
    of_bias, of_walk, of_noise = jax.random.split(key, 3)
    step = walk * math.sqrt(1 / imu.rate)
    off = bias * jax.random.normal(of_bias, (3,))
    walked = step * jnp.cumsum(jax.random.normal(of_walk, true.shape), axis=0)
    read = (
        true + off[None, :] + walked + noise * jax.random.normal(of_noise, true.shape)
    )
    if imu.bits is None:
        return jnp.clip(read, -full_scale, full_scale)
    smallest = full_scale / 2.0 ** (imu.bits - 1)
    whole = jnp.round(read / smallest) * smallest
    return jnp.clip(whole, -full_scale, full_scale - smallest)


class JoltPick(NamedTuple):
    """A jolt, or the reason why none was found.

    Attributes:
        found: True if a jolt begins and ends within the samples.
        why: Reason if not; else "".
        onset: Index of its first sample.
        velocity_m_s: Change of velocity, world axes.
        sd_m_s: Standard error of each component, from noise and bias.
        clipped: True if a sample was at the bound of its range: a lower bound then.
    """

    found: bool
    why: str
    onset: int
    velocity_m_s: Float[np.ndarray, "3"]
    sd_m_s: float
    clipped: bool

    @property
    def speed_m_s(self) -> tuple[float, float]:
        """Magnitude and its sd, including the error of the forward model."""
        size = float(np.linalg.norm(self.velocity_m_s))
        return size, math.hypot(self.sd_m_s, MODEL_SHARE * size)

    @property
    def bearing_rad(self) -> tuple[float, float]:
        """Direction clockwise from north, and its sd; infinite for no direction."""
        east, north, _ = self.velocity_m_s
        level = math.hypot(east, north)
        sd = math.hypot(self.sd_m_s / level, ATTITUDE_RAD) if level else math.inf
        return math.atan2(east, north) % (2 * math.pi), sd

    @property
    def elevation_rad(self) -> tuple[float, float]:
        """Elevation and its sd."""
        east, north, up = self.velocity_m_s
        size = float(np.linalg.norm(self.velocity_m_s))
        own = math.hypot(ATTITUDE_RAD, MODEL_SHARE)
        sd = math.hypot(self.sd_m_s / size, own) if size else math.inf
        return math.atan2(up, math.hypot(east, north)), sd


def base_of(count: int) -> int:
    """Return the number of samples assumed to precede a jolt."""
    return max(FEWEST, round(BASE * count))


def pick_jolt(
    samples: Felt,
    imu: Imu,
    vehicle: Vehicle,
    start: State,
    rotor_speed_rad_s: Float[Array, "sample 4"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
    *,
    wind_m_s: Float[Array, "3"] | None = None,
) -> JoltPick:
    """Return the first jolt in consecutive samples.

    Args:
        samples: The samples.
        imu: Instrument that recorded them.
        vehicle: Vehicle that carries it.
        start: Estimated state of the vehicle at the first sample.
        rotor_speed_rad_s: Rotor speeds in the middle of each sample.
        offset_m: Position of the instrument, body axes.
        quaternion: Rotation from instrument to body (x, y, z, w).
        wind_m_s: Estimated wind; None: still air.
    """
    count = len(samples.force)
    base = base_of(count)
    if count < 2 * base:
        return _not_found(f"expected {2 * base} or more samples, got {count}")
    wind = jnp.zeros(3) if wind_m_s is None else wind_m_s
    residual, world = (
        np.asarray(x)
        for x in beyond(
            *(samples, 1 / imu.rate, base, vehicle, start, rotor_speed_rad_s),
            *(offset_m, quaternion, wind),
        )
    )
    if not np.isfinite(residual).all():
        return _not_found("the residual is not finite")
    noise = _Noise.of(imu, offset_m)
    if residual[:base].std() > OVER * noise.of_one:
        return _not_found("the samples begin within a jolt")
    # the norm: a jolt may have any direction
    size = np.linalg.norm(residual, axis=1)
    above = np.flatnonzero(size > FOUND * noise.of_one)
    if not above.size or above[0] < base:
        return _not_found("no residual exceeds the noise")
    onset = int(above[0])
    # full scale less one step: the largest positive code (53 bits: no quantisation)
    top = float(imu.accelerometer_range) * (1 - 2.0 ** (1 - (imu.bits or 53)))
    at_end = np.abs(np.asarray(samples.force)) >= top * (1 - 1e-9)
    clipped = bool(at_end[onset - 1 :].any())
    last = _end(residual, onset, noise, imu.rate, CLIPPED_SHARE if clipped else 0.0)
    if last is None:
        return _not_found("the jolt does not end within the samples")
    # the front may lie in the sample before, with too small a share to be found
    first = onset - 1
    # samples are means, so their sum over the rate is exactly the change of velocity
    jolt = world[first:last].sum(axis=0) / imu.rate
    # bias of the middle of the base, known to white / sqrt(base), walks until the end
    walked = float(imu.accelerometer_walk) * math.sqrt((last - base / 2) / imu.rate)
    off = math.hypot(noise.white / math.sqrt(base), walked) * (last - first)
    of_sum = math.sqrt(last - first) * noise.white
    sd = math.hypot(of_sum, off, math.sqrt(2.0) * noise.lever) / imu.rate
    if np.linalg.norm(jolt) < FOUND * sd:
        return _not_found("the jolt is below the noise")
    return JoltPick(True, "", onset, jolt, sd, clipped)


class _Noise(NamedTuple):
    """Noise of the residual without a jolt, sd [m/s2].

    Attributes:
        white: Noise of the accelerometer and its quantisation.
        lever: Noise of the gyroscope, whose differences enter by the instrument's lever
            arm: in a sum all but the first and last cancel.
    """

    white: float
    lever: float

    @classmethod
    def of(cls, imu: Imu, offset_m: Float[Array, "3"]) -> "_Noise":
        """Return the noise of an instrument at a position on the body."""
        force, rate = map(float, imu.sample_noise())
        if imu.bits is not None:
            # a step of width q has a rounding error of q / sqrt(12), standard deviation
            share = 2.0 ** (1 - imu.bits) / math.sqrt(12.0)
            force = math.hypot(force, share * float(imu.accelerometer_range))
            rate = math.hypot(rate, share * float(imu.gyroscope_range))
        arm = float(jnp.linalg.norm(offset_m))
        return cls(max(force, FLOOR_M_S2), rate / math.sqrt(2.0) * arm * imu.rate)

    @property
    def of_one(self) -> float:
        return math.hypot(self.white, self.lever)

    def of_mean(self, width: int) -> float:
        """Return the noise of the mean of several samples."""
        return math.hypot(self.white / math.sqrt(width), self.lever / width)


def _end(
    residual: Float[np.ndarray, "sample 3"],
    onset: int,
    noise: _Noise,
    rate_hz: float,
    share: float,
) -> int | None:
    """Return the sample after which the residual is quiet; None if it stays loud.

    Args:
        residual: Residual of the samples.
        onset: First sample of the jolt.
        noise: Noise of the residual.
        rate_hz: Sampling rate.
        share: Share of the largest residual that counts as quiet in any case.
    """
    width = max(1, round(SMOOTH_S * rate_hz))
    quiet = max(2, round(QUIET_S * rate_hz))
    kernel = np.ones(width) / width
    smooth = np.stack(
        [np.convolve(axis, kernel, "valid") for axis in residual.T], axis=1
    )
    size = np.linalg.norm(smooth, axis=1)
    loud = size > max(OVER * noise.of_mean(width), share * size.max())
    since = 0
    for n in range(onset, len(loud)):
        since = 0 if loud[n] else since + 1
        if since >= quiet:
            return n - quiet + width
    return None


def _not_found(why: str) -> JoltPick:
    return JoltPick(False, why, -1, np.full(3, np.nan), math.inf, False)


@kept
def beyond(
    samples: Felt,
    step_s: Float[Array, ""] | float,
    base: int,
    vehicle: Vehicle,
    start: State,
    rotor_speed: Float[Array, "sample 4"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
    wind: Float[Array, "3"],
) -> tuple[Float[Array, "sample 3"], Float[Array, "sample 3"]]:
    """Return the residual: specific force minus that of the vehicle's own air [m/s2].

    Args:
        samples: The samples.
        step_s: Time of a sample.
        base: Number of first samples, whose mean residual is removed as bias.
        vehicle: Vehicle that carries the instrument.
        start: Its state at the first sample.
        rotor_speed: Rotor speeds in the middle of each sample [rad/s].
        offset_m: Position of the instrument, body axes.
        quaternion: Rotation from instrument to body.
        wind: Wind [m/s].

    Returns:
        In body axes, and in world axes.
    """
    to_body = quaternion_matrix(quaternion)
    force, rate = samples.force @ to_body.T, samples.rate @ to_body.T
    turns = jax.vmap(rotation_quaternion)(rate * step_s)
    halves = jax.vmap(rotation_quaternion)(rate * step_s / 2)

    def turn(attitude, both):
        whole, half = both
        return quaternion_product(attitude, whole), quaternion_product(attitude, half)

    _, attitude = jax.lax.scan(turn, start.quaternion, (turns, halves))
    # acceleration of the instrument's position by the vehicle's rotation
    edges = jnp.concatenate([rate[:1], (rate[1:] + rate[:-1]) / 2, rate[-1:]])
    arm = jnp.broadcast_to(offset_m, edges.shape)
    rotational = jnp.diff(jnp.cross(edges, arm), axis=0) / step_s
    rotational = rotational + jnp.cross(rate, jnp.cross(rate, arm[1:]))
    centre = force - rotational
    to_world = jax.vmap(quaternion_matrix)(attitude)
    gravity = jnp.array([[0.0, 0.0, FLIGHT_GRAVITY]])

    def residual(bias):
        gained = jnp.einsum("nij,nj->ni", to_world, centre - bias[None]) - gravity
        after = start.velocity_m_s[None] + jnp.cumsum(gained, axis=0) * step_s
        velocity = after - gained * step_s / 2

        def of(velocity, attitude, rate, speeds):
            state = State(jnp.zeros(3), velocity, attitude, rate, speeds)
            return jnp.stack(air_wrench(vehicle, components(state), tuple(wind))[0])

        own = jax.vmap(of)(velocity, attitude, rate, rotor_speed) / vehicle.mass_kg
        return centre - own - bias[None]

    bias = jnp.zeros(3)
    for _ in range(2):  # the first pass leaves a velocity that drifts with the bias
        bias = bias + residual(bias)[:base].mean(axis=0)
    found = residual(bias)
    return found, jnp.einsum("nij,nj->ni", to_world, found)
