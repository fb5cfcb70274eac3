"""A scene file arrives in a scene, key by key."""

import numpy as np
import pytest

from jblast.scene import (
    Free,
    LogNormal,
    LogUniform,
    Normal,
    Uniform,
)
from jblast.scene.uncertain import value_of, with_values
from tests.scene.reader.alone import ALONE

FULL = """
schema = 1
[charge]
name = "main"
mass_kg = 15.0
explosive = "TNT"
tnt_factor = { normal = [1.1, 0.1] }
position_m = [1.0, { normal = [2.0, 0.5] }, "free"]
time_s = -0.25
burst = "free-air"
[air]
temperature_k = 290
pressure_pa = 9e4
relative_humidity = 0.25
sound_speed_m_s = { normal = [345.0, 2.0] }
wind_m_s = [3.0, "free"]
[ground]
p_speed_m_s = { lognormal = [5000.0, 1.2] }
path = "thesis"
[[sensor]]
name = "a"
kind = "pressure"
position_m = [20.0, 0, 1.5]
clock_offset_s = 0.5
records = { air_arrival_s = 1e-3, peak_overpressure_pa = "5%" }
[[sensor]]
name = "b"
clock_offset_s = { normal = [2.0, 0.5] }
[law]
air_arrival_s = "kingery_bulmash"
ground_arrival_s = "auto"
scatter = false
sedov_gamma = { uniform = [1.2, 1.4] }
"""
TWO_CHARGES = """
[[charge]]
name = "first"
mass_kg = 2.0
explosive = "comp b"
[[charge]]
name = "second"
position_m = [5.0, "free", 0.0]
time_s = "free"
burst = "free-air"
"""


def test_several_charges_keep_what_is_theirs_by_name(scene):
    uncertain = scene(TWO_CHARGES)
    first, second = uncertain.scene.charges
    assert (first.name, first.mass_kg, first.explosive) == ("first", 2, "Comp B")
    assert (second.name, second.east, second.burst) == ("second", 5, "free-air")
    assert set(uncertain.beliefs) == {
        "charge_mass_kg.second",
        "charge_north_m.second",
        "origin_time_s.second",
    }
    moved = with_values(uncertain.scene, {"charge_mass_kg.second": 7.0})
    assert (moved.charges[0].mass_kg, moved.charges[1].mass_kg) == (2, 7)


def assert_is(belief, kind, *numbers):
    assert type(belief) is kind
    assert tuple(map(float, vars(belief).values())) == numbers


def test_every_key_of_the_contract_arrives_where_it_belongs(scene):
    uncertain = scene(FULL)
    charge, air = uncertain.scene.charge, uncertain.scene.air
    assert charge.mass_kg == 15
    assert (charge.east, charge.north, charge.up) == (1, 2, 0)
    assert charge.time_s == -0.25
    assert charge.range_m is None
    assert charge.burst == "free-air"
    assert charge.tnt_factor == pytest.approx(1.1)
    assert (air.wind_east, air.wind_north) == (3, 0)
    assert uncertain.scene.ground.path == "thesis"
    assert (air.temperature, air.pressure, air.relative_humidity) == (290, 9e4, 0.25)
    assert air.sound_speed == 345
    assert air.altitude is None
    assert uncertain.scene.ground.p_speed == 5000
    a, b = uncertain.scene.sensors
    assert (a.name, a.kind, b.name, b.kind) == ("a", "pressure", "b", "")
    np.testing.assert_array_equal(a.position_m, [20, 0, 1.5])
    assert (a.clock_offset_s, b.clock_offset_s) == (0.5, 2)
    assert a.records == (("air_arrival_s", 1e-3), ("peak_overpressure_pa", 0.05))
    assert np.isnan(b.position_m).all()
    assert b.records == ()
    assert uncertain.scene.law == (("air_arrival_s", "kingery_bulmash"),)
    assert uncertain.scene.scatter is False
    assert uncertain.scene.sedov_gamma == pytest.approx(1.3)
    assert uncertain.source.endswith("scene.toml")
    beliefs = dict(uncertain.beliefs)
    assert beliefs.pop("charge_up_m") == Free(positive=False)
    assert_is(beliefs.pop("charge_north_m"), Normal, 2, 0.5)
    assert_is(beliefs.pop("air_sound_speed_m_s"), Normal, 345, 2)
    assert_is(beliefs.pop("tnt_factor"), Normal, 1.1, 0.1)
    assert_is(beliefs.pop("clock_offset_s.b"), Normal, 2, 0.5)
    assert beliefs.pop("wind_north_m_s") == Free(positive=False)
    assert_is(beliefs.pop("ground_p_speed_m_s"), LogNormal, 5000, 1.2)
    assert_is(beliefs.pop("sedov_gamma"), Uniform, 1.2, 1.4)
    assert beliefs == {}


def test_an_empty_file_is_the_default_scene(scene):
    uncertain = scene("")
    assert uncertain.beliefs == {"charge_mass_kg": Free(positive=True)}
    assert uncertain.scene.charge.time_s == 0
    assert uncertain.scene.charge.burst is None  # the height decides: the surface
    assert uncertain.scene.air.temperature == 288.15
    assert uncertain.scene.air.pressure == 101325
    assert uncertain.scene.air.relative_humidity == 0.5
    assert uncertain.scene.air.sound_speed is None
    assert uncertain.scene.ground.p_speed == 5660
    assert uncertain.scene.sensors == ()
    assert uncertain.scene.scatter is True
    assert uncertain.scene.sedov_gamma == 1.4


@pytest.mark.parametrize("one", ALONE, ids=lambda one: one.name)
def test_every_number_may_be_free(scene, one):
    uncertain = scene(f'[{one.key.table}]\n{one.key.name} = "free"\n')
    assert uncertain.beliefs[one.name] == Free(positive=one.positive)
    assert value_of(uncertain.scene, one.name) == one.default


def test_the_median_of_a_prior_is_where_a_fit_starts(scene):
    uncertain = scene("[charge]\nrange_m = { loguniform = [10, 1000] }\n")
    assert uncertain.scene.charge.range_m == pytest.approx(100)
    assert_is(uncertain.beliefs["charge_range_m"], LogUniform, 10, 1000)


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(scene):
    text = "\ufeff" + FULL.replace("\n", "\r\n")
    assert scene(text).scene.charge.mass_kg == 15
