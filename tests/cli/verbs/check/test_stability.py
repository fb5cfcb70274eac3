import json

import pytest

from jblast.verification.stability.failure import AREAS, verified

KEYS = "area,method,edge,boundary,unit,beyond,deed,said"
"""What is written is read by others, whatever we call it inside."""


def test_json_and_csv_have_every_field_of_every_failure_mode(jblast):
    code, out, err = jblast("stability", "clocks", "wave_forms", "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert answer["schema"] == 1
    assert list(answer["areas"]) == ["clocks", "wave forms"]
    for area, modes in answer["areas"].items():
        for mode in modes:
            assert ",".join(mode) == KEYS
            assert mode["area"] == area


def test_bad_input_exits_2_with_one_message(jblast):
    said = jblast.refused("stability", "nobody")
    for area in AREAS:
        assert area.replace(" ", "-") in said
    assert "did you mean clocks?" in jblast.refused("stability", "clock")
    file = jblast.file("taken", "")
    said = jblast.refused("stability", "clocks", "--out", file)
    assert "cannot be written" in said


@pytest.mark.slow
def test_the_whole_map_is_measured_and_drawn(jblast):
    code, out, err = jblast("stability", "--out", jblast.path("map"))
    assert code == 0, err
    for area in AREAS:
        assert f"{area.capitalize()}\n" in out
    table, _, written = out.rpartition("\nWritten to ")  # whose path may be long
    assert written
    assert max(map(len, table.splitlines())) <= 96


def test_a_deed_that_was_not_seen_is_not_claimed():
    assert verified("marks", True, "a law") == "marks"
    with pytest.raises(RuntimeError, match='a law: expected the response "marks"'):
        verified("marks", False, "a law")
