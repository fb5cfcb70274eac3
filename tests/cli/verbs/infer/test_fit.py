import json
import math
import subprocess

import pytest

from tests.cli.cli_files import HEADER, JBLAST, TWO

ANSWER = {
    "schema": int,
    "law": dict,
    "law_reason": dict,
    "law_valid": bool,
    "law_valid_rows": int,
    "estimates": dict,
    "derived": dict,
    "free": list,
    "identifiable": bool,
    "null_directions": list,
    "ambiguities": list,
    "determined": list,
    "posterior": str,
    "converged": bool,
    "chi2": float,
    "dof": int,
    "n_observations": int,
    "n_lower_bounds": int,
    "suspected_outliers": list,
    "explained_by": list,
    "problems": list,
    "warnings": list,
    "assumptions": list,
    "extrapolated": list,
    "understood": list,
    "bearing_arcs": list,
    "regions": list,
    "unchecked": bool,
    "place": type(None),
    "origin_time_utc": type(None),
    "origin_clock": str,
    "charges_on_earth": list,
}
ESTIMATE = ("value", "sd", "log_sd", "q05", "q50", "q95", "identified")
FLASH = HEADER + "a,flash_time_s,0.001,0.0001,300,0,1\n"


def of_contract(out: str) -> dict:
    """Return the JSON, its keys and types those of the contract."""
    answer = json.loads(out)
    assert list(answer) == list(ANSWER)
    for key, kind in ANSWER.items():
        assert type(answer[key]) is kind, key
    assert list(answer["estimates"]) == answer["free"]
    for estimate in (*answer["estimates"].values(), *answer["derived"].values()):
        assert tuple(estimate) == ESTIMATE
    assert answer["law"].keys() == answer["law_reason"].keys()
    for null in answer["null_directions"]:
        assert null.keys() == {"parameters", "space", "cure"}
    for other in answer["ambiguities"]:
        assert other.keys() == {"parameters", "reason", "cure"}
    for told in answer["determined"]:
        assert told.keys() == {"combination", "value", "sd"}
    doubts = answer["null_directions"] or answer["ambiguities"]
    assert answer["identifiable"] == (not doubts)
    return answer


@pytest.mark.slow
def test_the_answer_has_every_key_and_stdout_holds_nothing_else(jblast):
    # as spreadsheets write it, with a name that quotes itself
    log = TWO.replace("b,peak", '"b, ""q"" é",peak').replace("\n", "\r\n")
    log = jblast.file("log.csv", b"\xef\xbb\xbf" + log.encode())
    code, out, err = jblast("fit", log, "--json")
    assert (code, err) == (0, "")
    answer = of_contract(out)
    assert answer["schema"] == 1
    assert answer["free"] == ["charge_mass_kg"]
    assert answer["n_observations"] == 2
    mass = answer["estimates"]["charge_mass_kg"]
    assert mass["q05"] < mass["value"] < mass["q95"]
    assert mass["log_sd"] > 0
    assert mass["sd"] > 0
    derived = answer["derived"]
    assert derived["charge_tnt_mass_kg"] == mass
    assert derived["charge_energy_j"]["value"] == pytest.approx(mass["value"] * 4.184e6)
    assert any("no scene was given" in one for one in answer["assumptions"])

    # the same in words, and the report beside what was there, by force
    jblast.file("held", "mine")
    code, text, err = jblast("fit", log, "--out", jblast.path(""), "--force")
    assert (code, err) == (0, "")
    assert f"{mass['value']:.0f} kg" in text
    kept = json.loads(jblast.text("fit.json"))
    assert kept.pop("provenance")["logs"][0]["name"] == "log.csv"
    assert of_contract(json.dumps(kept)) == answer
    assert "b, " in jblast.text("report.html")
    assert jblast.text("held") == "mine"


@pytest.mark.slow
def test_the_law_on_the_command_line_wins_over_the_scene(jblast):
    log = jblast.file("log.csv", TWO)
    scene = jblast.file("s.toml", '[law]\nair_arrival_s = "wu_hao"\n')
    law = {}
    for option in ((), ("--law", "auto"), ("--law", "wu_hao", "--noise", "gaussian")):
        code, out, _ = jblast("fit", log, "--scene", scene, "--json", *option)
        assert code == 0
        law[option[1:2]] = of_contract(out)["law"]["air_arrival_s"]
    assert law == {(): "wu_hao", ("auto",): "kingery_bulmash", ("wu_hao",): "wu_hao"}


@pytest.mark.slow
def test_what_the_log_cannot_tell_exits_4_with_null_and_a_cure(jblast):
    code, out, err = jblast(
        "fit", jblast.file("f.csv", FLASH), "--free", "origin_time_s", "--json"
    )
    assert (code, err) == (4, "")
    answer = of_contract(out)
    nothing = dict.fromkeys(ESTIMATE) | {"identified": False}
    assert answer["estimates"]["charge_mass_kg"] == nothing
    assert answer["derived"]["charge_energy_j"] == nothing
    assert not answer["identifiable"]
    (null,) = answer["null_directions"]
    assert null["parameters"] == {"charge_mass_kg": 1.0}
    assert null["space"] == "ln"
    assert "charge_mass_kg" in null["cure"]
    # light takes 1 microsecond for 300 m
    time = answer["estimates"]["origin_time_s"]
    assert time["value"] == pytest.approx(0.001 - 300.0 / 2.998e8, abs=1e-7)
    assert time["log_sd"] is None


@pytest.mark.slow
def test_a_range_can_be_asked_for_with_one_sensor_and_a_known_mass(jblast):
    log = jblast.file(
        "r.csv",
        "sensor,quantity,value,sigma\n"
        "a,peak_overpressure_pa,9000,450\na,peak_overpressure_pa,9300,450\n",
    )
    scene = jblast.file("s.toml", '[charge]\nmass_kg = 15.0\nrange_m = "free"\n')
    code, out, err = jblast("fit", log, "--scene", scene, "--json")
    assert (code, err) == (0, "")
    answer = of_contract(out)
    assert list(answer["estimates"]) == ["charge_range_m"]
    assert answer["derived"] == {}
    assert math.isclose(answer["estimates"]["charge_range_m"]["value"], 33, rel_tol=0.1)


def test_a_reader_that_leaves_gets_no_traceback(jblast):
    log = jblast.file("log.csv", TWO)
    command = " ".join(f"'{word}'" for word in (*JBLAST, "scene", log))
    done = subprocess.run(
        ["bash", "-c", f"{command} | true; exit ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 141
    lines = done.stderr.splitlines()  # how far it is, where that takes over a second
    assert all(line.startswith("jblast scene: ") for line in lines)
