import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings, strategies as st

from jblast.sensors.camera.geometry import (
    distort,
    distortion_jacobian,
    unfolded,
)
from tests.sensors.camera.geometry.lenses import LENS, fold_radius

PLACE = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)).map(np.array)
jacobian_by_jax = jax.jit(jax.jacfwd(distort))
clear_of_folds = jax.jit(unfolded)


@settings(deadline=None, max_examples=50)
@given(PLACE, LENS)
def test_the_jacobian_is_symmetric_and_that_of_the_map(point, lens):
    point, lens = jnp.array(point), jnp.array(lens)
    xx, xy, yy = distortion_jacobian(point, lens)
    jacobian = jacobian_by_jax(point, lens)
    # cancellation among terms of up to 10
    np.testing.assert_allclose(jacobian, [[xx, xy], [xy, yy]], atol=1e-13)


@settings(deadline=None, max_examples=50)
@given(LENS)
def test_a_place_is_unfolded_if_the_fold_lies_beyond(lens):
    angles = np.linspace(0.0, 6.0, 25)
    ways = jnp.array(np.stack([np.cos(angles), np.sin(angles)], axis=-1))
    lens = jnp.array(lens)
    folds = np.array([fold_radius(np.asarray(lens), np.asarray(w)) for w in ways])
    for distance in (0.3, 0.9, 1.5):
        before = distance < folds
        said = clear_of_folds(distance * ways, lens)
        assert (said | ~before).all()
        # A fold is overlooked only where it opens and closes between two of 64 steps:
        # then it has closed again one step on.
        missed = said & ~before
        reopened = (folds + distance / 64)[:, None] * ways
        xx, xy, yy = distortion_jacobian(reopened, lens)
        assert ((xx * yy > xy * xy) & (xx > 0))[missed].all()
