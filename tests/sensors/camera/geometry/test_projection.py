import csv
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation

from jblast.scene import Camera, look_at
from jblast.sensors.camera import geometry

TABLE = Path(__file__).with_name("opencv_projections.csv").read_text().splitlines()
ROWS = list(csv.DictReader(line for line in TABLE if not line.startswith("#")))
project = eqx.filter_jit(geometry.project)
LENSES = sorted({row["lens"] for row in ROWS})


def camera_at(position=(0.0, 0.0, 0.0), target=(0.0, 9.0, 0.0), distortion=(0.0,) * 5):
    """A camera that looks north, 346 pixels by 260."""
    return Camera(
        position=np.array(position),
        quaternion=look_at(np.array(position), np.array(target)),
        focal=np.array([300.0, 310.0]),
        center=np.array([172.5, 129.5]),
        width=346,
        height=260,
        distortion=np.array(distortion),
    )


def numbers(row, *names):
    return np.array([float(row[name]) for name in names])


@pytest.mark.parametrize("lens", LENSES)
def test_pixels_are_those_of_opencv(lens):
    rows = [row for row in ROWS if row["lens"] == lens]
    turned = Rotation.from_rotvec(
        numbers(rows[0], "rotation_x", "rotation_y", "rotation_z")
    )
    camera = Camera(
        position=numbers(rows[0], "camera_east_m", "camera_north_m", "camera_up_m"),
        quaternion=turned.inv().as_quat(),
        focal=numbers(rows[0], "focal_x", "focal_y"),
        center=numbers(rows[0], "center_x", "center_y"),
        width=640,
        height=480,
        distortion=numbers(rows[0], "k1", "k2", "p1", "p2", "k3"),
    )
    points = np.stack([numbers(row, "east_m", "north_m", "up_m") for row in rows])
    pixels = np.stack([numbers(row, "pixel_x", "pixel_y") for row in rows])
    projected = project(camera, points)
    assert projected.seen.all()
    # some thousand pixels, with rounding of a dozen operations each way: 7e-13
    np.testing.assert_allclose(projected.pixel, pixels, rtol=0, atol=1e-11)


def test_up_is_up_and_east_is_right_of_a_camera_that_looks_north():
    projected = project(camera_at(), np.array([[1.0, 10.0, 0.0], [0.0, 10.0, 1.0]]))
    expected = [[172.5 + 30, 129.5], [172.5, 129.5 - 31]]
    np.testing.assert_allclose(projected.pixel, expected, atol=1e-12)
    np.testing.assert_allclose(projected.depth, [10, 10], rtol=1e-15)


def test_only_pixels_of_the_image_are_within_it():
    camera = camera_at()
    edges = (np.array([-0.5, 345.5]) - 172.5) / 300  # the outer edges of its pixels
    across = np.stack([edges * (1 - 1e-9), edges * (1 + 1e-9)])
    points = np.stack([across, np.ones((2, 2)), np.zeros((2, 2))], axis=-1)
    within = project(camera, points).within(camera)
    assert within.tolist() == [[True, True], [False, False]]


# Behind, in the camera's own place and plane, and so near the plane that the sixth
# power of the tangent leaves even float64.
UNSEEN = [[0, -5, 0], [3, -1e-3, 2], [0, 0, 0], [4, 0, 1], [4, 1e-60, 1], [1e9, 1, 0]]


@pytest.mark.parametrize("lens", [[0.0] * 5, [0.2, 0.1, 0.01, 0.02, 0.3]])
@pytest.mark.parametrize("point", UNSEEN)
def test_what_is_behind_is_marked_and_its_gradients_are_finite(lens, point):
    camera, point = camera_at(distortion=lens), jnp.array(point, float)

    @eqx.filter_jit
    def loss(arguments):
        projected = project(*arguments)
        weight = jnp.exp(-1e-4 * jnp.sum(jnp.square(projected.pixel)))
        return jnp.where(projected.seen, weight, 0.0)

    assert not project(camera, point).seen
    assert project(camera, point).depth == pytest.approx(point[1])
    slopes = jax.tree.leaves(eqx.filter_grad(loss)((camera, point)))
    assert all(jnp.isfinite(slope).all() for slope in slopes)


def test_what_a_barrel_lens_folds_back_into_the_image_is_not_seen():
    camera = camera_at(distortion=[-0.3, 0.0, 0.0, 0.0, 0.0])
    fold = 1 / np.sqrt(0.9)  # where 1 + 3 k1 r^2 is zero
    tangents = fold * np.array([0.5, 1 - 1e-9, 1 + 1e-9, 1.5])
    points = np.stack([tangents, np.ones(4), np.zeros(4)], axis=-1)
    projected = project(camera, points)
    assert 0 < projected.pixel[3, 0] < 345  # it would seem to be in the image
    assert not projected.within(camera)[3]
    assert projected.seen.tolist() == [True, True, False, False]


def test_gradients_are_those_of_finite_differences():
    camera = camera_at([1.0, -20.0, 2.0], [0.0, 0, 4], [-0.3, 0.1, 2e-3, -3e-3, 0.02])
    arrays, static = eqx.partition(camera, eqx.is_array)

    @jax.jit
    def pixel(arrays, points):
        projected = project(eqx.combine(arrays, static), points)
        return projected.pixel, projected.depth

    points = jnp.array([[3.0, 2.0, 1.0], [-6.0, 5.0, 7.0]])
    check_grads(pixel, (arrays, points), order=1)
