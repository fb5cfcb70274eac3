import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.verification.stability.laws import (
    gradient_failures,
    laws_without_slope,
    pulse,
    slope_ratio,
)
from jblast.waves import kingery_bulmash_pressure, slant_range


@pytest.mark.slow
def test_each_edge_of_a_derivative_is_seen():
    assert [mode.response for mode in gradient_failures()] == [
        *("holds", "holds", "holds", "refuses"),
    ]


def test_at_the_arrival_pressure_and_slope_are_those_behind_the_front():
    slope = jax.grad(pulse)
    assert float(pulse(jnp.array(-1e-12))) == 0.0
    assert float(slope(-1e-12)) == 0.0
    assert float(pulse(jnp.array(0.0))) == 1.0
    # -(1 + b)/td
    assert float(slope(0.0)) == pytest.approx(-250.0, rel=1e-12)
    rise = jnp.array(1e-4)
    for time in (-1e-12, 0.0, 1e-12):
        # as t^2 behind the arrival: x^2 with x = 3.358 t/rise, so 1.1e9 t a second
        assert 0.0 <= float(slope(time, rise)) < 1.2e9 * 1e-12


def test_a_sharp_front_hides_the_slope_of_a_misfit_and_a_rise_shows_it():
    assert slope_ratio(0) < 0.6
    assert slope_ratio(1) < 0.6
    # the misfit of a discrete record, differences over 20 samples
    assert slope_ratio(10) == pytest.approx(1.0, abs=0.02)


@pytest.mark.slow
def test_at_distance_zero_the_slope_is_defined_and_laws_are_refused():
    origin = jnp.zeros(3)
    assert bool(jnp.isnan(jax.grad(jnp.linalg.norm)(origin)).all())
    np.testing.assert_array_equal(jax.grad(slant_range)(origin, origin), 0.0)
    assert "peak_overpressure_pa by kingery_bulmash" in laws_without_slope()
    with pytest.raises(ValueError, match="slant_range must be positive, got 0 m"):
        kingery_bulmash_pressure(0.0, 1.0)
