"""What `jblast calc` refuses, in one line; help waits for nothing."""

import pytest

from tests.cli.child import told

BAD = {
    "a mass past all powers": ("--mass 1e300 --range 1", ["--mass", "1e+30", "1e300"]),
    "next to no air": ("--mass 1 --range 9 --pressure 1e-300", ["--pressure", "1e-30"]),
    "no number": ("--mass x --range 1", ["--mass", "finite number", "'x'"]),
    "a negative mass": ("--mass -5 --range 1", ["--mass", "positive", "-5"]),
    "a negative mass with an exponent": ("--mass -5e-1 --range 1", ["--mass", "-0.5"]),
    "a mass of zero": ("--mass 0 --range 1", ["--mass", "positive", "got 0"]),
    "a range of zero": ("--mass 5 --range 0", ["--range", "positive"]),
    "a mass in full-width digits": (
        "--mass １２ --range 1",
        ["--mass", "the digits 0 to 9", "'１２'"],
    ),
    "ranges from far to near": (
        "--mass 5 --range 20:10:5",
        ["--range", "FROM below TO, got '20:10:5'; write 10:20:5"],
    ),
    "ranges from one end to the same": (
        "--mass 5 --range 10:10:5",
        ["--range", "FROM below TO, got '10:10:5'\n"],
    ),
    "a negative range in a list": ("--mass 5 --range 3,-1", ["--range", "-1"]),
    "an infinite range": ("--mass 5 --range inf", ["--range", "finite"]),
    "a pressure in hectopascals": (
        "--mass 100 --range 50 --quantity overpressure --pressure 1013",
        ["--pressure", "between 20000 and 120000", "1013hPa is 101300"],
    ),
    "a pressure in bar": ("--mass 1 --range 9 --pressure 0.9", ["0.9bar is 90000"]),
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
    "a decimal comma": ("--mass 15,5 --range 9", ["15.5 with a point, or 15 5"]),
    "a decimal comma and a unit": ("--mass 33,5lb --range 9", ["33.5lb", "33 5lb"]),
    "a value with a comma": ("--mass 5 --overpressure 5,5kPa", ["a decimal point"]),
    "a count of 5000 digits": (f"--mass 5 --range 1:2:{'9' * 5000}", ["FROM:TO:COUNT"]),
    "a broken list": ("--mass 5 --range 1:2", ["FROM:TO:COUNT", "'1:2'"]),
    "a list of one": ("--mass 5 --range 1:2:1", ["COUNT"]),
    "a list of halves": ("--mass 5 --range 1:2:2.5", ["COUNT"]),
    "too many rows": ("--mass 1:2:1000 --range 1:2:1000", ["combinations"]),
    "json and csv": ("--mass 5 --range 9 --json --csv", ["--json or --csv"]),
    "a plot of no kind": ("--mass 5 --range 9 --plot a.doc", [".png, .svg, .pdf"]),
    "a plot of masses": ("--mass 5 6 --range 9 --plot a.png", ["one --mass"]),
    "a unit of something else": ("--mass 5ft --range 9", ["unit of mass", "33lb"]),
    "no unit": ("--mass 5lbx --range 9", ["did you mean lb", "33lb"]),
    "a quantity unknown": (
        "--mass 5 --range 9 --quantity peak_overpresure_pa",
        ["--quantity", "did you mean peak_overpressure_pa"],
    ),
    "a quantity of what is asked for": (
        "--mass 5 --impulse 9 --quantity impulse",
        ["--quantity", "--mass and --range", "--impulse"],
    ),
    "a law unknown": ("--mass 5 --range 9 --law swisdac", ["did you mean swisdak"]),
    "a law of something else": (
        "--mass 5 --range 9 --quantity ground_arrival_s --law swisdak",
        ["--law", "expected one of wu_hao"],
    ),
    "units of nowhere": ("--mass 5 --range 9 --units cgs", ["si or us", "'cgs'"]),
    "pounds in JSON": ("--mass 5 --range 9 --units us --json", ["--units", "--json"]),
    "a table in CSV": ("--mass 5 --range 9 --table --csv", ["--table", "--csv"]),
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


def test_a_quantity_unknown_is_told_each_name_once(jblast):
    words = ("--mass", "5", "--range", "9", "--quantity", "nothing")
    error = jblast.refused("calc", *words)
    names = error.partition("expected one of ")[2].partition("; got")[0].split(", ")
    assert len(names) == len(set(names))
    assert {"air_arrival_s", "arrival_difference_s", "shock_speed_m_s"} <= set(names)


def test_help_needs_no_jax():
    said = told()["calc", "--help"]
    assert "jax" not in said.modules
    assert "--overpressure" in said.out
