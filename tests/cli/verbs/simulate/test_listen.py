import csv
import json

import numpy as np
import pytest
import soundfile
from jsonschema import Draft202012Validator

from docs.generate import documents
from tests.cli.cli_files import table

SCENE = """
[charge]
mass_kg = 2.0
time_s = 0.02
[[sensor]]
name = "phone"
kind = "microphone"
position_m = [60.0, 0.0, 1.5]
clock_offset_s = 0.01
rate_hz = 8000
full_scale_pa = 200.0
noise_pa = 0.02
bits = 12
[[sensor]]
name = "studio"
kind = "microphone"
position_m = [60.0, 0.0, 1.5]
rate_hz = 8000
[[sensor]]
name = "gauge"
kind = "pressure"
position_m = [60.0, 0.0, 1.5]
rate_hz = 8000
[[sensor]]
name = "light"
kind = "flash"
position_m = [60.0, 0.0, 2.0]
"""


def sounds(path: str) -> tuple[np.ndarray, float]:
    """Samples and rate of a file, by another reader."""
    samples, rate_hz = soundfile.read(path)
    return samples, rate_hz


def rows(text: str) -> list[dict[str, str]]:
    """Rows of a table, comments left out."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


@pytest.mark.slow
def test_every_sensor_writes_what_the_laws_say(jblast):
    scene = jblast.file("scene.toml", SCENE)
    code, out, err = jblast("listen", scene, "--out", jblast.path("o"), "--json")
    assert (code, err) == (0, ""), err
    told = json.loads(out)
    assert json.loads(jblast.text("o/listen.json")) == told
    Draft202012Validator(documents.schema("listen")).validate(told)
    assert told["skipped"] == {"light": "kind flash writes no samples over time"}
    phone, studio, gauge = (told["sensors"][n] for n in ("phone", "studio", "gauge"))
    for sensor in (phone, studio, gauge):
        assert sensor["samples"] == round(8000 * told["seconds"])
        assert sensor["rate_hz"] == 8000
    # the phone's clock is 10 ms ahead, and its file begins at its own 0
    assert phone["air_arrival_s"] == pytest.approx(studio["air_arrival_s"] + 0.01)
    assert (phone["clipped"], studio["clipped"], gauge["clipped"]) == (
        True,
        False,
        False,
    )
    pascals, rate_hz = sounds(jblast.path("o/studio.wav"))
    assert (rate_hz, pascals.size) == (8000, studio["samples"])
    front = np.flatnonzero(pascals > 0.1 * studio["peak_overpressure_pa"])[0]
    assert front / 8000 == pytest.approx(studio["air_arrival_s"], abs=1.5 / 8000)
    # 15 ms of positive phase are 120 samples: the mean over the first is 2 % less
    assert pascals.max() == pytest.approx(studio["peak_overpressure_pa"], rel=0.03)
    end = studio["air_arrival_s"] + studio["positive_duration_s"]
    impulse = pascals[front - 1 : round(8000 * end)].sum() / 8000
    # samples are means, so their sum misses part of the last one alone: half of
    # (1/130)^2; another law's impulse is a tenth off
    assert impulse == pytest.approx(studio["positive_impulse_pa_s"], rel=1e-3)
    sampled = rows(jblast.text("o/gauge.csv"))
    assert [float(row["time_s"]) for row in sampled[:2]] == [0.0, 0.000125]
    overpressure = [float(row["overpressure_pa"]) for row in sampled]
    assert max(overpressure) == pytest.approx(gauge["peak_overpressure_pa"], rel=0.03)
    share, _ = sounds(jblast.path("o/phone.wav"))
    assert phone["full_scale_pa"] == 200.0
    assert share.max() == 1 - 2.0**-11  # twelve bits
    np.testing.assert_array_equal(share * 2**11, np.round(share * 2**11))
    truth = {row["sensor"]: row for row in rows(jblast.text("o/truth.csv"))}
    assert truth["phone"]["clipped"] == "true"
    assert float(truth["gauge"]["air_arrival_s"]) == pytest.approx(
        gauge["air_arrival_s"]
    )
    for picture in ("waveforms.png", "spectrograms.png"):
        assert (jblast.directory / "o" / picture).stat().st_size > 10_000
    assert "exists already" in jblast.refused(
        "listen", scene, "--out", jblast.path("o")
    )
    # recordings of another origin, in a folder without records of jblast
    (jblast.directory / "own").mkdir()
    own = jblast.file("own/phone.wav", "a recording")
    out = jblast.path("own")
    assert f"{own}: exists already" in jblast.refused("listen", scene, "--out", out)
    assert jblast.text("own/phone.wav") == "a recording"


OPTIONS = table("""
--seconds -1 => --seconds: expected a positive number, got -1
--seconds 1e9 => --seconds: expected 1 to
--packets 0 => expected a positive number
--packets 9000 => --packets: expected at most 8000 packets per second
--ambient none.wav => no such file
--ambient EMPTY => is empty
--seed x => whole number
""")


def test_what_is_bad_exits_2_in_one_message(jblast):
    scene = jblast.file("scene.toml", SCENE)
    silent = jblast.file("empty.wav", b"")
    charge = "[charge]\nmass_kg = 2.0\n"
    sensor = '[[sensor]]\nname = "a"\n'
    cases = {
        charge: "got no sensor",
        charge + sensor + 'kind = "flash"\n': "kind flash writes no samples",
        charge + sensor + 'kind = "pressure"\n': "'a': expected position_m",
        charge + sensor + 'kind = "pressure"\nposition_m = [0, 0, 0]\n': "sensor 'a'",
        sensor
        + 'kind = "pressure"\nposition_m = [9, 0, 0]\n': "charge_mass_kg: expected a",
    }
    for content, words in cases.items():
        bad = jblast.file("bad.toml", content)
        assert words in jblast.refused("listen", bad, "--out", jblast.path("o"))
    for words, said in OPTIONS:
        words = words.replace("EMPTY", silent).split()
        told = jblast.refused("listen", scene, "--out", jblast.path("o"), *words)
        assert said in told
