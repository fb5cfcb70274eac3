from functools import cache

import jax
import numpy as np
import pytest

from jblast.waves.waveform import (
    decay_of_fraction,
    impulse_fraction,
    middle_fraction,
)
from tests.tools.slopes import with_slopes

WEIGHTS = {
    impulse_fraction: lambda x: 1 - x,
    middle_fraction: lambda x: x * (1 - x),
}
AT = {integral: with_slopes(integral) for integral in WEIGHTS}
DECAY_AT = with_slopes(decay_of_fraction)
compiled = cache(jax.jit)


def moment(integral, decay, order=0):
    """Integrate by quadrature; each order is one more derivative by the decay.

    Forty nodes of Gauss are exact to rounding for e^(-b x) with |b| up to 30 and more.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x = (nodes + 1) / 2
    return weights / 2 @ (WEIGHTS[integral](x) * (-x) ** order * np.exp(-decay * x))


def test_the_decay_is_found_to_rounding_over_eighteen_decades():
    fraction = np.geomspace(1e-6, 1e12, 2001)
    # k is steep in b where b = -35: a rounding of b there is 35 of k.
    np.testing.assert_allclose(
        AT[impulse_fraction](DECAY_AT(fraction)[0])[0], fraction, rtol=1e-14
    )


def test_in_single_precision_the_decay_is_found_too():
    decay = np.concatenate([np.linspace(-5.0, 5.0, 101), np.geomspace(5.0, 1e5)])
    fraction = AT[impulse_fraction](decay)[0].astype("float32")
    found = np.asarray(compiled(decay_of_fraction)(fraction))
    assert found.dtype == np.float32
    exact = DECAY_AT(fraction.astype(float))[0]
    # Rounding of k, 6e-8, times b or 6k, whichever is more.
    np.testing.assert_allclose(found.astype(float), exact, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("fraction", [0.04, 0.1, 0.45, 0.5, 0.55, 0.7, 3.0])
def test_slope_and_curvature_are_those_of_the_inverse_function(fraction):
    decay, slope, curvature = DECAY_AT(fraction)
    k1, k2 = (
        moment(impulse_fraction, float(decay), 1),
        moment(impulse_fraction, float(decay), 2),
    )
    np.testing.assert_allclose(slope, 1 / k1, rtol=1e-12)
    np.testing.assert_allclose(curvature, -k2 / k1**3, rtol=1e-12)
