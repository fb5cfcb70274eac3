import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.sensors.camera.geometry import (
    distort,
    distortion_jacobian,
    fold_radius,
    unfolded,
)
from tests.sensors.camera.geometry.lenses import LENS

PLACE = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)).map(np.array)
NORTH = np.array([0.0, 1.0])
jacobian_by_jax = jax.jit(jax.jacfwd(distort))
first_fold, clear_of_folds = jax.jit(fold_radius), jax.jit(unfolded)


def determinant(point, lens):
    return np.linalg.det(np.asarray(jacobian_by_jax(jnp.array(point), lens)))


@settings(deadline=None, max_examples=50)
@given(PLACE, LENS)
def test_the_jacobian_is_symmetric_and_that_of_the_map(point, lens):
    point, lens = jnp.array(point), jnp.array(lens)
    xx, xy, yy = distortion_jacobian(point, lens)
    jacobian = jacobian_by_jax(point, lens)
    # cancellation among terms of up to 10
    np.testing.assert_allclose(jacobian, [[xx, xy], [xy, yy]], atol=1e-13)


@pytest.mark.parametrize(
    ("lens", "radius"),
    [
        ([-0.2, 0, 0, 0, 0], 1 / np.sqrt(0.6)),  # 1 + 3 k1 r^2 = 0
        ([0, -0.1, 0, 0, 0], 2**0.25),  # 1 + 5 k2 r^4 = 0
        ([0, 0, 0, 0, -0.1], (1 / 0.7) ** (1 / 6)),  # 1 + 7 k3 r^6 = 0
        ([0, 0, 0, -0.05, 0], 1 / 0.1),  # along y: 1 + 2 p2 x and its fellow, b = p2
        ([0, 0, 0, 0, 0], np.inf),
        ([0.3, 0, 0, 0, 0], np.inf),
        ([-0.2, 0.1, 0, 0, 0], np.inf),  # 1 - 0.6 r^2 + 0.5 r^4 has no root
    ],
)
def test_folds_are_where_the_formula_has_them(lens, radius):
    found = fold_radius(jnp.array(lens, float), jnp.array(3.0 * NORTH))
    assert found == pytest.approx(radius, rel=1e-14)


def test_a_decentred_lens_folds_nearer_on_one_side():
    lens = jnp.array([-0.35, 0.12, 0.01, 0.02, -0.02])
    angles = np.linspace(0, 2 * np.pi, 9)
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    radii = fold_radius(lens, jnp.array(ways))
    assert radii.max() > 1.1 * radii.min()
    for way, radius in zip(ways, radii, strict=True):
        inside, beyond = (
            determinant(way * radius * f, lens) for f in (1 - 1e-9, 1 + 1e-9)
        )
        assert inside > 0 > beyond


@settings(deadline=None, max_examples=50)
@given(LENS)
def test_a_place_is_unfolded_if_the_fold_lies_beyond(lens):
    angles = np.linspace(0.0, 6.0, 25)
    ways = jnp.array(np.stack([np.cos(angles), np.sin(angles)], axis=-1))
    lens = jnp.array(lens)
    folds = first_fold(lens, ways)
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
