import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.curves import (
    HEAD_START_END,
    Tail,
    chebyshev_arrival,
    head_start,
    log_sound_fraction,
)

STRENGTH = 3.0
"""6/7 Z p/P0 of a shock that falls as 1/Z everywhere: M^2 = 1 + STRENGTH/Z."""


def log_pressure(log_z):
    return math.log(7.0 / 6.0 * STRENGTH) - log_z


def mach_number(log_z):
    return jnp.sqrt(1.0 + STRENGTH * jnp.exp(-log_z))


def exact(z):
    """The integral of dz/M from nought."""
    return np.sqrt(z * (z + STRENGTH)) - STRENGTH * np.arcsinh(np.sqrt(z / STRENGTH))


def arrival(start, start_time, first):
    return chebyshev_arrival(
        log_pressure,
        mach_number,
        start=start,
        start_time=start_time,
        first=first,
        join=10.0,
        degrees=(60, 40),
        tail=Tail(log_pressure, degree=30),
    )


@pytest.mark.parametrize("z", [0.06, 0.5, 9.99, 10.01, 300.0, 9e5, 1e8])
def test_from_a_time_on_it_is_the_integral(z):
    shock = arrival(0.05, float(exact(0.05)), 0.05)
    fraction = math.exp(log_sound_fraction(jnp.log(z), shock))
    # the three series; past the last the slope is off by 1e-6 of its 3/2, over 1e6
    assert fraction * z == pytest.approx(exact(z), rel=1e-10)


def test_from_a_surface_on_it_is_the_integral_from_there():
    shock = arrival(0.05, 0.0, 0.06)
    z = np.array([0.061, 1.0, 200.0])
    fraction = np.exp(log_sound_fraction(jnp.log(z), shock))
    np.testing.assert_allclose(fraction * z, exact(z) - exact(0.05), rtol=1e-10)


def test_its_derivative_is_one_over_the_mach_number():
    shock = arrival(0.05, float(exact(0.05)), 0.05)
    z = jnp.geomspace(0.05, 1e8, 50)
    time = jax.vmap(
        jax.grad(lambda z: z * jnp.exp(log_sound_fraction(jnp.log(z), shock)))
    )
    np.testing.assert_allclose(time(z) * mach_number(jnp.log(z)), 1.0, rtol=1e-13)


def test_the_head_start_of_a_weak_shock_is_a_straight_line_in_its_coordinate():
    amplitude, length = 0.3, 0.9
    weak = Tail(
        lambda log_z: (
            math.log(amplitude) - log_z - 0.5 * np.log(log_z - math.log(length))
        ),
        degree=10,
        log_length=math.log(length),
    )
    lead = head_start(weak, math.log(1e4), 1.0)
    q = np.sqrt(np.log(np.array([1e4, HEAD_START_END, 1e9]) / length))
    # its slope is 6/7 A, less 3e-6 of it at the start
    np.testing.assert_allclose(
        lead(jnp.log(jnp.array([1e4, HEAD_START_END, 1e9]))),
        1.0 + 6 / 7 * amplitude * (q - q[0]),
        rtol=1e-6,
    )
