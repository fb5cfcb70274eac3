"""Exit codes of commands of several files, and of one whose reader leaves."""

import subprocess

from tests.cli.cli_files import HEADER, JBLAST, TWO

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
