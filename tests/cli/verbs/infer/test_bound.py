import json

import pytest

from tests.cli.cli_files import SENSORS, table

ANSWER = {
    "schema": int,
    "at": dict,
    "law": dict,
    "law_reason": dict,
    "law_valid": bool,
    "parameters": dict,
    "free": list,
    "identifiable": bool,
    "null_directions": list,
    "ambiguities": list,
    "determined": list,
    "noise": str,
    "n_observations": int,
    "help": list,
    "leans_on": list,
    "mass_exponents": dict,
    "warnings": list,
}
FREE = '[charge]\nmass_kg = "free"\n' + SENSORS
ONE = """[charge]
mass_kg = "free"
[[sensor]]
name = "a"
position_m = [30.0, 0.0, 1.0]
records = { peak_overpressure_pa = "5%" }
"""
"""As much as a bound can be of: every other candidate is programs of its own."""
PRIOR = "[charge]\nmass_kg = { lognormal = [15.0, 3.0] }\n" + SENSORS


def of_contract(out: str) -> dict:
    """Return the JSON, its keys and types those of the contract."""
    answer = json.loads(out)
    assert list(answer) == list(ANSWER)
    for key, kind in ANSWER.items():
        assert type(answer[key]) is kind, key
    assert list(answer["parameters"]) == answer["free"] == list(answer["at"])
    for spread in answer["parameters"].values():
        assert spread.keys() == {"sd", "log_sd"}
    doubts = answer["null_directions"] or answer["ambiguities"]
    assert answer["identifiable"] == (not doubts)
    return answer


@pytest.mark.parametrize(
    ("plan", "rows"), [(ONE, 1), pytest.param(FREE, 4, marks=pytest.mark.slow)]
)
def test_json_has_every_key_and_stdout_holds_nothing_else(jblast, plan, rows):
    scene = jblast.file("plan.toml", plan)
    asked = ("bound", scene, "--at", "charge_mass_kg=15", "--json")
    code, out, err = jblast(*asked)
    assert (code, err) == (0, "")
    answer = of_contract(out)
    assert answer["at"] == {"charge_mass_kg": 15.0}
    assert answer["n_observations"] == rows
    assert 0.01 < answer["parameters"]["charge_mass_kg"]["log_sd"] < 0.5


@pytest.mark.slow
def test_text_and_map_say_the_same_and_fit_the_terminal(jblast, tmp_path):
    scene = jblast.file("plan.toml", PRIOR)
    code, out, err = jblast("bound", scene, "--map", jblast.path("map.svg"))
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 96
    assert "Bound of plan.toml: 4 planned recordings of 2 sensors" in out
    assert "15 kg" in out  # the prior's median
    assert "Sd of the charge mass with one more datum, now" in out
    assert f"Written: {jblast.path('map.svg')}" in out
    assert "</svg>" in jblast.text("map.svg")
    refusal = jblast.refused("bound", scene, "--map", jblast.path("map.svg"))
    assert "exists already" in refusal


@pytest.mark.slow
def test_what_is_not_identifiable_exits_4_and_is_still_printed(jblast):
    content = FREE.replace('"free"', '"free"\ntime_s = "free"').replace(
        'peak_overpressure_pa = "5%", positive_impulse_pa_s = "5%"', "air_arrival_s = 1"
    )
    content = content.replace(', peak_overpressure_pa = "5%"', "")
    content = content.replace("[0.0, 60.0, 1.0]", "[30.0, 0.0, 1.0]")
    scene = jblast.file("plan.toml", content)
    at = ("--at", "charge_mass_kg=15, origin_time_s=0")
    code, out, err = jblast("bound", scene, *at, "--json")
    assert (code, err) == (4, "")
    answer = of_contract(out)
    assert len(answer["null_directions"]) == 1
    nothing = {"sd": None, "log_sd": None}
    assert answer["parameters"]["charge_mass_kg"] == nothing
    code, out, _ = jblast("bound", scene, *at)
    assert code == 4
    assert "charge mass: not identified" in out
    assert max(map(len, out.splitlines())) <= 96


REFUSED = table("""
 => --at charge_mass_kg=VALUE
--at charge_mas_kg=3 => did you mean charge_mass_kg?
--at charge_mass_kg=15,charge_up_m=3 => or --free charge_up_m beside it
--free charge_up_m --at charge_mass_kg=3 => --at charge_up_m=VALUE
--free nobody --at charge_mass_kg=3 => --free nobody
--at charge_mass_kg => PARAMETER=VALUE
--at charge_mass_kg=x => PARAMETER=VALUE
--at charge_mass_kg=nan => finite
--at charge_mass_kg=3,charge_mass_kg=4 => got several
--at charge_mass_kg=0 => positive
--at charge_mass_kg=3 --map map.jpg => .png, .svg, .pdf
--at charge_mass_kg=3 --law nobody => nobody
""")


def test_bad_input_exits_2_with_one_message(jblast):
    scene = jblast.file("plan.toml", FREE)
    for words, said in REFUSED:
        assert said in jblast.refused("bound", scene, *words.split())
    bare = jblast.file("bare.toml", "[charge]\nmass_kg = 15.0\n" + SENSORS)
    assert "nothing to bound" in jblast.refused("bound", bare)
    clock = ("--free", "clock_offset_s.z", "--at", "clock_offset_s.z=0")
    assert "no such clock" in jblast.refused("bound", bare, *clock)
    mute = jblast.file("mute.toml", '[charge]\nmass_kg = "free"\n')
    said = jblast.refused("bound", mute, "--at", "charge_mass_kg=3")
    assert "no sensor records anything" in said
    assert "no such file" in jblast.refused("bound", jblast.path("none.toml"))
