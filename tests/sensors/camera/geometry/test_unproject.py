"""Distortion of random lenses, wider than those that are sold, and its inverse."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from jax.test_util import check_grads
from scipy.optimize import brentq

from jblast.scene import Camera, look_at
from jblast.sensors.camera.geometry import (
    distort,
    distortion_jacobian,
    project,
    undistort,
    unfolded,
    unproject,
)

LENS = st.tuples(
    st.floats(-0.5, 0.5),
    st.floats(-0.3, 0.3),
    st.floats(-0.02, 0.02),
    st.floats(-0.02, 0.02),
    st.floats(-0.1, 0.1),
).map(np.array)
"""k1, k2, p1, p2, k3."""


def fold_radius(lens, way) -> float:
    """Return the radius at which a lens first folds over along a unit vector."""

    def least(radius):
        xx, xy, yy = distortion_jacobian(np.asarray(radius)[..., None] * way, lens)
        return (xx + yy) / 2 - np.hypot((xx - yy) / 2, xy)

    radii = np.tan(np.arange(1024) * (np.pi / 2 / 1024))
    folded = np.flatnonzero(least(radii) <= 0)
    if not folded.size:
        return np.inf
    first: Any = folded[0]
    root: Any = brentq(least, radii[first - 1], radii[first], xtol=1e-15)
    return float(root)


PLACE = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)).map(np.array)
jacobian_by_jax = jax.jit(jax.jacfwd(distort))


@settings(deadline=None, max_examples=15)
@given(PLACE, LENS)
def test_the_jacobian_is_symmetric_and_that_of_the_map(point, lens):
    point, lens = jnp.array(point), jnp.array(lens)
    xx, xy, yy = distortion_jacobian(point, lens)
    jacobian = jacobian_by_jax(point, lens)
    # cancellation among terms of up to 10
    np.testing.assert_allclose(jacobian, [[xx, xy], [xy, yy]], atol=1e-13)


@settings(deadline=None, max_examples=15)
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


BARREL = np.array([-0.35, 0.12, 0.01, -0.02, -0.02])
CAMERA = Camera(
    position=np.array([3.0, -20.0, 2.0]),
    quaternion=look_at(np.array([3.0, -20.0, 2.0]), np.array([0.0, 0.0, 5.0])),
    focal=np.array([300.0, 310.0]),
    center=np.array([172.5, 129.5]),
    width=346,
    height=260,
    distortion=np.array([-0.3, 0.1, 2e-3, -3e-3, 0.0]),
)
GRID = np.stack(np.meshgrid(np.linspace(-1.5, 1.5, 13), np.linspace(-1, 1, 9)), -1)
rays_of, seen_by = eqx.filter_jit(unproject), eqx.filter_jit(project)
straight, bent_back = jax.jit(distort), jax.jit(undistort)
clear_of_folds, jacobian = jax.jit(unfolded), jax.jit(distortion_jacobian)


def test_every_pixel_of_the_image_comes_back():
    pixels = np.stack(np.meshgrid(np.arange(346.0), np.arange(260.0)), axis=-1)
    rays = rays_of(CAMERA, pixels)
    np.testing.assert_allclose(jnp.linalg.norm(rays, axis=-1), 1, rtol=1e-15)
    far = seen_by(CAMERA, CAMERA.position.reshape(1, 1, 3) + 70.0 * rays)
    assert far.seen.all()
    # rounding of a few hundred pixels and of the place 70 m away
    np.testing.assert_allclose(far.pixel, pixels, rtol=0, atol=1e-11)


@settings(deadline=None, max_examples=15)
@given(LENS)
def test_what_lies_inside_the_fold_comes_back_and_nothing_else_does(lens):
    places, lens = GRID, jnp.array(lens)
    back = np.asarray(bent_back(straight(places, lens), lens))
    found = ~np.isnan(back[..., 0])
    inside = np.asarray(clear_of_folds(places, lens))
    away = np.abs(back - places).max(axis=-1)
    xx, xy, yy = map(np.asarray, jacobian(places, lens))
    eigenvalue = 0.5 * (xx + yy - np.hypot(xx - yy, 2 * xy))
    # Rounding grows by the inverse of the eigenvalue, to 1e-13.
    clear = inside & (eigenvalue > 1e-2)
    assert found[clear].all()
    assert (away[clear] < 1e-12).all()
    # A pixel that shows several directions gives the one inside the fold.
    assert np.asarray(clear_of_folds(back, lens))[found].all()
    assert (away[found & ~inside] > 0).all()


@pytest.mark.parametrize("way", [[1.0, 0.0], [0.0, 1.0], [-0.6, -0.8]])
def test_the_inverse_reaches_to_the_fold_and_ends_there(way):
    lens, way = jnp.array(BARREL), jnp.array(way)
    fold = fold_radius(BARREL, np.asarray(way)) * way
    for short in (0.5, 1e-3, 1e-6):
        place = fold * (1 - short)
        # the nearer the fold, the more a rounding moves the place: 1e-15/short, and
        # some 5 of a fold that is met aslant
        error = jnp.abs(bent_back(straight(place, lens), lens) - place).max()
        assert error < 1e-14 / short
    assert jnp.isnan(bent_back(straight(fold, lens) * (1 + 1e-6), lens)).all()


def test_a_masked_pixel_beyond_the_fold_has_finite_gradients():
    camera = dataclasses.replace(CAMERA, distortion=BARREL)

    @eqx.filter_jit
    def east(arguments):
        ray = unproject(*arguments)
        return jnp.sum(jnp.where(jnp.isnan(ray), 0.0, ray))

    pixels = jnp.array([[100.0, 50.0], [900.0, 129.5]])
    slopes = jax.tree.leaves(eqx.filter_grad(east)((camera, pixels)))
    assert all(jnp.isfinite(slope).all() for slope in slopes)
    assert any((slope != 0).any() for slope in slopes)


def test_gradients_are_those_of_finite_differences():
    arrays, static = eqx.partition(CAMERA, eqx.is_array)

    @jax.jit
    def ray(arrays, pixel):
        return unproject(eqx.combine(arrays, static), pixel)

    check_grads(ray, (arrays, jnp.array([[10.0, 20.0], [300.0, 200.0]])), order=1)
