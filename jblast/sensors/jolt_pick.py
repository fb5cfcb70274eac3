r"""The jolt of a blast in the samples of an inertial measurement unit.

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
from jaxtyping import Array, Float
from numpy.lib.stride_tricks import sliding_window_view

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.sensors.imu import Inertial, clipped, rotation_quaternion
from jblast.vehicle import State, Vehicle
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


class JoltPick(NamedTuple):
    """A jolt in samples.

    Attributes:
        onset: Index of its first sample.
        velocity_m_s: Change of velocity, world axes.
        sd_m_s: Standard error of each component, from noise and bias.
        clipped: True if a sample was at the bound of its range: a lower bound then.
    """

    onset: int
    velocity_m_s: Float[np.ndarray, "3"]
    sd_m_s: float
    clipped: bool

    @property
    def speed_m_s(self) -> tuple[float, float]:
        """Magnitude and its sd, including the error of the forward model."""
        size = math.hypot(*self.velocity_m_s)
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
        """Elevation and its sd; infinite for no direction."""
        east, north, up = self.velocity_m_s
        size = math.hypot(east, north, up)
        own = math.hypot(ATTITUDE_RAD, MODEL_SHARE)
        sd = math.hypot(self.sd_m_s / size, own) if size else math.inf
        return math.atan2(up, math.hypot(east, north)), sd


def base_of(count: int) -> int:
    """Return the number of samples assumed to precede a jolt."""
    return max(FEWEST, round(BASE * count))


def pick_jolt(
    samples: Inertial,
    imu: Imu,
    vehicle: Vehicle,
    start: State,
    rotor_speed_rad_s: Float[Array, "sample 4"],
    offset_m: Float[Array, "3"],
    quaternion: Float[Array, "4"],
    *,
    wind_m_s: Float[Array, "3"] | None = None,
) -> JoltPick | str:
    """Return the first jolt in consecutive samples, or the reason why there is none.

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
    base, width = base_of(count), max(1, round(SMOOTH_S * imu.rate))
    least = max(2 * base, width)
    if count < least:
        return f"expected {least} or more samples, got {count}"
    wind = jnp.zeros(3) if wind_m_s is None else wind_m_s
    carried = vehicle, start, rotor_speed_rad_s, offset_m, quaternion, wind
    residual, world = map(np.asarray, _residual(samples, 1 / imu.rate, base, *carried))
    if not np.isfinite(residual).all():
        return "the residual is not finite"
    white, lever = _noise(imu, offset_m)
    noise = math.hypot(white, lever)
    if residual[:base].std() > OVER * noise:
        return "the samples begin within a jolt"
    # the norm: a jolt may have any direction
    above = np.flatnonzero(np.linalg.norm(residual, axis=1) > FOUND * noise)
    if not above.size or above[0] < base:
        return "no residual exceeds the noise"
    onset = int(above[0])
    # the front may lie in the sample before, with too small a share to be found
    first = onset - 1
    cut = bool(clipped(samples, imu)[first:, 0].any())
    smooth = sliding_window_view(residual, width, axis=0).mean(axis=-1)
    size = np.linalg.norm(smooth, axis=1)
    # noise of the mean of several samples: in a sum the lever's cancels
    quiet_below = OVER * math.hypot(white / math.sqrt(width), lever / width)
    loud = size > max(quiet_below, CLIPPED_SHARE * size.max() if cut else 0.0)
    quiet = max(2, round(QUIET_S * imu.rate))
    # after the last sample it counts as loud: the jolt has to end before
    after = np.append(loud[onset:], np.ones(quiet, bool))
    is_over = ~sliding_window_view(after, quiet).any(axis=1)
    if not is_over.any():
        return "the jolt does not end within the samples"
    last = onset + int(np.argmax(is_over)) - 1 + width
    # samples are means, so their sum over the rate is exactly the change of velocity
    jolt = world[first:last].sum(axis=0) / imu.rate
    # bias of the middle of the base, known to white / sqrt(base), walks until the end
    walk = float(imu.accelerometer_walk) * math.sqrt((last - base / 2) / imu.rate)
    bias = math.hypot(white / math.sqrt(base), walk) * (last - first)
    of_sum = math.sqrt(last - first) * white
    sd = math.hypot(of_sum, bias, math.sqrt(2.0) * lever) / imu.rate
    if np.linalg.norm(jolt) < FOUND * sd:
        return "the jolt is below the noise"
    return JoltPick(onset, jolt, sd, cut)


def _noise(imu: Imu, offset_m: Float[Array, "3"]) -> tuple[float, float]:
    """Return the noise of the residual without a jolt, sd [m/s2].

    Returns:
        Noise of the accelerometer with its quantisation; noise of the gyroscope, whose
        differences enter by the instrument's lever arm: in a sum all but the first and
        last cancel.
    """
    force, rate = map(float, imu.sample_noise())
    if imu.bits is not None:
        # a step of width q has a rounding error of q / sqrt(12), standard deviation
        share = 2.0 ** (1 - imu.bits) / math.sqrt(12.0)
        force = math.hypot(force, share * float(imu.accelerometer_range))
        rate = math.hypot(rate, share * float(imu.gyroscope_range))
    arm = float(jnp.linalg.norm(offset_m))
    return max(force, FLOOR_M_S2), rate / math.sqrt(2.0) * arm * imu.rate


@kept
def _residual(
    samples: Inertial,
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
