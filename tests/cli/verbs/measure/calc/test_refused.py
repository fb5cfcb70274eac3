"""What `jblast calc` refuses, in one line; help waits for nothing."""

import pytest

from tests.cli.child import told
from tests.cli.cli_files import says, table

NINES = 5000 * "9"
BAD = table(f"""
--mass 1e300 --range 1 => --mass | 1e+30 | 1e300
--mass 1 --range 9 --pressure 1e-300 => --pressure | 1e-30
--mass x --range 1 => --mass | finite number | 'x'
--mass -5 --range 1 => --mass | positive | -5
--mass -5e-1 --range 1 => --mass | -0.5
--mass 0 --range 1 => --mass | positive | got 0
--mass 5 --range 0 => --range | positive
--mass １２ --range 1 => --mass | the digits 0 to 9 | '１２'
--mass 5 --range 20:10:5 => --range | FROM below TO, got '20:10:5'; write 10:20:5
--mass 5 --range 10:10:5 => --range | FROM below TO, got '10:10:5'
--mass 5 --range 3,-1 => --range | -1
--mass 5 --range inf => --range | finite
--mass 100 --range 50 --quantity overpressure --pressure 1013 =>\
 --pressure | between 20000 and 120000 | 1013 hPa is 101300
--mass 1 --range 9 --pressure 0.9 => 0.9 bar is 90000
--mass 5 --range 9 --pressure 0 => --pressure | got 0
--mass 5 --overpressure -2 => --overpressure | -2
--mass 5 --range 9 --temperature 15 => 150 and 400
--mass 5 --range 9 --temperature 380 --humidity 0.9 =>\
 --humidity | less than 0.78 | 380 K | got 0.9
--mass 5 --range 9 --humidity 50 => between 0 and 1
--mass 5 --range 9 --height inf => --height
--mass 5 --range 9 --altitude 9e4 => 11000
--mass 5 --range 9 --altitude 100 --pressure 9e4 => --altitude | --pressure
--mass 5 --range 9 --altitude 100 --temperature 280 => --altitude | --temperature
--mass 15 --range 0.1 20 => outside the charge | 0.13 m | 1630 kg/m3 | 0.1 m
--mass 5 --range 9 --explosive gunpowder => gunpowder | TNT | RDX | PETN
--mass 5 --range 9 --burst air => surface, free-air
--mass 15 --overpressure 1e12 => --overpressure | MPa; got 1000000 MPa | from
--range 5 --overpressure 1e-9 => from | to
--mass 1e-3 --arrival 1e6 => --arrival
 => --mass and --range | neither
--mass 5 => --mass and --range | --mass alone
--overpressure 5 => --mass | --range | neither
--mass 5 --range 9 --overpressure 5 => got both
--mass 5 --overpressure 5 --impulse 5 => --overpressure and --impulse
--mass 5 6 --overpressure 5000 => one --mass
--mass 15,5 --range 9 => 15.5 with a point, or 15 5
--mass 33,5lb --range 9 => 33.5lb | 33 5lb
--mass 5 --overpressure 5,5kPa => a decimal point
--mass 5 --range 1:2:{NINES} => FROM:TO:COUNT
--mass 5 --range 1:2 => FROM:TO:COUNT | '1:2'
--mass 5 --range 1:2:1 => COUNT
--mass 5 --range 1:2:2.5 => COUNT
--mass 1:2:1000 --range 1:2:1000 => combinations
--mass 5 --range 9 --json --csv => --json or --csv
--mass 5 --range 9 --plot a.doc => .png, .svg, .pdf
--mass 5 6 --range 9 --plot a.png => one --mass
--mass 5ft --range 9 => unit of mass | 33lb
--mass 5lbx --range 9 => did you mean lb | 33lb
--mass 5 --range 9 --quantity peak_overpresure_pa =>\
 --quantity | did you mean peak_overpressure_pa
--mass 5 --impulse 9 --quantity impulse => --quantity | --mass and --range | --impulse
--mass 5 --range 9 --law swisdac => did you mean swisdak
--mass 5 --range 9 --quantity ground_arrival_s --law swisdak =>\
 --law | expected one of wu_hao
--mass 5 --range 9 --units cgs => si or us | 'cgs'
--mass 5 --range 9 --units us --json => --units | --json
--mass 5 --range 9 --table --csv => --table | --csv
--mass 5 --range 9 --plot no/a.png => cannot be written
""")


@pytest.mark.parametrize(("words", "said"), BAD)
def test_bad_input_is_one_line_and_exits_2(jblast, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    says(jblast.refused("calc", *words.split()), said)
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
