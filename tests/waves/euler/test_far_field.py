import jax
import jax.numpy as jnp
import pytest

from jblast.errors import InputError
from jblast.waves.euler import far_field


def test_the_tail_leaves_with_the_value_and_slope_it_was_given():
    tail = far_field(100.0, 1.45847e-3, -1.1066)
    at = jnp.log(100.0)
    assert float(jnp.exp(tail.log_pressure(at))) == pytest.approx(1.45847e-3, rel=1e-12)
    assert float(jax.grad(tail.log_pressure)(at)) == pytest.approx(-1.1066, rel=1e-12)


def test_the_tail_from_a_hundred_meets_the_printed_far_values():
    tail = far_field(100.0, 1.45847e-3, -1.1066)
    # formulas.md, section 11; the stated error, and the fourth digit
    for scaled, printed, off in ((1000.0, 1.196e-4, 2e-3), (1e6, 8.54e-8, 1e-2)):
        value = float(jnp.exp(tail.log_pressure(jnp.log(scaled))))
        assert value == pytest.approx(printed, rel=off)


def test_a_decay_flatter_than_sound_is_refused():
    with pytest.raises(InputError, match=r"steeper than -1, got -0\.9"):
        far_field(100.0, 1e-3, -0.9)
