"""What `jblast fit` and the command itself refuse, and files they leave alone."""

from pathlib import Path

import pytest

from tests.cli.cli_files import TWO, says, table

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
