"""How a set is made, gone on with and refused; a small program stands for Blender."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.progress import Listener, heard_by
from jblast.sensors.camera.bake import baking
from jblast.sensors.camera.bake.baking import WORK, Baking, read_sheet
from jblast.sensors.camera.bake.coding import frames_of_sheet
from jblast.sensors.camera.bake.recipe import Recipe
from tests.sensors.camera.bake.exr_file import exr_bytes
from tests.sensors.camera.bake.fake_blender import ball, installed

RECIPE = Recipe(views=3, frames=4, size=32)
PICTURES = 8  # of a view: four frames, twice


@pytest.fixture
def blender(tmp_path, monkeypatch) -> str:
    """A program that draws balls; it waits for nobody."""
    monkeypatch.setattr(baking, "LOOK_S", 0.02)
    return str(installed(tmp_path))


def made(blender: str, out: Path, recipe: Recipe = RECIPE, force: bool = False):
    baking = Baking(recipe, out)
    baking.begin(force=force)
    return baking.make(blender, "3.4.1")


def test_a_set_has_its_index_and_a_sheet_for_each_view(blender, tmp_path):
    out = tmp_path / "set"
    assert made(blender, out) == ["views.toml", "00.webp", "01.webp", "02.webp"]
    assert sorted(path.name for path in out.iterdir()) == [
        *("00.webp", "01.webp", "02.webp", "views.toml"),
    ]
    index = tomllib.loads((out / "views.toml").read_text())
    assert index["kind"] == "explosion"
    assert index["size_px"] == 32
    assert index["made"]["blender"] == "3.4.1"
    assert index["made"]["licence"] == "CC0-1.0"
    assert len(index["phases"]) == 4
    assert index["phases"] == sorted(index["phases"])
    assert [view["file"] for view in index["view"]] == ["00.webp", "01.webp", "02.webp"]


def test_radii_of_the_index_are_those_of_the_balls_that_were_drawn(blender, tmp_path):
    made(blender, tmp_path / "set")
    index = tomllib.loads((tmp_path / "set/views.toml").read_text())
    drawn = [32 * (0.15 + 0.02 * number) for number in range(4)]
    for view in index["view"]:
        # a ball of pixels is off its circle by a fifth of a pixel, the coding as much
        np.testing.assert_allclose(view["radius_px"], drawn, atol=0.4)


def test_light_and_colour_that_were_rendered_come_back_from_the_sheet(
    blender, tmp_path
):
    made(blender, tmp_path / "set")
    sheet = read_sheet(tmp_path / "set/00.webp")
    frame = frames_of_sheet(sheet, 32, 4)[-1]
    middle = slice(13, 19)
    # eight bits, and what a lossy picture changes far from its edges
    np.testing.assert_allclose(frame.heat[middle, middle], 1.0, atol=0.03)
    np.testing.assert_allclose(frame.shade[middle, middle], 0.25, atol=0.03)
    np.testing.assert_allclose(frame.alpha[middle, middle], 1.0, atol=0.03)
    assert frame.alpha[0, 0] == 0.0


@pytest.mark.parametrize("wrong", ["kill", "fail", "quiet"])
def test_what_is_finished_is_kept_and_the_rest_is_gone_on_with(
    blender, tmp_path, monkeypatch, wrong
):
    out = tmp_path / "set"
    monkeypatch.setenv("FAKE_BLENDER", f"{wrong}:{PICTURES + 3}")
    with pytest.raises(InputError, match=r"blender\.log: Blender .* 1 of 3 views"):
        made(blender, out)
    assert (out / "00.webp").exists()
    assert not (out / "views.toml").exists()
    assert len(list((out / WORK / "frames/001").glob("*.exr"))) == 3
    before = (out / "00.webp").stat().st_mtime_ns
    monkeypatch.setenv("FAKE_BLENDER", f"kill:{2 * PICTURES - 3 + 1}")  # enough
    made(blender, out)
    assert (out / "00.webp").stat().st_mtime_ns == before
    assert not (out / WORK).exists()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("kill", r"was killed by signal 9 \(SIGKILL\)"),
        ("fail", "ended with code 1"),
        ("quiet", "ended before all views were rendered"),
    ],
)
def test_a_message_says_what_blender_died_of(
    blender, tmp_path, monkeypatch, wrong, words
):
    monkeypatch.setenv("FAKE_BLENDER", f"{wrong}:1")
    with pytest.raises(InputError, match=words):
        made(blender, tmp_path / "set")
    if wrong == "fail":
        assert "out of memory" in (tmp_path / "set/.bake/blender.log").read_text()


def test_eevee_that_fails_says_that_it_may_need_a_display(
    blender, tmp_path, monkeypatch
):
    monkeypatch.setenv("FAKE_BLENDER", "fail:0")
    with pytest.raises(InputError, match="eevee may need a display"):
        made(blender, tmp_path / "set", RECIPE._replace(engine="eevee"))


def test_a_simulation_that_left_nothing_is_a_failure(blender, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_BLENDER", "nothing")
    with pytest.raises(InputError, match="without a simulated explosion"):
        made(blender, tmp_path / "set")


def test_a_picture_cut_short_is_named_and_rendered_again(blender, tmp_path):
    out = tmp_path / "set"
    baking = Baking(RECIPE, out)
    baking.begin(force=False)
    path = out / WORK / "frames/000/0001.glow.exr"
    path.parent.mkdir(parents=True)
    path.write_bytes(exr_bytes(ball(32, 1, "glow"))[:500])
    with pytest.raises(InputError, match=r"000/0001\.glow\.exr: expected a complete"):
        baking.make(blender, "3.4.1")
    made(blender, out)
    assert (out / "views.toml").exists()


def test_a_view_that_is_damaged_is_made_again(blender, tmp_path, monkeypatch):
    out = tmp_path / "set"
    monkeypatch.setenv("FAKE_BLENDER", f"fail:{2 * PICTURES}")
    with pytest.raises(InputError, match="2 of 3 views"):
        made(blender, out)
    whole = (out / "01.webp").read_bytes()
    (out / "01.webp").write_bytes(whole[: len(whole) // 2])
    monkeypatch.delenv("FAKE_BLENDER")
    made(blender, out)
    assert read_sheet(out / "01.webp").shape == read_sheet(out / "00.webp").shape


def test_a_changed_recipe_is_refused_with_what_differs(blender, tmp_path, monkeypatch):
    out = tmp_path / "set"
    monkeypatch.setenv("FAKE_BLENDER", "fail:9")
    with pytest.raises(InputError, match="1 of 3"):
        made(blender, out)
    monkeypatch.delenv("FAKE_BLENDER")
    with pytest.raises(InputError, match=r"another recipe \(seed 7, there 0\)"):
        made(blender, out, RECIPE._replace(seed=7))
    assert (out / "00.webp").exists()
    made(blender, out, RECIPE._replace(seed=7), force=True)
    assert (out / "views.toml").exists()


def test_a_finished_set_is_overwritten_only_if_asked(blender, tmp_path):
    out = tmp_path / "set"
    made(blender, out)
    (out / "README").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        made(blender, out)
    made(blender, out, RECIPE._replace(views=2), force=True)
    assert sorted(path.name for path in out.iterdir()) == [
        *("00.webp", "01.webp", "README", "views.toml"),
    ]


@pytest.mark.parametrize("finished", [True, False], ids=["finished", "half made"])
def test_pictures_of_ones_own_are_left_alone_whatever_they_are_called(
    blender, tmp_path, monkeypatch, finished
):
    out = tmp_path / "set"
    if not finished:
        monkeypatch.setenv("FAKE_BLENDER", f"fail:{2 * PICTURES}")
        with pytest.raises(InputError, match="2 of 3 views"):
            made(blender, out)
        monkeypatch.delenv("FAKE_BLENDER")
    else:
        made(blender, out)
    for name in ("07.webp", "2024.webp"):
        (out / name).write_text("mine")
    made(blender, out, RECIPE._replace(views=2), force=True)
    assert (out / "07.webp").read_text() == (out / "2024.webp").read_text() == "mine"
    assert not (out / "02.webp").exists()  # of the set that was overwritten
    with pytest.raises(InputError, match=r"07\.webp: has the name of a view"):
        made(blender, out, RECIPE._replace(views=8), force=True)
    assert (out / "views.toml").exists()  # nothing was begun


def test_a_folder_of_pictures_of_ones_own_is_refused_before_anything(blender, tmp_path):
    out = tmp_path / "set"
    out.mkdir()
    (out / "views.toml").write_text('kind = "mine"\n[[view]]\nfile = "01.webp"\n')
    (out / "01.webp").write_text("mine")
    with pytest.raises(InputError, match=r"01\.webp: has the name of a view"):
        made(blender, out, force=True)
    (out / "views.toml").unlink()
    with pytest.raises(InputError, match=r"01\.webp: has the name of a view"):
        made(blender, out)
    assert [path.name for path in out.iterdir()] == ["01.webp"]


@pytest.mark.parametrize("name", ["recipe", "baked"])
def test_notes_of_a_half_made_set_that_are_broken_are_named(
    blender, tmp_path, monkeypatch, name
):
    monkeypatch.setenv("FAKE_BLENDER", "fail:3")
    with pytest.raises(InputError, match="0 of 3"):
        made(blender, tmp_path / "set")
    (tmp_path / "set" / WORK / f"{name}.json").write_text("{")
    with pytest.raises(InputError, match=rf"{name}\.json: expected .* in JSON"):
        made(blender, tmp_path / "set")


def test_progress_is_told_in_steps_and_pictures(blender, tmp_path):
    class Kept(Listener):
        said: tuple[str, ...] = ()

        def heard(self):
            self.said = (*self.said, self.words())

    kept = Kept()
    with heard_by(kept):
        made(blender, tmp_path / "set")
    assert any("simulating (1 of 2)" in words for words in kept.said)
    assert kept.said[-1] == "rendering (2 of 2): 24 of 24 pictures"


def test_blender_that_is_not_there_is_one_message(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="on the PATH, got none"):
        baking.blender_found(None)
    with pytest.raises(InputError, match="at /nowhere/blender, got none"):
        baking.blender_found("/nowhere/blender")


@pytest.mark.parametrize(
    ("says", "words"),
    [("Blender 2.79", "expected Blender 3.4 or later"), ("tea", "print its version")],
)
def test_another_program_or_an_old_one_is_refused(blender, monkeypatch, says, words):
    monkeypatch.setenv("FAKE_VERSION", says)
    with pytest.raises(InputError, match=words):
        baking.blender_found(blender)


def test_blender_is_found_with_its_version(blender):
    assert baking.blender_found(blender) == (blender, "3.4.1")


def test_directions_of_ones_own_are_part_of_the_recipe(blender, tmp_path, monkeypatch):
    monkeypatch.setenv("FAKE_BLENDER", "fail:0")
    with pytest.raises(InputError):
        made(blender, tmp_path / "set")
    kept = json.loads((tmp_path / "set/.bake/recipe.json").read_text())
    np.testing.assert_allclose(kept["directions"], RECIPE.directions(), atol=1e-6)
