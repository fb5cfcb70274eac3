import csv
import json

import pytest

from jblast.cli.verbs import stability
from jblast.report.stability import stability_markdown, stability_text
from jblast.verification.stability.failure import AREAS, FailureMode, verified
from tests.cli.child import told


def test_the_table_goes_to_stdout_and_fits_the_terminal(jblast):
    code, out, err = jblast("stability", "clocks")
    assert (code, err) == (0, "")
    assert out.startswith("Clocks\n")
    assert "16400 s on the clock" in out
    assert max(map(len, out.splitlines())) <= 96


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


def test_out_holds_a_table_a_page_and_a_picture(jblast):
    out = jblast.path("map")
    code, said, _ = jblast("stability", "clocks", "--out", out)
    assert code == 0
    assert said.endswith("stability.csv, stability.md, stability.png\n")
    table = jblast.text("map/stability.csv").splitlines()
    assert table[0] == KEYS
    rows = list(csv.DictReader(table))
    assert [float(row["boundary"]) for row in rows] == [2.0**14, 2.0**33]
    assert "| clock times in float32 |" in jblast.text("map/stability.md")
    with open(jblast.path("map/stability.png"), "rb") as file:
        assert file.read(4) == b"\x89PNG"
    refusal = jblast.refused("stability", "clocks", "--out", out)
    assert "stability.csv: exists already" in refusal
    assert jblast("stability", "clocks", "--out", out, "--force")[0] == 0


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


def test_help_names_every_area_and_does_not_wait_for_jax():
    said = told()["stability", "--help"]
    assert "jax" not in said.modules
    for area in AREAS:
        assert area.replace(" ", "-") in said.out
    assert set(stability.FILES) <= set(said.out.replace(",", " ").split())


MODE = FailureMode("clocks", "a | b", "breaks", 3.0, "of 200", "far off", "marks", "so")


def test_a_count_of_cases_is_one_only_with_a_number():
    assert MODE.cases == 200
    other = FailureMode(
        "solver", "a", "b", 1.0, "of the stable step", "c", "marks", "d"
    )
    assert other.cases == 0
    assert "3 of 200" in stability_text({"clocks": [MODE]})
    assert r"a \| b" in stability_markdown({"clocks": [MODE]})


def test_a_deed_that_was_not_seen_is_not_claimed():
    assert verified("marks", True, "a law") == "marks"
    with pytest.raises(RuntimeError, match='a law: expected the response "marks"'):
        verified("marks", False, "a law")
