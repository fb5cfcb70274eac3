"""What `jblast detect` cannot use: one message each, exit code 2."""

import numpy as np
import pytest

from tests.cli.cli_files import table
from tests.cli.verbs.infer.detect.sounds import RATE, recording, template, write


@pytest.fixture
def good(jblast):
    return write(jblast, "good.wav", recording([[1.0]]))


def refused(jblast, *words):
    """Return the one line that is said."""
    said = jblast.refused("detect", *words)
    assert said.count("\n") == 1
    return said


def test_recordings_that_are_none(jblast):
    shape = ("--template", template(jblast))
    nan = recording([[1.0]])
    nan[0, 100] = np.nan
    silent = np.zeros(RATE)
    whole = (jblast.directory / "template.wav").read_bytes()
    for file, said in (
        (jblast.path("absent.wav"), "no such file"),
        (jblast.file("empty.wav", b""), "is empty"),
        (jblast.file("cut.wav", whole[:40]), "cut short"),
        (jblast.file("words.wav", b"no sound at all"), "expected a sound file"),
        (
            write(jblast, "nan.wav", nan),
            "nan, sample 101 (0.0125 s): expected a finite sample",
        ),
        (write(jblast, "silent.wav", silent), "one value throughout"),
        (write(jblast, "short.wav", silent[:50] + np.arange(50)), "at least as long"),
    ):
        assert said in refused(jblast, file, *shape)


def test_templates_that_are_none(jblast, good):
    long = np.random.default_rng(0).standard_normal(5 * RATE)
    for file, said in (
        (write(jblast, "silent.wav", np.zeros(100)), "one value throughout"),
        (write(jblast, "two.wav", recording([[1.0], [1.0]])), "one channel, got 2"),
        (write(jblast, "long.wav", long), "at least as long as the longest template"),
        (jblast.file("empty.wav", b""), "is empty"),
    ):
        assert said in refused(jblast, good, "--template", file)


OPTIONS = table("""
--charge -1 --range 5 => --charge: expected a positive number
--charge 1 --range -5 => --range: expected a positive number
--charge 1 => --charge: expected --range with it
--range 1 => --range: expected --charge with it
--template SHAPE --charge 1 --range 5 => expected it or --charge, got both
--template SHAPE --all-sounds => --all-sounds: expected it or --template
--template SHAPE --false-alarms 0 => --false-alarms: expected a positive
--template SHAPE --false-alarms 1e12 => --false-alarms: expected less than
--template SHAPE --positions x.csv => --positions: expected --out
""")
# beneath east, north and up of others, or a slash and a whole one
STATIONS = table("""
other,1,2,3 => expected a station for good of
 => a station a row
good,1,2 => line 2: expected 4 fields
good,1,2,x => column up_m: expected a finite number, got 'x'
good,1,2,3 / good,1,2,4 => got 'good' twice
/sensor,east_m,north_m / good,1,2 => missing column up_m
/sensor,lat_deg,lon_deg,alt_m / good,91,2,3 => column lat_deg
/sensor,esat_m,north_m,up_m / good,1,2,3 => did you mean east_m?
""")


def test_options_that_cannot_be_used(jblast, good):
    shape = template(jblast)
    for words, said in OPTIONS:
        words = words.replace("SHAPE", shape).split()
        assert said in refused(jblast, good, *words)


def test_stations_that_are_none(jblast, good):
    words = ("--template", template(jblast), "--out", jblast.path("out"), "--positions")
    for rows, said in STATIONS:
        rows = rows[1:] if rows[:1] == "/" else f"sensor,east_m,north_m,up_m / {rows}"
        file = jblast.file("st.csv", rows.rstrip(" /").replace(" / ", "\n") + "\n")
        assert said in refused(jblast, good, *words, file)
