r"""The jolt in the samples of an inertial measurement unit: when, how much, whereto.

What a vehicle's own air would give it without a blast is known: attitude by the
gyroscope, velocity by the accelerometer, rotor speeds from their telemetry, and the
equations of flight. What the accelerometer reads beyond it,

$$r = f - \tfrac1m F_{air}(v, q, \omega, \Omega) - b,$$

is the blast's, with the bias $b$ of the stretch's first tenth; the jolt is
$\int R\,r\,dt$ from where it leaves the noise to where it is back in it for a while.
That the hold meanwhile works against the jolt is in $F_{air}$, and so taken off.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Imu
from jblast.sensors.imu.beyond import beyond
from jblast.sensors.imu.motion import Felt
from jblast.vehicle import State, Vehicle

BASE, FEWEST = 0.1, 20
"""Of a stretch, and samples at least, before a jolt: for bias."""
FOUND, OVER = 6.0, 4.0
"""Standard deviations that a sample is off where a jolt begins; and fewer than which,
over `SMOOTH_S`, it is not any more."""
SMOOTH_S, QUIET_S = 0.005, 0.03
CLIPPED_SHARE = 0.02
"""Of the largest, below which a clipped jolt is over: it leaves a velocity that nobody
knows, and what that gives is no jolt."""
FLOOR_M_S2 = 1e-3
"""Of noise: what straight lines between the rows of a flight leave."""
MODEL_SHARE = 0.03
"""What the forward model is off by, of the jolt, one standard deviation:
`calibration.jolts`."""
ATTITUDE_RAD = 0.01
"""How well the vehicle knows its attitude where the stretch begins, likewise."""


class JoltPick(NamedTuple):
    """A jolt, or none.

    Attributes:
        found: Whether there is one, that begins and ends within the stretch.
        why: If not, why.
        onset: Number of the first sample that it is in.
        velocity_m_s: Change of velocity, world.
        sd_m_s: Of each of its components, of noise and bias.
        clipped: Whether a sample stood at the end of its range: it is a lower bound.
    """

    found: bool
    why: str
    onset: int
    velocity_m_s: Float[np.ndarray, "3"]
    sd_m_s: float
    clipped: bool

    @property
    def speed_m_s(self) -> tuple[float, float]:
        """Its size and sd, what the forward model leaves out among it."""
        size = float(np.linalg.norm(self.velocity_m_s))
        return size, math.hypot(self.sd_m_s, MODEL_SHARE * size)

    @property
    def bearing_rad(self) -> tuple[float, float]:
        """Whereto, clockwise from north, and sd; an infinite one of none."""
        east, north, _ = self.velocity_m_s
        level = math.hypot(east, north)
        sd = math.hypot(self.sd_m_s / level, ATTITUDE_RAD) if level else math.inf
        return math.atan2(east, north) % (2 * math.pi), sd

    @property
    def elevation_rad(self) -> tuple[float, float]:
        """How steeply up, and sd."""
        east, north, up = self.velocity_m_s
        size = float(np.linalg.norm(self.velocity_m_s))
        own = math.hypot(ATTITUDE_RAD, MODEL_SHARE)
        sd = math.hypot(self.sd_m_s / size, own) if size else math.inf
        return math.atan2(up, math.hypot(east, north)), sd


def base_of(count: int) -> int:
    """Return how many samples of a stretch are taken to come before a jolt."""
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
    """Return the first jolt in a stretch of samples.

    Args:
        samples: The stretch.
        imu: What wrote them.
        vehicle: What it is on.
        start: Its motion where the stretch begins, as it knows it.
        rotor_speed_rad_s: In the middle of each sample.
        offset_m: Of the instrument, body axes.
        quaternion: Instrument to body (x, y, z, w).
        wind_m_s: Of the air, as far as it is known; None: still.
    """
    count = len(samples.force)
    base = base_of(count)
    if count < 2 * base:
        return _none(f"{count} samples are too few")
    wind = jnp.zeros(3) if wind_m_s is None else wind_m_s
    left, world = (
        np.asarray(x)
        for x in beyond(
            *(samples, 1 / imu.rate, base, vehicle, start, rotor_speed_rad_s),
            *(offset_m, quaternion, wind),
        )
    )
    if not np.isfinite(left).all():
        return _none("the vehicle was lost")
    noise = _Noise.of(imu, offset_m)
    if left[:base].std() > OVER * noise.of_one:
        return _none("the stretch begins within a jolt")
    size = np.linalg.norm(left, axis=1)
    above = np.flatnonzero(size > FOUND * noise.of_one)
    if not above.size or above[0] < base:
        return _none("no jolt leaves the noise")
    onset = int(above[0])
    top = float(imu.accelerometer_range) * (1 - 2.0 ** (1 - (imu.bits or 53)))
    at_end = np.abs(np.asarray(samples.force)) >= top * (1 - 1e-9)
    clipped = bool(at_end[onset - 1 :].any())
    last = _end(left, onset, noise, imu.rate, CLIPPED_SHARE if clipped else 0.0)
    if last is None:
        return _none("the jolt is not over within the stretch")
    # the front may have stood in the sample before, below what is found
    first = onset - 1
    jolt = world[first:last].sum(axis=0) / imu.rate
    walked = float(imu.accelerometer_walk) * math.sqrt((last - base / 2) / imu.rate)
    off = math.hypot(noise.white / math.sqrt(base), walked) * (last - first)
    of_sum = math.sqrt(last - first) * noise.white
    sd = math.hypot(of_sum, off, math.sqrt(2.0) * noise.lever) / imu.rate
    if np.linalg.norm(jolt) < FOUND * sd:
        return _none("the jolt is lost in the noise")
    return JoltPick(True, "", onset, jolt, sd, clipped)


class _Noise(NamedTuple):
    """What is left of a sample without a jolt, sd [m/s2].

    Attributes:
        white: Of the accelerometer, and of its bits.
        lever: Of the gyroscope, by whose changes the instrument's own way is taken
            off: all but the ends of it cancel in a sum.
    """

    white: float
    lever: float

    @classmethod
    def of(cls, imu: Imu, offset_m: Float[Array, "3"]) -> "_Noise":
        """Return that of an instrument at a place."""
        force, rate = map(float, imu.sample_noise())
        if imu.bits is not None:
            share = 2.0 ** (1 - imu.bits) / math.sqrt(12.0)
            force = math.hypot(force, share * float(imu.accelerometer_range))
            rate = math.hypot(rate, share * float(imu.gyroscope_range))
        arm = float(jnp.linalg.norm(offset_m))
        return cls(max(force, FLOOR_M_S2), rate / math.sqrt(2.0) * arm * imu.rate)

    @property
    def of_one(self) -> float:
        return math.hypot(self.white, self.lever)

    def of_mean(self, width: int) -> float:
        """Return that of a mean over several."""
        return math.hypot(self.white / math.sqrt(width), self.lever / width)


def _end(
    left: Float[np.ndarray, "sample 3"],
    onset: int,
    noise: _Noise,
    rate_hz: float,
    share: float,
) -> int | None:
    """Return the sample after which it is quiet; None if it is so nowhere.

    Args:
        left: What is left of the samples.
        onset: Where the jolt begins.
        noise: Of them.
        rate_hz: Of them.
        share: Of the largest, below which it is quiet in any case.
    """
    width = max(1, round(SMOOTH_S * rate_hz))
    quiet = max(2, round(QUIET_S * rate_hz))
    kernel = np.ones(width) / width
    smooth = np.stack([np.convolve(axis, kernel, "valid") for axis in left.T], axis=1)
    size = np.linalg.norm(smooth, axis=1)
    loud = size > max(OVER * noise.of_mean(width), share * size.max())
    since = 0
    for n in range(onset, len(loud)):
        since = 0 if loud[n] else since + 1
        if since >= quiet:
            return n - quiet + width
    return None


def _none(why: str) -> JoltPick:
    return JoltPick(False, why, -1, np.full(3, np.nan), math.inf, False)
