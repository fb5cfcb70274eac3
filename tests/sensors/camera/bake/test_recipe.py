import numpy as np
import pytest

from jblast.errors import InputError
from jblast.sensors.camera.bake.recipe import (
    ENGINES,
    SAMPLINGS,
    Recipe,
    differences,
    packing_distance,
)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_a_recipe_looks_from_as_many_sides_as_it_says(sampling):
    direction = Recipe(views=9, sampling=sampling).directions()
    assert direction.shape == (9, 3)
    assert packing_distance(direction) > 0.1


@pytest.mark.parametrize(
    "wrong",
    [
        {"views": 0},
        {"views": 513},
        {"frames": 1},
        {"size": 8},
        {"size": 4096},
        {"engine": "luxrender"},
        {"sampling": "random"},
    ],
)
def test_a_recipe_that_cannot_be_is_refused_by_its_key(wrong):
    (key,) = wrong
    with pytest.raises(InputError, match=f"^{key}: expected"):
        Recipe(**wrong).checked()


def test_what_differs_is_told_key_by_key():
    ours = Recipe(seed=3).as_json()
    assert differences(ours, ours) == []
    theirs = Recipe(size=64, physics={"last": 60}).as_json()
    lines = differences(ours, theirs)
    assert "size 128, there 64" in lines
    assert "seed 3, there 0" in lines
    assert any(line.startswith("physics.resolution 64, there None") for line in lines)
    assert differences({}, {"views": 1}) == ["views None, there 1"]


def test_defaults_are_the_shipped_set():
    assert Recipe().checked() == Recipe(32, 40, 128, "cycles", 0, "hardin")
    assert "cycles" in ENGINES
    assert np.all(Recipe().directions()[:, 2] > 0)
