r"""Error-state Kalman filter of a vehicle's state, and control with its estimate.

At each sample of the controller the instruments are read, the estimate is predicted and
corrected, and the controller receives the estimate in place of the state. Rotor speeds
are measured exactly; a switch detects contact with the ground. Controller states are
not stored. If a row is stored at each sample, the estimate along a flight is recomputed
from the stored states.

**Prediction** over one sample of the inertial unit. With its mean rate and specific
force, each less the estimated bias, and the attitude in the middle of the sample,
$R_m = R\exp(\omega\,\Delta t/2)$,

$$R' = R\exp(\omega\,\Delta t), \quad v' = v + (R_m f - g\hat z)\Delta t, \quad
p' = p + (v + v')\Delta t/2.$$

The first two are exact for the samples of `flight_sensors`. The error, with attitude
about the body's axes, is propagated to first order (Sola 2017, Quaternion kinematics
for the error-state Kalman filter, section 5.3, with the middle of the sample in place
of its beginning):

$$\delta\theta' = \exp(-\omega\Delta t)\,\delta\theta -
  (\Delta t - [\omega]_\times\Delta t^2/2)\,\delta b_\omega$$
$$\delta v' = \delta v - R_m [f]_\times \Delta t\,(R_h^T\delta\theta -
  \delta b_\omega\Delta t/2) - R_m\Delta t\,\delta b_f$$

with $R_h = \exp(\omega\,\Delta t/2)$, and $\delta p' = \delta p + (\delta v +
\delta v')\Delta t/2$.

**Correction** by a barometer, a magnetometer, and delayed position fixes. Measurements
have independent errors and are used one by one, so no matrix is inverted. Each
innovation is limited to `GATE` standard deviations. The pressure of a blast on the
barometer then hardly changes the estimate, and an estimate with a large error still
recovers, which it might not if such measurements were rejected.

A fix measures the position a time $d$ earlier. The error then was, to first order,

$$\delta v_d = \delta v + d\,e, \qquad \delta p_d = \delta p - d\,\delta v -
  d^2 e/2, \qquad e = [\bar a]_\times R\,\delta\theta + R\,\delta b_f$$

with the mean specific force $\bar a$ since then, from the estimated velocities then and
now. Corrections since then are also applied to the stored state.
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
    Held,
    Sample,
    Suite,
    height_of,
)
from jblast.sensors.imu import Inertial, rotation_between, rotation_quaternion
from jblast.types import as_numbers
from jblast.vehicle import State, Trajectory, Vehicle

WATCHED_S = 10.0
"""Time after its arrival in which errors are attributed to a blast [s]; declared.

Position errors by a blast decay with the fixes within some seconds. The interval ends
at the next blast.
"""
BEFORE_S = 1.0
"""Time before an arrival for the error before it [s]: five position fixes."""
_ALIGNMENT_KEY = 2**32 - 1
"""Folded into the key of the initial error; above the numbers of the instruments."""
TILT_RAD, HEADING_RAD, PLACE_M, MOVES_M_S = (0.01, 0.01), 0.03, 0.2, 0.05
"""Standard deviations of the initial roll and pitch, heading, position and velocity
along each axis; declared."""
GATE = 5.0
"""PX4's gate of barometer and fixes (EKF2_BARO_GATE, EKF2_GPS_P_GATE) [-]."""
METRES_PER_PASCAL = 0.083
"""Height per pressure near the ground [m/Pa]: 1 / (1.225 kg/m3 x 9.81 m/s2)."""
TURN, PLACE, MOVES, RATE_BIAS, FORCE_BIAS = (slice(3 * n, 3 * n + 3) for n in range(5))
"""Slices of the error vector: attitude about the body's axes [rad], position [m],
velocity [m/s], biases of gyroscope [rad/s] and accelerometer [m/s2]."""
FIX = slice(6)
"""Numbers of a fix among those of a sample: position and velocity."""
SIZE = 15
"""Length of the error vector: five vectors of three."""


class Thrown(NamedTuple):
    """Errors of an estimate by blast: root mean square before, maximum after.

    Attributes:
        place_before_m: Position error before the arrival.
        place_m: Position error after the arrival.
        moves_before_m_s: Velocity error before.
        moves_m_s: Velocity error after.
        turn_before_rad: Attitude error before.
        turn_rad: Attitude error after.
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
        shown: Estimated states, as passed to the controller.
        error: Error vectors from the estimate to the truth.
        deviation: Standard deviations of the error vector.
    """

    shown: State
    error: Float[Array, "time 15"]
    deviation: Float[Array, "time 15"]


def thrown(
    followed: Followed, time_s: Float[Array, " time"], arrival_s: Float[Array, " blast"]
) -> Thrown:
    """Return the errors of an estimate by blast; NaN for blasts outside the flight.

    Args:
        followed: The estimate along a flight.
        time_s: Times of its rows.
        arrival_s: Arrival times of the blasts at the vehicle; infinite: never.
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
            # A diverged estimate has NaN, which the maximum preserves. -1 marks
            # intervals without rows, because errors are never negative.
            greatest = jnp.max(size, where=after, initial=-1.0)
            found += [
                jnp.sqrt(jnp.mean(jnp.square(size), where=before)),
                jnp.where(greatest < 0, jnp.nan, greatest),
            ]
        return found

    return Thrown(*jax.vmap(of)(arrival_s, until))


def alignment(
    rate_bias: Float[Array, ""], force_bias: Float[Array, ""]
) -> Float[Array, "15"]:
    """Return the standard deviations of the initial error vector.

    Declared for a vehicle aligned and calibrated at rest, with its heading from the
    magnetic field.

    Args:
        rate_bias: Bias of the calibrated gyroscope [rad/s].
        force_bias: Bias of the calibrated accelerometer [m/s2].
    """
    start = jnp.array([*TILT_RAD, HEADING_RAD, *[PLACE_M] * 3, *[MOVES_M_S] * 3])
    biases = jnp.stack([rate_bias, force_bias])
    return jnp.concatenate([start, jnp.repeat(biases, 3)])


class Past(NamedTuple):
    """The estimate at the time of the last fix.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        age_s: Age of this estimate.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    age_s: Float[Array, ""]


class Estimate(NamedTuple):
    """An estimate with its covariance.

    Attributes:
        position_m: East, north, up.
        velocity_m_s: East, north, up.
        quaternion: Body to world (x, y, z, w), of length 1.
        rate_bias: Estimated bias of the gyroscope [rad/s].
        force_bias: Estimated bias of the accelerometer [m/s2].
        covariance: Covariance of the error vector, which takes the estimate to the
            truth (`moved_on`).
        past: Estimate at the time of the pending fix.
    """

    position_m: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    quaternion: Float[Array, "4"]
    rate_bias: Float[Array, "3"]
    force_bias: Float[Array, "3"]
    covariance: Float[Array, "15 15"]
    past: Past


class Known(NamedTuple):
    """State of the estimator at a sample.

    Attributes:
        estimate: Estimate of the vehicle's state.
        held: Internal state of the instruments.
        before: True state at the previous sample, where the instruments' interval
            begins.
        rate_rad_s: Measured body rate without the estimated bias.
    """

    estimate: Estimate
    held: Held
    before: State
    rate_rad_s: Float[Array, "3"]


class EstimatedControl(eqx.Module):
    """Controller that uses the estimate of an error-state Kalman filter.

    Attributes:
        control: Controller of the estimated state.
        suite: Instruments, read at each sample of the controller.
        initial: True initial state.
        seed: Seed of the instruments' errors and of the initial error.
        ground_m: Height of the ground.

    Example:
        `simulate(vehicle, start, control=EstimatedControl(hold, suite, start, seed))`
    """

    control: Any
    suite: Suite
    initial: State
    seed: Integer[Array, "*batch"]
    ground_m: Float[Array, "*batch"] = eqx.field(converter=as_numbers, default=0.0)

    @property
    def gains(self) -> Any:
        """Gains of the controller; the step limit depends on them."""
        return self.control.gains

    def start(self) -> tuple[PyTree[Array], Known]:
        """Return the initial states of controller and estimator."""
        return self.control.start(), self.known()

    def known(self) -> Known:
        """Return the state of the estimator before the first sample."""
        key, imu = self._key(), self.suite.imu
        deviations = alignment(
            CALIBRATED * imu.gyroscope_bias, CALIBRATED * imu.accelerometer_bias
        )
        estimate = aligned(
            jax.random.fold_in(key, _ALIGNMENT_KEY), self.initial, deviations
        )
        held = self.suite.start(key, self.initial)
        return Known(estimate, held, self.initial, jnp.zeros(3))

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: tuple[PyTree[Array], Known],
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], tuple[PyTree[Array], Known]]:
        """Return rotor speed commands [rad/s], shape (4,), and the next state."""
        inner, known = memory
        known = self.sensed(time_s, state, known, period_s)
        shown = self.shown(known, state)
        speeds, inner = self.control(time_s, shown, vehicle, inner, period_s)
        return speeds, (inner, known)

    def shown(self, known: Known, state: State) -> State:
        """Return the estimated state, as passed to the controller.

        Args:
            known: State of the estimator at this sample.
            state: True state, for rotor speeds and the contact switch.
        """
        estimate = known.estimate
        # The contact switch: an estimated height would bounce on the ground.
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
        """Return the state of the estimator after reading the instruments.

        Args:
            time_s: Time of the sample.
            state: True state of the vehicle.
            known: State of the estimator at the previous sample.
            period_s: Time since then.
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
    """Return the estimate along a flight, recomputed from the true states.

    Args:
        control: Controller of the flight.
        trajectory: A single flight with one row per sample of its controller.
        period_s: Period of the controller.
    """

    def turn(known: Known, row: tuple[Array, State]) -> tuple[Known, Followed]:
        time_s, state = row
        known = control.sensed(time_s, state, known, period_s)
        estimate = known.estimate
        # The biases after this sample's random walk are those of the instruments'
        # state.
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
    """Return the estimate after a sample: prediction, then correction.

    Args:
        suite: The instruments.
        estimate: Estimate before the sample.
        sample: Readings of the instruments.
        moves: False at the first sample, which no interval precedes.
        period_s: Length of the interval.
    """
    # Computed also at the first sample and masked: a branch would be a second program.
    later = predicted(
        estimate, sample.force_m_s2, sample.rate_rad_s, suite.imu, period_s
    )
    estimate = jax.tree.map(lambda a, b: jnp.where(moves, a, b), later, estimate)
    # Four of five samples have inertial data only: the branch skips their correction.
    comes = sample.has_fix | sample.has_field | sample.has_pressure
    estimate = jax.lax.cond(
        comes,
        lambda own: corrected(own, suite, sample),
        lambda own: own,
        estimate,
    )
    return fix_taken(estimate, sample.takes_fix)


def corrected(estimate: Estimate, suite: Suite, sample: Sample) -> Estimate:
    """Return the estimate corrected by the numbers of a sample: fix, field, height.

    Args:
        estimate: Estimate predicted to the time of the sample.
        suite: The instruments.
        sample: Their readings.
    """

    def take(
        carried: tuple[Array, Array], one: Any
    ) -> tuple[tuple[Array, Array], None]:
        (error, spread), (off, row, deviation, comes) = carried, one
        # Sequential scalar updates: the noises are independent, so no matrix inverse.
        left, across = off - row @ error, spread @ row
        variance = row @ across + jnp.square(deviation)
        # The variance of a straggler is increased until its innovation is `GATE`
        # standard deviations. The estimate then converges slowly to persistent fixes,
        # where a filter that rejects them would never return.
        variance = jnp.maximum(variance, jnp.square(left / GATE))
        gain = jnp.where(comes, across / variance, 0.0)
        after = spread - jnp.outer(gain, across)
        # Rounding makes the covariance asymmetric and, after thousands of samples,
        # indefinite.
        return (error + gain * left, (after + after.T) / 2), None

    fix, none = sample.fix, jnp.zeros(SIZE)
    height = height_of(
        sample.pressure_pa, suite.ground_pressure_pa, suite.ground_temperature_k
    )
    # Linearized near the ground: 5 % too small at 500 m.
    height_noise = METRES_PER_PASCAL * suite.barometer.noise
    field_noise = suite.magnetometer.noise * jnp.ones(3)
    comes = [sample.has_fix] * 6 + [sample.has_field] * 3 + [sample.has_pressure]
    measured = [fix.position_m, fix.velocity_m_s, sample.field_gauss, height[None]]
    rows = jax.jacfwd(expected, argnums=2)(estimate, suite, none)
    numbers = (
        jnp.concatenate(measured) - expected(estimate, suite, none),
        rows,
        jnp.concatenate([suite.gps.noise(), field_noise, height_noise[None]]),
        jnp.stack(comes),
    )
    (error, spread), _ = jax.lax.scan(take, (none, estimate.covariance), numbers)
    then, past = rows[FIX] @ error, estimate.past
    return moved_on(estimate, error)._replace(
        covariance=spread,
        past=Past(past.position_m + then[:3], past.velocity_m_s + then[3:], past.age_s),
    )


def expected(
    estimate: Estimate, suite: Suite, error: Float[Array, "15"]
) -> Float[Array, "10"]:
    """Return the expected numbers of a sample if an estimate has an error.

    Args:
        estimate: Estimate at the time of the sample.
        suite: The instruments.
        error: Error vector.

    Returns:
        Position and velocity of a delayed fix, magnetic field about the body's axes,
        height.
    """
    true, past = moved_on(estimate, error), estimate.past
    age, since = past.age_s, past.age_s > 0
    attitude = quaternion_matrix(estimate.quaternion)
    # The mean acceleration since the fix replaces its history, so the past needs no
    # buffer of states.
    gained = (estimate.velocity_m_s - past.velocity_m_s) / jnp.where(since, age, 1.0)
    pull = jnp.where(since, gained, 0.0) + jnp.array([0.0, 0.0, FLIGHT_GRAVITY])
    turned = quaternion_matrix(true.quaternion)
    gain = turned @ (attitude.T @ pull - error[FORCE_BIAS]) - pull
    return jnp.concatenate(
        [
            past.position_m + error[PLACE] - age * error[MOVES] + age**2 / 2 * gain,
            past.velocity_m_s + error[MOVES] - age * gain,
            turned.T @ suite.magnetometer.field_gauss,
            (true.position_m - suite.barometer.lag * true.velocity_m_s)[2:],
        ]
    )


def fix_taken(estimate: Estimate, takes: Bool[Array, ""]) -> Estimate:
    """Return the estimate, with itself as its past if a fix is measured now."""
    now = Past(estimate.position_m, estimate.velocity_m_s, jnp.zeros(()))
    past = jax.tree.map(lambda a, b: jnp.where(takes, a, b), now, estimate.past)
    return estimate._replace(past=past)


def predicted(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    imu: Imu,
    period_s: Float[Array, ""],
) -> Estimate:
    """Return the estimate and covariance one sample later.

    Args:
        estimate: Estimate at the beginning of the sample.
        force_m_s2: Measured specific force, body axes.
        rate_rad_s: Measured body rate.
        imu: Noise parameters.
        period_s: Length of the sample.
    """
    on = transition(estimate, force_m_s2, rate_rad_s, period_s)
    spread = on @ estimate.covariance @ on.T + noise_gained(imu, period_s)
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
    """Return the estimate one sample later, with unchanged covariance."""
    turn = (rate_rad_s - estimate.rate_bias) * period_s
    # The attitude in the middle of the sample makes the step second order in its
    # length.
    half = quaternion_product(estimate.quaternion, rotation_quaternion(turn / 2))
    pull = quaternion_matrix(half) @ (force_m_s2 - estimate.force_bias)
    gain = (pull - jnp.array([0.0, 0.0, FLIGHT_GRAVITY])) * period_s
    way = (estimate.velocity_m_s + gain / 2) * period_s
    return moved_on(estimate, jnp.concatenate([turn, way, gain, jnp.zeros(6)]))


def transition(
    estimate: Estimate,
    force_m_s2: Float[Array, "3"],
    rate_rad_s: Float[Array, "3"],
    period_s: Float[Array, ""],
) -> Float[Array, "15 15"]:
    """Return the transition matrix of the error vector over a sample."""
    rate = rate_rad_s - estimate.rate_bias
    force = force_m_s2 - estimate.force_bias
    half = rotation_quaternion(rate * period_s / 2)
    middle = quaternion_matrix(quaternion_product(estimate.quaternion, half))
    back, one, none = quaternion_matrix(half).T, jnp.eye(3), jnp.zeros((3, 3))
    # The matrix of the vector product with a vector v is the one of products e_i x v.
    pushed = -period_s * middle @ jnp.cross(one, force)
    turned = -period_s * one + jnp.cross(one, rate) * period_s**2 / 2
    gains = [pushed @ back, none, one, -pushed * period_s / 2, -period_s * middle]
    ways = [period_s / 2 * part for part in gains]
    ways[1:3] = [one, period_s * one]
    # Concatenated blocks: setting them one by one with `.at` costs ten times as much.
    blocks = [
        [back @ back, none, none, turned, none],
        ways,
        gains,
        [none, none, none, one, none],
        [none, none, none, none, one],
    ]
    return jnp.concatenate([jnp.concatenate(row, axis=1) for row in blocks])


def noise_gained(imu: Imu, period_s: Float[Array, ""]) -> Float[Array, "15 15"]:
    """Return the covariance that the noise of a sample adds."""
    # A white density n sampled at a rate f has the standard deviation n sqrt(f / 2).
    gain = math.sqrt(imu.rate / 2) * period_s
    walk = jnp.sqrt(period_s)
    turn, push, of_rate, of_force = (
        jnp.asarray(part * noise)
        for part, noise in [
            (gain, imu.gyroscope_noise),
            (gain, imu.accelerometer_noise),
            (walk, imu.gyroscope_walk),
            (walk, imu.accelerometer_walk),
        ]
    )
    # One error of force changes velocity and, by half a sample, position.
    none = jnp.zeros(())
    parts = [
        [turn, none, none, none],
        [none, push * period_s / 2, none, none],
        [none, push, none, none],
        [none, none, of_rate, none],
        [none, none, none, of_force],
    ]
    gains = jnp.stack([jnp.stack(row) for row in parts])
    return jnp.kron(gains @ gains.T, jnp.eye(3))


def moved_on(estimate: Estimate, error: Float[Array, "15"]) -> Estimate:
    """Return an estimate corrected by an error vector; its past is unchanged.

    Args:
        estimate: The estimate.
        error: Error vector.
    """
    turned = quaternion_product(estimate.quaternion, rotation_quaternion(error[TURN]))
    return estimate._replace(
        position_m=estimate.position_m + error[PLACE],
        velocity_m_s=estimate.velocity_m_s + error[MOVES],
        quaternion=turned / jnp.sqrt(jnp.sum(jnp.square(turned))),
        rate_bias=estimate.rate_bias + error[RATE_BIAS],
        force_bias=estimate.force_bias + error[FORCE_BIAS],
    )


def error_of(estimate: Estimate, true: State, biases: Inertial) -> Float[Array, "15"]:
    """Return the error vector from an estimate to the truth.

    Args:
        estimate: The estimate.
        true: True state of the vehicle.
        biases: True biases of its instruments.
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
    """Return the initial estimate: the truth with a random error.

    The estimated biases of the instruments are 0.

    Args:
        key: Key of the error.
        true: True state of the vehicle.
        deviations: Standard deviations of the error vector.
    """
    # The instruments sample their own biases, so the estimated biases begin at zero.
    off = (deviations * jax.random.normal(key, (SIZE,))).at[9:].set(0.0)
    zero, spread = jnp.zeros(3), jnp.diag(jnp.square(deviations))
    past = Past(true.position_m, true.velocity_m_s, jnp.zeros(()))
    exact = Estimate(
        true.position_m, true.velocity_m_s, true.quaternion, zero, zero, spread, past
    )
    return fix_taken(moved_on(exact, off), jnp.asarray(True))
