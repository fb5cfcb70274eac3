"""A scene file arrives in a scene; what no single key states is refused."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from jblast.errors import InputError
from jblast.quantities import ADDITIVE, QUANTITIES
from jblast.scene import (
    PARAMETERS,
    Ambient,
    Box,
    ByCount,
    ByRate,
    ByTick,
    Free,
    Imu,
    Instrument,
    LogNormal,
    LogUniform,
    Normal,
    Place,
    Ring,
    Uniform,
    quaternion_matrix,
    read_scene,
    value_of,
    with_values,
)
from jblast.scene.keys import RECORDS, VEHICLE_MODELS, keys_of
from jblast.scene.reader import (
    read_scene_or_world,
    scene_from_document,
    world_from_document,
)
from jblast.scene.values import Share, share_text
from jblast.vehicle import hold_of
from jblast.vehicle.quadrotor import GAINS, PARAMETERS as MODELS

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
absorption = true
absorption_scale = 2.0
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
[[clock]]
name = "phone"
offset_s = "free"
[place]
lat_deg = 33.9
lon_deg = 35.5
[law]
air_arrival_s = "kingery_bulmash"
ground_arrival_s = "auto"
scatter = false
sedov_gamma = { uniform = [1.2, 1.4] }
fireball_growth_s = { loguniform = [1e-3, 1e-1] }
"""
VEHICLE = '[vehicle]\nmodel = "iris"\nposition_m = [10, -5, 2]\n'
CAMERA = "[camera]\nwidth = 346\nheight = 260\nfocal_px = 300\n"
PLACED = CAMERA + "position_m = [0, -50, 2]\n"


def read(text) -> Any:
    return scene_from_document(tomllib.loads(text), "there/s.toml")


def world(**keys) -> Any:
    document = {"world": keys} | tomllib.loads(VEHICLE)
    return world_from_document(document, "s.toml")[1]


def sensor(text) -> Any:
    (one,) = read(f"{VEHICLE}[[sensor]]\nname = 'a'\n{text}").scene.sensors
    return one


@pytest.mark.parametrize("start", ["", "\ufeff"])
def test_every_number_and_word_arrives_where_it_belongs(start, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(start + FULL, "utf-8", newline="\r\n")
    uncertain = read_scene(path)
    scene, beliefs = uncertain.scene, dict(uncertain.beliefs)
    charge, air = scene.charge, scene.air
    assert (charge.mass_kg, charge.time_s, charge.burst) == (15, -0.25, "free-air")
    assert charge.position_m == (1, 2, 0)
    assert charge.range_m is None
    assert (air.wind_east, air.wind_north, air.sound_speed) == (3, 0, 345)
    assert (air.temperature, air.pressure, air.relative_humidity) == (290, 9e4, 0.25)
    assert (air.absorption, air.absorption_scale, air.altitude) == (True, 2, None)
    assert (scene.ground.p_speed, scene.ground.path) == (5000, "thesis")
    a, b = scene.sensors
    assert (a.name, a.kind, b.name, b.kind) == ("a", "pressure", "b", "")
    np.testing.assert_array_equal(a.position_m, [20, 0, 1.5])
    assert a.records == (("air_arrival_s", 1e-3), ("peak_overpressure_pa", 0.05))
    assert np.isnan(b.position_m).all()
    assert scene.clock_offsets() == {"a": 0.5, "b": 2, "phone": 0}
    assert scene.law == (("air_arrival_s", "kingery_bulmash"),)
    assert scene.scatter is False
    assert uncertain.place == Place(33.9, 35.5, 0)
    numbers = {name: tuple(map(float, vars(b).values())) for name, b in beliefs.items()}
    kinds = {name: type(belief) for name, belief in beliefs.items()}
    assert numbers == {
        "tnt_factor": pytest.approx((1.1, 0.1)),
        "charge_north_m": (2, 0.5),
        "charge_up_m": (False,),
        "air_sound_speed_m_s": (345, 2),
        "wind_north_m_s": (False,),
        "ground_p_speed_m_s": pytest.approx((5000, 1.2)),
        "clock_offset_s.b": (2, 0.5),
        "clock_offset_s.phone": (False,),
        "sedov_gamma": pytest.approx((1.2, 1.4)),
        "fireball_growth_s": pytest.approx((1e-3, 1e-1)),
    }
    assert kinds["charge_up_m"] is Free
    assert kinds["tnt_factor"] is Normal
    assert kinds["ground_p_speed_m_s"] is LogNormal
    assert kinds["sedov_gamma"] is Uniform
    assert kinds["fireball_growth_s"] is LogUniform
    # a fit starts at the median
    assert value_of(scene, "sedov_gamma") == pytest.approx(1.3)
    assert value_of(scene, "fireball_growth_s") == pytest.approx(1e-2)


def test_an_empty_file_is_the_default_scene():
    uncertain = read("")
    assert uncertain.beliefs == {"charge_mass_kg": Free(positive=True)}
    for name, row in PARAMETERS.items():
        assert value_of(uncertain.scene, name) in (row.default, None)


def test_several_charges_keep_what_is_theirs_by_name():
    uncertain = read(
        "[[charge]]\nname = 'first'\nmass_kg = 2.0\nexplosive = 'comp b'\n"
        "[[charge]]\nname = 'second'\nposition_m = [5, 'free', 0]\ntime_s = 'free'\n"
    )
    first, second = uncertain.scene.charges
    assert (first.name, first.mass_kg, first.explosive) == ("first", 2, "Comp B")
    assert (second.name, second.east) == ("second", 5)
    names = ("charge_mass_kg", "charge_north_m", "origin_time_s")
    assert set(uncertain.beliefs) == {f"{name}.second" for name in names}
    moved = with_values(uncertain.scene, {"charge_mass_kg.second": 7.0})
    assert [charge.mass_kg for charge in moved.charges] == [2, 7]


def test_instruments_have_the_unit_of_their_kind_and_are_ideal_by_default():
    shared = (
        "rate_hz = 44100\nbits = 24\nfilter_hz = [20, 2e4]\nsaturation = 'compress'\n"
    )
    for kind, unit in (
        ("microphone", "pa"),
        ("geophone", "m_s"),
        ("anemometer", "m_s"),
    ):
        text = (
            f"kind = '{kind}'\nfull_scale_{unit} = 200\nnoise_{unit} = 0.02\n{shared}"
        )
        expected = Instrument(44100, 200.0, 0.02, 24, 20.0, 2e4, "compress")
        assert sensor(text).instrument == expected
    assert sensor("kind = 'microphone'").instrument is None
    assert sensor("rate_hz = 8000").instrument == Instrument(rate=8000.0)
    ideal = sensor("bits = 'float'\nfilter_hz = ['none', 300]").instrument
    assert ideal == Instrument(low_pass=300.0)


def test_an_imu_on_a_vehicle_has_all_of_its_keys():
    numbers = [800, 160, 17.5, 1e-3, 2e-4, 0.1, 0.0, 1e-4, 1e-5]
    keys = zip(keys_of_imu(), numbers, strict=True)
    text = "kind = 'imu'\nmount = 'vehicle'\nbits = 'float'\n"
    one = sensor(text + "".join(f"{key} = {value}\n" for key, value in keys))
    assert one.imu == Imu(*numbers, bits=None)
    assert sensor("kind = 'imu'\nmount = 'vehicle'").imu is None
    assert sensor("kind = 'imu'\nmount = 'vehicle'\nrate_hz = 500").imu == Imu(rate=500)


def keys_of_imu():
    start = ["rate_hz", "full_scale_m_s2", "full_scale_rad_s", "noise_m_s2_sqrt_hz"]
    bias = [
        "bias_m_s2",
        "bias_rad_s",
        "bias_walk_m_s2_sqrt_s",
        "bias_walk_rad_s_sqrt_s",
    ]
    return [*start, "noise_rad_s_sqrt_hz", *bias]


def test_ambient_sound_is_noise_or_a_recording_beside_the_file():
    noise = read("[ambient]\nlevel_pa = 0.1\nslope_db_octave = -3\nheight_m = 20")
    assert noise.scene.ambient == Ambient(0.1, -3.0, 20.0)
    recorded = read("[ambient]\nfile = 'loop.wav'\nfull_scale_pa = 3").scene.ambient
    assert recorded == Ambient(file="there/loop.wav", full_scale=3.0)


def test_a_mounted_sensor_or_camera_has_a_place_on_the_body_or_its_centre():
    one = sensor(
        "mount = 'vehicle'\noffset_m = [1, 2, 3]\nquaternion_xyzw = [0, 0, 2, 0]"
    )
    assert (one.offset_m.tolist(), one.quaternion.tolist()) == ([1, 2, 3], [0, 0, 2, 0])
    assert np.isnan(one.position_m).all()
    assert sensor("mount = 'vehicle'").offset_m.tolist() == [0, 0, 0]
    camera = read(f"{VEHICLE}{CAMERA}mount = 'vehicle'").scene.camera
    right, down, ahead = np.asarray(quaternion_matrix(camera.quaternion)).T
    np.testing.assert_allclose(
        [right, down, ahead], [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
    )
    assert camera.position.tolist() == [0, 0, 0]


def test_a_camera_has_its_defaults_or_what_the_file_states():
    camera = read(f"{PLACED}look_at_m = [0, 0, 2]").scene.camera
    axes = np.asarray(quaternion_matrix(camera.quaternion)).T
    np.testing.assert_allclose(axes, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)
    assert camera.focal.tolist() == [300, 300]
    assert camera.center.tolist() == [172.5, 129.5]  # the first pixel's centre is 0
    assert (camera.frames_hz, camera.exposure_s, camera.daylight) == (1000, 0, None)
    camera = read(
        PLACED.replace("300", "[300, 310]") + "quaternion_xyzw = [-2, 0, 0, 2]\n"
        "center_px = [170, 131.25]\ndistortion = [-0.3, 0.1, 1e-3, -2e-3, 0.01]\n"
        "frames_hz = 500\nexposure_s = 2e-3\nthreshold = [0.2, 0.3]\ndaylight_lux = 9e4"
    ).scene.camera
    assert camera.quaternion.tolist() == pytest.approx([-(0.5**0.5), 0, 0, 0.5**0.5])
    assert camera.focal.tolist() == [300, 310]
    assert camera.center.tolist() == [170, 131.25]
    assert camera.distortion.tolist() == [-0.3, 0.1, 1e-3, -2e-3, 0.01]
    assert (camera.frames_hz, camera.exposure_s, camera.daylight) == (500, 2e-3, 9e4)
    assert camera.threshold.tolist() == [0.2, 0.3]


def test_a_vehicle_holds_its_position_or_flies_a_mission_from_its_home():
    spec = read(VEHICLE).scene.vehicle
    assert (spec.model, spec.position.tolist()) == ("iris", [10, -5, 2])
    assert (spec.target, spec.integral, spec.yaw, spec.gains) == (None, None, 0, {})
    assert spec.velocity.tolist() == [0, 0, 0]
    gains = {"kp_pos": [6, 7, 8], "ki_pos": [1, 0, 2], "kp_att": 100, "motor_lead": 2}
    control = {"integral": False, "target_m": [10, 0, 3], "yaw_rad": 0.5} | gains
    entry = {"model": "iris", "position_m": [1, 2, 3], "velocity_m_s": [1, 0, -0.5]}
    document = {"vehicle": entry | {"control": control}}
    spec: Any = scene_from_document(document, "s.toml").scene.vehicle
    assert (spec.integral, spec.target.tolist(), spec.yaw) == (False, [10, 0, 3], 0.5)
    assert spec.velocity.tolist() == [1, 0, -0.5]
    assert {name: gain.tolist() for name, gain in spec.gains.items()} == gains
    assert hold_of(spec, integral=True).gains.motor_lead == 2
    spec = read("[vehicle]\nmodel = 'iris'\nmission = 'plans/a.plan'").scene.vehicle
    assert (spec.mission, spec.placed) == ("there/plans/a.plan", False)
    spec = read(f"{VEHICLE}mission = 'a.plan'").scene.vehicle
    assert spec.placed
    with pytest.raises(InputError, match="jblast fly and world support missions"):
        hold_of(spec, integral=True)


def test_models_and_gains_are_those_that_fly():
    assert set(VEHICLE_MODELS) == set(MODELS)
    for model in MODELS.values():
        assert {*GAINS} & {*model} <= set(keys_of("control"))


def test_a_vehicle_may_fly_without_a_charge_but_a_fit_has_a_free_one(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(VEHICLE)
    uncertain, random = read_scene_or_world(file, needs_charge=False)
    assert (random, uncertain.beliefs) == (None, {})
    assert bool(uncertain.scene.charge.never)
    uncertain, _ = read_scene_or_world(file)
    assert "charge_mass_kg" in uncertain.beliefs
    assert not bool(uncertain.scene.charge.never)


def test_random_blasts_are_as_the_reference_page_prints_or_as_stated():
    default = world()
    assert (default.occurrence, default.about) == (ByCount(5), "world")
    np.testing.assert_array_equal(default.region.low, [-50, -50, 0])
    np.testing.assert_array_equal(default.region.high, [50, 50, 0])
    assert (default.mass.lo, default.mass.hi, default.gap) == (5, 15, 0.5)
    assert default.window == (1, 20)
    other = world(mass_kg=[1, 2], gap_s={"uniform": [0.1, 0.2]}, rate_hz=2.0)
    assert isinstance(other.mass, Uniform)
    assert isinstance(other.gap, Uniform)
    assert isinstance(other.occurrence, ByRate)
    assert isinstance(world(mass_kg={"lognormal": [5, 2]}).mass, LogNormal)
    assert world(probability=0.15, tick_s=1.0).occurrence == ByTick(0.15, 1.0)
    assert world(count=3).occurrence == ByCount(3)
    box = world(region_m={"box": [[0, 1, 2], [3, 4, 2]]}).region
    assert isinstance(box, Box)
    assert (box.low.tolist(), box.high.tolist()) == ([0, 1, 2], [3, 4, 2])
    inside = world(region_m={"ring": [10, 20], "about": "vehicle"})
    beside = world(region_m={"ring": [10, 20]}, about="vehicle")
    assert isinstance(inside.region, Ring)
    assert inside.about == beside.about == "vehicle"
    # twenty blasts a second apart fit into nineteen seconds
    assert world(count=20, time_s=[0, 19], gap_s=1).occurrence == ByCount(20)


def test_with_random_blasts_a_missing_charge_never_detonates():
    uncertain, _ = world_from_document({"world": {}}, "s.toml")
    assert uncertain.scene.charge.never
    assert not uncertain.beliefs
    both = {"world": {}, "charge": {"mass_kg": 3.0}}
    assert not world_from_document(both, "s.toml")[0].scene.charge.never


@given(st.sampled_from(list(QUANTITIES)), st.floats(1e-4, 10.0))
def test_what_is_written_for_a_sigma_is_read_again(quantity, sigma):
    """To the three digits that are written, half of the last: 0.5 %."""
    text = share_text(sigma).strip('"')
    (key,) = (one for one in RECORDS if one.name == quantity)
    again = key.value.read(sigma if quantity in ADDITIVE else text, "s")
    assert again == pytest.approx(sigma, rel=5e-3)


@pytest.mark.parametrize("text", ["5%", " 5 % ", "5.0%", "0.5e1%", "5.%"])
def test_a_share_is_a_hundredth_of_its_percentage(text):
    assert Share("m").read(text, "s") == 0.05


LINES = (Path(__file__).parent / "refused.txt").read_text().splitlines()
"""Tables, separated by semicolons, and words of their refusal; V, C, P are blocks."""


@pytest.mark.parametrize("line", LINES, ids=lambda line: line.split(" => ")[0])
def test_what_no_scene_has_is_refused_by_file_key_expectation_and_find(line, tmp_path):
    text, said = line.split(" => ")
    placed = PLACED.replace(
        "focal_px = 300\n", "" if "focal" in text else "focal_px = 300\n"
    )
    blocks = {"V": VEHICLE, "C": CAMERA, "P": placed}
    path = tmp_path / "s.toml"
    path.write_text("\n".join(blocks.get(part) or part for part in text.split(";")))
    with pytest.raises(InputError) as caught:
        read_scene(path)
    message = str(caught.value)
    assert "s.toml" in message
    for words in said.split(" | "):
        assert words in message, message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            {"count": 21, "time_s": [0, 19], "gap_s": 1},
            "count: expected at most 20, which",
        ),
        ({"count": 2, "time_s": 3}, "count: expected at most 1"),
        ({"count": 2, "time_s": 3, "gap_s": 0}, "count: expected at most 1"),
        (
            {"region_m": {"box": [[0, 0, 0], [0, 5, 0]]}},
            "region_m box: .* with an area",
        ),
        (
            {"region_m": {"box": [[1, 1, 1], [2, 2, 0]]}},
            "region_m box: .* not higher",
        ),
        (
            {"region_m": {"box": [[0, 0, 0], [5, 0, 0]]}},
            "region_m box: .* with an area",
        ),
        ({"region_m": {"box": [[0, 0, 0]]}}, "region_m box: expected"),
        ({"region_m": {"ring": [5, 5]}}, "region_m ring: .*increasing order, got"),
        ({"region_m": {"ring": [-1, 5]}}, "region_m ring.0.: .*not negative, got -1"),
        ({"region_m": 5}, "region_m: expected { box = "),
        ({"about": "world", "region_m": {"about": "world"}}, "about: expected it once"),
        (
            {"mass_kg": "free"},
            "mass_kg: expected a number .* to sample from, got 'free'",
        ),
        (
            {"time_s": {"normal": [10, 1]}},
            "gap_s: expected 0 between times that are not",
        ),
        ({"rate_hz": 1, "time_s": 3}, "time_s: .*the interval with blasts"),
    ],
)
def test_random_blasts_that_cannot_be_are_refused(keys, said):
    with pytest.raises(InputError, match=rf"s\.toml: \[world\] {said}"):
        world(**keys)


def test_what_a_file_of_random_blasts_lacks_is_named(tmp_path):
    for document, said in (
        ({}, r"\[world\]: expected a table of random blasts, got none"),
        ({"world": {"about": "vehicle"}}, r"about: expected a \[vehicle\]"),
    ):
        with pytest.raises(InputError, match=said):
            world_from_document(document, "s.toml")
    with pytest.raises(InputError, match=r"none\.toml: no such file; expected a scene"):
        read_scene(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b"# caf\xe9\n")
    with pytest.raises(InputError, match="line 1: expected UTF-8 text"):
        read_scene(tmp_path / "latin.toml")
