"""Explosion sets read from files: what is taken, and what is refused by name."""

import shutil

import numpy as np
import pytest
from PIL import Image

from jblast.errors import InputError
from jblast.sensors.camera.files.views import (
    explosion_views,
    is_explosion_set,
    read_views,
)
from tests.sensors.camera.rendering.baked.noise_set import (
    ANCHOR,
    PHASES,
    SIZE,
    directions,
    picture,
    write_noise_set,
)


@pytest.fixture(scope="module")
def noise_set(tmp_path_factory):
    return write_noise_set(tmp_path_factory.mktemp("set"), lossless=True)


@pytest.fixture
def copy(noise_set, tmp_path):
    return shutil.copytree(noise_set, tmp_path / "set")


def test_sheets_are_cut_into_heat_colour_and_opacity(noise_set):
    views = explosion_views(noise_set)
    count = len(directions())
    assert views.frames.shape == (count, len(PHASES), SIZE, SIZE, 5)
    heat, shade, alpha, radius = picture(PHASES[4], *directions()[2])
    texels = np.asarray(views.frames[2, 4]) / 255.0
    # a half of a step of 8 bits; what is hardly there is left out
    there = alpha[..., 0] > 3 / 255
    np.testing.assert_allclose(texels[there][:, :1], heat[there], atol=0.51 / 255)
    np.testing.assert_allclose(texels[there][:, 1:4], shade[there], atol=0.51 / 255)
    np.testing.assert_allclose(texels[there][:, 4:], alpha[there], atol=0.51 / 255)
    assert float(views.radius[2, 4]) == pytest.approx(radius, abs=1e-4)
    np.testing.assert_allclose(views.anchor, [ANCHOR] * count)
    np.testing.assert_allclose(views.phase, PHASES, rtol=1e-6)
    first, last, top, bottom = np.asarray(views.box[2, 4]).astype(int)
    rows, columns = np.nonzero(texels[..., 4])
    assert (first, last) == (columns.min(), columns.max())
    assert (top, bottom) == (rows.min(), rows.max())


def test_only_views_that_are_shown_are_decoded(copy, noise_set):
    towards = [np.sin(2.5), np.cos(2.5), 0.2]  # 143 degrees, between rings
    whole = (copy / "00.webp").read_bytes()
    (copy / "00.webp").write_bytes(whole[:300] + bytes(len(whole) - 300))
    near = explosion_views(copy, towards=towards)
    assert near.frames.shape[0] == 1
    np.testing.assert_allclose(near.direction[0] @ np.array(towards), 1.0, atol=0.03)


def sheet(copy, change):
    with Image.open(copy / "03.webp") as image:
        changed = change(image.convert("RGBA"))
    changed.save(copy / "03.webp", format="WEBP", lossless=True)


def text(copy, old, new):
    index = copy / "views.toml"
    whole = index.read_text()
    assert old in whole
    index.write_text(whole.replace(old, new, 1))


BROKEN = {
    "no index": (lambda c: (c / "views.toml").unlink(), "set: has no index"),
    "another kind": (
        lambda c: text(c, '"explosion"', '"fire"'),
        "kind: expected \"explosion\", got 'fire'",
    ),
    "a missing file": (
        lambda c: (c / "03.webp").unlink(),
        r"03\.webp: no such file; expected a complete WebP",
    ),
    "cut short": (
        lambda c: (c / "03.webp").write_bytes((c / "03.webp").read_bytes()[:2000]),
        r"03\.webp: expected a complete WebP image, got 2,000 of",
    ),
    "another format": (
        lambda c: Image.new("RGBA", (9, 9)).save(c / "03.webp", format="PNG"),
        r"03\.webp: expected a complete WebP image, got something else",
    ),
    "another size": (
        lambda c: sheet(c, lambda i: i.crop((0, 0, 200, 256))),
        r"03\.webp: expected 256 x 256 pixels, 7 frames .*got 200 x 256",
    ),
    "no alpha": (
        lambda c: sheet(c, lambda i: i.convert("RGB")),
        r"^\S*03\.webp: expected an image with alpha, got RGB$",
    ),
    "falling phases": (
        lambda c: text(c, "0.002, 0.006", "0.006, 0.002"),
        r"phases: expected rising numbers, got 0\.002 after 0\.006",
    ),
    "too few radii": (
        lambda c: text(c, "radius_px = [", "radius_px = [1.0, "),
        "radius_px: expected 7 numbers, one per phase, got 8",
    ),
    "a radius of zero": (
        lambda c: text(c, "radius_px = [", "radius_px = [0.0, "),
        r"radius_px: expected a positive number, got 0\.0",
    ),
    "no anchor": (lambda c: text(c, "anchor_px", "#"), "1 anchor_px: expected"),
    "an unknown key": (lambda c: text(c, "columns", "colums"), "did you mean columns"),
    "no file": (lambda c: text(c, "file", "#"), "file: expected a WebP file, got None"),
}


@pytest.mark.parametrize(("change", "said"), BROKEN.values(), ids=BROKEN)
def test_a_set_that_cannot_be_used_is_refused(copy, change, said):
    change(copy)
    with pytest.raises(InputError, match=said) as refused:
        explosion_views(copy)
    assert str(copy) in str(refused.value)


def test_each_reader_tells_of_what_it_does_not_read(noise_set, tmp_path):
    assert is_explosion_set(noise_set)
    with pytest.raises(InputError, match="is read by `explosion_views`"):
        read_views(noise_set)
    below = write_noise_set(tmp_path / "set", views=[(0.0, -20.0), (90.0, -5.0)])
    with pytest.raises(InputError, match="from above the ground, got 2 from below"):
        explosion_views(below)
    (tmp_path / "views.toml").write_text("frames_hz = 30.0\n")
    assert not is_explosion_set(tmp_path)
    with pytest.raises(InputError, match='kind: expected "explosion", got None'):
        explosion_views(tmp_path)
