import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.scene import Charge
from jblast.sensors.camera.files.images import read_depth
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.geometry import pixel_rays
from jblast.sensors.camera.rendering import render
from tests.sensors.camera.fireball_scenes import one_charge, small_camera

CAMERA = small_camera((0.0, -60.0, 2.0), (0.0, 0.0, 2.0))
NEXT = np.array([0.5])


def saved(path, metres):
    if path.suffix == ".npy":
        np.save(path, metres)
    else:
        values = np.where(np.isfinite(metres), 1e3 * np.asarray(metres), 0.0)
        Image.fromarray(np.rint(values).astype(np.uint16)).save(path)
    return path


@pytest.mark.parametrize("name", ["wall.png", "wall.npy"])
def test_a_wall_across_the_axis_is_as_far_on_all_pixels_of_a_file(tmp_path, name):
    depth = read_depth(saved(tmp_path / name, np.full((18, 24), 21.5)), CAMERA)
    north = np.asarray(pixel_rays(CAMERA, ground=False).direction)[1]
    np.testing.assert_allclose(depth * north, 21.5, rtol=1e-12)


def test_zero_of_a_png_and_infinity_of_an_array_are_nothing_there(tmp_path):
    metres = np.full((18, 24), 5.0)
    metres[3, 4] = np.inf
    for name in ("a.png", "a.npy"):
        depth = read_depth(saved(tmp_path / name, metres), CAMERA)
        assert np.argwhere(np.isinf(depth)).tolist() == [[3, 4]]


def test_a_wall_hides_what_is_behind_it_and_fire_what_is_behind_that(tmp_path):
    near = one_charge(mass=20.0, up=2.0, name="near")
    far = Charge(mass_kg=20.0, position_m=(14.0, 60.0, 2.0), name="far")
    both = dataclasses.replace(near, others=(far,))
    dark = Appearance(flash=False)

    def alpha(scene, metres):
        if metres is None:
            depth = None
        else:
            file = saved(tmp_path / "wall.npy", np.full((18, 24), metres))
            depth = read_depth(file, CAMERA)
        options = {"depth": depth, "alpha": True, "appearance": dark}
        return np.asarray(render(scene, CAMERA, NEXT, **options))[0, ..., 3]

    assert alpha(both, 20.0).max() == 0.0
    single = alpha(near, None)
    assert single.max() > 0.9
    # between the two it hides the far one alone
    np.testing.assert_allclose(alpha(both, 90.0), single, atol=1e-12)
    assert (alpha(both, None) >= single).all()
    assert np.abs(alpha(both, None) - single).max() > 0.1


@pytest.mark.slow
def test_of_two_blasts_the_nearer_is_in_front_wherever_it_stands_in_the_scene():
    cool = one_charge(mass=20.0, up=2.0, time_s=-1.0)  # black smoke by then
    hot = Charge(mass_kg=20.0, position_m=(0.0, 60.0, 2.0), time_s=0.45, name="hot")
    black = dataclasses.replace(cool.charge, name="black")
    frames = [
        np.asarray(
            render(dataclasses.replace(cool, charge=a, others=(b,)), CAMERA, NEXT)
        )[0]
        for a, b in ((black, hot), (hot, black))
    ]
    np.testing.assert_allclose(frames[0], frames[1], rtol=1e-12)
    alone = np.asarray(
        render(
            dataclasses.replace(cool, charge=hot),
            CAMERA,
            NEXT,
            background=jnp.zeros(()),
        )
    )[0]
    row, column = np.unravel_index(np.argmax(alone[..., 0]), alone.shape[:2])
    assert alone[row, column, 0] > 1.0
    assert frames[0][row, column, 0] < 0.5 * alone[row, column, 0]


BAD = {
    "another size": (np.ones((18, 23)), "expected 24 x 18 pixels .* got 23 x 18"),
    "negative": (np.full((18, 24), -1.0), "above 0 m, got -1 at row 0, column 0"),
    "nan": (np.full((18, 24), np.nan), "above 0 m, got nan at row 0, column 0"),
    "a cube": (np.ones((18, 24, 3)), r"rows and columns, .*\(18, 24, 3\)"),
    "whole numbers": (np.ones((18, 24), int), "expected floats, in metres, got int64"),
}


@pytest.mark.parametrize(("metres", "said"), BAD.values(), ids=BAD)
def test_an_array_that_is_none_is_refused_by_name(tmp_path, metres, said):
    with pytest.raises(InputError, match=f"depth.npy: expected {said}|{said}"):
        read_depth(saved(tmp_path / "depth.npy", metres), CAMERA)


def test_a_file_that_is_none_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"no\.npy: .* but No such file"):
        read_depth(tmp_path / "no.npy", CAMERA)
    for name, said in (("x.npy", "not an array of numbers"), ("x.png", "PNG image")):
        (tmp_path / name).write_bytes(b"nothing")
        with pytest.raises(InputError, match=rf"{name}: expected .*{said}"):
            read_depth(tmp_path / name, CAMERA)
    Image.fromarray(np.zeros((18, 24), np.uint8)).save(tmp_path / "grey.png")
    with pytest.raises(InputError, match=r"millimetres.*got a PNG with 8 bits"):
        read_depth(tmp_path / "grey.png", CAMERA)
    Image.fromarray(np.zeros((18, 24, 3), np.uint8)).save(tmp_path / "colours.png")
    with pytest.raises(InputError, match="got a PNG with"):
        read_depth(tmp_path / "colours.png", CAMERA)
    np.save(tmp_path / "pickled.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match=r"pickled\.npy: expected"):
        read_depth(tmp_path / "pickled.npy", CAMERA)
