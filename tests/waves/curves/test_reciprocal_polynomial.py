import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.curves import LogCurve, ReciprocalPolynomial

SEGMENT = ReciprocalPolynomial(1.0, 10.0, (-0.5, 2.0, 0.0, 8.0))


@pytest.mark.parametrize("kind", [float, np.asarray, jnp.asarray])
def test_value_is_the_sum_of_powers_for_numbers_and_arrays(kind):
    # at z = 2: -0.5 + 2/2 + 8/8
    np.testing.assert_allclose(
        SEGMENT.log_value(kind(math.log(2.0))), math.log(1.5), rtol=1e-14
    )


def test_slope_is_the_derivative_of_the_value():
    slope = jax.grad(SEGMENT.log_value)(math.log(2.0))
    # -(2/2 + 3 * 8/8) / 1.5
    assert SEGMENT.log_slope(math.log(2.0)) == pytest.approx(-4.0 / 1.5, rel=1e-14)
    assert float(slope) == pytest.approx(-4.0 / 1.5, rel=1e-14)


def test_a_curve_of_it_stays_positive_where_the_sum_is_negative():
    end, far = math.log(3.0), math.log(100.0)
    assert 2.0 / 100 + 8.0 / 100**3 - 0.5 < 0
    segment = ReciprocalPolynomial(1.0, 3.0, SEGMENT.coefficients)
    expected = segment.log_value(end) + segment.log_slope(end) * (far - end)
    got = LogCurve((segment,)).log_value(jnp.asarray(far))
    assert float(got) == pytest.approx(expected, rel=1e-13)
