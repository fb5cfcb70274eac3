"""With Blender itself, if there is one: a tiny explosion and its properties."""

import shutil
import tomllib

import numpy as np
import pytest

from jblast.sensors.camera.bake.baking import Baking, blender_found, read_sheet
from jblast.sensors.camera.bake.coding import frames_of_sheet
from jblast.sensors.camera.bake.recipe import PHYSICS, Recipe

TINY = {"resolution": 24, "lobes": 8, "puffs": 6, "noise": 0.0}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("blender") is None, reason="needs Blender")
def test_blender_bakes_fire_that_grows_and_then_smoke(tmp_path):
    recipe = Recipe(views=2, frames=5, size=48, physics=PHYSICS | TINY)
    baking = Baking(recipe, tmp_path / "set")
    baking.begin(force=False)
    files = baking.make(*blender_found(None))
    assert files == ["views.toml", "00.webp", "01.webp"]
    assert not list(tmp_path.glob("*.bin"))
    index = tomllib.loads((tmp_path / "set/views.toml").read_text())
    for view in index["view"]:
        sheet = read_sheet(tmp_path / "set" / view["file"])
        frames = frames_of_sheet(sheet, 48, 5)
        hottest = [np.max(frame.heat * (frame.alpha > 0.5)) for frame in frames]
        # so coarse a grid has nothing of the first instant
        assert min(hottest[1:3]) > 0.8  # fire, about as bright as the law
        assert hottest[-1] < 0.1  # smoke
        assert min(frame.alpha.max() for frame in frames[1:]) > 0.9
        assert all(frame.alpha[0].max() < 0.5 for frame in frames)  # held whole
        column = round(view["anchor_px"][0])
        assert frames[1].alpha[:, column].max() > 0.9  # over the burst
