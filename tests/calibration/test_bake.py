"""Baking of views, with a small program in place of Blender."""

import math
import sys
import tomllib

import numpy as np
import pytest
from PIL import Image

from calibration import bake
from jblast.sensors.camera import explosion_views
from tests.calibration import fake_blender

RECIPE = bake.Recipe(views=3, frames=4, size=32)
PICTURES = 8
"""Of a view: four frames, twice."""


@pytest.fixture
def blender(tmp_path, monkeypatch) -> str:
    monkeypatch.setattr(bake, "LOOK_S", 0.02)
    program = tmp_path / "blender"
    program.write_text(
        f'#!/bin/sh\nexec "{sys.executable}" "{fake_blender.__file__}" "$@"\n'
    )
    program.chmod(0o755)
    return str(program)


def test_an_interrupted_set_is_continued_and_shows_what_was_rendered(
    blender, tmp_path, monkeypatch
):
    out = tmp_path / "set"
    monkeypatch.setenv("FAKE_BLENDER", f"{PICTURES + 3}")
    with pytest.raises(SystemExit, match=r"blender\.log: Blender ended with code 1"):
        bake.bake(RECIPE, out, blender)
    assert "out of memory" in (out / ".bake/blender.log").read_text()
    first = (out / "00.webp").stat().st_mtime_ns
    with pytest.raises(SystemExit, match="another set"):
        bake.bake(RECIPE._replace(seed=7), out, blender)
    monkeypatch.delenv("FAKE_BLENDER")
    bake.bake(RECIPE, out, blender)
    assert (out / "00.webp").stat().st_mtime_ns == first
    assert sorted(path.name for path in out.iterdir()) == [
        *("00.webp", "01.webp", "02.webp", "views.toml"),
    ]
    with pytest.raises(SystemExit, match="another set"):
        bake.bake(RECIPE, out, blender)
    assert len(explosion_views(out).direction) == 3
    index = tomllib.loads((out / "views.toml").read_text())
    drawn = [32 * (0.15 + 0.02 * number) for number in range(4)]
    for view in index["view"]:
        # a ball of pixels is off its circle by a fifth of a pixel, the coding as much
        np.testing.assert_allclose(view["radius_px"], drawn, atol=0.4)
    frame = bake.frames_of(out / "00.webp", 32, 4)[-1]
    middle = slice(13, 19), slice(13, 19)
    # eight bits, and what a lossy picture changes far from its edges
    for layer, value in zip(frame, (1.0, 0.25, 1.0), strict=True):
        np.testing.assert_allclose(layer[middle], value, atol=0.03)
    assert frame.alpha[0, 0] == 0.0


@pytest.mark.parametrize("number", [1, 5, 12])
def test_frames_come_back_from_a_sheet_within_its_eight_bits(tmp_path, number):
    draw = np.random.default_rng(0)
    frames = [
        bake.Layers(
            draw.uniform(0.0, 1.0, (4, 4)),
            draw.uniform(0.0, 1.0, (4, 4, 3)),
            draw.uniform(0.1, 1.0, (4, 4)),
        )
        for _ in range(number)
    ]
    picture = bake.sheet(frames, bake.columns_for(number))
    path = tmp_path / "00.webp"
    Image.fromarray(picture).save(path, lossless=True, exact=True)
    half, inside = 0.5 / 255 + 1e-9, np.s_[1:-1, 1:-1]  # the margin is transparent
    for frame, back in zip(frames, bake.frames_of(path, 4, number), strict=True):
        # the slope of sRGB's curve is at most 2.3
        for one, other, slope in zip(frame, back, (1.0, 2.3, 1.0), strict=True):
            np.testing.assert_allclose(other[inside], one[inside], atol=slope * half)
        assert not back.alpha[0].any()


def test_the_radius_of_a_disc_and_of_half_a_disc_is_its_radius():
    y, x = np.mgrid[:128, :128]
    disc = (np.hypot(x - 60, y - 99.5) < 25.0).astype(float)
    half = np.where(y < 100, disc, 0.45)  # and thin dust
    # pixels on the edge are in or out: a fraction of a pixel
    assert bake.visible_radius(disc) == pytest.approx(25.0, abs=0.25)
    assert bake.visible_radius(half) == pytest.approx(25.0, abs=0.25)
    assert bake.visible_radius(0 * half) == 0.0


def test_the_offset_lattice_packs_better_than_the_plain_one():
    distance = [
        math.degrees(bake.packing_distance(lattice(32)))
        for lattice in (bake.offset_lattice, bake.fibonacci_lattice)
    ]
    assert distance == pytest.approx([23.3, 22.3], abs=0.05)  # digits
