r"""An error-state Kalman filter of a vehicle's own state, and control by it.

At each turn of the controller the instruments are sampled, the estimate is predicted
and corrected, and the controller is given the estimate in place of the state. Rotor
speeds are known; a switch detects contact with the ground. The memory
of a controller is not stored: where a row is stored at each of its turns, the estimate
along a flight is computed again from the stored states.

**Prediction** over one sample of the inertial unit. With its mean rate and specific
force, each less the estimated bias, and the attitude in the middle of the sample,
$R_m = R\exp(\omega\,\Delta t/2)$,

$$R' = R\exp(\omega\,\Delta t), \quad v' = v + (R_m f - g\hat z)\Delta t, \quad
p' = p + (v + v')\Delta t/2.$$

The first two are exact for what `flight_sensors` measures. The error, with attitude
about the body's axes, is propagated to first order (Sola 2017, Quaternion kinematics
for the error-state Kalman filter, section 5.3, with the middle of the sample in place
of its beginning):

$$\delta\theta' = \exp(-\omega\Delta t)\,\delta\theta -
  (\Delta t - [\omega]_\times\Delta t^2/2)\,\delta b_\omega$$
$$\delta v' = \delta v - R_m [f]_\times \Delta t\,(R_h^T\delta\theta -
  \delta b_\omega\Delta t/2) - R_m\Delta t\,\delta b_f$$

with $R_h = \exp(\omega\,\Delta t/2)$, and $\delta p' = \delta p + (\delta v +
\delta v')\Delta t/2$.

**Correction** by a barometer, a magnetometer, and position fixes that come late.
Numbers have independent errors and are used one by one, so no matrix is inverted. The
innovation of each is limited to `GATE` standard deviations: the pressure of a blast on
the barometer hardly moves the estimate, and an estimate that is far off still recovers,
which it might not if such numbers were rejected.

A fix measures the position a time $d$ earlier. The error then was, to first order,

$$\delta v_d = \delta v + d\,e, \qquad \delta p_d = \delta p - d\,\delta v -
  d^2 e/2, \qquad e = [\bar a]_\times R\,\delta\theta + R\,\delta b_f$$

with the mean specific force $\bar a$ since then, from the velocities estimated then and
now. Corrections since then are applied to the stored state as well.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Integer, PRNGKeyArray, PyTree

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import Imu, quaternion_matrix
from jblast.scene.camera import quaternion_product
from jblast.sensors.flight_sensors import (
    CALIBRATED,
    Biases,
    Held,
    Sample,
    Suite,
    height_of,
)
from jblast.sensors.imu import rotation_between, rotation_quaternion
from jblast.types import as_float_array
from jblast.vehicle import State, Trajectory, Vehicle

WATCHED_S = 10.0
"""Time after its arrival over which errors are attributed to a blast, until the next
blast at most."""
BEFORE_S = 1.0
"""Time before an arrival over which the error before it is computed."""
_ALIGNMENT = 2**32 - 1
"""Folded into the key of the first error: past the numbers of the instruments."""
GATE = 5.0
"""PX4's for its barometer and for fixes (EKF2_BARO_GATE, EKF2_GPS_P_GATE)."""
HEIGHT_SHARE = 0.083
"""Metres that a pascal is near the ground."""
TURN, PLACE, MOVES, RATE_BIAS, FORCE_BIAS = (slice(3 * n, 3 * n + 3) for n in range(5))
"""Parts of an error: attitude about the body's axes [rad], position [m], velocity
[m/s], what gyroscope [rad/s] and accelerometer [m/s2] are off by."""
SIZE = 15
"""Of an error: five vectors."""


class Thrown(NamedTuple):
    """Errors of an estimate by blast: root mean square before, greatest after.

    Attributes:
        place_before_m: Of the position.
        place_m: Likewise, after.
        moves_before_m_s: Of the velocity.
        moves_m_s: Likewise, after.
        turn_before_rad: Of the attitude.
        turn_rad: Likewise, after.
    """

    place_before_m: Float[Array, "*batch blast"]
    place_m: Float[Array, "*batch blast"]
    moves_before_m_s: Float[Array, "*batch blast"]
    moves_m_s: Float[Array, "*batch blast"]
    turn_before_rad: Float[Array, "*batch blast"]
    turn_rad: Float[Array, "*batch blast"]


class Followed(NamedTuple):
    """An estimate along a flight.

    Attributes:
        shown: What who flew took for the state.
        error: That takes it to the truth, by the parts of `estimate`.
        deviation: How sure it was: one standard deviation of each.
    """

    shown: State
    error: Float[Array, "time 15"]
    deviation: Float[Array, "time 15"]


def thrown(
    followed: Followed, time_s: Float[Array, " time"], arrival_s: Float[Array, " blast"]
) -> Thrown:
    """Return what blasts did to an estimate; NaN of one that the flight does not meet.

    Args:
        followed: The estimate along a flight.
        time_s: Of its rows.
        arrival_s: Of the blasts at the vehicle; infinite: never.
    """
    later = jnp.where(
        arrival_s[None, :] > arrival_s[:, None], arrival_s[None, :], jnp.inf
    )
    until = jnp.minimum(jnp.min(later, axis=1), arrival_s + WATCHED_S)
    sizes = [
        jnp.linalg.norm(followed.error[:, part], axis=-1)
        for part in (PLACE, MOVES, TURN)
    ]

    def of(came: Array, end: Array) -> list[Array]:
        before = (time_s >= came - BEFORE_S) & (time_s < came)
        after = (time_s >= came) & (time_s < end)
        found = []
        for size in sizes:
            found += [_rms(size, before), _most(size, after)]
        return found

    return Thrown(*jax.vmap(of)(arrival_s, until))


def _rms(values: Float[Array, " time"], rows: Bool[Array, " time"]) -> Array:
    count = jnp.sum(rows).astype(values.dtype)
    square = jnp.sum(jnp.where(rows, jnp.square(values), 0.0))
    some = count > 0
    mean = jnp.where(some, square / jnp.where(some, count, 1.0), jnp.nan)
    return jnp.sqrt(mean)


def _most(values: Float[Array, " time"], rows: Bool[Array, " time"]) -> Array:
    # one that is lost has no size: it stays NaN
    greatest = jnp.max(jnp.where(rows, values, -1.0))
    return jnp.where(greatest < 0, jnp.nan, greatest)


class Alignment(eqx.Module):
    """How sure a vehicle is of its state as it begins: one standard deviation each.

    Declared: aligned and calibrated at rest, its heading by the field.

    Attributes:
        tilt: Of roll and pitch [rad].
        heading: [rad].
        place: Along each axis [m].
        moves: Likewise [m/s].
    """

    tilt: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.01)
    heading: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.03)
    place: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.2)
    moves: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.05)

    def deviations(
        self, rate_bias: Float[Array, ""], force_bias: Float[Array, ""]
    ) -> Float[Array, "15"]:
        """Return one standard deviation of each number of the error.

        Args:
            rate_bias: Of what the gyroscope is off by, calibrated [rad/s].
            force_bias: Of what the accelerometer is off by [m/s2].
        """
        one = jnp.ones(3)
        turn = jnp.stack([self.tilt, self.tilt, self.heading])
        return jnp.concatenate(
            [
                *(turn, self.place * one, self.moves * one),
                *(rate_bias * one, force_bias * one),
            ]
        )


class Past(NamedTuple):
    """The estimate at the time of the last fix.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        age_s: How long ago.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    age_s: Float[Array, ""]


class Estimate(NamedTuple):
    """An estimate.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w), of length 1.
        rate_bias: What the gyroscope is off by [rad/s].
        force_bias: What the accelerometer is off by [m/s2].
        covariance: Of the error: the truth is the estimate turned and moved on by it.
        past: What a late fix is compared with.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    quaternion: Float[Array, "4"]
    rate_bias: Float[Array, "3"]
    force_bias: Float[Array, "3"]
    covariance: Float[Array, "15 15"]
    past: Past


class Known(NamedTuple):
    """The estimator's memory at a turn.

    Attributes:
        estimate: Of the state.
        held: What the instruments keep.
        before: The true state at the turn before, which they feel from.
        rate_rad_s: About the body's axes, as it was read and corrected.
    """

    estimate: Estimate
    held: Held
    before: State
    rate_rad_s: Float[Array, "3"]


class EstimatedControl(eqx.Module):
    """Flies by an error-state Kalman filter of a vehicle's instruments.

    Attributes:
        control: Who flies by it.
        suite: The instruments; a turn of the control is a sample of them.
        initial: The state of the start.
        seed: Of all draws of the instruments, and of the first error.
        alignment: How sure it is of its state at the start.
        ground_m: Height of the ground.

    Example:
        `simulate(vehicle, start, control=EstimatedControl(hold, suite, start, seed))`
    """

    control: Any
    suite: Suite
    initial: State
    seed: Integer[Array, "*batch"]
    alignment: Alignment = eqx.field(default_factory=Alignment)
    ground_m: Float[Array, "*batch"] = eqx.field(converter=as_float_array, default=0.0)

    @property
    def gains(self) -> Any:
        """Of who flies: by them the step is checked."""
        return self.control.gains

    def start(self) -> tuple[PyTree[Array], Known]:
        """Return the memory of who flies, and what is known."""
        return self.control.start(), self.known()

    def known(self) -> Known:
        """Return what is known before the first turn."""
        key, imu = self._key(), self.suite.imu
        deviations = self.alignment.deviations(
            CALIBRATED * imu.gyroscope_bias, CALIBRATED * imu.accelerometer_bias
        )
        estimate = aligned(
            jax.random.fold_in(key, _ALIGNMENT), self.initial, deviations
        )
        held = self.suite.start(key, self.initial)
        return Known(estimate, held, self.initial, jnp.zeros(3))

    def ready(self, vehicle: Vehicle) -> "EstimatedControl":
        """Return the same with whatever does not change in flight calculated."""
        control = self.control
        if hasattr(control, "ready"):
            control = control.ready(vehicle)
        return eqx.tree_at(lambda own: own.control, self, control)

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: tuple[PyTree[Array], Known],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], tuple[PyTree[Array], Known]]:
        """Return rotor speeds to ask for [rad/s], and the memory afterwards."""
        inner, known = memory
        known = self.sensed(time_s, state, known, period_s)
        shown = self.shown(known, state)
        speeds, inner = self.control(time_s, shown, vehicle, inner, period_s)
        return speeds, (inner, known)

    def shown(self, known: Known, state: State) -> State:
        """Return what who flies takes for the state.

        Args:
            known: At this turn.
            state: The vehicle, in truth: of it come the rotors, and the switch.
        """
        estimate = known.estimate
        stands = state.position_m[2] <= self.ground_m
        up = jnp.where(stands, self.ground_m, estimate.position_m[2])
        return State(
            estimate.position_m.at[2].set(up),
            estimate.velocity_m_s,
            estimate.quaternion,
            known.rate_rad_s,
            state.rotor_speed_rad_s,
        )

    def sensed(
        self,
        time_s: Float[Array, ""],
        state: State,
        known: Known,
        period_s: Float[Array, ""],
    ) -> Known:
        """Return what is known once the instruments have been read.

        Args:
            time_s: Of the turn.
            state: The vehicle, in truth.
            known: At the turn before.
            period_s: Since then.
        """
        turn = jnp.round(time_s / period_s).astype(jnp.int32)
        sample, held = self.suite(
            self._key(), turn, known.held, known.before, state, time_s, period_s
        )
        estimate = estimated(self.suite, known.estimate, sample, turn > 0, period_s)
        rate = sample.rate_rad_s - estimate.rate_bias
        return Known(estimate, held, state, rate)

    def _key(self) -> PRNGKeyArray:
        return jax.random.key(self.seed)


def followed(
    control: EstimatedControl, trajectory: Trajectory, period_s: Float[Array, ""]
) -> Followed:
    """Return what was believed along a flight.

    Args:
        control: Of the flight.
        trajectory: One flight, a row each time that its controller was asked.
        period_s: Between two.
    """

    def turn(known: Known, row: tuple[Array, State]) -> tuple[Known, Followed]:
        time_s, state = row
        known = control.sensed(time_s, state, known, period_s)
        estimate = known.estimate
        # after the turn's walk the instruments are off by what they keep
        error = error_of(estimate, state, known.held.biases)
        return known, Followed(
            control.shown(known, state),
            error,
            jnp.sqrt(jnp.diagonal(estimate.covariance)),
        )

    rows = trajectory.time_s, trajectory.states
    return jax.lax.scan(turn, control.known(), rows)[1]


def estimated(
    suite: Suite,
    estimate: Estimate,
    sample: Sample,
    moves: Array,
    period_s: Float[Array, ""],
) -> Estimate:
    """Return the estimate after a sample.

    Args:
        suite: The instruments.
        estimate: Before.
        sample: Their readings.
        moves: Whether time has gone on since the last: at the first turn it has not.
        period_s: Of the sample.
    """
    later = predicted(
        estimate, sample.force_m_s2, sample.rate_rad_s, suite.imu, period_s
    )
    estimate = jax.tree.map(lambda a, b: jnp.where(moves, a, b), later, estimate)
    # at four turns of five nothing comes but the inertial unit's
    comes = sample.has_fix | sample.has_field | sample.has_pressure
    estimate = jax.lax.cond(
        comes,
        lambda own: corrected(own, numbers_read(own, suite, sample)),
        lambda own: own,
        estimate,
    )
    return fix_taken(estimate, sample.takes_fix)


class Numbers(NamedTuple):
    """What was read, number by number.

    Attributes:
        off: Less what was expected.
        rows: By how much an error changes it.
        deviation: One standard deviation of its noise.
        comes: Whether it was read at all.
    """

    off: Float[Array, " number"]
    rows: Float[Array, "number 15"]
    deviation: Float[Array, " number"]
    comes: Bool[Array, " number"]


def corrected(estimate: Estimate, numbers: Numbers) -> Estimate:
    """Return an estimate after some numbers were read."""

    def take(
        carried: tuple[Array, Array], one: Numbers
    ) -> tuple[tuple[Array, Array], None]:
        error, spread = carried
        # numbers one after another: their noises are independent, so no matrix is
        # inverted
        left = one.off - one.rows @ error
        across = spread @ one.rows
        expected = one.rows @ across + jnp.square(one.deviation)
        # a straggler counts as if it were `GATE` standard deviations off: a fix that is
        # far off moves the estimate slowly, where a filter that refused it would never
        # return
        expected = jnp.maximum(expected, jnp.square(left / GATE))
        gain = jnp.where(one.comes, across / expected, 0.0)
        after = spread - jnp.outer(gain, across)
        # rounding makes it asymmetric, and after thousands of turns indefinite
        return (error + gain * left, (after + after.T) / 2), None

    start = (jnp.zeros(SIZE), estimate.covariance)
    (error, spread), _ = jax.lax.scan(take, start, numbers)
    then, past = past_rows(estimate) @ error, estimate.past
    return moved_on(estimate, error)._replace(
        covariance=spread,
        past=Past(past.position_m + then[:3], past.velocity_m_s + then[3:], past.age_s),
    )


def numbers_read(estimate: Estimate, suite: Suite, sample: Sample) -> Numbers:
    """Return the innovations of a sample: fix, field, height.

    Args:
        estimate: Carried on to the sample.
        suite: The instruments.
        sample: Their readings.
    """
    fix, past, magnetometer = sample.fix, estimate.past, suite.magnetometer
    field, lag = magnetometer.field_gauss, suite.barometer.lag
    height = height_of(
        sample.pressure_pa, suite.ground_pressure_pa, suite.ground_temperature_k
    )
    off = [
        fix.position_m - past.position_m,
        fix.velocity_m_s - past.velocity_m_s,
        sample.field_gauss - field_expected(estimate, field),
        (height - height_expected(estimate, lag))[None],
    ]
    rows = [past_rows(estimate), field_rows(estimate, field), height_row(lag)]
    one = jnp.ones(3)
    height_noise = HEIGHT_SHARE * suite.barometer.noise
    deviation = [suite.gps.noise(), magnetometer.noise * one, height_noise[None]]
    comes = [
        jnp.repeat(sample.has_fix, 6),
        jnp.repeat(sample.has_field, 3),
        sample.has_pressure[None],
    ]
    return Numbers(*map(jnp.concatenate, (off, rows, deviation, comes)))


def fix_taken(estimate: Estimate, takes: Bool[Array, ""]) -> Estimate:
    """Return an estimate that keeps what it is now, if a fix is taken now."""
    now = Past(estimate.position_m, estimate.velocity_m_s, jnp.zeros(()))
    kept = jax.tree.map(lambda a, b: jnp.where(takes, a, b), now, estimate.past)
    return estimate._replace(past=kept)


def height_expected(estimate: Estimate, lag_s: Float[Array, ""]) -> Float[Array, ""]:
    """Return the height expected from a barometer with lag [m]."""
    return estimate.position_m[2] - lag_s * estimate.velocity_m_s[2]


def height_row(lag_s: Float[Array, ""]) -> Float[Array, "1 15"]:
    """Return by how much an error changes that height."""
    row = jnp.zeros((1, SIZE)).at[0, PLACE.start + 2].set(1.0)
    return row.at[0, MOVES.start + 2].set(-lag_s)


def field_expected(
    estimate: Estimate, field_gauss: Float[Array, "3"]
) -> Float[Array, "3"]:
    """Return the field that should be read, body axes [gauss]."""
    return quaternion_matrix(estimate.quaternion).T @ field_gauss


def field_rows(
    estimate: Estimate, field_gauss: Float[Array, "3"]
) -> Float[Array, "3 15"]:
    """Return by how much an error changes the field that is read."""
    turned = cross_matrix(field_expected(estimate, field_gauss))
    return jnp.zeros((3, SIZE)).at[:, TURN].set(turned)


def past_rows(estimate: Estimate) -> Float[Array, "6 15"]:
    """Return by how much an error changes place and velocity of the past."""
    past = estimate.past
    age, known = past.age_s, past.age_s > 0
    attitude = quaternion_matrix(estimate.quaternion)
    # the mean acceleration since the fix stands for all of it: the past needs no
    # history of its own
    gained = (estimate.velocity_m_s - past.velocity_m_s) / jnp.where(known, age, 1.0)
    pull = jnp.where(known, gained, 0.0) + jnp.array([0.0, 0.0, FLIGHT_GRAVITY])
    one = jnp.eye(3)
    rows = jnp.zeros((6, SIZE))
    rows = rows.at[:3, PLACE].set(one).at[:3, MOVES].set(-age * one)
    rows = rows.at[3:, MOVES].set(one)
    gain = jnp.zeros((3, SIZE)).at[:, TURN].set(cross_matrix(pull) @ attitude)
    gain = gain.at[:, FORCE_BIAS].set(attitude)
    return rows.at[3:].add(age * gain).at[:3].add(-jnp.square(age) / 2 * gain)


def predicted(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    imu: Imu,
    period_s: Float[Array, ""],
) -> Estimate:
    """Return an estimate a sample later.

    Args:
        estimate: At its beginning.
        force_m_s2: Specific force that was read, body axes.
        rate_rad_s: Rate that was read, body axes.
        imu: How noisy it is.
        period_s: Of the sample.
    """
    on = transition(estimate, force_m_s2, rate_rad_s, period_s)
    noise = noise_gained(estimate, rate_rad_s, imu, period_s)
    spread = on @ estimate.covariance @ on.T + noise
    past = estimate.past
    return carried_on(estimate, force_m_s2, rate_rad_s, period_s)._replace(
        covariance=(spread + spread.T) / 2,
        past=past._replace(age_s=past.age_s + period_s),
    )


def carried_on(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> Estimate:
    """Return where an estimate goes in a sample; its spread stays."""
    turn = (rate_rad_s - estimate.rate_bias) * period_s
    # by the attitude in the middle of the sample: of second order in its length
    half = quaternion_product(estimate.quaternion, rotation_quaternion(turn / 2))
    pull = quaternion_matrix(half) @ (force_m_s2 - estimate.force_bias)
    gain = (pull - jnp.array([0.0, 0.0, FLIGHT_GRAVITY])) * period_s
    velocity = estimate.velocity_m_s + gain
    turned = quaternion_product(estimate.quaternion, rotation_quaternion(turn))
    mean = (estimate.velocity_m_s + velocity) / 2
    return estimate._replace(
        position_m=estimate.position_m + mean * period_s,
        velocity_m_s=velocity,
        quaternion=turned / jnp.sqrt(jnp.sum(jnp.square(turned))),
    )


def transition(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> Float[Array, "15 15"]:
    """Return the matrix that carries an error on over a sample."""
    rate = rate_rad_s - estimate.rate_bias
    force = force_m_s2 - estimate.force_bias
    half = rotation_quaternion(rate * period_s / 2)
    middle = quaternion_matrix(quaternion_product(estimate.quaternion, half))
    back = quaternion_matrix(half).T
    pushed = -period_s * middle @ cross_matrix(force)
    one, none = jnp.eye(3), jnp.zeros((3, 3))
    turned = -period_s * one + cross_matrix(rate) * period_s**2 / 2
    gains = [pushed @ back, none, one, -pushed * period_s / 2, -period_s * middle]
    half_way = period_s / 2
    ways = [half_way * part for part in gains]
    ways[1:3] = [one, period_s * one]
    # by rows, in the order of the parts: to set them one by one costs ten times that
    return jnp.concatenate(
        [
            jnp.concatenate(parts, axis=1)
            for parts in (
                [back @ back, none, none, turned, none],
                ways,
                gains,
                [none, none, none, one, none],
                [none, none, none, none, one],
            )
        ]
    )


def noise_gained(
    estimate: Estimate,
    rate_rad_s: Float[Array, "3"],
    imu: Imu,
    period_s: Float[Array, ""],
) -> Float[Array, "15 15"]:
    """Return what a sample's noise adds to the spread."""
    half = math.sqrt(imu.rate / 2)
    turn = half * imu.gyroscope_noise * period_s
    push = half * imu.accelerometer_noise * period_s
    one = jnp.ones(3)
    gained = jnp.concatenate(
        [
            jnp.square(turn) * one,
            jnp.square(push * period_s / 2) * one,
            jnp.square(push) * one,
            jnp.square(imu.gyroscope_walk) * period_s * one,
            jnp.square(imu.accelerometer_walk) * period_s * one,
        ]
    )
    # a push moves velocity and, half a sample's worth, position: both errors are one
    both = jnp.square(push) * period_s / 2 * jnp.eye(3)
    spread = jnp.diag(gained)
    return spread.at[PLACE, MOVES].set(both).at[MOVES, PLACE].set(both)


def cross_matrix(v: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Return the matrix whose product with a vector is the vector product by it."""
    zero = jnp.zeros_like(v[0])
    return jnp.stack(
        [
            jnp.stack([zero, -v[2], v[1]]),
            jnp.stack([v[2], zero, -v[0]]),
            jnp.stack([-v[1], v[0], zero]),
        ]
    )


def moved_on(estimate: Estimate, error: Float[Array, "15"]) -> Estimate:
    """Return an estimate turned and moved on by an error; its past stays.

    Args:
        estimate: Any.
        error: By the parts of it.
    """
    turned = quaternion_product(estimate.quaternion, rotation_quaternion(error[TURN]))
    return estimate._replace(
        position_m=estimate.position_m + error[PLACE],
        velocity_m_s=estimate.velocity_m_s + error[MOVES],
        quaternion=turned / jnp.sqrt(jnp.sum(jnp.square(turned))),
        rate_bias=estimate.rate_bias + error[RATE_BIAS],
        force_bias=estimate.force_bias + error[FORCE_BIAS],
    )


def error_of(estimate: Estimate, true: State, biases: Biases) -> Float[Array, "15"]:
    """Return the error that takes an estimate to the truth.

    Args:
        estimate: What is believed.
        true: The vehicle's state.
        biases: What its instruments are off by.
    """
    return jnp.concatenate(
        [
            rotation_between(estimate.quaternion, true.quaternion),
            true.position_m - estimate.position_m,
            true.velocity_m_s - estimate.velocity_m_s,
            biases.rate - estimate.rate_bias,
            biases.force - estimate.force_bias,
        ]
    )


def aligned(key: PRNGKeyArray, true: State, deviations: Float[Array, "15"]) -> Estimate:
    """Return the estimate that a flight begins with: the truth, less a drawn error.

    The estimated biases of its instruments begin at 0.

    Args:
        key: Of the error.
        true: The vehicle's state.
        deviations: One standard deviation of each number of the error.
    """
    off = deviations * jax.random.normal(key, (SIZE,))
    # the instruments draw their own biases: the estimate of these begins at zero
    off = off.at[RATE_BIAS].set(0.0).at[FORCE_BIAS].set(0.0)
    zero = jnp.zeros(3)
    exact = Estimate(
        true.position_m,
        true.velocity_m_s,
        true.quaternion,
        zero,
        zero,
        jnp.diag(jnp.square(deviations)),
        Past(true.position_m, true.velocity_m_s, jnp.zeros(())),
    )
    believed = moved_on(exact, off)
    return believed._replace(
        past=Past(believed.position_m, believed.velocity_m_s, jnp.zeros(()))
    )
