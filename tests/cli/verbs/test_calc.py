import csv
import io
import json
import subprocess
import sys

import numpy as np
import pytest

from jblast.waves import kingery_bulmash_pressure, wu_hao_air_arrival_time
from tests.cli.cli_files import Command


@pytest.fixture
def jblast(tmp_path, capsys):
    return Command(tmp_path, capsys)


@pytest.fixture
def calc(jblast):
    def run(words):
        code, out, err = jblast("calc", *words.split())
        assert (code, err) == (0, "")
        return out

    return run


@pytest.fixture
def numbers(calc):
    return lambda words: json.loads(calc(f"{words} --json"))


def test_the_thesis_case_comes_out_as_printed(numbers):
    # table 4.1: 3.14 ms by 6000 m/s, 38.57 ms by 340 m/s, at 20 m from 15 kg
    found = numbers("--mass 15 --range 20 --sound-speed 340 --p-speed 6000")
    air, ground, between = (
        found["quantities"][quantity]["wu_hao"]["value"]
        for quantity in ("air_arrival_s", "ground_arrival_s", "arrival_difference_s")
    )
    assert (round(air, 5), round(ground, 5)) == (0.03857, 0.00314)
    assert between == pytest.approx(air - ground, rel=1e-12)


def test_defaults_are_printed_and_named(calc, numbers):
    text = calc("--mass 15 --range 20")
    for words in (
        "surface (default)",
        "288.15 K, 101.325 kPa, dry",
        "(default: at sea level)",
        "5660 m/s (default: granite)",
        "8.11 m/kg^(1/3)",
    ):
        assert words in text
    inputs = numbers("--mass 15 --range 20")["inputs"]
    assert inputs["defaults"] == ["air", "burst", "explosive", "ground"]
    assert inputs["scaled_distance_m_kg13"] == pytest.approx(20.0 / np.cbrt(15.0))
    said = "--burst free-air --explosive rdx --humidity 0.1 --p-speed 6000"
    inputs = numbers(f"--mass 15 --range 20 {said}")["inputs"]
    assert inputs["defaults"] == []
    assert inputs["explosive"] == "RDX"


def test_json_says_value_validity_and_range(numbers):
    pressure = numbers("--mass 1 --range 100")["quantities"]["peak_overpressure_pa"]
    entry = pressure["kingery_bulmash"]
    assert entry.keys() == {"value", "valid", "range"}
    assert entry["value"] == pytest.approx(float(kingery_bulmash_pressure(100.0, 1.0)))
    assert entry["valid"] is False  # past Z = 40
    assert pressure["shock_kinematics"]["valid"] is True


def test_a_number_outside_its_range_is_marked_in_text(calc):
    lines = calc("--mass 1 --range 100").splitlines()
    (pressure, *_) = [
        line
        for line in lines[lines.index("Peak overpressure") :]
        if "kingery_bulmash" in line
    ]
    assert "outside" in pressure
    (acoustic,) = [
        line for line in calc("--mass 1 --range 600").splitlines() if "acous" in line
    ]
    assert "outside" not in acoustic


def test_lines_are_not_wider_than_96_columns(calc):
    for words in (
        "--mass 15 --range 20 --height 1",
        "--mass 15 1000 --range 1:1000:5 --explosive C4",
        "--mass 15 --overpressure 2e4",
    ):
        assert max(len(line) for line in calc(words).splitlines()) <= 96


def test_air_of_an_altitude_is_the_standard_atmosphere(numbers):
    inputs = numbers("--mass 1 --range 9 --altitude 5000")["inputs"]
    assert inputs["temperature_k"] == pytest.approx(255.65)
    assert inputs["pressure_pa"] == pytest.approx(54020.0, rel=1e-4)
    assert inputs["altitude_m"] == 5000.0


def test_an_explosive_is_worth_its_tnt(numbers):
    c4, tnt = (
        numbers(f"--range 20 {words}")["quantities"]
        for words in ("--mass 10 --explosive C4", "--mass 13.7")
    )
    for quantity, same in (
        ("peak_overpressure_pa", True),
        ("positive_impulse_pa_s", False),
    ):
        one, other = (q[quantity]["kingery_bulmash"]["value"] for q in (c4, tnt))
        assert (one == pytest.approx(other, rel=1e-12)) is same


def test_several_values_make_all_combinations(numbers, calc):
    found = numbers("--mass 1 8 --range 1:100:3,7")
    assert found["inputs"]["range_m"] == pytest.approx(2 * [1.0, 10.0, 100.0, 7.0])
    assert found["inputs"]["mass_kg"] == 4 * [1.0] + 4 * [8.0]
    pressure = found["quantities"]["peak_overpressure_pa"]["kingery_bulmash"]
    ranges, masses = found["inputs"]["range_m"], found["inputs"]["mass_kg"]
    expected = kingery_bulmash_pressure(np.array(ranges), np.array(masses))
    np.testing.assert_allclose(pressure["value"], expected, rtol=1e-12)
    within = np.array(ranges) / np.cbrt(masses) <= 40.0
    assert pressure["valid"] == within.tolist()
    assert set(pressure["valid"]) == {True, False}
    table = calc("--mass 1 8 --range 1:100:3,7")
    assert "10 m" in table
    assert "*" in table


def test_csv_is_one_value_a_line_beneath_comments(calc, numbers):
    text = calc("--mass 15 --range 5 50 --csv")
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert any("surface (default)" in line for line in comments)
    rows = list(csv.DictReader(io.StringIO(text.split("\n", len(comments))[-1])))
    assert [*rows[0]] == ["range_m", "mass_kg", "quantity", "law", "value", "valid"]
    found = numbers("--mass 15 --range 5 50")["quantities"]
    assert len(rows) == 2 * sum(len(by_law) for by_law in found.values())
    for row in rows:
        entry = found[row["quantity"]][row["law"]]
        i = [5.0, 50.0].index(float(row["range_m"]))
        assert float(row["value"]) == entry["value"][i]
        assert (row["valid"] == "true") == entry["valid"][i]


def test_a_burst_between_the_limits_says_what_the_other_set_gives(numbers, calc):
    found = numbers("--mass 15 --range 20 --height 1")
    (note,) = found["inputs"]["notes"]
    assert "the surface ones were used" in note
    entry = found["quantities"]["peak_overpressure_pa"]["kingery_bulmash"]
    free = numbers("--mass 15 --range 20 --burst free-air")
    other = free["quantities"]["peak_overpressure_pa"]["kingery_bulmash"]
    assert entry["other_burst"]["value"] == other["value"] < entry["value"]
    assert "other_burst" not in found["quantities"]["air_arrival_s"]["wu_hao"]
    assert "(free-air)" in calc("--mass 15 --range 20 --height 1")


def test_a_note_of_a_csv_promises_no_more_than_stands_there(calc):
    head = calc("--mass 15 --range 20 --height 1 --csv").partition("range_m,")[0]
    assert "compare with the other --burst" in head
    assert "beside" not in head


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


@pytest.mark.parametrize(
    ("words", "used"),
    [
        ("--mass 1 --height 1", "surface"),
        ("--mass 1 --height 12 --burst surface", "surface"),
        ("--mass 1 --height 12 --burst free-air", "free-air"),
        ("--range 5 --height 12", "surface"),
    ],
)
def test_where_a_range_or_a_mass_is_asked_for_the_curves_used_are_named(
    words, used, numbers
):
    found = numbers(f"{words} --overpressure 20000")["inputs"]
    (note,) = found["notes"]
    assert found["burst"] == used
    assert note.startswith(f"the {used} curves were used")
    assert "compare with the other --burst" in note


def test_on_the_ground_there_is_nothing_to_note(numbers):
    assert numbers("--mass 15 --range 20")["inputs"]["notes"] == []


def test_a_pressure_gives_the_range_and_the_mass(numbers):
    found = numbers("--mass 15 --overpressure 20000")["quantities"]
    assert found.keys() == {"range_m"}
    for law in ("kingery_bulmash", "shock_kinematics"):
        entry = found["range_m"][law]
        assert entry.keys() == {"value", "valid", "roots", "range"}
        assert entry["roots"] == [{"value": entry["value"], "valid": True}]
    back = float(
        kingery_bulmash_pressure(found["range_m"]["kingery_bulmash"]["value"], 15.0)
    )
    assert back == pytest.approx(20000.0, rel=1e-9)
    found = numbers("--range 50 --overpressure 20000")["quantities"]
    mass = found["charge_mass_kg"]["kingery_bulmash"]["value"]
    back = float(kingery_bulmash_pressure(50.0, mass))
    assert back == pytest.approx(20000.0, rel=1e-9)


@pytest.mark.parametrize(
    ("option", "quantity"),
    [
        ("overpressure", "peak_overpressure_pa"),
        ("impulse", "positive_impulse_pa_s"),
        ("arrival", "air_arrival_s"),
        ("duration", "positive_duration_s"),
        ("reflected-pressure", "reflected_pressure_pa"),
        ("reflected-impulse", "reflected_impulse_pa_s"),
    ],
)
def test_every_inverse_undoes_its_quantity(numbers, option, quantity):
    forward = numbers("--mass 15 --range 40")["quantities"][quantity]
    value = forward["kingery_bulmash"]["value"]
    for known, asked, start in (
        ("--mass 15", "range_m", 40.0),
        ("--range 40", "charge_mass_kg", 15.0),
    ):
        found = numbers(f"{known} --{option} {value!r}")["quantities"][asked]
        roots = [root["value"] for root in found["kingery_bulmash"]["roots"]]
        assert np.isclose(roots, start, rtol=1e-8).any()


def test_an_inverse_of_an_explosive_gives_its_own_mass(numbers):
    tnt, rdx = (
        numbers(f"--range 50 --impulse 100 --explosive {name}")["quantities"][
            "charge_mass_kg"
        ]["kingery_bulmash"]["value"]
        for name in ("TNT", "RDX")
    )
    assert rdx == pytest.approx(tnt / 1.09, rel=1e-9)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--arrival 0.01", "makes an air arrival of 10 ms"),
        ("--impulse 300", "makes a positive impulse of 300 Pa s"),
    ],
)
def test_an_inverse_is_titled_in_a_sentence(calc, words, said):
    assert said in calc(f"--mass 15 {words}").splitlines()[0]


def test_all_roots_and_laws_without_one_are_shown(numbers, calc):
    words = "--mass 15 --duration 0.001"
    found = numbers(words)["quantities"]["range_m"]
    inner, outer = found["kingery_bulmash"]["roots"]
    assert (inner["valid"], outer["valid"]) == (False, True)
    assert found["kingery_bulmash"]["value"] == outer["value"]
    assert found["ford_2021"] == {
        "value": None,
        "valid": False,
        "roots": [],
        "range": found["ford_2021"]["range"],
    }
    text = calc(words)
    assert "none" in text
    assert "outside" in text


def test_an_arrival_is_inverted_by_the_law_that_does_not_scale(numbers):
    value = float(wu_hao_air_arrival_time(20.0, 15.0, 340.0))
    words = f"--range 20 --arrival {value!r} --sound-speed 340"
    found = numbers(words)["quantities"]["charge_mass_kg"]
    assert found["wu_hao"]["value"] == pytest.approx(15.0, rel=1e-9)
    assert found["acoustic"]["value"] is None


def test_roots_as_csv(calc):
    text = calc("--mass 15 --overpressure 20000 --csv")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "range_m,law,valid"
    value, law, valid = next(line for line in lines if "kingery" in line).split(",")
    assert (law, valid) == ("kingery_bulmash", "true")
    assert float(kingery_bulmash_pressure(float(value), 15.0)) == pytest.approx(2e4)


@pytest.mark.slow
def test_a_plot_is_written_once(jblast, calc, tmp_path):
    file = jblast.path("laws.png")
    assert f"Plot: {file}" in calc(f"--mass 15 --range 20 --plot {file}")
    assert (tmp_path / "laws.png").read_bytes().startswith(b"\x89PNG")
    words = ["calc", "--mass", "15", "--range", "20", "--plot", file]
    assert "exists already" in jblast.refused(*words)
    assert jblast(*words, "--force")[0] == 0
    assert json.loads(calc(f"--mass 15 --range 1:9:3 --plot {file} --force --json"))


BAD = {
    "a mass past all powers": ("--mass 1e300 --range 1", ["--mass", "1e+30", "1e300"]),
    "next to no air": ("--mass 1 --range 9 --pressure 1e-300", ["--pressure", "1e-30"]),
    "no number": ("--mass x --range 1", ["--mass", "finite number", "'x'"]),
    "a negative mass": ("--mass -5 --range 1", ["--mass", "positive", "-5"]),
    "a negative mass with an exponent": ("--mass -5e-1 --range 1", ["--mass", "-0.5"]),
    "a mass of zero": ("--mass 0 --range 1", ["--mass", "positive", "got 0"]),
    "a range of zero": ("--mass 5 --range 0", ["--range", "positive"]),
    "a negative range in a list": ("--mass 5 --range 3,-1", ["--range", "-1"]),
    "an infinite range": ("--mass 5 --range inf", ["--range", "finite"]),
    "a pressure of zero": ("--mass 5 --range 9 --pressure 0", ["--pressure", "got 0"]),
    "a negative overpressure": ("--mass 5 --overpressure -2", ["--overpressure", "-2"]),
    "a temperature in Celsius": (
        "--mass 5 --range 9 --temperature 15",
        ["150 and 400"],
    ),
    "steam": (
        "--mass 5 --range 9 --temperature 380 --humidity 0.9",
        ["--humidity", "less than 0.78", "380 K", "got 0.9"],
    ),
    "a humidity in percent": ("--mass 5 --range 9 --humidity 50", ["between 0 and 1"]),
    "a height of infinity": ("--mass 5 --range 9 --height inf", ["--height"]),
    "an altitude in space": ("--mass 5 --range 9 --altitude 9e4", ["11000"]),
    "altitude and pressure": (
        "--mass 5 --range 9 --altitude 100 --pressure 9e4",
        ["--altitude", "--pressure"],
    ),
    "altitude and temperature": (
        "--mass 5 --range 9 --altitude 100 --temperature 280",
        ["--altitude", "--temperature"],
    ),
    "a range inside the charge": (
        "--mass 15 --range 0.1 20",
        ["outside the charge", "0.13 m", "1630 kg/m3", "0.1 m"],
    ),
    "an unknown explosive": (
        "--mass 5 --range 9 --explosive gunpowder",
        ["gunpowder", "TNT", "RDX", "PETN"],
    ),
    "an unknown burst": ("--mass 5 --range 9 --burst air", ["surface, free-air"]),
    "a pressure out of reach": (
        "--mass 15 --overpressure 1e12",
        ["--overpressure", "MPa; got 1000000 MPa", "from"],
    ),
    "a pressure too low for any law": ("--range 5 --overpressure 1e-9", ["from", "to"]),
    "an arrival too late": ("--mass 1e-3 --arrival 1e6", ["--arrival"]),
    "nothing": ("", ["--mass and --range", "neither"]),
    "a mass alone": ("--mass 5", ["--mass and --range", "--mass alone"]),
    "a pressure alone": ("--overpressure 5", ["--mass", "--range", "neither"]),
    "all three": ("--mass 5 --range 9 --overpressure 5", ["got both"]),
    "two measured": (
        "--mass 5 --overpressure 5 --impulse 5",
        ["--overpressure and --impulse"],
    ),
    "several masses for a range": ("--mass 5 6 --overpressure 5000", ["one --mass"]),
    "a broken list": ("--mass 5 --range 1:2", ["FROM:TO:COUNT", "'1:2'"]),
    "a list of one": ("--mass 5 --range 1:2:1", ["COUNT"]),
    "a list of halves": ("--mass 5 --range 1:2:2.5", ["COUNT"]),
    "too many rows": ("--mass 1:2:1000 --range 1:2:1000", ["combinations"]),
    "json and csv": ("--mass 5 --range 9 --json --csv", ["--json or --csv"]),
    "a plot of no kind": ("--mass 5 --range 9 --plot a.doc", [".png, .svg, .pdf"]),
    "a plot of masses": ("--mass 5 6 --range 9 --plot a.png", ["one --mass"]),
    "a plot of roots": ("--mass 5 --impulse 9 --plot a.png", ["--plot"]),
    "a plot nowhere": ("--mass 5 --range 9 --plot no/a.png", ["cannot be written"]),
}


@pytest.mark.parametrize(("words", "said"), BAD.values(), ids=BAD)
def test_bad_input_is_one_line_and_exits_2(jblast, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    error = jblast.refused("calc", *words.split())
    assert error.count("\n") == 1
    for word in said:
        assert word in error
    assert list(tmp_path.iterdir()) == []


def test_the_attainable_span_can_be_asked_for(jblast, numbers):
    error = jblast.refused("calc", "--mass", "15", "--overpressure", "1e12")
    top = float(error.split(" to ")[1].split(" MPa")[0]) * 1e6
    found = numbers(f"--mass 15 --overpressure {0.99 * top!r}")["quantities"]["range_m"]
    assert any(entry["valid"] for entry in found.values())


def test_help_needs_no_jax():
    script = (
        "import sys\nfrom jblast.cli.main import main\n"
        "try:\n    main(['calc', '--help'])\nexcept SystemExit:\n    pass\n"
        "sys.exit('jax' in sys.modules)"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert "--overpressure" in run.stdout
