import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.study import own_outcome, read_study, run
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
