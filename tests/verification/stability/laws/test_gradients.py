import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.verification.stability.laws import (
    gradient_failures,
    laws_without_slope,
    pulse,
)
from jblast.waves import kingery_bulmash_pressure, slant_range


@pytest.mark.slow
def test_each_edge_of_a_derivative_is_seen():
    assert [mode.response for mode in gradient_failures()] == [
        *("holds", "holds", "refuses"),
    ]


def test_at_the_arrival_pressure_and_slope_are_those_behind_the_front():
    slope = jax.grad(pulse)
    assert float(pulse(jnp.array(-1e-12))) == 0.0
    assert float(slope(-1e-12)) == 0.0
    assert float(pulse(jnp.array(0.0))) == 1.0
    # -(1 + b)/td
    assert float(slope(0.0)) == pytest.approx(-250.0, rel=1e-12)


@pytest.mark.slow
def test_at_distance_zero_the_slope_is_defined_and_laws_are_refused():
    origin = jnp.zeros(3)
    assert bool(jnp.isnan(jax.grad(jnp.linalg.norm)(origin)).all())
    np.testing.assert_array_equal(jax.grad(slant_range)(origin, origin), 0.0)
    assert "peak_overpressure_pa by kingery_bulmash" in laws_without_slope()
    with pytest.raises(ValueError, match="slant_range must be positive, got 0 m"):
        kingery_bulmash_pressure(0.0, 1.0)
