"""Of a log that the default scene does not fit: what to free, and which clock."""

from dataclasses import replace

import numpy as np
import pytest

import jblast
from jblast.inference.fitting.findings import MoreToFree
from jblast.inference.fitting.suspects import out_of_order
from jblast.report import summary
from jblast.scene import Charge, Free, Scene, Sensor, UncertainScene, default_scene
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
    return [one for one in found.summary.warnings if isinstance(one, MoreToFree)]


def test_an_origin_time_alone_is_not_tried_where_the_order_forbids_it():
    blind = default_scene()
    assert out_of_order(log(), blind)  # m1 heard before the nearer m0
    here = (80.0, -50.0, 0.0)
    there = UncertainScene(Scene(Charge(position_m=here)), blind.beliefs)
    assert not out_of_order(log(), there)
    free = UncertainScene(
        Scene(), {**blind.beliefs, "charge_east_m": Free(positive=False)}
    )
    assert not out_of_order(log(), free)
    apart = replace(log(), clock=log().sensor)  # clocks of their own have no order
    assert not out_of_order(apart, blind)


@pytest.mark.slow
def test_a_charge_elsewhere_at_another_time_is_told_by_what_to_free():
    found = jblast.fit(log())
    assert found.exit_code == 4
    (more,) = told(found)
    assert more.parameters == ("charge_east_m", "charge_north_m", "origin_time_s")
    mass = more.estimates["charge_mass_kg"]
    assert abs(np.log(mass.value / 100.0)) < 4 * mass.log_sd
    said = " ".join(summary(found).split())
    assert "--free charge_east_m,charge_north_m,origin_time_s" in said
    assert said.index("--free") < said.index("Estimates")


@pytest.mark.slow
def test_a_wrong_clock_beside_is_named():
    (more,) = told(jblast.fit(log(clock_off=-1.0)))
    assert more.clock == "m4"
    assert more.parameters[-1] == "clock_offset_s.m4"


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
    assert more.parameters == (
        "origin_time_s",
        "clock_offset_s.b",
        "clock_offset_s.c",
    )
    mass = more.estimates["charge_mass_kg"]
    assert abs(np.log(mass.value / 100.0)) < 4 * mass.log_sd
