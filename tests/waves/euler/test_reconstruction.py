import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings, strategies as st

from jblast.waves.euler import Primitives
from jblast.waves.euler.step import reconstruct

positive = st.lists(st.floats(1e-6, 1e6), min_size=12, max_size=12)


@settings(deadline=None, max_examples=100)
@given(density=positive, pressure=positive, fitted=st.booleans())
def test_between_positive_means_limited_values_are_positive(density, pressure, fitted):
    cells = Primitives(jnp.array(density), jnp.zeros(12), jnp.array(pressure))
    for side in reconstruct(cells, fitted=fitted, limited=True):
        assert side.density.shape == (13,)
        assert float(side.density.min()) > 0.0
        assert float(side.pressure.min()) > 0.0


def test_without_the_limiter_a_cell_whose_face_would_be_negative_is_flat():
    density = jnp.array([5.0, 1.0, 1.0, 0.1, 3.0, 3.0])
    cells = Primitives(density, jnp.arange(6.0), jnp.ones(6))
    inner, outer = reconstruct(cells, fitted=False, limited=False)
    assert float(jnp.minimum(inner.density.min(), outer.density.min())) > 0.0
    # the cell of 0.1: its inner face is the outer side of face 3
    np.testing.assert_allclose(outer.density[3], 0.1)
    np.testing.assert_allclose(outer.velocity[3], 3.0)
    np.testing.assert_allclose(inner.velocity[4], 3.0)


def test_beyond_a_wall_lies_the_mirrored_flow():
    cells = Primitives(
        jnp.linspace(1.0, 2.0, 6), jnp.linspace(0.3, 0.9, 6), jnp.ones(6)
    )
    left, right = reconstruct(cells, fitted=False, limited=True)
    for at in (0, -1):
        assert float(left.velocity[at]) == -float(right.velocity[at])
        assert float(left.density[at]) == float(right.density[at])
