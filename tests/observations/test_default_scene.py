"""What the default scene and the starter scene of a log leave free."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import jblast
from jblast.errors import InputError
from jblast.observations import (
    observed,
    read,
    resolve_positions,
    some_rows,
    starter_scene,
)
from jblast.observations.grouping import located
from jblast.observations.scenes import clocks_to_free, for_log
from jblast.scene import (
    Free,
    Place,
    Scene,
    UncertainScene,
    default_scene,
    freed,
    read_scene,
)

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


BARE = "sensor,quantity,value,sigma\n"
POSITION = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
RANGE = "sensor,quantity,value,sigma,range_m\n"


@pytest.fixture
def start(tmp_path):
    """Return the log, its starter scene, and that scene as text."""

    def write(text):
        (tmp_path / "log.csv").write_text(text, encoding="utf-8")
        observations = read(tmp_path / "log.csv")
        text = starter_scene(observations)
        (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
        return observations, read_scene(tmp_path / "scene.toml"), text

    return write


def test_three_sensors_around_the_charge_free_its_place_and_time(start):
    observations, uncertain, text = start(
        POSITION
        + "a,air_arrival_s,1,0.001,30,0,0.1\n"
        + "b,air_arrival_s,1,0.003,0,30,0.1\n"
        + "c,air_arrival_s,1,,-30,0,0.1\n"
        + "a,air_arrival_s,1.1,0.005,30,0,0.1\n"
        + "b,peak_overpressure_pa,2000,100,0,30,0.1\n"
    )
    free = Free(positive=False)
    assert uncertain.beliefs == {
        "charge_mass_kg": Free(positive=True),
        "charge_east_m": free,
        "charge_north_m": free,
        "origin_time_s": free,
    }
    a, b, c = uncertain.scene.sensors
    assert (a.name, b.name, c.name) == ("a", "b", "c")
    assert a.records == (("air_arrival_s", 0.003),)  # the median, in seconds
    assert b.records == (("air_arrival_s", 0.003), ("peak_overpressure_pa", 0.05))
    assert c.records == ()
    assert "no sigma for air_arrival_s" in text
    assert "[ground]" not in text
    resolve_positions(observations, uncertain.scene, uncertain.beliefs)


def test_one_range_goes_into_the_scene(start):
    observations, uncertain, _ = start(RANGE + "a,positive_impulse_pa_s,70,,276.25\n")
    assert uncertain.scene.charge.range_m == 276.25
    placed = resolve_positions(observations, uncertain.scene, uncertain.beliefs)
    assert placed.slant_range[0] == 276.25


def test_a_sensor_at_an_unknown_range_frees_it(start):
    observations, uncertain, _ = start(BARE + "a,positive_impulse_pa_s,70,\n")
    assert set(uncertain.beliefs) == {"charge_mass_kg", "charge_range_m"}
    resolve_positions(observations, uncertain.scene, uncertain.beliefs)


def test_a_shock_radius_alone_leaves_place_and_time_fixed(start):
    observations, uncertain, text = start(
        "sensor,quantity,value,sigma,time_s\n"
        "camera,shock_radius_m,11.1,0.1,1e-4\n"
        "camera,shock_radius_m,19.9,0.2,3.8e-4\n"
    )
    assert set(uncertain.beliefs) == {"charge_mass_kg"}
    assert "position_m = [EAST" not in text
    resolve_positions(observations, uncertain.scene, uncertain.beliefs)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.text(st.characters(exclude_categories=("Cs",)), min_size=1).filter(
            lambda name: name == name.strip()
        ),
        min_size=1,
        unique=True,
    )
)
def test_any_name_of_a_sensor_survives_as_toml(tmp_path, names):
    observations = observed(
        names,
        ["air_arrival_s"] * len(names),
        np.ones(len(names)),
        np.full(len(names), np.nan),
        position=np.zeros((len(names), 3)),
        source=f"{names[0]}.csv",
    )
    (tmp_path / "scene.toml").write_text(
        starter_scene(observations), encoding="utf-8", newline="\n"
    )
    sensors = read_scene(tmp_path / "scene.toml").scene.sensors
    assert [sensor.name for sensor in sensors] == names


EARTH = "sensor,quantity,value_utc,sigma,clock,lat_deg,lon_deg,alt_m\n"
DATED = [
    f"{name},{quantity},2024-05-17T12:00:0{second}Z,0.01,{name},{place},1500\n"
    for name, place in (("a", "33.9,35.5"), ("b", "33.9,35.51"), ("c", "33.91,35.5"))
    for quantity, second in (("flash_time_s", 1), ("air_arrival_s", 3))
]


def test_it_frees_what_the_default_scene_does_at_the_same_places(start):
    log, uncertain, _ = start(EARTH + "".join(DATED))
    assert uncertain.beliefs.keys() == for_log(default_scene(), log).beliefs.keys()
    there = located(log, uncertain)
    assert there.frame == log.frame
    settled = resolve_positions(there, uncertain.scene, uncertain.beliefs)
    np.testing.assert_array_equal(settled.position, log.position)
    assert float(uncertain.scene.air.altitude) == 1500.0


def test_clocks_that_nothing_sets_are_commented_out(start):
    rows = [row for row in DATED if "flash" not in row]
    _, uncertain, text = start(EARTH + "".join(rows))
    assert not [name for name in uncertain.beliefs if "clock" in name]
    assert text.count("# [[clock]]") == 2
    assert '# name = "b"' in text
