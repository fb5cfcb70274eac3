import tomllib

import pytest

from jblast.errors import InputError
from jblast.scene.reader.scene import (
    read_scene_or_world,
    read_vehicle,
)
from jblast.scene.reader.tables import KEYS, VEHICLE_MODELS
from jblast.vehicle import hold_of
from jblast.vehicle.control.position_hold import NAMED_GAINS
from jblast.vehicle.quadrotor import PARAMETERS

PLACED = {"model": '"iris"', "position_m": "[10, -5, 2]"}


@pytest.fixture
def vehicle():
    def read(**changed):
        entries = {**PLACED, **changed}
        lines = [f"{key} = {value}" for key, value in entries.items() if value]
        document = tomllib.loads("\n".join(["[vehicle]", *lines, ""]))
        spec = read_vehicle(document, "scene.toml")
        assert spec is not None
        return spec

    return read


def test_what_is_not_said_takes_its_default(vehicle):
    spec = vehicle()
    assert spec.model == "iris"
    assert spec.position.tolist() == [10, -5, 2]
    assert spec.velocity.tolist() == [0, 0, 0]
    assert (spec.target, spec.integral, float(spec.yaw)) == (None, None, 0)
    assert spec.gains == {}


def test_every_key_arrives_where_it_belongs(vehicle):
    spec = vehicle(
        velocity_m_s="[1, 0, -0.5]",
        control="{ integral = false, target_m = [10, 0, 3], yaw_rad = 0.5, "
        "kp_pos = [6, 7, 8], ki_pos = [1, 0, 2], kp_att = 100, integral_limit = 3, "
        "motor_lead = 2 }",
    )
    assert spec.velocity.tolist() == [1, 0, -0.5]
    assert spec.integral is False
    assert spec.target is not None
    assert spec.target.tolist() == [10, 0, 3]
    assert float(spec.yaw) == 0.5
    assert {name: value.tolist() for name, value in spec.gains.items()} == {
        "kp_pos": [6, 7, 8],
        "ki_pos": [1, 0, 2],
        "kp_att": 100,
        "integral_limit": 3,
        "motor_lead": 2,
    }
    lead = hold_of(spec, integral=True).gains.motor_lead
    assert lead is not None
    assert float(lead) == 2


def test_a_mission_stands_beside_its_scene_and_begins_at_home():
    entries = {"model": "iris", "mission": "plans/a.plan"}
    spec = read_vehicle({"vehicle": entries}, "there/scene.toml")
    assert spec is not None
    assert spec.mission == "there/plans/a.plan"
    assert not spec.placed
    placed = read_vehicle({"vehicle": entries | {"position_m": [3, 4, 0]}}, "a.toml")
    assert placed is not None
    assert placed.placed
    with pytest.raises(InputError, match="jblast fly and world support missions"):
        hold_of(placed, integral=True)


def test_models_and_gains_are_those_that_fly():
    assert set(VEHICLE_MODELS) == set(PARAMETERS)
    for table in NAMED_GAINS.values():
        assert set(table) <= set(KEYS["control"])


BROKEN = {
    "no model": ({"model": None}, ["model: expected one of crazyflie", "got nothing"]),
    "misspelt model": ({"model": '"crazyfly"'}, ["model", "did you mean crazyflie?"]),
    "no place": ({"position_m": None}, ["position_m", "[east, north, up]"]),
    "place with a prior": (
        {"position_m": "[{ normal = [0, 1] }, 0, 2]"},
        ["position_m", "prior is not supported yet"],
    ),
    "free velocity": ({"velocity_m_s": "['free', 0, 0]"}, ["velocity_m_s", "free"]),
    "unknown key": ({"positon_m": "[1, 2, 3]"}, ["did you mean position_m?"]),
    "mission that is a number": ({"mission": "3"}, ["mission", "a name", "got 3"]),
    "mission from a speed": (
        {"mission": '"a.plan"', "velocity_m_s": "[1, 0, 0]"},
        ["velocity_m_s", "with a mission"],
    ),
    "mission and a place to hold": (
        {"mission": '"a.plan"', "control": "{ target_m = [1, 2, 3] }"},
        ["control target_m", "with a mission"],
    ),
    "control that is a word": ({"control": '"hold"'}, ["control", "got 'hold'"]),
    "unknown gain": (
        {"control": "{ kp_position = [1, 1, 1] }"},
        ["control kp_position", "did you mean kp_pos?"],
    ),
    "integral that is a number": (
        {"control": "{ integral = 1 }"},
        ["control integral", "true or false", "got 1"],
    ),
    "negative gain": (
        {"control": "{ kd_pos = [4, -4, 9] }"},
        ["control kd_pos", "not negative", "-4"],
    ),
    "lead below one": (
        {"control": "{ motor_lead = 0.5 }"},
        ["control motor_lead", "1 and more", "0.5"],
    ),
    "gain of one number": ({"control": "{ kp_pos = 6 }"}, ["control kp_pos", "got 6"]),
    "gain of three": ({"control": "{ kp_att = [1, 2, 3] }"}, ["control kp_att"]),
    "integral gains of zero": (
        {"control": "{ integral = true, ki_pos = [0, 0, 0] }"},
        ["control ki_pos", "above zero"],
    ),
    "target of two numbers": ({"control": "{ target_m = [1, 2] }"}, ["target_m"]),
}


@pytest.mark.parametrize(("changed", "said"), BROKEN.values(), ids=BROKEN)
def test_a_broken_vehicle_is_refused_by_file_and_key(vehicle, changed, said):
    with pytest.raises(InputError) as caught:
        vehicle(**changed)
    message = str(caught.value)
    assert message.startswith("scene.toml: [vehicle]")
    for words in said:
        assert words in message, message


def test_a_vehicle_may_fly_without_a_charge_but_a_fit_has_a_free_one(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text('[vehicle]\nmodel = "iris"\nposition_m = [0, 0, 5]\n')
    uncertain, world = read_scene_or_world(file, needs_charge=False)
    assert world is None
    assert bool(uncertain.scene.charge.never)
    assert not uncertain.beliefs
    uncertain, _ = read_scene_or_world(file)
    assert "charge_mass_kg" in uncertain.beliefs
    assert not bool(uncertain.scene.charge.never)
