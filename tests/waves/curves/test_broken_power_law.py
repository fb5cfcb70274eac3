import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.curves import Break, BrokenPowerLaw

BREAKS = (Break(2.0, 3.0, -0.5), Break(30.0, 2.0, 0.25))
PLAIN = BrokenPowerLaw(7.0, -1.0, BREAKS)
CUT = BrokenPowerLaw(7.0, -1.0, BREAKS, z_min=0.5, z_max=100.0)


def test_it_is_the_product_it_stands_for():
    z = np.geomspace(0.5, 100.0, 60)
    product = 7.0 / z * (1 + (z / 2) ** 3) ** -0.5 * (1 + (z / 30) ** 2) ** 0.25
    for law in (PLAIN, CUT):
        # the roundings of a few logarithms below 20
        np.testing.assert_allclose(
            law.log_value(jnp.log(z)), np.log(product), rtol=0, atol=1e-14
        )


def test_far_inside_and_outside_it_is_a_power():
    slope = jax.grad(PLAIN.log_value)
    # what is left of the nearest break: (1e-6)^3 and (1e-5)^2
    assert float(slope(math.log(2e-6))) == pytest.approx(-1.0, abs=1e-11)
    assert float(slope(math.log(3e6))) == pytest.approx(-1.0 - 1.5 + 0.5, abs=1e-9)


@pytest.mark.parametrize("z", [0.7, 2.0, 11.0, 30.0, 99.0])
def test_the_slope_in_words_is_the_derivative(z):
    for law in (PLAIN, CUT):
        assert law.log_slope(z) == pytest.approx(
            float(jax.grad(law.log_value)(math.log(z))), rel=1e-12
        )


@pytest.mark.parametrize(("end", "beyond"), [(0.5, 1e-4), (100.0, 1e7)])
def test_past_a_cut_it_keeps_value_and_slope(end, beyond):
    slope = jax.grad(CUT.log_value)
    at_end = float(slope(math.log(end)))
    assert at_end == pytest.approx(PLAIN.log_slope(end), rel=1e-12)
    assert float(slope(math.log(beyond))) == pytest.approx(at_end, rel=1e-12)
    straight = float(PLAIN.log_value(jnp.log(end))) + at_end * math.log(beyond / end)
    # a dozen roundings of numbers up to 30
    assert float(CUT.log_value(jnp.log(beyond))) == pytest.approx(straight, abs=1e-13)


def test_a_tenth_power_overflows_in_single_precision_but_not_here():
    law = BrokenPowerLaw(1.0, 0.0, (Break(0.54, 10.0, 1.0),))
    log_z = jnp.log(jnp.asarray(1e5, dtype=jnp.float32))
    value, slope = jax.value_and_grad(law.log_value)(log_z)
    assert value.dtype == jnp.float32
    assert float(value) == pytest.approx(10 * math.log(1e5 / 0.54), rel=1e-6)
    assert float(slope) == pytest.approx(10.0, rel=1e-6)
