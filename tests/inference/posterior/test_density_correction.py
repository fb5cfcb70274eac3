"""What one density has over another: a spline through the places where it is known."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.posterior.posterior import (
    DensityCorrection,
    correction_by,
    no_correction,
)

FREE, NODES = 2, 40


def nodes():
    return np.random.default_rng(2).uniform(-3.0, 3.0, (NODES, FREE))


def smooth(w):
    return 0.3 * np.sin(w[..., 0]) + 0.1 * w[..., 0] * w[..., 1] ** 2


def quadratic(w):
    return 2.0 - w[..., 0] + 0.5 * w[..., 0] * w[..., 1] - 0.25 * w[..., 1] ** 2


def laid_through(function) -> tuple[DensityCorrection, np.ndarray]:
    w = nodes()
    return correction_by(no_correction(FREE, 2 * NODES), w, function(w))


def test_a_quadratic_is_met_everywhere_within_reach():
    made, missed = laid_through(quadratic)
    at = np.random.default_rng(3).uniform(-2.0, 2.0, (20, FREE))
    # the tail is a quadratic: what is left is the rounding of the equations
    found = jax.vmap(made)(jnp.asarray(at))
    np.testing.assert_allclose(found, quadratic(at), atol=1e-8)
    np.testing.assert_allclose(missed, 0.0, atol=1e-8)


def test_a_smooth_function_is_met_at_nodes_and_nearly_between():
    made, missed = laid_through(smooth)
    found = jax.vmap(made)(jnp.asarray(nodes()))
    np.testing.assert_allclose(found, smooth(nodes()), atol=1e-8)
    at = np.random.default_rng(3).uniform(-2.0, 2.0, (50, FREE))
    off = np.asarray(jax.vmap(made)(jnp.asarray(at))) - smooth(at)
    # nodes left out are at the edges, too, and so are missed by more
    assert np.sqrt(np.mean(off**2)) < np.sqrt(np.mean(missed**2)) < 0.5


@pytest.mark.parametrize("left_out", [0, 17])
def test_a_node_left_out_is_missed_by_as_much_as_said(left_out):
    w = nodes()
    _, missed = correction_by(no_correction(FREE, NODES), w, smooth(w))
    rest = np.delete(w, left_out, axis=0)
    made, _ = correction_by(no_correction(FREE, NODES), rest, smooth(rest))
    # beyond its nodes a correction is held: this one has to reach the one left out
    far = replace(made, reach=jnp.asarray(10.0))
    found = float(far(jnp.asarray(w[left_out])))
    assert smooth(w[left_out]) - found == pytest.approx(missed[left_out], rel=1e-6)


def test_beyond_its_nodes_it_stays_as_at_their_edge():
    made, _ = laid_through(smooth)
    way = jnp.array([0.6, 0.8])
    edge = float(made(made.reach * way))
    assert float(made(100.0 * way)) == pytest.approx(edge, abs=1e-9)


def test_its_slope_at_a_node_is_that_of_differences():
    made, _ = laid_through(smooth)
    at, step = jnp.asarray(nodes()[0]), jnp.array([1e-5, 0.0])
    slope = jax.grad(made)(at)[0]
    # central differences of a cubic: their error is of the order of the step's square
    expected = float(made(at + step) - made(at - step)) / 2e-5
    assert float(slope) == pytest.approx(expected, rel=1e-4)


def test_one_unknown_is_a_cubic_spline():
    w = np.linspace(-4.0, 4.0, 16)[:, None]
    made, _ = correction_by(no_correction(1, 16), w, np.tanh(w[:, 0]))
    at = np.linspace(-3.0, 3.0, 31)
    found = jax.vmap(made)(jnp.asarray(at[:, None]))
    # nodes half a unit apart: error of a cubic spline, h^4 / 384 max|f''''|
    np.testing.assert_allclose(found, np.tanh(at), atol=5 / 384 * 4.1 * 0.533**4)
