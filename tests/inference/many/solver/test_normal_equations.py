import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.many.solver import (
    backward,
    cholesky,
    forward,
    inverse_of,
    squared,
)


def triangles(lanes, unknowns, seed=0):
    rng = np.random.default_rng(seed)
    j = rng.standard_normal((lanes, 12, unknowns)) * np.geomspace(1e-3, 1e3, unknowns)
    h = np.einsum("lik,lim->lkm", j, j)
    packed = tuple(
        tuple(jnp.asarray(h[:, k, i]) for i in range(k + 1)) for k in range(unknowns)
    )
    return h, packed, rng.standard_normal((lanes, unknowns))


@pytest.mark.parametrize("unknowns", [1, 4, 6])
def test_the_written_out_solve_is_that_of_numpy_in_every_lane(unknowns):
    h, packed, g = triangles(7, unknowns)
    factor = cholesky(packed, 0.3)
    found = backward(factor, forward(factor, tuple(jnp.asarray(g.T))))
    damped = h + 0.3 * h * np.eye(unknowns)
    expected = np.linalg.solve(damped, g[..., None])[..., 0]
    np.testing.assert_allclose(np.stack(found, axis=1), expected, rtol=1e-10)
    assert factor.positive.all()


def test_the_whitened_gradient_is_as_long_as_newtons_promise():
    h, packed, g = triangles(5, 4)
    length = squared(forward(cholesky(packed), tuple(jnp.asarray(g.T))))
    expected = np.einsum("lk,lkm,lm->l", g, np.linalg.inv(h), g)
    np.testing.assert_allclose(length, expected, rtol=1e-9)


def test_the_inverse_is_that_of_numpy():
    h, packed, _ = triangles(5, 4)
    found = np.moveaxis(
        np.stack([np.stack(c) for c in inverse_of(cholesky(packed))]), 2, 0
    )
    np.testing.assert_allclose(found, np.linalg.inv(h), rtol=1e-8)


def test_a_singular_matrix_is_not_positive_and_leaves_that_unknown_alone():
    one = jnp.ones(2)
    # the second unknown does what the first does, the third nothing at all
    factor = cholesky(((one,), (one, one), (0 * one, 0 * one, 0 * one)))
    step = backward(factor, forward(factor, (one, one, one)))
    assert not factor.positive.any()
    assert np.isfinite(np.stack(step)).all()
    assert (step[2] == 0).all()
