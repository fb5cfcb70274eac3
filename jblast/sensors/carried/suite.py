"""All that a vehicle flies by, sampled together: one sample a turn, the slow ones less.

All noise of a turn is drawn at once, by a key that is `fold_in` of the turn's number:
so a sample does not hang on what was asked before it, and a turn costs one draw.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from jblast.scene import Imu
from jblast.sensors.carried.barometer import (
    MOMENTS,
    Barometer,
    blast_overpressure,
    lagging,
    may_press,
    pressure_at,
)
from jblast.sensors.carried.gps import Fix, Gps, fix
from jblast.sensors.carried.inertial import (
    Biases,
    drawn_biases,
    felt_between,
    sampled,
    walked,
)
from jblast.sensors.carried.magnetometer import Magnetometer, field_read
from jblast.types import as_float_array
from jblast.vehicle import BlastLoad, State

CALIBRATED = 0.1
"""Of its offsets a calibration on the ground leaves the inertial unit; declared."""
_BIASES = 2**32 - 2
"""Folded into the key of the inertial unit's offsets: past the numbers of turns."""
_PARTS = (6, 12, 18, 21)
"""Where the noise of a turn is parted: walk, inertial unit, fix, field, pressure."""


class Sample(NamedTuple):
    """What a vehicle's instruments say at a turn.

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


class Held(NamedTuple):
    """What the instruments keep from turn to turn.

    Attributes:
        biases: Of the inertial unit.
        port_pa: Pressure in the barometer's port.
        fix: The last that was taken.
    """

    biases: Biases
    port_pa: Float[Array, ""]
    fix: Fix


class Suite(eqx.Module):
    """The instruments, and the air and the blasts about them.

    Attributes:
        magnetometer: Which says the field of the place.
        imu: Its rate is that of the turns.
        barometer: Of static pressure.
        gps: The receiver of satellites.
        ground_pressure_pa: Of the air at up = 0.
        ground_temperature_k: Likewise.
        wind_m_s: Of the air: east, north, up.
        blasts: Whose overpressure the barometer feels; None: it feels none.
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
        """How many turns a fix comes late."""
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
        """Return what the instruments say at a turn, and what they keep.

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
