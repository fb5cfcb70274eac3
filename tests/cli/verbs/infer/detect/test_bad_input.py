"""What `jblast detect` cannot use: one message each, exit code 2."""

import subprocess
import sys

import numpy as np
import pytest

from tests.cli.cli_files import table
from tests.cli.verbs.infer.detect.sounds import RATE, recording, template, write

OPTIONS = table("""
--charge -1 --range 5 => --charge: expected a positive number
--charge 1 => --charge: expected --range with it
--range 1 => --range: expected --charge with it
--template SHAPE --charge 1 --range 5 => expected it or --charge, got both
--template SHAPE --all-sounds => --all-sounds: expected it or --template
--template SHAPE --false-alarms 0 => --false-alarms: expected a positive
--template SHAPE --false-alarms 1e12 => --false-alarms: expected less than
--template SHAPE --positions x.csv => --positions: expected --out
--fps 1000 => --fps: expected it with frames
--size 640 => --size: expected width and height
--template SILENT => one value throughout
--template TWO => one channel, got 2
--template LONG => at least as long as the longest template
--template EMPTY => is empty
""")
RECORDINGS = table("""
absent.wav => no such file
EMPTY => is empty
CUT => cut short
WORDS => expected a sound file
NAN => nan, sample 101 (0.0125 s): expected a finite sample
SILENT => one value throughout
""")
# below east, north and up of others, or after a slash a whole table
STATIONS = table("""
other,1,2,3 => expected a station for good of
 => a station a row
good,1,2 => line 2: expected 4 fields
good,1,2,3 / good,1,2,4 => got 'good' twice
/sensor,east_m,north_m / good,1,2 => missing column up_m
/sensor,lat_deg,lon_deg,alt_m / good,91,2,3 => column lat_deg
/sensor,esat_m,north_m,up_m / good,1,2,3 => did you mean east_m?
""")


@pytest.fixture
def files(jblast):
    """Files by name: sounds that are none, and a good one."""
    nan = recording([[1.0]])
    nan[0, 100] = np.nan
    shape = template(jblast)
    whole = (jblast.directory / "template.wav").read_bytes()
    long = np.random.default_rng(0).standard_normal(5 * RATE)
    return {
        "GOOD": write(jblast, "good.wav", recording([[1.0]])),
        "SHAPE": shape,
        "SILENT": write(jblast, "silent.wav", np.zeros(RATE)),
        "TWO": write(jblast, "two.wav", recording([[1.0], [1.0]])),
        "LONG": write(jblast, "long.wav", long),
        "EMPTY": jblast.file("empty.wav", b""),
        "CUT": jblast.file("cut.wav", whole[:40]),
        "WORDS": jblast.file("words.wav", b"no sound at all"),
        "NAN": write(jblast, "nan.wav", nan),
    }


def test_recordings_templates_options_and_stations_are_refused(jblast, files):
    def refused(said, *words):
        message = jblast.refused("detect", *(files.get(word, word) for word in words))
        assert message.count("\n") == 1
        assert said in message

    for words, said in RECORDINGS:
        refused(said, words, "--template", "SHAPE")
    for words, said in OPTIONS:
        refused(said, "GOOD", *words.split())
    words = ("--template", "SHAPE", "--out", jblast.path("out"), "--positions")
    for rows, said in STATIONS:
        rows = rows[1:] if rows[:1] == "/" else f"sensor,east_m,north_m,up_m / {rows}"
        file = jblast.file("st.csv", rows.rstrip(" /").replace(" / ", "\n") + "\n")
        refused(said, "GOOD", *words, file)


def test_arguments_that_exclude_each_other_are_refused_before_jax_starts(tmp_path):
    code = (
        "import sys; from jblast.cli.main import main; "
        "code = main(['detect', 'a.wav', '--template', 'b.wav', '--charge', '1']); "
        "sys.exit(code if 'jax' not in sys.modules else 9)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False)
    assert done.returncode == 2
