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
