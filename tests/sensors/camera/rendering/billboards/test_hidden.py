"""What hides a picture, or hides behind it, and gradients through it."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Scene
from jblast.sensors.camera import project
from jblast.sensors.camera.billboards import billboard
from jblast.sensors.camera.geometry import pixel_rays
from tests.sensors.camera.rendering.billboards.pictures import (
    BURST,
    SCALE,
    blob,
    camera,
    layer,
    scene_of,
    views_of,
)


def slopes(burst, eye=None, views=None):
    """Return the sum over an image, and its gradient in the place of the burst."""
    return _slopes(burst, eye or camera(), views or views_of())


@eqx.filter_jit
def _slopes(burst, eye, views):
    @jax.value_and_grad
    def light(place):
        return jnp.sum(layer(views, scene_of(place), eye))

    return light(burst)


def test_what_is_nearer_hides_it_as_a_whole():
    eye = camera()
    away = float(np.linalg.norm(BURST - np.asarray(eye.position)))
    whole = layer(views_of(), scene_of(), eye)
    depth = jnp.full((48, 64), away - 1.0)
    assert float(layer(views_of(), scene_of(), eye, depth=depth).max()) == 0.0
    half = depth.at[:, :32].set(jnp.inf)
    seen = layer(views_of(), scene_of(), eye, depth=half)
    np.testing.assert_array_equal(seen[:, :32], whole[:, :32])
    np.testing.assert_array_equal(seen[:, 32:], 0.0)


def test_the_ground_cuts_it_on_request():
    eye, low = camera(), scene_of(np.array([3.0, 40.0, 0.0]))
    rays = pixel_rays(eye, ground=False)
    board = billboard(views_of(), rays, low.charge)
    up = 1.5 + np.asarray(board.distance * rays.direction[2])
    whole = np.asarray(layer(views_of(), low, eye))
    cut = np.asarray(layer(views_of(), low, eye, ground=True))
    assert whole[up < -0.5][:, 3].max() > 0.3
    np.testing.assert_array_equal(cut[up < 0.0], 0.0)
    np.testing.assert_array_equal(cut[up > 0.0], whole[up > 0.0])


@pytest.mark.parametrize(
    "burst",
    [[0.0, -40.0, 1.5], [0.0, 0.0, 1.5], [40.0, 0.0, 1.5]],
    ids=["behind the camera", "at the camera", "beside it"],
)
def test_where_it_is_not_in_view_nothing_is_shown_and_all_is_finite(burst):
    value, slope = slopes(jnp.asarray(burst))
    assert float(value) == 0.0
    np.testing.assert_array_equal(slope, 0.0)


def test_the_nearer_of_two_charges_is_in_front():
    red, green = np.full((41, 41, 4), 255), np.full((41, 41, 4), 255)
    red[..., 1:3], green[..., [0, 2]] = 0, 0
    near, far = scene_of().charge, scene_of(1.5 * BURST, time_s=-0.1).charge
    # a charge of 0.1 s ago shows the second frame
    for charges in ((near, far), (far, near)):
        scene = Scene(
            charge=replace(charges[0], name="a"),
            others=(replace(charges[1], name="b"),),
        )
        pixel = project(camera(), BURST).pixel.round().astype(int)
        seen = layer(views_of(red, green), scene, camera())[pixel[1], pixel[0]]
        np.testing.assert_allclose(seen, [1.0, 0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.slow
def test_gradients_are_those_of_differences():
    weights = jnp.asarray(np.random.default_rng(0).random((48, 64, 4)))
    axis = jnp.asarray(np.random.default_rng(1).normal(size=12))

    @jax.jit
    def light(z):
        eye = eqx.tree_at(
            lambda c: (c.position, c.quaternion),
            camera(),
            (camera().position + z[:3], camera().quaternion + z[3:7]),
        )
        views = views_of(blob(), 0.5 * blob(), metres_per_pixel=SCALE * jnp.exp(z[7:8]))
        scene = scene_of(jnp.asarray(BURST) + z[8:11], time_s=-0.05 + z[11])
        seen = layer(views, scene, eye)
        return jnp.sum(weights * seen[..., 3:] * seen)

    start = jnp.zeros(12)
    gradient = jax.jit(jax.grad(light))(start)
    # so short that hardly a ray passes the centre of a pixel, where there is a kink
    step = 1e-7
    for way in (*jnp.eye(12), axis):
        there, back = light(start + step * way), light(start - step * way)
        slope = jnp.vdot(gradient, way)
        np.testing.assert_allclose(slope, (there - back) / (2 * step), rtol=1e-4)
