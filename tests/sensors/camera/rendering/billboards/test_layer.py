"""Pictures that stand for a fireball: which is shown, where, when, and behind what."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Scene, look_at, quaternion_matrix
from jblast.sensors.camera import project, unproject
from jblast.sensors.camera.billboards import billboard, nearest_view
from jblast.sensors.camera.geometry import Rays, pixel_rays
from jblast.sensors.camera.image import resampled
from tests.sensors.camera.rendering.billboards.pictures import (
    BURST,
    MASS,
    SCALE,
    blob,
    camera,
    layer,
    scene_of,
    views_of,
)


def test_the_nearest_view_is_the_one_of_the_largest_dot_product():
    directions = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0.6, 0.8], [-1.0, 0, 0]])
    views = views_of(
        frames=jnp.zeros((4, 1, 3, 3, 4), jnp.uint8),
        direction=directions,
        up=np.full((4, 3), 0.5),
        metres_per_pixel=np.full(4, SCALE),
        anchor=np.ones((4, 2)),
    )
    for number, direction in enumerate(directions):
        near = jnp.asarray(7.0 * direction + 0.2)
        assert nearest_view(views, near) == number
    # the half way between north and the raised view, to either side
    for elevation, number in ((26.0, 1), (27.0, 2)):
        turn = np.radians(elevation)
        assert nearest_view(views, jnp.array([0, np.cos(turn), np.sin(turn)])) == number
    # the camera stands south and above: its view is none of these but the nearest
    seen = billboard(views, pixel_rays(camera()), scene_of().charge)
    assert seen.view == 3


def test_a_place_on_the_billboard_is_shown_at_its_pixel():
    # through the lens there, and through its inverse and the picture back
    eye = camera()
    axes = quaternion_matrix(look_at(eye.position, BURST))
    offsets = np.array([[0.0, 0.0], [1.2, -0.7], [-2.0, 1.5]])  # right, down [m]
    places = BURST + offsets @ np.asarray(axes[:, :2]).T
    unit = unproject(eye, project(eye, places).pixel).T[:, None]
    rays = Rays(eye.position, unit, jnp.full((1, 3), jnp.inf))
    seen = billboard(views_of(), rays, scene_of().charge)
    met = np.stack([seen.x[0], seen.y[0]], axis=-1)
    # half a metre below the burst it leans by 2e-7, over 20 pixels
    np.testing.assert_allclose(met, 20.0 + offsets / SCALE, atol=1e-5)
    away = np.linalg.norm(places - np.asarray(eye.position), axis=-1)
    np.testing.assert_allclose(seen.distance[0], away, rtol=1e-9)


def seen_from(place, direction, up):
    """Return which way of the world is up on the billboard of one view."""
    place = np.asarray(place, float)
    east, north, above = place / np.linalg.norm(place)
    eye, ahead = jnp.asarray(place), -np.array([east, north, above])
    # two directions across the line of sight, and what the picture's axes say of them
    aside = np.cross(ahead, [0.3, 0.5, 0.8])
    across = np.stack([aside, np.cross(ahead, aside)]) / np.linalg.norm(aside)
    unit = ahead + 1e-3 * across
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    views = views_of(direction=[direction], up=[up], anchor=[[0.0, 0.0]])
    rays = Rays(eye, jnp.asarray(unit.T[:, None]), jnp.full((1, 2), jnp.inf))
    board = billboard(views, rays, scene_of(np.zeros(3)).charge)
    turn = np.stack([board.x[0], -board.y[0]]) * SCALE / (1e-3 * np.linalg.norm(place))
    return turn[1] @ across


SOUTH, UP, NORTH = [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("direction", "up"), [(SOUTH, UP), (UP, NORTH), ([0.0, -0.6, 0.8], [0, 0.8, 0.6])]
)
def test_a_step_of_a_viewer_near_the_zenith_turns_no_picture(direction, up):
    steps = [[0.005, 0.0], [-0.005, 0.0], [0.0, 0.005], [0.0, -0.005], [0.0, 0.0]]
    ups = [seen_from([*step, 40.0], direction, up) for step in steps]
    # 1 cm at 40 m is 2.5e-4 rad; the field of ups bends a few times faster at most
    assert np.ptp(ups, axis=0).max() < 2e-3
    np.testing.assert_allclose(ups[-1], NORTH, atol=1e-6)


def test_a_level_view_stays_upright_from_all_around():
    for azimuth in np.radians([0.0, 30.0, 90.0, 170.0]):
        east, south = 40.0 * np.sin(azimuth), 40.0 * np.cos(azimuth)
        level = seen_from([east, -south, 0.0], SOUTH, UP)
        np.testing.assert_allclose(level, UP, atol=1e-6)
        raised = seen_from([east, -south, 7.0], SOUTH, UP)
        # it leans aside by the third power of the sine of ten degrees at most
        assert abs(raised @ [south, east, 0.0]) / 40.0 < 0.0055
        assert raised[2] > 0.98


def test_another_charge_is_shown_as_the_law_of_its_fireball_has_it():
    """Twice as wide for eight times the mass, and slower by the law's 8^0.349."""
    frames = [np.full((41, 41, 4), 255 * share) for share in (0.2, 1.0)]
    views = views_of(*frames, frames_hz=10.0)
    rays = pixel_rays(camera())
    one, eight = (scene_of(mass=MASS * times).charge for times in (1.0, 8.0))
    small, large = (billboard(views, rays, charge) for charge in (one, eight))
    np.testing.assert_allclose(large.x - 20.0, 0.5 * (small.x - 20.0), atol=1e-9)
    np.testing.assert_allclose(large.distance, small.distance)
    alphas = [
        float(layer(views, scene_of(mass=MASS * times), camera(), at)[..., 3].max())
        for times, at in ((1.0, 0.05), (8.0, 0.05 * 8**0.349), (8.0, 0.05))
    ]
    assert alphas[0] == pytest.approx(0.6)
    assert alphas[1] == pytest.approx(0.6)
    assert alphas[2] == pytest.approx(0.2 + 0.8 * 0.5 / 8**0.349)


def test_the_colour_of_what_is_transparent_does_not_bleed():
    picture = np.full((3, 3, 4), 255.0)
    picture[..., 3] = 0.0
    picture[1, 1] = [51.0, 0.0, 0.0, 255.0]
    x, y = jnp.array([[[1.5, 1.25, -2.0, -5.0]], [[1.0, 0.75, -2.0, 1e9]]])
    straight = picture[..., :3] / 255 * picture[..., 3:] / 255
    picture = np.concatenate([straight, picture[..., 3:] / 255], axis=-1)
    seen = resampled(jnp.asarray(picture), x, y)[:, 0].T
    np.testing.assert_allclose(seen[:, 3], [0.5, 0.5625, 0.0, 0.0])
    np.testing.assert_allclose(seen[:, 0], 0.2 * seen[:, 3])
    np.testing.assert_array_equal(seen[:, 1:3], 0.0)


def test_srgb_pictures_are_decoded():
    square = np.full((41, 41, 4), 255)
    square[..., :3] = 188  # half of full light
    seen = layer(views_of(square, square, srgb=True), scene_of(), camera())
    assert float(seen[..., 0].max()) == pytest.approx(0.503, abs=1e-3)
    seen = layer(views_of(square, square), scene_of(), camera())
    assert float(seen[..., 0].max()) == pytest.approx(188 / 255)


def test_time_runs_from_the_burst_and_is_linear_between_frames():
    frames = [np.full((41, 41, 4), 255 * share) for share in (0.2, 1.0)]
    scene = scene_of(time_s=5.0)

    def alpha(time):
        return float(layer(views_of(*frames), scene, camera(), time)[..., 3].max())

    assert alpha(4.999) == 0.0
    assert alpha(5.0) == pytest.approx(0.2)
    assert alpha(5.05) == pytest.approx(0.6)
    assert alpha(5.1) == pytest.approx(1.0)
    assert alpha(5.15) == pytest.approx(0.5)  # fades out after the last
    assert alpha(5.2) == pytest.approx(0.0, abs=1e-9)
    assert alpha(99.0) == 0.0


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
            charges=(replace(charges[0], name="a"), replace(charges[1], name="b")),
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
