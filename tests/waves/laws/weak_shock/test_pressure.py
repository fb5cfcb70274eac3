import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from jblast.waves.laws.shock_kinematics import shock_kinematics_pressure
from jblast.waves.laws.weak_shock import weak_shock_pressure, weak_shock_valid

BURSTS = ("surface", "free-air")
both_bursts = pytest.mark.parametrize("burst", BURSTS)


@pytest.mark.parametrize(
    ("burst", "amplitude", "length"),
    [("surface", 170_256.0, 2.7953), ("free-air", 105_693.0, 4.8852)],
)
def test_it_is_the_law_with_the_printed_amplitude_and_length(burst, amplitude, length):
    z = np.array([20.0, 100.0, 1e4, 1e5])
    expected = amplitude / (z * np.sqrt(np.log(z / length)))
    # five digits of b: 1e-5 / ln(Z/b) at Z = 20; six of A
    np.testing.assert_allclose(
        weak_shock_pressure(z, 1.0, burst=burst), expected, rtol=2e-5
    )


@both_bursts
def test_past_20_it_is_shock_kinematics(burst):
    r = np.geomspace(20.0, 1e5, 50) * (3.0 * 101_325.0 / 9e4) ** (1 / 3)
    np.testing.assert_allclose(
        weak_shock_pressure(r, 3.0, 9e4, burst),
        shock_kinematics_pressure(r, 3.0, 9e4, burst),
        rtol=1e-12,
    )


@both_bursts
def test_nearer_it_is_a_power_law_with_the_slope_at_20(burst):
    def law(x):
        return jnp.log(weak_shock_pressure(jnp.exp(x), 1.0, burst=burst))

    curve = kingery_bulmash_curve("incident_pressure", burst).segments[-1]
    expected = curve.log_slope(math.log(20.0))
    slope = jax.vmap(jax.grad(law))(jnp.log(jnp.array([0.01, 1.0, 19.99, 20.0])))
    np.testing.assert_allclose(slope, expected, rtol=1e-9)


def test_valid_from_20_to_ten_thousand():
    z = np.array([19.9, 20.1, 299.0, 301.0])
    assert weak_shock_valid(z, 1.0).tolist() == [False, True, True, False]
