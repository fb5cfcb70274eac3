import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings, strategies as st

from jblast.waves.euler.state import GradedMesh


def mesh(label=0.0, core=0):
    return GradedMesh(
        label=jnp.asarray(label),
        length=jnp.asarray(0.7),
        density=jnp.asarray(1.2),
        cells=30,
        core=core,
    )


@settings(deadline=None, max_examples=30)
@given(
    clock=st.floats(0.02, 50.0),
    share=st.floats(1e-4, 0.1),
    label=st.sampled_from([0, 1]),
)
def test_what_faces_overtake_is_what_cells_gain(clock, share, label):
    graded = mesh(float(label))
    clock, advance = jnp.asarray(label + clock), jnp.asarray(share * clock)
    gained = graded.masses(clock + advance) - graded.masses(clock)
    swept = graded.swept(clock, advance)
    whole = float(jnp.sum(graded.masses(clock + advance)))
    np.testing.assert_allclose(jnp.diff(swept), gained, rtol=0, atol=1e-13 * whole)


def test_the_cells_hold_all_air_within_the_shock():
    graded, clock = mesh(1.0), jnp.asarray(8.0)
    whole = 1.2 * (8.0**3 - 1.0) / 3.0
    np.testing.assert_allclose(jnp.sum(graded.masses(clock)), whole, rtol=1e-14)


def test_the_rate_is_the_derivative_of_what_is_swept():
    graded, clock = mesh(1.0, core=4), jnp.asarray(3.0)
    one = jnp.ones(())
    _, rate = jax.jvp(lambda a: graded.swept(clock, a), (jnp.zeros(()),), (one,))
    np.testing.assert_allclose(rate, graded.sweeping(clock), rtol=1e-12)
    np.testing.assert_array_equal(rate[:4], 0.0)


def test_far_out_the_cells_at_the_shock_keep_their_width():
    graded = mesh()
    for clock in (70.0, 700.0):
        labels = graded.labels(jnp.asarray(clock))
        # L/30 less the share L/R and the second cell's beginning growth, 1/30
        np.testing.assert_allclose(labels[-1] - labels[-2], 0.7 / 30, rtol=0.05)
