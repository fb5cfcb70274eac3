"""What the default scene leaves free for a log, and where a scene is."""

import numpy as np
import pytest

import jblast
from jblast.errors import InputError
from jblast.observations import some_rows
from jblast.observations.grouping import located
from jblast.observations.scenes import clocks_to_free, for_log
from jblast.scene import Place, Scene, UncertainScene, default_scene, freed

HEAD = "sensor,quantity,value,sigma,clock,lat_deg,lon_deg,alt_m\n"
PLACES = {"a": "33.9,35.5,1500", "b": "33.902,35.5,1500", "c": "33.9,35.503,1500"}


def at(tmp_path, text):
    (tmp_path / "log.csv").write_text(text)
    return jblast.read(tmp_path / "log.csv")


def log(tmp_path, readings, clocks=("a", "b", "c"), flash=(1.0, 2.0, 3.0)):
    rows = []
    for (name, place), clock, seen in zip(PLACES.items(), clocks, flash, strict=True):
        for quantity in readings:
            value = {"flash_time_s": seen, "air_arrival_s": seen + 1}.get(quantity, 500)
            rows.append(f"{name},{quantity},{value},0.01,{clock},{place}")
    return at(tmp_path, HEAD + "\n".join(rows))


SEEN_AND_HEARD = ("flash_time_s", "air_arrival_s")


def test_place_time_and_clocks_tied_by_a_flash_are_free(tmp_path):
    uncertain = for_log(default_scene(), log(tmp_path, SEEN_AND_HEARD))
    assert list(uncertain.beliefs) == [
        *("charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s"),
        *("clock_offset_s.b", "clock_offset_s.c"),
    ]
    # ISO 2533, table 5: 278.402 K and 84.5597 kPa at 1500 m
    assert float(uncertain.scene.air.temperature) == pytest.approx(278.40, abs=0.01)
    assert float(uncertain.scene.air.pressure) == pytest.approx(84560, rel=1e-4)


def test_a_clock_that_heard_alone_is_taken_to_agree(tmp_path):
    assert clocks_to_free(log(tmp_path, ("air_arrival_s",))) == []


def test_a_named_clock_that_heard_alone_is_free_beside_a_flash(tmp_path):
    # its sensor must not shift the charge by a clock that nobody set
    whole = log(tmp_path, SEEN_AND_HEARD)
    heard = some_rows(whole, np.array([0, 1, 2, 3, 5]))
    assert clocks_to_free(heard) == ["b", "c"]
    seen = some_rows(whole, np.array([0, 1, 2, 3, 4]))
    assert clocks_to_free(seen) == ["b"]


def test_rows_without_a_clock_beside_others_are_on_the_common_one(tmp_path):
    clocks = ("", "gps", "phone")
    assert clocks_to_free(log(tmp_path, SEEN_AND_HEARD, clocks)) == ["gps", "phone"]


def test_without_a_column_of_clocks_flashes_tell_whether_they_agree(tmp_path):
    clocks = ("", "", "")
    apart = log(tmp_path, SEEN_AND_HEARD, clocks)
    assert clocks_to_free(apart) == ["b", "c"]
    agreed = log(tmp_path, SEEN_AND_HEARD, clocks, flash=(1.0, 1.01, 0.99))
    assert clocks_to_free(agreed) == []


def test_a_log_in_metres_and_a_scene_that_was_given_stay_as_they_are(tmp_path):
    given = UncertainScene(Scene(), {}, "scene.toml")
    readings = log(tmp_path, SEEN_AND_HEARD)
    assert for_log(given, readings) is given
    text = "sensor,quantity,value,sigma,range_m\na,air_arrival_s,1,.1,300\n"
    metres = for_log(default_scene(), at(tmp_path, text))
    assert metres.beliefs.keys() == {"charge_mass_kg"}


def test_place_and_time_are_free_with_positions_in_metres_that_identify_them(tmp_path):
    path = tmp_path / "metres.csv"
    head = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
    places = ("60,0,1", "-20,95,1", "-130,-40,1")
    rows = [f"s{i},air_arrival_s,{i + 1},0.001,{at}\n" for i, at in enumerate(places)]
    rows.append("s0,peak_overpressure_pa,9000,450,60,0,1\n")
    path.write_text(head + "".join(rows))
    place_and_time = ["charge_east_m", "charge_north_m", "origin_time_s"]
    free = ["charge_mass_kg", *place_and_time]
    assert list(for_log(default_scene(), jblast.read(path)).beliefs) == free
    ranged = freed(default_scene(), ["charge_range_m"])
    assert place_and_time[0] not in for_log(ranged, jblast.read(path)).beliefs
    path.write_text(head + "".join(rows[1:]))
    three = for_log(default_scene(), jblast.read(path))
    assert list(three.beliefs) == free[:1]


def test_positions_count_from_the_place_of_the_scene(tmp_path):
    readings = log(tmp_path, SEEN_AND_HEARD)
    there = located(readings, UncertainScene(Scene(), place=Place(33.9, 35.5, 1400.0)))
    assert there.position[0] == pytest.approx([0, 0, 100], abs=1e-6)
    apart = [
        np.linalg.norm(of.position[0] - of.position[2]) for of in (readings, there)
    ]
    assert apart[0] == pytest.approx(apart[1], abs=1e-6)
    with pytest.raises(InputError, match=r"line 2: expected a sensor within .* away"):
        located(readings, UncertainScene(Scene(), place=Place(-33.9, 35.5)))


@pytest.mark.parametrize(("east", "is_free"), [(300.0, False), (500_000.0, True)])
def test_one_sensor_is_on_a_map_only_far_from_the_origin(tmp_path, east, is_free):
    head = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
    one = at(tmp_path, f"{head}a,peak_overpressure_pa,900,45,{east},0,1\n")
    found = for_log(default_scene(), one)
    assert ("charge_east_m" in found.beliefs) == is_free
