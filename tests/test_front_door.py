"""What `import jblast` offers: each name is there, told of, and works."""

import importlib
import inspect

import jax.numpy as jnp
import numpy as np
import pandas
import pytest

import jblast
from jblast.errors import InputError
from jblast.inference.fitting.fit_input import fit_input
from jblast.scene import scene_of

NAMES = (
    *("fit", "fit_each", "fit_many", "read", "read_scene", "pick_files", "detect"),
    *("discover_law", "simulate", "record", "calculate", "bound", "choose", "render"),
    *("events", "fly", "pick", "Scene", "Charge"),
)
TOML = """
[charge]
mass_kg = {mass}
position_m = [0.0, 0.0, 1.0]

[law]
air_arrival_s = "kingery_bulmash"
peak_overpressure_pa = "kingery_bulmash"

[camera]
position_m = [0.0, -40.0, 2.0]
look_at_m = [0.0, 0.0, 4.0]
focal_px = 10.0
width = 8
height = 6

[vehicle]
model = "crazyflie"
position_m = [0.0, 8.0, 2.0]

[[sensor]]
name = "a"
position_m = [30.0, 0.0, 1.0]
records = {{ air_arrival_s = 1e-4 }}

[[sensor]]
name = "b"
position_m = [40.0, 0.0, 1.0]
records = {{ peak_overpressure_pa = "5%" }}
"""


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    path = tmp_path_factory.mktemp("known") / "scene.toml"
    path.write_text(TOML.format(mass="15.0"))
    return jblast.read_scene(path)


@pytest.fixture(scope="module")
def unknown(tmp_path_factory):
    path = tmp_path_factory.mktemp("unknown") / "scene.toml"
    path.write_text(TOML.format(mass="{ lognormal = [10.0, 2.0] }"))
    return jblast.read_scene(path)


@pytest.fixture(scope="module")
def log(known):
    return jblast.simulate(known, seed=1)


@pytest.mark.parametrize("name", NAMES)
def test_each_name_is_no_module_of_ours_and_says_how_it_is_used(name):
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module(f"jblast.{name}")
    told = inspect.getdoc(getattr(jblast, name)) or ""
    parts = ("Attributes:",) if name[0].isupper() else ("Args:", "Returns:", "Raises:")
    assert all(part in told for part in (*parts, "Example:")), told
    assert f"jblast.{name}(" in told.partition("Example:")[2]


def test_a_scene_may_be_given_by_its_file(known, log):
    again = jblast.simulate(known.source, seed=1)
    np.testing.assert_array_equal(again.value, log.value)


def test_objects_that_are_no_scene_or_log_are_refused():
    with pytest.raises(InputError, match=r"path of a scene file or the .*, got dict"):
        scene_of({"charge": {}})
    with pytest.raises(InputError, match=r"log\['value'\]: expected observations, got"):
        fit_input({"value": 1.0})
    with pytest.raises(InputError, match="or a data frame, got Series"):
        fit_input(pandas.Series([1.0]))


@pytest.mark.slow
def test_a_fireball_is_seen_and_sends_events(known):
    scene, times = known.scene, jnp.linspace(-1e-3, 5e-3, 4)
    frames = jblast.render(scene, scene.camera, times)
    assert frames.shape == (4, 6, 8, 3)
    assert float(frames[-1].max()) > float(frames[0].max())
    assert int(jblast.events(scene, scene.camera, times, capacity=1000).count) > 0
