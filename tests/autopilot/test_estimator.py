"""The filter: errors as large as it states, and derivatives against differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jblast.autopilot.estimator import (
    FIX,
    GATE,
    SIZE,
    Estimate,
    EstimatedControl,
    Followed,
    aligned,
    alignment,
    carried_on,
    corrected,
    error_of,
    expected,
    fix_taken,
    followed,
    moved_on,
    predicted,
    thrown,
    transition,
)
from jblast.sensors.flight_sensors import Fix, Magnetometer, Sample, Suite
from jblast.sensors.imu import Inertial
from jblast.vehicle import State, Trajectory
from tests.vehicle.flights import by_hand, stacked

FIELD = jnp.array([0.01, 0.2, -0.43])
SUITE = Suite(Magnetometer(FIELD))
PERIOD = jnp.asarray(0.004)
FORCE, RATE = jnp.array([1.5, -2.0, 9.0]), jnp.array([0.8, -0.5, 1.2])


def in_flight() -> Estimate:
    """An estimate that is turned, moves, and knows of biases."""
    quaternion = jnp.array([0.1, -0.2, 0.5, 0.8])
    state = State(
        jnp.array([3.0, -4.0, 12.0]),
        jnp.array([2.0, 1.0, -0.5]),
        quaternion / jnp.linalg.norm(quaternion),
        jnp.zeros(3),
        jnp.zeros(4),
    )
    deviations = alignment(jnp.asarray(0.002), jnp.asarray(0.02))
    estimate = aligned(jax.random.key(0), state, deviations)
    return estimate._replace(
        rate_bias=jnp.array([0.01, -0.02, 0.015]),
        force_bias=jnp.array([0.05, 0.02, -0.1]),
    )


def swinging(key: int, seconds: float) -> Trajectory:
    """A flight along random slow waves, tilting and turning."""
    rng = np.random.default_rng(key)
    time = np.arange(round(seconds / 0.004) + 1) * 0.004

    def waves(size: float) -> tuple[np.ndarray, np.ndarray]:
        pulses, phases = rng.uniform(0.5, 2.5, 3), rng.uniform(0, 6, 3)
        angle = time[:, None] * pulses + phases
        sizes = size * rng.uniform(0.3, 1.0, 3)
        return sizes * np.sin(angle), sizes * pulses * np.cos(angle)

    place, moves = waves(2.0)
    turn, _ = waves(0.4)
    turn[:, 2] += 0.3 * time
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    axis = turn / np.maximum(angle, 1e-12)
    quaternion = np.concatenate([np.sin(angle / 2) * axis, np.cos(angle / 2)], axis=1)
    above = place + np.array([0, 0, 20.0])
    return by_hand(time, above, velocity_m_s=moves, quaternion=quaternion)


taken = eqx.filter_jit(corrected)
NO, YES = jnp.asarray(False), jnp.asarray(True)


def read(pressure: float = 101_325.0, has_pressure=NO, fix=None) -> Sample:
    """A sample of which a pressure or a fix may be new."""
    nothing = Fix(jnp.zeros(3), jnp.zeros(3))
    return Sample(
        jnp.zeros(3),
        jnp.zeros(3),
        jnp.asarray(pressure),
        has_pressure,
        FIELD,
        NO,
        nothing if fix is None else fix,
        NO if fix is None else YES,
        NO,
    )


def test_what_does_not_come_changes_nothing():
    estimate = in_flight()
    after = taken(estimate, SUITE, read())
    for a, b in zip(jax.tree.leaves(after), jax.tree.leaves(estimate), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-15)


def test_one_number_is_taken_as_kalman_has_it():
    estimate = in_flight()
    # 12 m are 101325 (1 - 0.0065 12 / 288.15)^5.2559 Pa
    pressure = 101_325 * (1 - 0.0065 * 12.3 / 288.15) ** 5.255_88
    after = taken(estimate, SUITE, read(pressure, YES))
    spread, noise, lag = estimate.covariance, (0.083 * 1.2) ** 2, 0.02
    up, climbs = float(estimate.position_m[2]), float(estimate.velocity_m_s[2])
    of_place, of_climb = float(spread[5, 5]), float(spread[8, 8])
    gain = of_place / (of_place + lag**2 * of_climb + noise)
    off = 12.3 - (up - lag * climbs)
    assert float(after.position_m[2]) == pytest.approx(up + gain * off, abs=1e-4)
    left = (1 - gain) * of_place
    assert float(after.covariance[5, 5]) == pytest.approx(left, rel=1e-9)


def test_a_blast_on_the_barometer_hardly_moves_the_height():
    estimate = in_flight()
    after = taken(estimate, SUITE, read(111_325.0, YES))
    moved = float(after.position_m[2] - estimate.position_m[2])
    # of 800 m that it seems to fall: what one off by the gate would do, at most
    assert -GATE * np.sqrt(float(estimate.covariance[5, 5])) < moved < 0
    assert abs(moved) < 0.01


def test_thrown_off_by_far_it_finds_back_by_fixes():
    estimate = in_flight()
    true = estimate.position_m + jnp.array([30.0, 0.0, 0.0])

    def turn(estimate, _):
        spread = estimate.covariance + 0.01 * jnp.eye(15)
        sample = read(fix=Fix(true, estimate.velocity_m_s))
        estimate = estimate._replace(
            covariance=spread,
            past=estimate.past._replace(position_m=estimate.position_m),
        )
        return corrected(estimate, SUITE, sample), None

    after, _ = jax.lax.scan(turn, estimate, None, length=200)
    np.testing.assert_allclose(after.position_m, true, atol=0.5)


def squares(control: EstimatedControl, flight, period) -> jnp.ndarray:
    """The error's square along a flight in units of its covariance."""

    def turn(known, row):
        known = control.sensed(row[0], row[1], known, period)
        error = error_of(known.estimate, row[1], known.held.biases)
        return known, error @ jnp.linalg.solve(known.estimate.covariance, error)

    rows = flight.time_s, flight.states
    return jax.lax.scan(turn, control.known(), rows)[1]


@pytest.mark.slow
def test_over_random_flights_its_errors_are_as_large_as_it_says():
    count = 60
    flights = stacked([swinging(n, 12.0) for n in range(count)])
    control = eqx.filter_vmap(
        lambda start, seed: EstimatedControl(None, SUITE, start, seed)
    )
    starts = jax.tree.map(lambda x: x[:, 0], flights.states)
    many = control(starts, jnp.arange(count, dtype=jnp.uint32))
    lanes = (eqx.if_array(0), eqx.if_array(0), None)
    found, square = (
        eqx.filter_jit(eqx.filter_vmap(one, in_axes=lanes))(many, flights, PERIOD)
        for one in (followed, squares)
    )
    # independent lanes: the mean of their squares is chi square's
    low, high = stats.chi2.ppf([0.0005, 0.9995], 15 * count) / count
    means = np.asarray(square).mean(axis=0)[250::250]
    assert ((means > low) & (means < high)).all(), means
    # and it is of use: better than a fix, in the end
    place = np.asarray(found.error)[:, -1, 3:6]
    assert np.sqrt(np.mean(place[:, :2] ** 2)) < 0.2


def test_what_blasts_do_is_told_by_blast():
    time = jnp.arange(0.0, 6.0, 0.5)
    error = jnp.zeros((12, 15)).at[:, 3].set(0.1).at[5, 3].set(0.7).at[9, 3].set(0.4)
    level = jnp.zeros((12, 3))
    four = jnp.ones((12, 4)) / 2
    one = Followed(State(level, level, four, level, four), error, error)
    found = thrown(one, time, jnp.array([2.0, 4.0, jnp.inf]))
    np.testing.assert_allclose(found.place_before_m[:2], [0.1, 0.1])
    np.testing.assert_allclose(found.place_m[:2], [0.7, 0.4])
    assert np.isnan(found.place_m[2])
    np.testing.assert_allclose(found.moves_m_s[:2], 0)


STEP = 1e-5
"""Of the differences: the second derivatives of a turn leave 1e-10 of it."""


def apart(from_one: Estimate, to_other: Estimate) -> jnp.ndarray:
    """The error that takes one estimate to another."""
    true = State(
        to_other.position_m,
        to_other.velocity_m_s,
        to_other.quaternion,
        jnp.zeros(3),
        jnp.zeros(4),
    )
    return error_of(from_one, true, Inertial(to_other.force_bias, to_other.rate_bias))


def differences(function) -> np.ndarray:
    """Central differences along each part of an error."""
    program, columns = jax.jit(function), []
    for n in range(SIZE):
        off = jnp.zeros(SIZE).at[n].set(STEP)
        columns.append((program(off) - program(-off)) / (2 * STEP))
    return np.stack(columns, axis=-1)


def test_an_error_moves_an_estimate_to_where_it_is_that_error_away():
    estimate = in_flight()
    error = jnp.linspace(-0.3, 0.4, SIZE)
    found = apart(estimate, moved_on(estimate, error))
    np.testing.assert_allclose(found, error, atol=1e-12)


def test_the_transition_is_that_of_differences():
    estimate = in_flight()
    exact = carried_on(estimate, FORCE, RATE, PERIOD)

    def later(error):
        moved = moved_on(estimate, error)
        return apart(exact, carried_on(moved, FORCE, RATE, PERIOD))

    found = np.asarray(transition(estimate, FORCE, RATE, PERIOD))
    # what is left out is of the third order in 4 ms at 10 m/s2 and 1.5 rad/s, 1e-6
    np.testing.assert_allclose(found, differences(later), rtol=0, atol=2e-7)


@pytest.mark.slow
def test_the_rows_of_a_late_fix_are_those_of_an_error_carried_on_since():
    """An error of then becomes one of now; the rows take that one back."""
    then = fix_taken(in_flight(), jnp.asarray(True))
    # at rest but for what pulls: the mean force since then is what it was
    still = jnp.zeros(3)

    def carried(estimate: Estimate) -> Estimate:
        def on(estimate: Estimate, _: None) -> tuple[Estimate, None]:
            return predicted(estimate, FORCE, still, SUITE.imu, PERIOD), None

        return jax.lax.scan(on, estimate, None, length=30)[0]

    now = jax.jit(carried)(then._replace(rate_bias=still))

    def later(error):
        moved = moved_on(then._replace(rate_bias=still), error)
        return apart(now, carried(moved))

    on = differences(later)
    rows = jax.jacfwd(lambda error: expected(now, SUITE, error))(jnp.zeros(SIZE))
    back = np.asarray(rows[FIX]) @ on
    whole = np.zeros((6, SIZE))
    whole[:, 3:9] = np.eye(6)
    # gyroscope's bias over 0.12 s turns what pulls: of the second order, left out
    back[:, 9:12] = 0
    np.testing.assert_allclose(back, whole, rtol=0, atol=2e-4)
