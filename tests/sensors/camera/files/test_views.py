"""Explosion sets, simulated and of one's own pictures, are read or refused by name."""

import shutil

import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.sensors.camera.files.views import explosion_views
from jblast.waves.fireballs import fireball_duration
from tests.sensors.camera.rendering.baked.noise_set import (
    ANCHOR,
    PHASES,
    SIZE,
    directions,
    picture,
    write_noise_set,
)

TOP = "frames_hz = 30.0\nmetres_per_pixel = 0.05\ncharge_mass_kg = 8.0\n"
SOUTH = '[[view]]\nframes = "south"\nazimuth_deg = 180.0\n'
EAST = '[[view]]\nframes = "east"\nazimuth_deg = 90\n'


@pytest.fixture(scope="module")
def noise_set(tmp_path_factory):
    return write_noise_set(tmp_path_factory.mktemp("set"), lossless=True)


@pytest.fixture
def copy(noise_set, tmp_path):
    return shutil.copytree(noise_set, tmp_path / "set")


def save(path, value=0, size=(4, 6), channels=4):
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.full((*size, channels), value, np.uint8)).save(path)


@pytest.fixture
def own(tmp_path):
    for name in ("south", "east"):
        for k in range(3):
            save(tmp_path / name / f"{k:04d}.png", 10 * k)

    def indexed(text):
        (tmp_path / "views.toml").write_text(text)
        return tmp_path

    return indexed


def test_own_pictures_have_size_time_and_direction(own):
    high = "elevation_deg = 30\nmetres_per_pixel = 0.1\nanchor_px = [1, 3]\n"
    views = explosion_views(own(TOP + SOUTH + EAST + high))
    high = np.array([0.75**0.5, 0, 0.5])
    np.testing.assert_allclose(views.direction[0], [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(views.direction[1], high, atol=1e-15)
    np.testing.assert_allclose(views.up, [[0, 0, 1], [-0.5, 0, high[0]]], atol=1e-15)
    np.testing.assert_allclose(views.anchor, [[2.5, 1.5], [1, 3]])
    # 1 m/kg^(1/3) of 8 kg is 2 m; the frames are followed by a blank one
    np.testing.assert_allclose(views.radius, [[40.0] * 4, [20.0] * 4])
    seconds = np.asarray(views.phase) * float(fireball_duration(8.0))
    np.testing.assert_allclose(seconds, np.arange(4) / 30.0, rtol=1e-6)
    assert views.frames.shape == (2, 4, 4, 6, 5)
    np.testing.assert_array_equal(views.frames[0, :, 0, 0, 1], [0, 10, 20, 0])
    np.testing.assert_array_equal(views.frames[0, :, 0, 0, 4], [0, 10, 20, 0])
    assert not views.hot
    assert not np.asarray(views.frames[..., 0]).any()


def test_sheets_are_cut_into_heat_colour_and_opacity(noise_set):
    views = explosion_views(noise_set)
    count = len(directions())
    assert views.frames.shape == (count, len(PHASES), SIZE, SIZE, 5)
    heat, shade, alpha, radius = picture(PHASES[4], *directions()[2])
    texels = np.asarray(views.frames[2, 4]) / 255.0
    # a half of a step of 8 bits; faint pixels are left out
    there = alpha[..., 0] > 3 / 255
    expected = np.concatenate([heat, shade, alpha], axis=-1)[there]
    np.testing.assert_allclose(texels[there], expected, atol=0.51 / 255)
    assert float(views.radius[2, 4]) == pytest.approx(radius, abs=1e-4)
    np.testing.assert_allclose(views.anchor, [ANCHOR] * count)
    np.testing.assert_allclose(views.phase, PHASES, rtol=1e-6)
    rows, columns = np.nonzero(texels[..., 4])
    box = [columns.min(), columns.max(), rows.min(), rows.max()]
    np.testing.assert_array_equal(views.box[2, 4], box)


def test_only_views_that_are_shown_are_decoded(copy):
    whole = (copy / "00.webp").read_bytes()
    (copy / "00.webp").write_bytes(whole[:300] + bytes(len(whole) - 300))
    towards = [np.sin(2.5), np.cos(2.5), 0.2]  # 143 degrees, between rings
    near = explosion_views(copy, towards=towards)
    assert near.frames.shape[0] == 1
    np.testing.assert_allclose(near.direction[0] @ np.array(towards), 1.0, atol=0.03)


OWN = {
    "no TOML": (TOP + "[[view]", r"views\.toml: broken TOML"),
    "no scale": (
        "frames_hz = 30\ncharge_mass_kg = 5\n" + SOUTH,
        "1 metres_per_pixel: ",
    ),
    "no mass": (TOP.replace("charge", "#") + SOUTH, "charge_mass_kg: .*got nothing"),
    "no views": (TOP, r"expected views written \[\[view\]\], got none"),
    "no table": (TOP + "view = [1]\n", r"\[\[view\]\] 1: expected a table, got 1"),
    "an unknown key": (TOP + "fps = 3\n" + SOUTH, "fps: .*got an unknown key"),
    "a misspelt key": (TOP + SOUTH + "anchr_px = [1, 2]\n", "did you mean anchor_px"),
    "no direction": (TOP + '[[view]]\nframes = "south"\n', "azimuth_deg: .*nothing"),
    "too high": (TOP + SOUTH + "elevation_deg = 91\n", "elevation_deg: .*got 91"),
    "from below": (
        TOP + SOUTH + "elevation_deg = -1\n",
        "above the ground, got 1 from",
    ),
    "no such folder": (TOP + SOUTH.replace("south", "w"), "w: .*no such directory"),
    "no frames": (TOP + "[[view]]\nazimuth_deg = 1\n", "frames: expected a folder"),
    "a word": (TOP.replace("30.0", "'fast'") + SOUTH, "frames_hz: .*got 'fast'"),
    "srgb": (TOP + "srgb = 1\n" + SOUTH, "srgb: expected true or false, got 1"),
}


@pytest.mark.parametrize(("text", "message"), OWN.values(), ids=OWN)
def test_an_index_that_cannot_be_used_is_refused(own, text, message):
    with pytest.raises(InputError, match=message) as refused:
        explosion_views(own(text))
    assert str(own(text)) in str(refused.value)


@pytest.mark.parametrize(
    ("name", "how", "message"),
    [
        ("south/0001.png", {"channels": 3}, r"south/0001\.png: .*alpha"),
        ("south/0002.png", {"size": (5, 6)}, r"0002\.png: expected 6 x 4 .*got 6 x 5"),
        ("east/0003.png", {}, "east: expected 3 frames .* in the first view, got 4"),
    ],
)
def test_frames_that_do_not_fit_are_named(own, tmp_path, name, how, message):
    save(tmp_path / name, **how)
    with pytest.raises(InputError, match=message):
        explosion_views(own(TOP + SOUTH + EAST))


def sheet(copy, change):
    with Image.open(copy / "03.webp") as image:
        changed = change(image.convert("RGBA"))
    changed.save(copy / "03.webp", format="WEBP", lossless=True)


def text(copy, old, new):
    whole = (copy / "views.toml").read_text()
    assert old in whole
    (copy / "views.toml").write_text(whole.replace(old, new, 1))


SIMULATED = {
    "no index": (lambda c: (c / "views.toml").unlink(), "set: .*, got no index"),
    "another kind": (lambda c: text(c, '"explosion"', '"fire"'), "kind: .*got 'fire'"),
    "a missing file": (lambda c: (c / "03.webp").unlink(), r"03\.webp: no such file"),
    "cut short": (
        lambda c: (c / "03.webp").write_bytes((c / "03.webp").read_bytes()[:2000]),
        r"03\.webp: expected a complete WebP image",
    ),
    "another size": (
        lambda c: sheet(c, lambda i: i.crop((0, 0, 200, 256))),
        r"03\.webp: expected 256 x 256 pixels, 7 frames .*got 200 x 256",
    ),
    "falling phases": (
        lambda c: text(c, "0.002, 0.006", "0.006, 0.002"),
        r"phases: expected rising numbers, got \[0\.006, 0\.002",
    ),
    "too many radii": (
        lambda c: text(c, "radius_px = [", "radius_px = [1.0, "),
        "radius_px: expected 7 numbers, one per phase, got 8",
    ),
    "a radius of zero": (
        lambda c: text(c, "radius_px = [", "radius_px = [0.0, "),
        r"radius_px\[0\]: .* got 0\.0",
    ),
    "no anchor": (lambda c: text(c, "anchor_px", "#"), "1 anchor_px: expected"),
    "an unknown key": (lambda c: text(c, "columns", "colums"), "did you mean columns"),
    "no file": (lambda c: text(c, "file", "#"), "file: expected a WebP file"),
}


@pytest.mark.parametrize(("change", "message"), SIMULATED.values(), ids=SIMULATED)
def test_a_set_that_cannot_be_used_is_refused(copy, change, message):
    change(copy)
    with pytest.raises(InputError, match=message) as refused:
        explosion_views(copy)
    assert str(copy) in str(refused.value)
