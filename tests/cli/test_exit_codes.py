"""What `jblast fit` and the command itself refuse; exit codes of several files."""

import subprocess
from pathlib import Path

import pytest

from tests.cli.cli_files import HEADER, JBLAST, TWO, says, table

OPTIONS = table("""
--free clock_offset_s.c => no such clock | expected one of a, b
--free clock_offset_s => clock_offset_s.NAME
--free charge_mass_kg.main => did you mean charge_mass_kg
--free charge_mas_kg => did you mean charge_mass_kg
--free charge_range_m,charge_east_m => charge_range_m | charge_east_m
--law nobody => expected auto | 'nobody'
--law air_arrival=wu_hao => did you mean air_arrival_s
--law air_arrival_s=ford_2021 => wu_hao | 'ford_2021'
--law ford_2021 => a quantity of the log
--law arrival_difference_s=wu_hao => air_arrival_s and ground_arrival_s
--noise cauchy => student | gaussian
--seed 3 => unrecognized
--scene  => expected a path
""")


@pytest.mark.parametrize(("option", "said"), OPTIONS)
def test_a_bad_option_exits_2(jblast, option, said):
    err = jblast.refused("fit", jblast.file("log.csv", TWO), *option.split(" ", 1))
    assert all(part in err for part in said.split(" | "))


def test_a_log_and_a_scene_that_are_not_there_are_named(jblast):
    says(jblast.refused("fit", jblast.path("no.csv")), "no.csv | no such")
    log = jblast.file("log.csv", TWO)
    err = jblast.refused("fit", log, "--scene", jblast.path("no.toml"))
    says(err, "no.toml | no such")


def test_a_place_that_cannot_be_written_is_refused_before_the_fit(jblast, tmp_path):
    log = jblast.file("log.csv", TWO)
    (tmp_path / "full").mkdir()
    jblast.file("full/held", "mine")
    jblast.file("full/fit.json", "mine")
    for out, words in (
        ("full", "fit.json | exists already | --force"),
        ("full/held", "File exists"),
        ("full/held/deeper", "Not a directory"),
    ):
        says(jblast.refused("fit", log, "--out", jblast.path(out)), words)
    assert jblast.text("full/held") == "mine"


def test_debug_adds_the_traceback(jblast):
    code, out, err = jblast("fit", jblast.path("no.csv"), "--debug")
    assert (code, out) == (2, "")
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("jblast: ")


def test_no_verb_and_an_unknown_verb_exit_2_and_say_which_there_are(jblast):
    for arguments in ((), ("frobnicate",)):
        err = jblast.refused(*arguments)
        assert all(verb in err for verb in ("fit", "scene", "simulate"))


@pytest.mark.parametrize("verb", ["fit", "check", "pick"])
def test_ten_gigabytes_are_refused_before_they_are_read(jblast, verb):
    path = Path(jblast.path("huge.csv"))
    with path.open("wb") as file:
        file.truncate(10 * 1024**3)  # a hole: it takes no room on the disk
    message = jblast.refused(verb, str(path))
    assert "expected" in message
    assert "got 10.7 GB" in message


STATIONS = "sensor,east_m,north_m,up_m\na,10,0,0\n"
SILENT = "time_s,pressure_pa\n" + "".join(f"{k},0\n" for k in range(20))
BAD = "time_s,p_pa\n0,1\n1,\n"


def test_a_reader_that_leaves_gets_no_traceback(jblast):
    log = jblast.file("log.csv", TWO)
    command = " ".join(f"'{word}'" for word in (*JBLAST, "scene", log))
    done = subprocess.run(
        ["bash", "-c", f"{command} | true; exit ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 141
    lines = done.stderr.splitlines()  # how far it is, where that takes over a second
    assert all(line.startswith("jblast scene: ") for line in lines)


def test_a_record_that_cannot_be_read_costs_the_others_nothing_and_exits_2(jblast):
    good, bad = jblast.file("a.csv", SILENT), jblast.file("b.csv", BAD)
    stations = ("--positions", jblast.file("stations", STATIONS))
    for words in (("pick", good, bad), ("fit", good, bad, *stations)):
        code, out, err = jblast(*words)
        assert (code, out) == (2, "Nothing found in 1 record\n")
        assert "b.csv: line 3, column p_pa: expected a number, got nothing" in err
    several = jblast.refused("pick", bad, jblast.file("c.csv", "x\n"))
    assert "files cannot be read for 2 causes: " in several


def test_the_picks_of_an_earlier_fit_are_refused(jblast):
    (jblast.directory / "out/picks").mkdir(parents=True)
    old = jblast.file("out/picks/picks.csv", "old")
    words = ("fit", jblast.file("a.csv", SILENT), "--out", jblast.path("out"))
    stations = jblast.file("stations", STATIONS)
    refused = jblast.refused(*words, "--positions", stations)
    assert f"{old}: exists already" in refused


def test_no_log_at_all_that_can_be_fitted_exits_2(jblast):
    row = "a,peak_overpressure_pa,-1,1,20,0,0\n"
    bad = [jblast.file(f"{name}.csv", HEADER + row) for name in "xy"]
    err = jblast.refused("fit", *bad)
    assert "none of 2 logs" in err
    assert err.count("expected") == 2  # the reason of each


def test_no_valid_law_is_exit_code_4(jblast):
    far = ("calc", "--mass", "1", "--range")
    assert jblast(*far, "900000")[0] == 4
    assert jblast(*far, "9e5", "20", "--json")[0] == 0  # a row is valid
    assert jblast(*far, "9e5", "--quantity", "arrival")[0] == 0  # that of sound is
