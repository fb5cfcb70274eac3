"""Flights as outcomes: those of `fly`, and the same on all devices as on one."""

import numpy as np
import pytest

from jblast.scene import UncertainScene, read_scene
from jblast.scene.uncertain import with_values
from jblast.study import run
from jblast.study.flights import fly
from jblast.study.slabs import devices_of
from tests.study.example import study_in

SCENE = """
[charge]
mass_kg = { lognormal = [1.0, 1.5] }
position_m = [12.0, 0.0, 0.0]
time_s = 0.1
[vehicle]
model = "crazyflie"
position_m = [0.0, 0.0, 2.0]
"""
STEP_S = 5e-3
STUDY = f"""
scene = "scene.toml"
samples = 128
outcomes = ["peak_deviation_m", "flies_on", "vehicle_overpressure_pa"]
[options]
flight_step_s = {STEP_S}
"""


@pytest.mark.slow
def test_flights_are_those_of_fly_on_one_device_as_on_all(tmp_path):
    study = study_in(tmp_path, STUDY, SCENE)
    one, whole = (run(study, devices_of(n)) for n in (1, None))
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name], whole[name])
    masses = one.charge_mass_kg.values
    at = int(np.argsort(masses)[64])
    scene = with_values(
        read_scene(tmp_path / "scene.toml").scene, {"charge_mass_kg": masses[at]}
    )
    alone = fly(
        UncertainScene(scene),
        step_s=STEP_S,
        backend="jax",
        controllers=["with_integral"],
    ).holds["with_integral"]
    # rows of a sample are up to 20 ms apart: its peak is a little below
    peak = float(alone.metrics.peak_deviation_m)
    assert one.peak_deviation_m.values[at] == pytest.approx(peak, rel=2e-3)
    assert one.flies_on.values[at] == (not alone.metrics.crashed)
    pressure = float(alone.exposure.peak_overpressure_pa)
    assert one.vehicle_overpressure_pa.values[at] == pytest.approx(pressure, rel=1e-3)
    order = np.argsort(masses)
    assert (np.diff(one.vehicle_overpressure_pa.values[order]) > 0).all()
