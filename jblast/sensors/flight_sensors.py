r"""Sensors that a vehicle flies by: inertial, barometer, satellites and magnetometer.

All are sampled together at the rate of the inertial unit, one sample a turn; the slower
ones at some of the turns. All noise of a turn is drawn by one key, the `fold_in` of the
turn's number. So a sample does not depend on earlier calls, and a turn costs one draw.

Accelerometer and gyroscope measure specific force and rate as in `sensors.imu`, at the
centre of mass: a sample is the mean over its time, so that the samples sum to the
change of velocity and of attitude, however short a blast's push is. Their errors are
those of `sensors.imu` without its bits: a bias at power-on, which walks, white noise,
and a range.

The barometer measures static pressure through a lag. The pressure of air at rest falls
with height as in the standard atmosphere, from its value at the scene's ground,

$$P(h) = P_0\,(1 - L h/T_0)^{g/(R L)},$$

and a height is the inverse of that for a reading. A blast's overpressure at the
vehicle's position is added: 10 kPa are 800 m of height. The port is ideal: the wind
across it makes no pressure.

The satellite receiver measures position and velocity with white noise, some time ago.
The slow errors of a receiver, which wander by metres over minutes, are left out, as a
vehicle that holds its position by them moves with them.

The magnetometer measures one field, the same everywhere near the scene. By default it
is the Earth's dipole at the latitude and longitude of the scene, the first three
coefficients of IGRF-14 (epoch 2025: $g_1^0 = -29350$, $g_1^1 = -1410.3$,
$h_1^1 = 4545.5$ nT). Left out are a tenth of the field and up to some 15 degrees of its
direction: enough for an autopilot that is given the same field, not for one that looks
it up.
"""

import functools
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.sensors.imu import rotation_between, rotation_quaternion
from jblast.types import as_float_array
from jblast.vehicle import BlastLoad, State
from jblast.vehicle.loads.blast import map_grouped
from jblast.vehicle.loads.blast_wave import Blast, overpressure
from jblast.waves.propagation import HYDROSTATIC_GRADIENT, LAPSE_RATE

CALIBRATED = 0.1
"""Of its offsets a calibration on the ground leaves the inertial unit; declared."""
_BIASES = 2**32 - 2
"""Folded into the key of the inertial unit's offsets: past the numbers of turns."""
_PARTS = (6, 12, 18, 21)
"""Boundaries between the parts of a turn's noise: walk, inertial unit, fix, field,
pressure."""
EXPONENT = HYDROSTATIC_GRADIENT / LAPSE_RATE
LEAST_PA, MOST_PA = 1_000.0, 120_000.0
"""Range of the barometer (MS5611-01BA03 data sheet: 10 to 1200 mbar)."""
MOMENTS = 8
"""Of a period at which a blast's pressure is looked at: fronts come between samples."""
DIPOLE_GAUSS = (-0.29350, -0.014103, 0.045455)
"""$g_1^0, g_1^1, h_1^1$ of IGRF-14 at 2025.0."""


class Fix(NamedTuple):
    """Position and velocity from a receiver.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]


class Gps(eqx.Module):
    """A receiver.

    Rate and delay are those of PX4's plugin for Gazebo (PX4-SITL_gazebo-classic,
    gazebo_gps_plugin: 5 Hz, 0.12 s), the velocity's noise is that of a u-blox NEO-M8
    (data sheet: 0.05 m/s for half of all samples); the places' are declared.

    Attributes:
        rate: Fixes a second [Hz].
        delay: From a fix to its report, shorter than the time between two [s].
        horizontal_noise: One standard deviation of a fix, east and north each [m].
        vertical_noise: Likewise, up [m].
        velocity_noise: Likewise, along each axis [m/s].
    """

    rate: float = eqx.field(static=True, converter=float, default=5.0)
    delay: float = eqx.field(static=True, converter=float, default=0.12)
    horizontal_noise: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=0.4
    )
    vertical_noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.8)
    velocity_noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.05)

    def __check_init__(self):
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate:g} Hz")
        if not 0 <= self.delay < 1 / self.rate:
            raise ValueError(
                f"delay must be shorter than the time between two fixes, "
                f"{1 / self.rate:g} s, and not negative, got {self.delay:g} s"
            )

    def noise(self) -> Float[Array, "6"]:
        """Return one standard deviation of each number of a fix [m, m/s]."""
        place = [self.horizontal_noise, self.horizontal_noise, self.vertical_noise]
        return jnp.stack([*place, *[self.velocity_noise] * 3])


def fix(
    noise: Float[Array, "6"],
    gps: Gps,
    position_m: Float[Array, "3"],
    velocity_m_s: Float[Array, "3"],
) -> Fix:
    """Return a fix, noise and all.

    Args:
        noise: Standard normal numbers, of place and of velocity.
        gps: The receiver.
        position_m: Where it is.
        velocity_m_s: How it moves.
    """
    off = gps.noise() * noise
    return Fix(position_m + off[:3], velocity_m_s + off[3:])


class Sample(NamedTuple):
    """Readings of a vehicle's instruments at a turn.

    Attributes:
        force_m_s2: Specific force over the period before, body axes.
        rate_rad_s: Rate over it, body axes.
        pressure_pa: Static pressure.
        has_pressure: Whether it is a new one.
        field_gauss: Magnetic field, body axes.
        has_field: Whether it is a new one.
        fix: Where the vehicle was `Gps.delay` before.
        has_fix: Whether it comes now.
        takes_fix: Whether one is taken now, to come later.
    """

    force_m_s2: Float[Array, "3"]
    rate_rad_s: Float[Array, "3"]
    pressure_pa: Float[Array, ""]
    has_pressure: Bool[Array, ""]
    field_gauss: Float[Array, "3"]
    has_field: Bool[Array, ""]
    fix: Fix
    has_fix: Bool[Array, ""]
    takes_fix: Bool[Array, ""]


class Biases(NamedTuple):
    """Biases of accelerometer and gyroscope.

    Attributes:
        force: Of the accelerometer [m/s2].
        rate: Of the gyroscope [rad/s].
    """

    force: Float[Array, "3"]
    rate: Float[Array, "3"]


class Held(NamedTuple):
    """State of the instruments from turn to turn.

    Attributes:
        biases: Of the inertial unit.
        port_pa: Pressure in the barometer's port.
        fix: The last that was taken.
    """

    biases: Biases
    port_pa: Float[Array, ""]
    fix: Fix


class Barometer(eqx.Module):
    """A barometer.

    Absent numbers: noise is the resolution of an MS5611-01BA03 at its finest (data
    sheet: 0.012 mbar); the lag is declared, of a port under foam.

    Attributes:
        rate: Samples a second [Hz].
        noise: One standard deviation of a sample [Pa].
        lag: Of its port [s].
    """

    rate: float = eqx.field(static=True, converter=float, default=50.0)
    noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=1.2)
    lag: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.02)

    def __check_init__(self):
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate:g} Hz")


class Magnetometer(eqx.Module):
    """A magnetometer.

    Attributes:
        field_gauss: Of the place: east, north, up.
        rate: Samples a second [Hz].
        noise: One standard deviation of an axis of a sample [gauss]; declared, of an
            IST8310 (data sheet: 0.3 uT of resolution) three times over.
    """

    field_gauss: Float[Array, "3"] = eqx.field(converter=as_float_array)
    rate: float = eqx.field(static=True, converter=float, default=50.0)
    noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.009)

    def __check_init__(self):
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate:g} Hz")


class Suite(eqx.Module):
    """The instruments, and the air and the blasts about them.

    Attributes:
        magnetometer: Includes the field of the place.
        imu: Its rate is that of the turns.
        barometer: Of static pressure.
        gps: The receiver of satellites.
        ground_pressure_pa: Of the air at up = 0.
        ground_temperature_k: Likewise.
        wind_m_s: Of the air: east, north, up.
        blasts: Whose overpressure the barometer measures; None: none.
    """

    magnetometer: Magnetometer
    imu: Imu = eqx.field(default_factory=lambda: Imu(rate=250.0, bits=None))
    barometer: Barometer = eqx.field(default_factory=Barometer)
    gps: Gps = eqx.field(default_factory=Gps)
    ground_pressure_pa: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=101_325.0
    )
    ground_temperature_k: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=288.15
    )
    wind_m_s: Float[Array, "3"] = eqx.field(
        converter=as_float_array, default_factory=lambda: jnp.zeros(3)
    )
    blasts: BlastLoad | None = None

    def __check_init__(self):
        for name in ("gps", "barometer", "magnetometer"):
            rate = getattr(self, name).rate
            if rate > self.imu.rate:
                raise ValueError(
                    f"{name} rate must be that of the imu, {self.imu.rate:g} Hz, at "
                    f"most, got {rate:g} Hz"
                )

    def turns(self, rate: float) -> int:
        """Return how many turns lie between two samples of an instrument."""
        return max(1, round(self.imu.rate / rate))

    @property
    def turns_late(self) -> int:
        """Delay of a fix in turns."""
        return round(self.gps.delay * self.imu.rate)

    def start(self, key: PRNGKeyArray, state: State) -> Held:
        """Return what is kept before the first turn, the inertial unit calibrated.

        Args:
            key: Of all draws.
            state: Where the vehicle is.
        """
        drawn = drawn_biases(jax.random.fold_in(key, _BIASES), self.imu, CALIBRATED)
        pressure = pressure_at(
            state.position_m[2], self.ground_pressure_pa, self.ground_temperature_k
        )
        return Held(drawn, pressure, Fix(state.position_m, state.velocity_m_s))

    def __call__(
        self,
        key: PRNGKeyArray,
        turn: Int[Array, ""],
        held: Held,
        before: State,
        now: State,
        time_s: Float[Array, ""],
        period_s: Float[Array, ""],
    ) -> tuple[Sample, Held]:
        """Return the readings of the instruments at a turn, and their state.

        Args:
            key: Of all draws, the same at every turn.
            turn: Its number, from 0.
            held: What was kept.
            before: The vehicle at the turn before.
            now: The vehicle.
            time_s: On the clock of the blasts.
            period_s: Between two turns.
        """
        drawn = jax.random.normal(jax.random.fold_in(key, turn), (_PARTS[-1] + 1,))
        walk, inertial, of_fix, of_field, of_pressure = jnp.split(drawn, _PARTS)
        biases = walked(walk, self.imu, held.biases, period_s)
        true = felt_between(before, now, period_s)
        force, rate = sampled(inertial, self.imu, biases, true)
        port = lagging(
            held.port_pa,
            self._outside(before, now, time_s, period_s),
            self.barometer.lag,
            period_s,
        )
        noise = self.barometer.noise * of_pressure[0]
        every, late = self.turns(self.gps.rate), self.turns_late
        takes = turn % every == 0
        taken = fix(of_fix, self.gps, now.position_m, now.velocity_m_s)
        taken = jax.tree.map(lambda a, b: jnp.where(takes, a, b), taken, held.fix)
        sample = Sample(
            force,
            rate,
            port + noise,
            turn % self.turns(self.barometer.rate) == 0,
            field_read(of_field, self.magnetometer, now.quaternion),
            turn % self.turns(self.magnetometer.rate) == 0,
            taken,
            (turn >= late) & ((turn - late) % every == 0),
            takes,
        )
        return sample, Held(biases, port, taken)

    def _outside(
        self,
        before: State,
        now: State,
        time_s: Float[Array, ""],
        period_s: Float[Array, ""],
    ) -> Float[Array, " moment"]:
        """Return the static pressure at even moments of a period [Pa]."""
        shares = jnp.linspace(0.5, MOMENTS - 0.5, MOMENTS) / MOMENTS
        way = now.position_m - before.position_m
        places = before.position_m[None, :] + jnp.outer(shares, way)
        rest = pressure_at(
            places[:, 2], self.ground_pressure_pa, self.ground_temperature_k
        )
        if self.blasts is None:
            return rest
        times = time_s - (1 - shares) * period_s
        blasts = self.blasts
        # a wave comes and goes later by 4.7/c at most for each metre farther away
        slowest = 5 / blasts.sound_speed_m_s * jnp.sqrt(jnp.sum(jnp.square(way)))
        over = jax.lax.cond(
            may_press(blasts, time_s, now.position_m, 2 * period_s + slowest),
            lambda: jax.vmap(blast_overpressure, (None, 0, 0))(blasts, times, places),
            lambda: jnp.zeros_like(rest),
        )
        return rest + over


def drawn_biases(key: PRNGKeyArray, imu: Imu, share: float = 1.0) -> Biases:
    """Return what the instruments are off by as they are switched on.

    Args:
        key: Of the draw.
        imu: Standard deviations of the biases.
        share: What a calibration on the ground has left of it.
    """
    of_force, of_rate = jax.random.split(key)
    return Biases(
        share * imu.accelerometer_bias * jax.random.normal(of_force, (3,)),
        share * imu.gyroscope_bias * jax.random.normal(of_rate, (3,)),
    )


def walked(
    noise: Float[Array, "6"], imu: Imu, biases: Biases, period_s: Float[Array, ""]
) -> Biases:
    """Return what the instruments are off by a period later.

    Args:
        noise: Standard normal numbers, of force and of rate.
        imu: Random walk of the biases.
        biases: At its beginning.
        period_s: How long it is.
    """
    step = jnp.sqrt(period_s)
    return Biases(
        biases.force + step * imu.accelerometer_walk * noise[:3],
        biases.rate + step * imu.gyroscope_walk * noise[3:],
    )


def felt_between(
    before: State, now: State, period_s: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Return specific force [m/s2] and rate [rad/s] between two states, body axes."""
    turn = rotation_between(before.quaternion, now.quaternion)
    half = quaternion_product(before.quaternion, rotation_quaternion(turn / 2))
    gained = (now.velocity_m_s - before.velocity_m_s) / period_s
    gained = gained + jnp.array([0.0, 0.0, FLIGHT_GRAVITY])
    return quaternion_matrix(half).T @ gained, turn / period_s


def sampled(
    noise: Float[Array, "6"],
    imu: Imu,
    biases: Biases,
    true: tuple[Float[Array, "3"], Float[Array, "3"]],
) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Return a sample as it is read.

    Args:
        noise: Standard normal numbers, of force and of rate.
        imu: Noise, rate and range.
        biases: What the instruments are off by.
        true: Specific force and rate.
    """
    half = math.sqrt(imu.rate / 2)
    force = true[0] + biases.force
    force = force + half * imu.accelerometer_noise * noise[:3]
    rate = true[1] + biases.rate
    rate = rate + half * imu.gyroscope_noise * noise[3:]
    most, fastest = imu.accelerometer_range, imu.gyroscope_range
    return jnp.clip(force, -most, most), jnp.clip(rate, -fastest, fastest)


def pressure_at(
    up_m: Float[Array, "..."],
    ground_pressure_pa: Float[Array, ""],
    ground_temperature_k: Float[Array, ""],
) -> Float[Array, "..."]:
    """Return the pressure of air at rest at a height above the ground [Pa]."""
    colder = 1 - LAPSE_RATE * up_m / ground_temperature_k
    return ground_pressure_pa * colder**EXPONENT


def height_of(
    pressure_pa: Float[Array, "..."],
    ground_pressure_pa: Float[Array, ""],
    ground_temperature_k: Float[Array, ""],
) -> Float[Array, "..."]:
    """Return the height above the ground at which air at rest has a pressure [m]."""
    colder = (pressure_pa / ground_pressure_pa) ** (1 / EXPONENT)
    return ground_temperature_k / LAPSE_RATE * (1 - colder)


def blast_overpressure(
    load: BlastLoad, time_s: Float[Array, ""], position_m: Float[Array, "3"]
) -> Float[Array, ""]:
    """Return the overpressure of blasts at a time and place [Pa]; they add up.

    Those that come by way of the ground too.
    """

    def of(blast: Blast) -> Float[Array, ""]:
        # one that never happens has a wave without pressure
        wave = load.wave_of(blast, position_m)
        return overpressure(wave, _since_front(load, blast, time_s, position_m))

    return load.pressure_pa * sum(map_grouped(of, load.waves), jnp.zeros_like(time_s))


def may_press(
    load: BlastLoad,
    time_s: Float[Array, ""],
    position_m: Float[Array, "3"],
    slack_s: Float[Array, ""],
) -> Bool[Array, ""]:
    """Return whether blasts may make a pressure about a time and place.

    Args:
        load: Of the blasts.
        time_s: When.
        position_m: Where.
        slack_s: How much sooner or later a wave may come, and go.
    """

    def of(blast: Blast) -> Bool[Array, ""]:
        since = _since_front(load, blast, time_s, position_m)
        wave = load.wave_of(blast, position_m)
        lasts = wave.duration_s + wave.suction_s
        return ~blast.never & (since >= -slack_s) & (since <= lasts + slack_s)

    return functools.reduce(
        jnp.logical_or, map_grouped(of, load.waves), jnp.zeros((), bool)
    )


def _since_front(
    load: BlastLoad,
    blast: Blast,
    time_s: Float[Array, ""],
    position_m: Float[Array, "3"],
) -> Float[Array, ""]:
    """Return how long ago a front came; if it never goes off, as if it did now."""
    # not since its arrival time, which float32 rounds late on the clock
    travel = blast.travel_time_s(load.surroundings(), position_m)
    return time_s - blast.by(time_s).time_s - travel


def lagging(
    read_pa: Float[Array, ""],
    pressures_pa: Float[Array, " moment"],
    lag_s: Float[Array, ""],
    period_s: Float[Array, ""],
) -> Float[Array, ""]:
    """Return what the port has come to after a period.

    Args:
        read_pa: At its beginning.
        pressures_pa: Outside, at even moments of it, each held for its share.
        lag_s: Of the port.
        period_s: How long it is.
    """
    stays = jnp.exp(-period_s / pressures_pa.shape[0] / lag_s)
    for pressure in pressures_pa:
        read_pa = pressure + (read_pa - pressure) * stays
    return jnp.clip(read_pa, LEAST_PA, MOST_PA)


def dipole_field(lat_deg: float, lon_deg: float) -> Float[np.ndarray, "3"]:
    r"""Return the field of the Earth's dipole at sea level: east, north, up [gauss].

    Less the gradient of
    $\frac{a^3}{r^2}\,(g_1^0\sin\phi + (g_1^1\cos\lambda + h_1^1\sin\lambda)\cos\phi)$
    at $r = a$.

    Args:
        lat_deg: Latitude, taken as geocentric [degree].
        lon_deg: Longitude [degree].
    """
    g_0, g_1, h_1 = DIPOLE_GAUSS
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    across = g_1 * math.cos(lon) + h_1 * math.sin(lon)
    east = g_1 * math.sin(lon) - h_1 * math.cos(lon)
    north = -g_0 * math.cos(lat) + across * math.sin(lat)
    up = 2 * (g_0 * math.sin(lat) + across * math.cos(lat))
    return np.array([east, north, up])


def field_read(
    noise: Float[Array, "3"], magnetometer: Magnetometer, quaternion: Float[Array, "4"]
) -> Float[Array, "3"]:
    """Return a sample along the body's axes [gauss].

    Args:
        noise: Standard normal numbers.
        magnetometer: Field and noise.
        quaternion: Body to world (x, y, z, w), of length 1.
    """
    true = quaternion_matrix(quaternion).T @ magnetometer.field_gauss
    return true + magnetometer.noise * noise
