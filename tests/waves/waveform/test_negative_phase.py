import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import quad

from jblast.waves.waveform import negative_phase_pressure

DURATION, LOWEST, LENGTH = 4e-3, 2.5e4, 1.1e-2


def test_it_is_the_printed_cubic():
    s = np.array([0.1, 0.5, 0.9])
    np.testing.assert_allclose(
        negative_phase_pressure(DURATION + s * LENGTH, DURATION, LOWEST, LENGTH),
        -LOWEST * 6.75 * s * (1 - s) ** 2,
        rtol=1e-13,
    )


def test_it_is_zero_before_and_after_and_where_it_starts_and_ends():
    time = jnp.array([-1.0, 0.0, 3e-3, DURATION, DURATION + LENGTH, 0.02, 1e6])
    pressure = negative_phase_pressure(time, DURATION, LOWEST, LENGTH)
    # the end is met to rounding: (1 - s)^2 of 1e-16
    np.testing.assert_allclose(pressure, np.zeros(7), rtol=0, atol=1e-20)


def test_it_is_lowest_after_a_third_by_the_pressure_given():
    time = DURATION + LENGTH / 3
    low = negative_phase_pressure(time, DURATION, LOWEST, LENGTH)
    np.testing.assert_allclose(low, -LOWEST, rtol=1e-14)
    slope = jax.grad(negative_phase_pressure)(time, DURATION, LOWEST, LENGTH)
    assert abs(slope) < 1e-12 * LOWEST / LENGTH


def test_the_impulse_is_nine_sixteenths_of_the_rectangle():
    area = quad(
        lambda t: float(negative_phase_pressure(t, DURATION, LOWEST, LENGTH)),
        DURATION,
        DURATION + LENGTH,
    )[0]
    np.testing.assert_allclose(area, -9 / 16 * LOWEST * LENGTH, rtol=1e-12)


def test_slopes_at_its_ends_are_those_of_the_docstring():
    slope = jax.grad(negative_phase_pressure)
    np.testing.assert_allclose(
        slope(DURATION, DURATION, LOWEST, LENGTH), -6.75 * LOWEST / LENGTH, rtol=1e-14
    )
    assert slope(DURATION - 1e-9, DURATION, LOWEST, LENGTH) == 0.0
    # smooth at the end: 1e-9 s before it the slope is 2 * 6.75 P/t^2 times that
    before = slope(DURATION + LENGTH - 1e-9, DURATION, LOWEST, LENGTH)
    np.testing.assert_allclose(before, 13.5 * LOWEST / LENGTH**2 * 1e-9, rtol=1e-5)
    assert slope(DURATION + LENGTH + 1e-9, DURATION, LOWEST, LENGTH) == 0.0
