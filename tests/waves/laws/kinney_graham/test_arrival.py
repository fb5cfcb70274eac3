import math
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jblast.waves.curves import log_sound_fraction
from jblast.waves.laws.kinney_graham import (
    CHARGE_RADIUS,
    FIRST_ARRIVAL,
    kinney_graham_arrival,
)


def log_arrival(log_z):
    """ln(c t / Z)."""
    return log_sound_fraction(log_z, kinney_graham_arrival())


def slowness(z):
    """One over the Mach number, from the printed formula, in plain Python."""
    ratio = (
        808
        * (1 + (z / 4.5) ** 2)
        / math.sqrt(
            (1 + (z / 0.048) ** 2) * (1 + (z / 0.32) ** 2) * (1 + (z / 1.35) ** 2)
        )
    )
    return 1 / math.sqrt(1 + 6 * ratio / 7)


def integral(z):
    """The integral from the charge's surface, over ln Z, in pieces."""
    ends = np.linspace(math.log(CHARGE_RADIUS), math.log(z), 9)
    return math.fsum(
        quad(lambda x: math.exp(x) * slowness(math.exp(x)), a, b, epsabs=0)[0]
        for a, b in pairwise(ends)
    )


@pytest.mark.parametrize("z", [0.06, 0.07, 0.2, 1.0, 3.0, 9.9, 10.1, 60.0, 1e3, 1e5])
def test_it_is_the_integral_from_the_surface_of_the_charge(z):
    log_fraction = float(log_arrival(jnp.log(z)))
    # the two series, 1e-11, and the quadrature
    assert log_fraction == pytest.approx(math.log(integral(z) / z), abs=2e-11)


def test_before_the_first_distance_it_is_a_power_law_that_meets_the_integral():
    slope = jax.vmap(jax.grad(log_arrival))
    slopes = slope(jnp.log(jnp.array([1e-3, 0.01, 0.0599, FIRST_ARRIVAL, 0.0601])))
    expected = FIRST_ARRIVAL * slowness(FIRST_ARRIVAL) / integral(FIRST_ARRIVAL) - 1
    np.testing.assert_allclose(slopes[:4], expected, rtol=1e-9)
    # 0.0001 farther; the second derivative there is about -60
    assert float(slopes[4]) == pytest.approx(expected, abs=0.15)
    log_z = jnp.log(jnp.array([0.01, FIRST_ARRIVAL]))
    values = log_arrival(log_z)
    np.testing.assert_allclose(
        values[1] - values[0], expected * (log_z[1] - log_z[0]), rtol=1e-9
    )


def test_past_the_last_series_the_head_start_grows_as_the_logarithm():
    def head_start(z):
        return -z * math.expm1(float(log_arrival(jnp.log(z))))

    # 3/7 of Z p/P0 a factor e; rounding 1e-16 * 1e8 in the head start
    growth = (head_start(1e8) - head_start(1e7)) / math.log(10)
    assert growth == pytest.approx(3 / 7 * 0.8274, rel=1e-3)


def test_the_charge_is_a_sphere_of_cast_tnt():
    # 1600 kg/m3; three digits
    radius = (3 / (4 * math.pi * 1600)) ** (1 / 3)
    assert radius == pytest.approx(CHARGE_RADIUS, abs=5e-5)
