"""Presets: what a scene may say beside them, and the clocks that they go by."""

import numpy as np
import pytest

from jblast.cli.parsers import parsed
from jblast.errors import InputError
from jblast.scene import Box, ByTick, UncertainScene, Uniform
from jblast.scene.reader.scene import world_from_document
from jblast.sensors.listening import plan
from jblast.world import PRESETS, arrivals_in, draw_world, readings_of, with_preset

WORDS = ("world", "w.toml", "--out", "run")
CODED, PRINTED = PRESETS["thesis-as-coded"], PRESETS["thesis-as-printed"]
VEHICLE = {"model": "hummingbird", "position_m": [0.0, 0.0, 10.0]}
# 26 m from a charge of 10 kg at the origin, the case of the reference
SENSORS = [
    {
        "name": name,
        "kind": kind,
        "position_m": [24.0, 0.0, 10.0],
        "rate_hz": 8000,
        "records": {"air_arrival_s": 1e-9},
    }
    for name, kind in (("ear", "microphone"), ("gauge", "pressure"))
]
ONE = {"count": 1, "region_m": {"ring": [0, 1e-6]}, "about": "world"}


def drawn(preset, document):
    tables = with_preset(document, preset, "w.toml")
    return draw_world(*world_from_document(tables, "w.toml"), seed=3, preset=preset)


def test_a_silent_scene_gets_the_presets_blasts():
    _, spec = world_from_document(
        with_preset({"vehicle": VEHICLE}, CODED, "w.toml"), "w.toml"
    )
    assert spec.occurrence == ByTick(0.15, 0.5)
    assert spec.about == "vehicle"
    assert isinstance(spec.region, Box)
    assert isinstance(spec.mass, Uniform)
    np.testing.assert_array_equal(spec.region.low, [10.0, 10.0, 10.0])
    assert (float(spec.mass.lo), float(spec.mass.hi)) == (10.0, 11.0)


def test_what_a_scene_says_of_its_blasts_stands():
    said = {"world": {"count": 3, "mass_kg": 2.0}}
    world = with_preset(said, PRINTED, "w.toml")["world"]
    assert world["count"] == 3
    assert world["mass_kg"] == 2.0
    assert "probability" not in world
    assert "tick_s" not in world
    assert world["region_m"] == {"ring": [10.0, 20.0]}


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("law", "air_arrival_s", "kingery_bulmash"),
        ("air", "sound_speed_m_s", 343.0),
        ("ground", "path", "head"),
    ],
)
def test_a_scene_that_says_otherwise_is_refused(table, key, value):
    document = {"vehicle": VEHICLE, table: {key: value}}
    with pytest.raises(InputError, match=rf"w.toml: \[{table}\] {key}: expected"):
        with_preset(document, CODED, "w.toml")


def test_a_scene_that_says_the_same_is_not():
    document = {"vehicle": VEHICLE, "ground": {"path": "thesis"}}
    document["law"] = {"air_arrival_s": "auto"}
    made = with_preset(document, CODED, "w.toml")
    assert made["ground"]["p_speed_m_s"] == 6000.0
    assert made["law"]["air_arrival_s"] == "wu_hao"


def test_the_command_offers_the_presets_there_are():
    for name in PRESETS:
        asked = parsed([*WORDS, "--preset", name])
        assert asked.preset == name


def test_blasts_about_a_vehicle_that_is_not_there_are_refused_in_the_users_words():
    with pytest.raises(InputError, match="expected a region, or a \\[vehicle\\]"):
        with_preset({}, CODED, "w.toml")


def test_coded_pressure_comes_after_its_own_sound():
    world = drawn(
        CODED, {"world": ONE | {"mass_kg": 10.0}, "sensor": SENSORS, "vehicle": VEHICLE}
    )
    arrivals = arrivals_in(world)
    times = dict(
        zip(arrivals.entities, arrivals.times_s["air_arrival_s"][:, 0], strict=True)
    )
    origin = float(world.charges[0].time_s)
    # reference/thesis_as_coded.md: 86.7 ms and 60.4 ms at 26 m, 10 kg; the place of
    # the charge is drawn within a micrometre
    assert times["gauge"] - origin == pytest.approx(26.0 / 300.0, abs=1e-7)
    assert times["ear"] - origin == pytest.approx(60.4e-3, abs=5e-5)
    assert times["vehicle"] - origin == pytest.approx(10.0 / 300.0, abs=1e-7)
    log, _ = readings_of(world, arrivals, 100.0)
    assert log is not None
    read = dict(zip(log.sensor, log.value, strict=True))
    for name in ("ear", "gauge"):
        assert read[name] == pytest.approx(times[name], abs=1e-7)


def test_records_of_samples_go_by_the_same_clocks():
    world = drawn(CODED, {"world": ONE, "sensor": SENSORS})
    heard = plan(UncertainScene(world.scene, source="w"), 0, 5.0, {}, CODED.scene_of)
    told = heard.truth.values["air_arrival_s"][:, 0]
    comes = arrivals_in(world).times_s["air_arrival_s"][:, 0]
    np.testing.assert_allclose(told, comes, atol=1e-9)
    assert comes[1] > comes[0] + 20e-3


def test_printed_pressure_comes_with_its_sound():
    world = drawn(PRINTED, {"world": ONE, "sensor": SENSORS})
    (ear,), (gauge,) = arrivals_in(world).times_s["air_arrival_s"]
    assert ear == pytest.approx(gauge, abs=1e-12)
