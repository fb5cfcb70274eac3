import jax
import jax.numpy as jnp
import pytest

from jblast.waves.shock import tail_from


def test_the_tail_leaves_with_the_value_and_slope_it_was_given():
    tail = tail_from(100.0, 1.45847e-3, -1.1066)
    at = jnp.log(100.0)
    assert float(jnp.exp(tail.log_pressure(at))) == pytest.approx(1.45847e-3, rel=1e-12)
    assert float(jax.grad(tail.log_pressure)(at)) == pytest.approx(-1.1066, rel=1e-12)
