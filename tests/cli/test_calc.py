"""`jblast calc`: its answers, the documents that hold them, and what it refuses."""

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.cli.main import main
from jblast.waves import kingery_bulmash_pressure, wu_hao_air_arrival_time
from tests.cli.cli_files import says, table

PAGE = Path(__file__).parents[2] / "docs/howto/calculate.md"
FOOT, POUND, PSI = 0.3048, 0.45359237, 6894.757293168361
"""Of the international foot and pound, by definition; psi follows with g = 9.80665."""
FIVE = "1:1000:4,7"
"""1, 10, 100, 1000 and 7 m: always five, since another number compiles again."""
NINES = 5000 * "9"


@pytest.fixture
def calc(jblast):
    def run(words):
        code, out, err = jblast("calc", *words.split())
        assert (code, err) == (0, "")
        return out

    return run


@pytest.fixture
def numbers(calc):
    def run(words):
        found = json.loads(calc(f"{words} --json"))
        names = ("calc_inverse", "calc")
        fits = [
            Draft202012Validator(documents.schema(n)).is_valid(found) for n in names
        ]
        assert fits == ["asked" in found["inputs"], "asked" not in found["inputs"]]
        return found

    return run


def test_the_thesis_case_comes_out_as_printed(numbers):
    # table 4.1: 3.14 ms by 6000 m/s, 38.57 ms by 340 m/s, at 20 m from 15 kg
    found = numbers("--mass 15 --range 20 --sound-speed 340 --p-speed 6000")
    assert found["schema"] == 1
    assert found["inputs"]["notes"] == []
    air, ground, between = (
        found["quantities"][quantity]["wu_hao"]["value"]
        for quantity in ("air_arrival_s", "ground_arrival_s", "arrival_difference_s")
    )
    assert (round(air, 5), round(ground, 5)) == (0.03857, 0.00314)
    assert between == pytest.approx(air - ground, rel=1e-12)


def test_several_values_make_all_combinations_in_json_and_csv(numbers, calc):
    words = f"--mass 1 8 --range {FIVE}"
    found = numbers(words)
    ranges, masses = found["inputs"]["range_m"], found["inputs"]["mass_kg"]
    assert ranges == pytest.approx(2 * [1, 10, 100, 1000, 7])
    assert masses == 5 * [1.0] + 5 * [8.0]
    pressure = found["quantities"]["peak_overpressure_pa"]["kingery_bulmash"]
    expected = kingery_bulmash_pressure(np.array(ranges), np.array(masses))
    np.testing.assert_allclose(pressure["value"], expected, rtol=1e-12)
    within = np.array(ranges) / np.cbrt(masses) <= 40.0
    assert pressure["valid"] == within.tolist()
    text = calc(f"{words} --csv")
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert any("surface (default)" in line for line in comments)
    rows = list(csv.DictReader(io.StringIO(text.split("\n", len(comments))[-1])))
    assert [*rows[0]] == ["range_m", "mass_kg", "quantity", "law", "value", "valid"]
    assert len(rows) == 10 * sum(map(len, found["quantities"].values()))
    cases = list(zip(ranges, masses, strict=True))
    for row in rows:
        entry = found["quantities"][row["quantity"]][row["law"]]
        i = cases.index((float(row["range_m"]), float(row["mass_kg"])))
        assert float(row["value"]) == entry["value"][i]
        assert (row["valid"] == "true") == entry["valid"][i]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--height -1e-1", "buried"),
        ("--height -1 --burst free-air", "the free-air curves were used"),
        ("--height 30", "gives surface curves at 1 of 1"),
        ("--height 200", "gives free-air curves at 1 of 1"),
        ("--height 200 --burst surface", "contradicts the height"),
    ],
)
def test_other_heights_are_noted(numbers, words, said):
    assert said in " ".join(numbers(f"--mass 15 --range 90 {words}")["inputs"]["notes"])


def test_a_pressure_gives_the_range_and_the_mass(numbers, calc):
    found = numbers("--mass 15 --overpressure 20000")["quantities"]
    assert found.keys() == {"range_m"}
    entry = found["range_m"]["kingery_bulmash"]
    assert entry["roots"] == [{"value": entry["value"], "valid": True}]
    back = float(kingery_bulmash_pressure(entry["value"], 15.0))
    assert back == pytest.approx(20000.0, rel=1e-9)
    mass = numbers("--range 50 --overpressure 20000")["recommended"]
    assert (mass["quantity"], mass["law"]) == ("charge_mass_kg", "kingery_bulmash")
    back = float(kingery_bulmash_pressure(50.0, mass["value"]))
    assert back == pytest.approx(20000.0, rel=1e-9)
    text = calc("--mass 15 --overpressure 20000 --csv")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "range_m,law,valid"
    assert f"{entry['value']!r},kingery_bulmash,true" in lines


def test_all_roots_and_laws_without_one_are_shown(numbers, calc):
    found = numbers("--mass 15 --duration 0.001")["quantities"]["range_m"]
    inner, outer = found["kingery_bulmash"]["roots"]
    assert (inner["valid"], outer["valid"]) == (False, True)
    assert found["kingery_bulmash"]["value"] == outer["value"]
    none = found["ford_2021"]
    assert (none["value"], none["valid"], none["roots"]) == (None, False, [])
    text = calc("--mass 15 --duration 0.001 --all-laws")
    assert re.search(r"none +ford_2021 +Z = ", text)
    assert re.search(r"m\* +kingery_bulmash ", text)


def test_an_arrival_is_inverted_by_the_law_that_does_not_scale(numbers):
    value = float(wu_hao_air_arrival_time(20.0, 15.0, 340.0))
    words = f"--range 20 --arrival {value!r} --sound-speed 340"
    found = numbers(words)["quantities"]["charge_mass_kg"]
    assert found["wu_hao"]["value"] == pytest.approx(15.0, rel=1e-9)
    assert found["acoustic"]["value"] is None


def test_feet_pounds_and_psi_go_in_and_come_out(calc):
    found = re.match(
        r"33 lb of TNT, peak overpressure 1 psi: range (\S+) ft, kingery_bulmash",
        calc("--mass 33lb --overpressure 1psi --units us"),
    )
    assert found
    pressure = kingery_bulmash_pressure(float(found[1]) * FOOT, 33.0 * POUND)
    assert float(pressure) == pytest.approx(PSI, rel=2e-3)  # four digits of the range
    text = calc("--mass 33lb --range 100ft --units us")
    # 30.48 m / (33 lb in kg)^(1/3) in SI, times 2.52083 ft/lb^(1/3) a m/kg^(1/3)
    z = 100.0 / 33.0 ** (1 / 3)
    assert f"{z:.4g} ft/lb^(1/3)" in text
    assert "59.00 °F" in text


def test_the_manual_prints_what_the_calculator_prints(capsys):
    commands, *blocks = re.findall(
        r"^```\n(.*?)^```", PAGE.read_text("utf-8"), re.M | re.S
    )
    lines = [line.partition("#")[0].split()[1:] for line in commands.splitlines()]
    assert len(lines) > len(blocks) >= 3
    for words, block in zip(lines, blocks, strict=False):
        assert main(words) == 0
        printed = capsys.readouterr().out.splitlines()
        for line in filter(lambda line: line.strip() != "...", block.splitlines()):
            start = line.removesuffix("...")
            assert any(text.startswith(start) for text in printed), line


def test_the_python_in_the_manual_runs():
    (code,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.M | re.S)
    names: dict = {}
    exec(code, names)
    rise = np.gradient(names["pressures"], names["ranges"])
    np.testing.assert_allclose(names["slopes"][1:-1], rise[1:-1], rtol=1e-3)


BAD = table(f"""
--mass 1e300 --range 1 => --mass | 1e+30 | 1e300
--mass -5 --range 1 => --mass | positive | -5
--mass １２ --range 1 => --mass | the digits 0 to 9 | '１２'
--mass 5 --range 20:10:5 => --range | FROM below TO, got '20:10:5'; write 10:20:5
--mass 100 --range 50 --quantity overpressure --pressure 1013 =>\
 --pressure | between 20000 and 120000 | 1013 hPa is 101300
--mass 1 --range 9 --pressure 0.9 => 0.9 bar is 90000
--mass 5 --range 9 --temperature 380 --humidity 0.9 =>\
 --humidity | less than 0.78 | 380 K | got 0.9
--mass 5 --range 9 --altitude 9e4 => 11000
--mass 5 --range 9 --altitude 100 --pressure 9e4 => expected it or --pressure
--mass 5 --range 9 --altitude 100 --temperature 280 => or --temperature, got both
--mass 15 --range 0.1 20 => outside the charge | 0.13 m | 1630 kg/m3 | 0.1 m
--mass 5 --range 9 --explosive gunpowder => gunpowder | TNT | RDX | PETN
--mass 15 --overpressure 1e12 => --overpressure | MPa; got 1000000 MPa | from
--range 5 --overpressure 1e-9 => from | to
 => --mass and --range | neither
--mass 5 => --mass and --range | got --mass
--overpressure 5 => --mass | --range | got --overpressure
--mass 5 --range 9 --overpressure 5 => got --range and --mass and --overpressure
--mass 5 --overpressure 5 --impulse 5 => --overpressure and --impulse
--mass 5 6 --overpressure 5000 => one --mass
--mass 15,5 --range 9 => 15.5 with a point, or 15 5
--mass 5 --overpressure 5,5kPa => a decimal point
--mass 5 --range 1:2:{NINES} => FROM:TO:COUNT
--mass 1:2:1000 --range 1:2:1000 => combinations
--mass 5 --range 9 --json --csv => --json: expected it or --csv
--mass 5 --range 9 --plot a.doc => .png, .svg, .pdf
--mass 5 6 --range 9 --plot a.png => one --mass
--mass 5 --range 9 --quantity peak_overpresure_pa =>\
 --quantity | did you mean peak_overpressure_pa
--mass 5 --impulse 9 --quantity impulse => --quantity: expected it or --impulse
--mass 5 --range 9 --law swisdac => did you mean swisdak
--mass 5 --range 9 --quantity ground_arrival_s --law swisdak =>\
 --law | expected one of wu_hao
--mass 5 --range 9 --units us --json => --units: expected si with --json
--mass 5 --range 9 --all-laws --csv => --csv: expected it or --all-laws
--mass 5 --range 9 --burst air => --burst: expected surface or free-air, got 'air'
--mass 5 --range 9 --units cgs => --units: expected si or us, got 'cgs'
""")


@pytest.mark.parametrize(("words", "said"), BAD)
def test_bad_input_is_one_line_and_exits_2(jblast, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    says(jblast.refused("calc", *words.split()), said)
    assert list(tmp_path.iterdir()) == []
