"""What a batch of logs is missed by, where each log has errors of its own."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import batch_of, fit_many
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_laws, with_values
from jblast.sensors import planned_layout, record
from tests.inference.logs import log

LAWS = {"air_arrival_s": "wu_hao"}
PLACES = ((60.0, 0.0, 0.0), (-70.0, 30.0, 0.0), (0.0, 90.0, 0.0))
FREE = ["charge_mass_kg", "origin_time_s"]
START = np.array([[3.0, 1.5], [3.0, 1.5]])


def two_logs(errors, later):
    """A scene and two logs of it: one exact, one late by so many errors, by turns."""
    records = (("air_arrival_s", 1e-4),)
    sensors = tuple(
        Sensor(name, jnp.array(at), records=records)
        for name, at in zip("abc", PLACES, strict=True)
    )
    scene = dataclasses.replace(Scene(), scatter=False, sensors=sensors)
    scene = with_values(scene, {"charge_mass_kg": 30.0, "origin_time_s": 1.5})
    layout, *_ = planned_layout(scene)
    exact = np.asarray(record(scene, layout, LAWS).value)
    away = later * errors * np.array([1.0, -1.0, 1.0])
    logs = [
        log(
            *(
                (name, "air_arrival_s", time, errors, at)
                for name, time, at in zip("abc", times, PLACES, strict=True)
            )
        )
        for times in (exact, exact + away)
    ]
    uncertain = with_laws(freed(UncertainScene(scene), FREE), LAWS)
    return batch_of(logs, uncertain), uncertain


@pytest.mark.parametrize("noise", ["gaussian", "student"])
def test_a_perfect_log_with_errors_of_its_own_is_missed_by_nothing(noise):
    batch, uncertain = two_logs(1e-4, 0.5)
    assert batch.relative_sigma.shape == (2, 3)
    found = fit_many(uncertain, *batch, noise=noise, starts=START)
    assert found.converged.all()
    assert not found.doubtful.any()
    # half of the square of what rounding leaves, 1e-16 s in 1e-4 s
    assert abs(found.misfit[0]) < 1e-20
    assert abs(found.cost[0]) < 1e-20
    # three readings half an error off, each 5/2 ln(1 + 0.5^2/4) by Student-t and less
    # by normal errors; some of it fitted away
    assert 0 < found.misfit[1] < 0.455
    np.testing.assert_allclose(found.cost, found.misfit, atol=1e-20)
