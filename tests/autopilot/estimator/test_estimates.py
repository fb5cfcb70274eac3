"""The filter: as good as it says, through blasts too, alone and in batches."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from jblast.autopilot.estimator import (
    GATE,
    EstimatedControl,
    Followed,
    corrected,
    error_of,
    followed,
    thrown,
)
from jblast.sensors.flight_sensors import Fix, Sample
from jblast.vehicle import State
from tests.autopilot.estimator.estimates import (
    FIELD,
    PERIOD,
    SUITE,
    in_flight,
    swinging,
)

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


def controls(seeds: jnp.ndarray, flights) -> EstimatedControl:
    one = eqx.filter_vmap(
        lambda start, seed: EstimatedControl(None, SUITE, start, seed)
    )
    return one(jax.tree.map(lambda x: x[:, 0], flights.states), seeds)


def squares(control: EstimatedControl, flight, period) -> jnp.ndarray:
    """The error's square along a flight in units of its covariance."""

    def turn(known, row):
        known = control.sensed(row[0], row[1], known, period)
        error = error_of(known.estimate, row[1], known.held.biases)
        return known, error @ jnp.linalg.solve(known.estimate.covariance, error)

    rows = flight.time_s, flight.states
    return jax.lax.scan(turn, control.known(), rows)[1]


def estimates(count: int, seconds: float, *along):
    """What some functions give along random flights, one a lane."""
    flights = jax.tree.map(
        lambda *x: jnp.stack(x), *(swinging(n, seconds) for n in range(count))
    )
    many = controls(jnp.arange(count, dtype=jnp.uint32), flights)
    lanes = (eqx.if_array(0), eqx.if_array(0), None)
    found = [
        eqx.filter_jit(eqx.filter_vmap(one, in_axes=lanes))(many, flights, PERIOD)
        for one in along
    ]
    return flights, many, *found


@pytest.mark.slow
def test_over_random_flights_its_errors_are_as_large_as_it_says():
    count = 60
    _, _, found, square = estimates(count, 12.0, followed, squares)
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
