"""Functions of a user, and published thresholds of pressure, as outcomes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Scene, Sensor, UncertainScene
from jblast.study import own_outcome, read_study, run
from jblast.study.outcome.family import Setting
from jblast.study.outcome.quantities import LIMITS, prepare
from tests.study.example import STUDY, written


@own_outcome("m", "height of each sensor above the charge", per_sensor=True)
def heights(key, scene):
    return jnp.stack(
        [s.position_m[2] - scene.charge.position_m[2] for s in scene.sensors]
    )


@own_outcome(kind="yes_no")
def heavy(key, scene):
    return scene.charge.mass_kg > 10.0


def plain(key, scene):
    return scene.charge.mass_kg


OWN = [f"python:{__name__}.{name}" for name in ("heights", "heavy", "plain")]


def study_of(folder, *names):
    listed = ", ".join(f'"{name}"' for name in names)
    text = STUDY.replace('"air_arrival_s"', listed)
    return read_study(written(folder, text), allow_code=True)


def test_a_function_of_the_user_is_an_outcome_as_its_decorator_says(tmp_path):
    data = run(study_of(tmp_path, *OWN))
    found = [data[name] for name in OWN]
    assert found[0].dims == ("draw", "sensor")
    assert found[0].attrs["units"] == "m"
    assert found[0].attrs["long_name"] == "height of each sensor above the charge"
    masses = np.asarray(data["charge_mass_kg"])
    np.testing.assert_array_equal(found[1], masses > 10.0)
    np.testing.assert_array_equal(found[2], masses)


def test_a_value_of_another_shape_than_described_is_refused(tmp_path):
    study = study_of(tmp_path, f"python:{__name__}.flat")
    with pytest.raises(InputError, match=r"flat: expected the shape \(\)"):
        run(study)


def flat(key, scene):
    return jnp.zeros(3)


LAW = ("peak_overpressure_pa", "kingery_bulmash")
KPA = {
    # Clancey 1972, printed in kPa: "typical pressure for glass breakage"
    "above_glass_threshold": 1.03,
    # Zipf and Cashdollar 2007 print 5 and 15 psi; 1 psi is 6.8948 kPa
    "above_eardrum_threshold": 5 * 6.8948,
    "above_lung_threshold": 15 * 6.8948,
}


@pytest.mark.parametrize("name", KPA)
def test_a_threshold_has_its_published_value(name):
    assert LIMITS[name].value == pytest.approx(1e3 * KPA[name], rel=5e-3)


def test_a_sample_is_above_a_threshold_where_its_peak_is():
    gauge = Sensor("gauge", (40.0, 0.0, 1.5))
    scene = UncertainScene(Scene(sensors=(gauge,), law=(LAW,)))
    names = ("peak_overpressure_pa", "above_threshold", "above_glass_threshold")
    setting = Setting(scene, scene, names, {"threshold_pa": 9e3}, {})
    # without and with scatter the peak is about 3, 9 and 60 kPa
    masses = {"charge_mass_kg": jnp.array([1.0, 15.0, 1000.0])}
    keys = jax.random.split(jax.random.key(0), 3)
    found = jax.jit(prepare(setting).batched)(keys, masses)
    peak = np.asarray(found["peak_overpressure_pa"])
    for name, limit in (("above_threshold", 9e3), ("above_glass_threshold", 1034.2)):
        np.testing.assert_array_equal(np.asarray(found[name]) == 1, peak > limit)
    assert 0 < np.mean(peak > 9e3) < 1
