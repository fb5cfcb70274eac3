import json

import pytest

from tests.cli.cli_files import SENSORS

KNOWN = "[charge]\nmass_kg = 15.0\n" + SENSORS
KEYS = (
    "schema",
    "quantity",
    "method",
    "reason",
    "predicted_error",
    "tolerance",
    "met",
    "cost_s",
    "candidates",
)


def chosen(jblast, *asked: str) -> tuple[int, dict]:
    scene = jblast.file("scene.toml", KNOWN)
    code, out, err = jblast("choose", scene, "--json", *asked)
    assert err == ""
    return code, json.loads(out)


def test_the_answer_has_every_key_and_stdout_holds_nothing_else(jblast):
    code, answer = chosen(
        jblast, "--quantity", "peak_overpressure_pa", "--tolerance", "0.2"
    )
    assert tuple(answer) == KEYS
    assert (code, answer["met"]) == (0, True)
    assert answer["method"] in {each["method"] for each in answer["candidates"]}
    # recorded peaks are off the reference by 14 % at Z = 20 to 40
    assert 0.1 < answer["predicted_error"] <= 0.2
    assert answer["cost_s"] > 0
    errors = [each["error"] for each in answer["candidates"]]
    assert None in errors  # the laws of free air do not hold on the ground


def test_a_tolerance_that_none_meets_exits_4_and_still_answers(jblast):
    code, answer = chosen(
        jblast, "--quantity", "peak_overpressure_pa", "--tolerance", "1e-4"
    )
    assert (code, answer["met"]) == (4, False)
    assert "cannot be verified" in answer["reason"]
    assert answer["method"] == "kingery_bulmash"


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("--quantity", "hight"), "unknown quantity 'hight'"),
        (("--quantity", "air_arrival_s", "--tolerance", "0"), "a positive number"),
        (("--quantity", "air_arrival_s", "--tolerance", "nan"), "a finite number"),
        (("--quantity", "flash_time_s"), "no sensor of the scene records flash_time_s"),
    ],
)
def test_what_cannot_be_asked_is_one_message_and_exit_2(jblast, asked, said):
    scene = jblast.file("scene.toml", KNOWN)
    code, out, err = jblast("choose", scene, *asked)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.strip().splitlines()) == 1
