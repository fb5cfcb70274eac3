"""Logs without a scene: free position and time, and clocks that do not agree."""

from dataclasses import replace

import numpy as np
import pytest

import jblast
from jblast.scene import Charge, Scene, Sensor, UncertainScene
from jblast.sensors import simulate

PLACES = ((-180, 240), (310, 150), (420, -260), (60, -390), (-350, -120), (-90, 520))
RECORDS = (("air_arrival_s", 0.002), ("peak_overpressure_pa", 0.1))


def log(clock_off=0.0):
    """Return six sensors' log of a charge off the origin at 3 s."""
    sensors = tuple(
        Sensor(f"m{i}", np.array([east, north, 0.0]), records=RECORDS)
        for i, (east, north) in enumerate(PLACES)
    )
    charge = Charge(mass_kg=100.0, position_m=(80.0, -50.0, 0.0), time_s=3.0)
    made = simulate(UncertainScene(Scene(charge, sensors=sensors)), 1)
    heard = np.isin(made.quantity, "air_arrival_s") & np.isin(made.sensor, "m4")
    return replace(made, value=made.value + clock_off * heard)


def told(found):
    return [one for one in found.summary.warnings if one.kind == "more_to_free"]


@pytest.mark.slow
def test_place_and_time_of_a_log_with_positions_need_no_scene():
    found = jblast.fit(log())
    assert found.exit_code == 0
    truth = {
        "charge_mass_kg": 100.0,
        "charge_east_m": 80.0,
        "charge_north_m": -50.0,
        "origin_time_s": 3.0,
    }
    assert set(found.summary.free) == set(truth)
    assert found.summary.suspected_outliers == ()
    for name, value in truth.items():
        estimate = found.summary.estimates[name]
        assert abs(estimate.value - value) < 3 * estimate.sd, name


@pytest.mark.slow
def test_several_wrong_clocks_are_named_together():
    recorder = {f"m{i}": name for i, name in enumerate("aabbcc")}
    ahead = {"a": 0.0, "b": 1.7, "c": 0.85}
    made = log()
    clock = tuple(recorder[sensor] for sensor in made.sensor)
    late = np.array([ahead[name] for name in clock])
    late *= np.isin(made.quantity, "air_arrival_s")
    here = made.position - np.array([80.0, -50.0, 0.0])  # about a charge at the origin
    apart = replace(made, value=made.value + late, clock=clock, position=here)
    (more,) = told(jblast.fit(apart))
    assert more["parameters"] == ("clock_offset_s.b", "clock_offset_s.c")
    mass = more["masses"]["charge_mass_kg"]
    assert abs(np.log(mass.value / 100.0)) < 4 * mass.log_sd
