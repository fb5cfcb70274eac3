"""The filter's derivatives, held against differences of what they are of."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.autopilot.estimator import (
    FIX,
    SIZE,
    Estimate,
    carried_on,
    error_of,
    expected,
    fix_taken,
    moved_on,
    predicted,
    transition,
)
from jblast.sensors.imu import Inertial
from jblast.vehicle import State
from tests.autopilot.estimator.estimates import (
    FORCE,
    PERIOD,
    RATE,
    SUITE,
    in_flight,
)

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
