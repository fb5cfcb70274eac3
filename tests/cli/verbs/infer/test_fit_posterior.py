"""`--posterior auto` takes the normal approximation where it holds, else walkers."""

import json

import pytest

from tests.cli.cli_files import HEADER

EXACT = '[charge]\nmass_kg = "free"\n[law]\nscatter = false\n'
ROWS = "".join(
    f"s{i},peak_overpressure_pa,{value},{{}},{east},0,0\n"
    for i, (value, east) in enumerate(((196000, 10), (42000, 20), (14800, 40)))
)


@pytest.mark.slow
def test_auto_says_which_it_took_and_why(jblast):
    scene = jblast.file("scene.toml", EXACT)
    narrow = jblast.file("narrow.csv", HEADER + ROWS.format(9000, 2000, 700))
    wide = jblast.file("wide.csv", HEADER + ROWS.format(90000, 20000, 7000))
    asked = ("--scene", scene, "--posterior", "auto", "--noise", "gaussian")
    for log, method in ((narrow, "laplace"), (wide, "emcee")):
        code, out, err = jblast("fit", log, *asked, "--verbose")
        assert (code, err) == (0, "")
        text = " ".join(out.split())
        assert f"Intervals {method}: " in text
        assert "k-hat" in text
        assert "largest sd of ln" in text
        assert ("the normal approximation fails its check" in text) == (
            method == "emcee"
        )
        assert json.loads(jblast("fit", log, *asked, "--json")[1])["posterior"] == (
            method
        )


@pytest.mark.slow
def test_the_approximation_alone_warns_where_its_intervals_are_off(jblast):
    # two pressures of a charge twelve times as large: Student-t errors allow both
    more = "s3,peak_overpressure_pa,650000,200000,15,0,0\n"
    more += "s4,peak_overpressure_pa,97000,30000,30,0,0\n"
    scene = jblast.file("scene.toml", EXACT)
    log = jblast.file("log.csv", HEADER + ROWS.format(60000, 13000, 4500) + more)
    out = jblast.path("out")
    code, text, err = jblast(
        *("fit", log, "--scene", scene, "--out", out, "--posterior", "laplace")
    )
    assert (code, err) == (0, "")
    warned = "90 % intervals are those of a normal approximation, with an error of"
    assert warned in " ".join(text.split())
    assert warned in jblast.text("out/report.html")
    answer = json.loads(jblast.text("out/fit.json"))
    assert answer["posterior"] == "laplace"
    (warning,) = (said for said in answer["warnings"] if warned in said)
    assert "for charge_mass_kg" in warning
    assert "--posterior emcee runs MCMC" in warning
