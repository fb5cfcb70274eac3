"""`jblast calc` from a charge: what it prints, notes and draws."""

import csv
import io
import json

import numpy as np
import pytest

from jblast.waves import kingery_bulmash_pressure

FIVE = "1:1000:4,7"
"""1, 10, 100, 1000 and 7 m: always five, since another number compiles again."""


def test_the_thesis_case_comes_out_as_printed(numbers):
    # table 4.1: 3.14 ms by 6000 m/s, 38.57 ms by 340 m/s, at 20 m from 15 kg
    found = numbers("--mass 15 --range 20 --sound-speed 340 --p-speed 6000")
    air, ground, between = (
        found["quantities"][quantity]["wu_hao"]["value"]
        for quantity in ("air_arrival_s", "ground_arrival_s", "arrival_difference_s")
    )
    assert (round(air, 5), round(ground, 5)) == (0.03857, 0.00314)
    assert between == pytest.approx(air - ground, rel=1e-12)


def test_json_says_value_validity_and_range(numbers):
    pressure = numbers("--mass 1 --range 100")["quantities"]["peak_overpressure_pa"]
    entry = pressure["kingery_bulmash"]
    assert entry.keys() == {"value", "valid", "range"}
    assert entry["value"] == pytest.approx(float(kingery_bulmash_pressure(100.0, 1.0)))
    assert entry["valid"] is False  # past Z = 40
    assert pressure["shock_kinematics"]["valid"] is True


def test_several_values_make_all_combinations(numbers, calc):
    words = f"--mass 1 8 --range {FIVE}"
    found = numbers(words)
    assert found["inputs"]["range_m"] == pytest.approx(2 * [1, 10, 100, 1000, 7])
    assert found["inputs"]["mass_kg"] == 5 * [1.0] + 5 * [8.0]
    pressure = found["quantities"]["peak_overpressure_pa"]["kingery_bulmash"]
    ranges, masses = found["inputs"]["range_m"], found["inputs"]["mass_kg"]
    expected = kingery_bulmash_pressure(np.array(ranges), np.array(masses))
    np.testing.assert_allclose(pressure["value"], expected, rtol=1e-12)
    within = np.array(ranges) / np.cbrt(masses) <= 40.0
    assert pressure["valid"] == within.tolist()
    assert set(pressure["valid"]) == {True, False}
    table = calc(words)
    assert "10 m" in table
    lines = table.splitlines()
    first = lines.index("Peak overpressure [kPa]")
    # the recommended value of each range and mass comes before the table of all laws
    assert lines[first + 1].split() == [
        *("range", "mass", "recommended", "scatter", "law")
    ]
    best = [line.split() for line in lines[first + 2 : first + 12]]
    assert [row[:2] for row in best[:2]] == [["1", "m"], ["10", "m"]]
    assert best[1][4] == f"{pressure['value'][1] / 1e3:.4g}"
    assert best[1][-1] == "kingery_bulmash"
    assert "*" in table


def test_csv_is_one_value_a_line_beneath_comments(calc, numbers):
    words = f"--mass 15 8 --range {FIVE}"
    text = calc(f"{words} --csv")
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert any("surface (default)" in line for line in comments)
    rows = list(csv.DictReader(io.StringIO(text.split("\n", len(comments))[-1])))
    assert [*rows[0]] == ["range_m", "mass_kg", "quantity", "law", "value", "valid"]
    found = numbers(words)
    cases = list(
        zip(found["inputs"]["range_m"], found["inputs"]["mass_kg"], strict=True)
    )
    found = found["quantities"]
    assert len(rows) == 10 * sum(len(by_law) for by_law in found.values())
    for row in rows:
        entry = found[row["quantity"]][row["law"]]
        i = cases.index((float(row["range_m"]), float(row["mass_kg"])))
        assert float(row["value"]) == entry["value"][i]
        assert (row["valid"] == "true") == entry["valid"][i]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--height -1", "buried"),
        ("--height -1e-1", "buried"),
        ("--height -1 --burst free-air", "the free-air curves were used"),
        ("--height 30", "of which the surface ones were used"),
        ("--height 200", "the free-air curves were used"),
        ("--height 200 --burst surface", "contradicts the height"),
        ("--height 30 --burst free-air", "contradicts the height"),
    ],
)
def test_other_heights_are_noted(numbers, words, said):
    assert said in " ".join(numbers(f"--mass 15 --range 90 {words}")["inputs"]["notes"])


def test_on_the_ground_there_is_nothing_to_note(numbers):
    assert numbers("--mass 15 --range 20")["inputs"]["notes"] == []


@pytest.mark.slow
def test_a_plot_is_written_once(jblast, calc, tmp_path):
    file = jblast.path("laws.png")
    assert f"Plot: {file}" in calc(f"--mass 15 --range 20 --plot {file}")
    assert (tmp_path / "laws.png").read_bytes().startswith(b"\x89PNG")
    words = ["calc", "--mass", "15", "--range", "20", "--plot", file]
    assert "exists already" in jblast.refused(*words)
    assert jblast(*words, "--force")[0] == 0
    assert json.loads(calc(f"--mass 15 --range 1:9:3 --plot {file} --force --json"))
