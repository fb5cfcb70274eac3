"""Doubts that need no physics, and all faults of a log beside a scene."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from jblast.observations.check import (
    clocks_doubted,
    places_doubted,
    refusals,
    sigmas_doubted,
)
from jblast.report.check import row_sentence
from jblast.scene import Scene, Sensor, default_scene
from tests.observations.rows import HEADER


@pytest.fixture
def log(table):
    return lambda *rows, header=HEADER: table(header + "\n".join(rows) + "\n")


PLACES = {
    "sensor_copied": ["a,air_arrival_s,0.05,,20,0,1", "b,air_arrival_s,0.05,,20,0,1"],
    "two_sensors_at_one_place": [
        "a,air_arrival_s,0.05,1e-4,20,0,1",
        "b,air_arrival_s,0.06,1e-4,20,0,1",
    ],
    "sensor_at_two_places": [
        "a,air_arrival_s,0.05,,20,0,1",
        "a,peak_overpressure_pa,5e3,,20,1,1",
    ],
}


@pytest.mark.parametrize("kind", PLACES)
def test_places_are_doubted(log, kind):
    (doubt,) = places_doubted(log(*PLACES[kind]))
    assert (doubt.kind, doubt["rows"]) == (kind, (1, 0))


def test_angles_at_one_place_are_compared_in_radians(log):
    rows = "a,bearing_rad,0.1,0.01,20,0,1", "b,bearing_rad,0.2,0.01,20,0,1"
    assert [doubt["rows"] for doubt in places_doubted(log(*rows))] == [(1, 0)]


@pytest.mark.parametrize(
    "rows",
    [
        ["a,air_arrival_s,0.05,1e-3,20,0,1", "b,air_arrival_s,0.052,1e-3,20,0,1"],
        ["a,peak_overpressure_pa,5e3,,9,0,1", "b,peak_overpressure_pa,7e3,,9,0,1"],
        ["a,peak_overpressure_pa,5e3,,9,0,1", "b,air_arrival_s,0.05,,9,0,1"],
        ["a,air_arrival_s,0.05,,20,0,1", "a,air_arrival_s,0.05,1e-3,20,0,1"],
    ],
)
def test_sensors_that_agree_are_not_doubted(log, rows):
    assert places_doubted(log(*rows)) == []


def test_clocks_and_shots_are_doubted(log):
    header = "sensor,quantity,value,sigma,range_m,shot,clock\n"
    table = log(
        "a,flash_time_s,1.0,0.001,50,one,phone",
        "a,air_arrival_s,0.9,0.001,50,one,phone",
        "b,air_arrival_s,1.2,0.001,60,one,watch",
        "a,flash_time_s,7.0,0.001,50,two,phone",
        header=header,
    )
    found = {doubt.kind: doubt for doubt in clocks_doubted(table)}
    assert found["shot_unheard"]["shot"] == "two"
    assert found["clock_of_one_row"]["rows"] == (2,)
    assert found["arrival_before_flash"]["rows"] == (1, 0)
    assert found["arrival_before_flash"].numbers["early_s"] == pytest.approx(0.1)
    assert len(found) == 3
    # a flash by another sensor's own clock tells nothing of this one's
    apart = replace(table, clock=("", "", "", ""), sensor=("a", "c", "b", "a"))
    assert [doubt.kind for doubt in clocks_doubted(apart)] == ["shot_unheard"]


@pytest.mark.parametrize(
    ("unit", "factor"), [("seconds", 1), ("milliseconds", 1000), ("nanoseconds", 10**9)]
)
def test_seconds_since_1970_are_told_and_never_taken_for_a_date(log, unit, factor):
    rows = [
        f"a,air_arrival_s,{1700000000 * factor},,20,0,1",
        f"b,air_arrival_s,{1700000001 * factor},,40,0,1",
        f"b,peak_overpressure_pa,{1700000001 * factor},,40,0,1",
    ]
    table = log(*rows)
    (doubt,) = clocks_doubted(table)
    assert (doubt.kind, doubt["rows"]) == ("since_1970", (0, 1))
    assert (doubt["unit"], doubt["when"]) == (unit, "2023-11-14T22:13:20.000Z")
    assert table.epoch is None
    assert f"{unit} since 1970, here 2023-11-14T22:13:20.000Z" in row_sentence(
        doubt, table
    )
    # a clock that counts from its start, or from a day's, is no date
    assert clocks_doubted(replace(table, value=table.value / factor / 2e4)) == []
    known = replace(table, epoch=datetime(2020, 8, 4, tzinfo=UTC))
    assert clocks_doubted(known) == []


def test_errors_are_doubted(log):
    table = log(
        "a,peak_overpressure_pa,5000,5001,20,0,1",
        "b,peak_overpressure_pa,5000,0.004,30,0,1",
        "c,peak_overpressure_pa,5000,250,40,0,1",
        "d,air_arrival_s,0.1,0.2,40,0,2",
    )
    found = [(doubt.kind, doubt["rows"]) for doubt in sigmas_doubted(table)]
    assert found == [("sigma_too_fine", (1,)), ("sigma_large", (0,))]


def test_all_faults_beside_a_scene_are_told_not_the_first_alone(log):
    table = log(
        "a,air_arrival_s,0.05,,20,0,1",
        "b,air_arrival_s,0.05,,,,",
        "c,air_arrival_s,-0.05,1e-3,40,0,1",
        "d,air_arrival_s,0.05,,0,0,0",
    )
    there = Sensor("a", position_m=np.array([21.0, 0.0, 1.0]))
    uncertain = replace(default_scene(), scene=Scene(sensors=(there,)))
    lines = sorted(
        str(fault).split("log.csv: ")[1] for fault in refusals(table, uncertain)
    )
    assert [line[:6] for line in lines] == ["line 2", "line 3", "line 4", "line 5"]
