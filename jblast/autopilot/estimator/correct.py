r"""An estimate corrected by a barometer, a magnetometer, and fixes that come late.

Numbers are taken in one by one, as their errors are independent: no matrix is inverted.
One that is more than `GATE` standard deviations off counts for no more than it would at
that: so a blast's pressure on the barometer hardly moves the estimate, and one that was
thrown off still finds back, as one that refuses what it does not expect may not.

A fix tells of a time $d$ before. Then the error was, to the first order,

$$\delta v_d = \delta v + d\,e, \qquad \delta p_d = \delta p - d\,\delta v -
  d^2 e/2, \qquad e = [\bar a]_\times R\,\delta\theta + R\,\delta b_f$$

with the mean specific force $\bar a$ since then, by the velocities that were estimated
then and now; corrections since then have moved what is kept of it likewise.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.autopilot.estimator.estimate import (
    FORCE_BIAS,
    MOVES,
    PLACE,
    SIZE,
    TURN,
    Estimate,
    Past,
    moved_on,
)
from jblast.autopilot.estimator.predict import cross_matrix
from jblast.constants import FLIGHT_GRAVITY
from jblast.scene import quaternion_matrix
from jblast.sensors.carried.barometer import height_of
from jblast.sensors.carried.suite import Sample, Suite

GATE = 5.0
"""PX4's for its barometer and for fixes (EKF2_BARO_GATE, EKF2_GPS_P_GATE)."""
HEIGHT_SHARE = 0.083
"""Metres that a pascal is near the ground."""


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
        left = one.off - one.rows @ error
        across = spread @ one.rows
        expected = one.rows @ across + jnp.square(one.deviation)
        expected = jnp.maximum(expected, jnp.square(left / GATE))
        gain = jnp.where(one.comes, across / expected, 0.0)
        after = spread - jnp.outer(gain, across)
        return (error + gain * left, (after + after.T) / 2), None

    start = (jnp.zeros(SIZE), estimate.covariance)
    (error, spread), _ = jax.lax.scan(take, start, numbers)
    then, past = past_rows(estimate) @ error, estimate.past
    return moved_on(estimate, error)._replace(
        covariance=spread,
        past=Past(past.position_m + then[:3], past.velocity_m_s + then[3:], past.age_s),
    )


def numbers_read(estimate: Estimate, suite: Suite, sample: Sample) -> Numbers:
    """Return what a sample says beside what the estimate expects: fix, field, height.

    Args:
        estimate: Carried on to the sample.
        suite: The instruments.
        sample: What they say.
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
    """Return the height that a barometer should tell through its lag [m]."""
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
    gained = (estimate.velocity_m_s - past.velocity_m_s) / jnp.where(known, age, 1.0)
    pull = jnp.where(known, gained, 0.0) + jnp.array([0.0, 0.0, FLIGHT_GRAVITY])
    one = jnp.eye(3)
    rows = jnp.zeros((6, SIZE))
    rows = rows.at[:3, PLACE].set(one).at[:3, MOVES].set(-age * one)
    rows = rows.at[3:, MOVES].set(one)
    gain = jnp.zeros((3, SIZE)).at[:, TURN].set(cross_matrix(pull) @ attitude)
    gain = gain.at[:, FORCE_BIAS].set(attitude)
    return rows.at[3:].add(age * gain).at[:3].add(-jnp.square(age) / 2 * gain)
