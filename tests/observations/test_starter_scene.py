import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jblast.observations import observed, read, resolve_positions, starter_scene
from jblast.observations.grouping import located
from jblast.observations.scenes import for_log
from jblast.scene import Free, default_scene, read_scene

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
