r"""Sensors that a vehicle flies by: inertial, barometer, satellites and magnetometer.

All are sampled together at the rate of the inertial unit, one sample per turn; slower
sensors at some of the turns. All noise of a turn is drawn with one key, the `fold_in`
of the turn's number. A sample therefore does not depend on earlier calls, and a turn
costs one draw.

Accelerometer and gyroscope measure specific force and rate as in `sensors.imu`, with
its errors, at the centre of mass.

The barometer measures static pressure through a lag. The pressure of air at rest falls
with height as in the standard atmosphere, from its value at the scene's ground,

$$P(h) = P_0\,(1 - L h/T_0)^{g/(R L)},$$

and the height of a reading is its inverse. A blast's overpressure at the vehicle's
position is added: 10 kPa are 800 m of height. The port is ideal: wind across it causes
no pressure.

The satellite receiver measures position and velocity with white noise and a delay. The
slow errors of a receiver, which wander by metres over minutes, are left out, because a
vehicle that holds its position by them moves with them.

The magnetometer measures one field, the same everywhere near the scene. By default it
is the Earth's dipole at the latitude and longitude of the scene, the first three
coefficients of IGRF-14 (epoch 2025: $g_1^0 = -29350$, $g_1^1 = -1410.3$,
$h_1^1 = 4545.5$ nT). This neglects a tenth of the field and up to some 15 degrees of
its direction. It suffices for an autopilot that is given the same field, not for one
that has a model of its own.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from jblast.errors import require
from jblast.scene import Imu, quaternion_matrix
from jblast.sensors.imu import (
    Inertial,
    inertial_between,
    power_on_bias,
    sampled,
    walked,
)
from jblast.types import as_numbers
from jblast.vehicle import BlastLoad, State
from jblast.vehicle.loads.blast_wave import Blast, overpressure
from jblast.waves.propagation import HYDROSTATIC_GRADIENT, LAPSE_RATE

CALIBRATED = 0.1
"""Share of the inertial unit's biases that a ground calibration leaves; declared.
"""
_BIASES = 2**32 - 2
"""Number folded into the key for the power-on biases, beyond the numbers of turns."""
_PARTS = (6, 12, 18, 21)
"""Bounds of the parts of a turn's noise: walk, inertial unit, fix, field, pressure.
"""
EXPONENT = HYDROSTATIC_GRADIENT / LAPSE_RATE
"""$g/(R L)$ of the standard atmosphere [-]: 5.26."""
LEAST_PA, MOST_PA = 1_000.0, 120_000.0
"""Range of the barometer (MS5611-01BA03 data sheet: 10 to 1200 mbar)."""
MOMENTS = 8
"""Times within a period at which a blast's pressure is evaluated, because fronts arrive
between samples. At 250 Hz they are 0.5 ms apart, well below the lag of 20 ms."""
DIPOLE_GAUSS = (-0.29350, -0.014103, 0.045455)
"""$g_1^0, g_1^1, h_1^1$ of IGRF-14 at 2025.0."""


class Fix(NamedTuple):
    """Position and velocity from a receiver.

    Attributes:
        position_m: East, north, up [m].
        velocity_m_s: East, north, up [m/s].
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]


class Sample(NamedTuple):
    """Readings of a vehicle's instruments at a turn.

    Attributes:
        force_m_s2: Mean specific force over the preceding period, body axes.
        rate_rad_s: Mean angular rate over it, body axes.
        pressure_pa: Static pressure.
        has_pressure: True if the pressure is new.
        field_gauss: Magnetic field, body axes.
        has_field: True if the field is new.
        fix: Fix taken `Gps.delay` before.
        has_fix: True if the fix is reported at this turn.
        takes_fix: True if a fix is taken at this turn, for a later report.
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


class Held(NamedTuple):
    """State of the instruments from turn to turn.

    Attributes:
        biases: Biases of the inertial unit.
        port_pa: Pressure in the barometer's port.
        fix: Last fix taken.
    """

    biases: Inertial
    port_pa: Float[Array, ""]
    fix: Fix


class Gps(eqx.Module):
    """A satellite receiver.

    Rate and delay are those of PX4's plugin for Gazebo (PX4-SITL_gazebo-classic,
    gazebo_gps_plugin: 5 Hz, 0.12 s). The noise of the velocity is that of a u-blox
    NEO-M8 (data sheet: 0.05 m/s for half of all samples). That of the position is
    declared.

    Attributes:
        rate: Fixes per second [Hz].
        delay: Time from a fix to its report, shorter than that between two fixes [s].
        horizontal_noise: Standard deviation of a fix, east and north each [m].
        vertical_noise: Likewise, up [m].
        velocity_noise: Likewise, along each axis [m/s].
    """

    rate: float = eqx.field(static=True, converter=float, default=5.0)
    delay: float = eqx.field(static=True, converter=float, default=0.12)
    horizontal_noise: Float[Array, ""] = eqx.field(converter=as_numbers, default=0.4)
    vertical_noise: Float[Array, ""] = eqx.field(converter=as_numbers, default=0.8)
    velocity_noise: Float[Array, ""] = eqx.field(converter=as_numbers, default=0.05)

    def noise(self) -> Float[Array, "6"]:
        """Return the standard deviation of each number of a fix [m, m/s]."""
        place = [self.horizontal_noise, self.horizontal_noise, self.vertical_noise]
        return jnp.stack([*place, *[self.velocity_noise] * 3])


class Barometer(eqx.Module):
    """A barometer.

    The default noise is the finest resolution of an MS5611-01BA03 (data sheet: 0.012
    mbar). The default lag is declared, for a port under foam.

    Attributes:
        rate: Samples per second [Hz].
        noise: Standard deviation of a sample [Pa].
        lag: Time constant of the port [s].
    """

    rate: float = eqx.field(static=True, converter=float, default=50.0)
    noise: Float[Array, ""] = eqx.field(converter=as_numbers, default=1.2)
    lag: Float[Array, ""] = eqx.field(converter=as_numbers, default=0.02)


class Magnetometer(eqx.Module):
    """A magnetometer.

    Attributes:
        field_gauss: Field at the scene: east, north, up.
        rate: Samples per second [Hz].
        noise: Standard deviation of an axis of a sample [gauss]; declared as three
            times the resolution of an IST8310 (data sheet: 0.3 uT).
    """

    field_gauss: Float[Array, "3"] = eqx.field(converter=as_numbers)
    rate: float = eqx.field(static=True, converter=float, default=50.0)
    noise: Float[Array, ""] = eqx.field(converter=as_numbers, default=0.009)


class Suite(eqx.Module):
    """Instruments, with the air and the blasts around them.

    Attributes:
        magnetometer: Magnetometer, with the field at the scene.
        imu: Inertial unit; its rate is that of the turns.
        barometer: Barometer for static pressure.
        gps: Satellite receiver.
        ground_pressure_pa: Air pressure at up = 0.
        ground_temperature_k: Air temperature at up = 0.
        wind_m_s: Wind: east, north, up.
        blasts: Blasts whose overpressure the barometer measures, or None.
    """

    magnetometer: Magnetometer
    imu: Imu = eqx.field(default_factory=lambda: Imu(rate=250.0, bits=None))
    barometer: Barometer = eqx.field(default_factory=Barometer)
    gps: Gps = eqx.field(default_factory=Gps)
    ground_pressure_pa: Float[Array, ""] = eqx.field(
        converter=as_numbers, default=101_325.0
    )
    ground_temperature_k: Float[Array, ""] = eqx.field(
        converter=as_numbers, default=288.15
    )
    wind_m_s: Float[Array, "3"] = eqx.field(
        converter=as_numbers, default_factory=lambda: jnp.zeros(3)
    )
    blasts: BlastLoad | None = None

    def __check_init__(self):
        for name in ("gps", "barometer", "magnetometer"):
            rate, most = getattr(self, name).rate, self.imu.rate
            rates = f"a rate above 0 and at most that of the imu, {most:g} Hz"
            require(0 < rate <= most, name, rates, f"{rate:g} Hz")
        delay, between = self.gps.delay, 1 / self.gps.rate
        delays = f"a delay shorter than the time between two fixes, {between:g} s"
        require(0 <= delay < between, "gps", delays, f"{delay:g} s")

    def turns(self, rate: float) -> int:
        """Return the number of turns between two samples of an instrument."""
        return max(1, round(self.imu.rate / rate))

    def start(self, key: PRNGKeyArray, state: State) -> Held:
        """Return the state before the first turn, with the inertial unit calibrated.

        Args:
            key: Random key of all draws.
            state: State of the vehicle.
        """
        biases = power_on_bias(jax.random.fold_in(key, _BIASES), self.imu, CALIBRATED)
        up = state.position_m[2]
        port = pressure_at(up, self.ground_pressure_pa, self.ground_temperature_k)
        return Held(biases, port, Fix(state.position_m, state.velocity_m_s))

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
            key: Random key of all draws, the same at every turn.
            turn: Number of the turn, from 0.
            held: State of the instruments.
            before: State of the vehicle at the previous turn.
            now: State of the vehicle.
            time_s: Time on the clock of the blasts [s].
            period_s: Time between two turns [s].
        """
        # one draw of all numbers: several calls would cost more than the samples
        drawn = jax.random.normal(jax.random.fold_in(key, turn), (_PARTS[-1] + 1,))
        walk, inertial, of_fix, of_field, of_pressure = jnp.split(drawn, _PARTS)
        biases = walked(walk, self.imu, held.biases, period_s)
        true = inertial_between(before, now, period_s)
        read = sampled(inertial, self.imu, biases, true)
        outside = self._outside(before, now, time_s, period_s)
        port = lagging(held.port_pa, outside, self.barometer.lag, period_s)
        to_body = quaternion_matrix(now.quaternion).T
        field = to_body @ self.magnetometer.field_gauss
        every, late = self.turns(self.gps.rate), round(self.gps.delay * self.imu.rate)
        takes = turn % every == 0
        off = self.gps.noise() * of_fix
        new = Fix(now.position_m + off[:3], now.velocity_m_s + off[3:])
        # between fixes the last one is kept for its delayed report
        fix = jax.tree.map(lambda a, b: jnp.where(takes, a, b), new, held.fix)
        sample = Sample(
            *read,
            pressure_pa=port + self.barometer.noise * of_pressure[0],
            has_pressure=turn % self.turns(self.barometer.rate) == 0,
            field_gauss=field + self.magnetometer.noise * of_field,
            has_field=turn % self.turns(self.magnetometer.rate) == 0,
            fix=fix,
            has_fix=(turn >= late) & ((turn - late) % every == 0),
            takes_fix=takes,
        )
        return sample, Held(biases, port, fix)

    def _outside(
        self,
        before: State,
        now: State,
        time_s: Float[Array, ""],
        period_s: Float[Array, ""],
    ) -> Float[Array, " moment"]:
        """Return the static pressure at evenly spaced times of a period [Pa]."""
        # middles of equal parts
        shares = jnp.linspace(0.5, MOMENTS - 0.5, MOMENTS) / MOMENTS
        gained = now.position_m - before.position_m
        up = before.position_m[2] + shares * gained[2]
        rest = pressure_at(up, self.ground_pressure_pa, self.ground_temperature_k)
        if self.blasts is None:
            return rest
        # Waves in the middle of the path: at the ends of 4 ms at 10 m/s they arrive
        # 0.06 ms earlier or later, far below the lag.
        middle, times = now.position_m - gained / 2, time_s - (1 - shares) * period_s
        return rest + blast_overpressure(self.blasts, times, middle)


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
    load: BlastLoad, time_s: Float[Array, "*time"], position_m: Float[Array, "3"]
) -> Float[Array, "*time"]:
    """Return the overpressure of all blasts at some times at a position [Pa].

    Waves reflected by the ground are included.
    """

    def of(blast: Blast) -> Float[Array, "..."]:
        # not from the arrival time, which float32 rounds on a clock of many minutes
        since = time_s - blast.time_s - blast.travel_time_s(load.air, position_m)
        return overpressure(blast.wave(load.air, position_m), since)

    return load.pressure_pa * jnp.sum(load.of_waves(of, 0.0), axis=0)


def lagging(
    read_pa: Float[Array, ""],
    pressures_pa: Float[Array, " moment"],
    lag_s: Float[Array, ""],
    period_s: Float[Array, ""],
) -> Float[Array, ""]:
    """Return the pressure in the port after a period [Pa].

    Args:
        read_pa: Pressure in the port at the beginning.
        pressures_pa: Pressure outside, constant over equal parts of the period.
        lag_s: Time constant of the port.
        period_s: Length of the period.
    """
    # exact for a first-order lag with an input constant over each part
    stays = jnp.exp(-period_s / pressures_pa.shape[0] / lag_s)
    for pressure in pressures_pa:
        read_pa = pressure + (read_pa - pressure) * stays
    return jnp.clip(read_pa, LEAST_PA, MOST_PA)


def dipole_field(lat_deg: float, lon_deg: float) -> Float[np.ndarray, "3"]:
    r"""Return the field of the Earth's dipole at sea level: east, north, up [gauss].

    Minus the gradient of
    $\frac{a^3}{r^2}\,(g_1^0\sin\phi + (g_1^1\cos\lambda + h_1^1\sin\lambda)\cos\phi)$
    at $r = a$.

    Args:
        lat_deg: Latitude, used as geocentric [degree].
        lon_deg: Longitude [degree].
    """
    g_0, g_1, h_1 = DIPOLE_GAUSS
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    across = g_1 * math.cos(lon) + h_1 * math.sin(lon)
    east = g_1 * math.sin(lon) - h_1 * math.cos(lon)
    north = -g_0 * math.cos(lat) + across * math.sin(lat)
    up = 2 * (g_0 * math.sin(lat) + across * math.cos(lat))
    return np.array([east, north, up])
