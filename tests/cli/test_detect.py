"""`jblast detect`: the log of what it finds in sounds, and what it refuses."""

import json

import numpy as np
import pytest
import soundfile

from jblast.observations import read
from tests.cli.cli_files import says, table

RATE = 8000
WIDTH = 1e-3
BEFORE = 0.01
"""The template's first sample is so long before the middle of its pulse [s]."""


def pulse(time, middle):
    """A bang of some milliseconds, up, then down."""
    x = (time - middle) / WIDTH
    return x * np.exp(-0.5 * x**2)


def recording(times, seconds=4.0, noise=0.02, seed=0, rate=RATE):
    """Channels, each with bangs in white noise; `times` are arrivals by channel."""
    rng = np.random.default_rng(seed)
    clock = np.arange(round(seconds * rate)) / rate
    channels = [
        sum((pulse(clock, t + BEFORE) for t in of), np.zeros(clock.size))
        for of in times
    ]
    return np.array(channels) + noise * rng.standard_normal((len(times), clock.size))


def write(jblast, name, samples, rate=RATE, subtype="FLOAT"):
    """Write a file with nothing of jblast; return its path."""
    path = jblast.path(name)
    soundfile.write(path, np.atleast_2d(samples).T, rate, subtype=subtype)
    return path


def template(jblast, rate=RATE, name="template.wav"):
    """Write the pulse alone."""
    clock = np.arange(round(2 * BEFORE * rate)) / rate
    return write(jblast, name, pulse(clock, BEFORE), rate)


SPOTS = np.array([[60.0, 0, 1.5], [-20, 70, 1.5], [-50, -40, 1.5], [30, -80, 1.5]])


def stations(jblast, names, places, clocks=None):
    """Write where the microphones stood."""
    rows = ["sensor,east_m,north_m,up_m" + (",clock" if clocks else "")]
    for i, (name, (east, north, up)) in enumerate(zip(names, places, strict=True)):
        rows.append(f"{name},{east},{north},{up}" + (f",{clocks[i]}" if clocks else ""))
    return jblast.file("stations.csv", "\n".join(rows) + "\n")


def log_of(jblast, file, where):
    """Write a log; return it, and the document."""
    words = ("--template", template(jblast), "--positions", where)
    code, out, err = jblast(
        "detect", file, *words, "--out", jblast.path("out"), "--force", "--json"
    )
    assert code == 0, err
    return read(jblast.path("out/observations.csv")), json.loads(out)


def names_of(stem, count):
    return [f"{stem}.{number}" for number in range(1, count + 1)]


def test_microphones_apart_have_a_row_each(jblast):
    times = [1.0, 1.1, 1.2, 1.15]
    file = write(jblast, "far.wav", recording([[t] for t in times]))
    log, found = log_of(jblast, file, stations(jblast, names_of("far", 4), SPOTS))
    assert log.quantity == ("air_arrival_s",) * 4
    by_name = dict(zip(log.sensor, log.value, strict=True))
    np.testing.assert_allclose(
        [by_name[name] for name in names_of("far", 4)], times, atol=1e-4
    )
    np.testing.assert_array_equal(log.position[log.sensor.index("far.2")], SPOTS[1])
    assert found["arrays"] == []


def test_an_array_has_one_time_and_a_direction(jblast):
    places = np.array([[0, 0, 1], [1.2, 0, 1], [0.6, 1, 1], [0.6, 0.4, 1.9]])
    source = np.array([-300.0, 400.0, 1.0])
    times = 0.5 + np.linalg.norm(places - source, axis=1) / 340.29
    file = write(jblast, "quad.wav", recording([[t] for t in times]))
    log, found = log_of(jblast, file, stations(jblast, names_of("quad", 4), places))
    assert log.sensor == ("quad",) * 3
    assert log.quantity == ("air_arrival_s", "bearing_rad", "elevation_rad")
    middle = source - places.mean(axis=0)
    truth = [times.mean(), np.arctan2(middle[0], middle[1]) % (2 * np.pi), 0.0]
    assert (np.abs(log.value - truth) < 4 * log.sigma).all()
    (array,) = found["arrays"]
    assert (array["layout"], array["in_log"]) == ("spatial", True)
    # microseconds between microphones, but the air has turned the front
    assert array["bearing_sd_rad"] > 0.03


def test_an_array_that_contradicts_a_plane_wave_has_rows_of_its_own(jblast):
    places = np.array([[0, 0, 1.0], [2, 0, 1], [0, 2, 1], [2, 2, 1]])
    times = 0.5 + np.linalg.norm(places - [300, 400, 1], axis=1) / 340.29
    times[3] += 4e-3  # the air within a kilometre moves times by 0.5 ms
    file = write(jblast, "odd.wav", recording([[t] for t in times]))
    log, found = log_of(jblast, file, stations(jblast, names_of("odd", 4), places))
    assert log.quantity == ("air_arrival_s",) * 4
    assert found["arrays"][0]["in_log"] is False
    assert found["arrays"][0]["p_plane_wave"] < 1e-3


def test_two_bangs_are_two_shots_and_an_echo_stands_in_no_row(jblast):
    times = np.array([[1.0, 3.0], [1.1, 3.1]])
    samples = recording(times)
    samples[0] += 0.3 * recording([[1.07]], noise=0.0)[0]
    file = write(jblast, "far.wav", samples)
    log, _ = log_of(jblast, file, stations(jblast, names_of("far", 2), SPOTS[:2]))
    assert log.shot == ("1", "1", "2", "2")
    assert not np.isclose(log.value, 1.07, atol=1e-3).any()
    words = ("--template", template(jblast), "--positions", jblast.path("stations.csv"))
    said = jblast("detect", file, *words, "--out", jblast.path("out"), "--force")[1]
    assert "far.1: the arrival at 1.0" in said
    assert "is not in the log" in said


def test_recorders_with_clocks_of_their_own_keep_them(jblast):
    names = [f"m{i}" for i in range(3)]
    files = [
        write(jblast, f"{name}.wav", recording([[t]], seed=i))
        for i, (name, t) in enumerate(zip(names, (0.5, 2.9, 1.7), strict=True))
    ]
    where = stations(jblast, names, SPOTS[:3], clocks=("p", "q", "r"))
    words = ("--template", template(jblast), "--positions", where)
    assert jblast("detect", *files, *words, "--out", jblast.path("out"))[0] == 0
    log = read(jblast.path("out/observations.csv"))
    assert dict(zip(log.sensor, log.clock, strict=True)) == dict(
        zip(names, "pqr", strict=True)
    )
    assert log.shot == ("", "", "")


KEYS = ("schema", "detected", "arrivals", "threshold_snr_db", "latency_s")


def answer(jblast, *words):
    """Ask for JSON; return the exit code and the document."""
    code, out, _ = jblast("detect", *words, "--json")
    return code, json.loads(out)


def test_a_bang_is_found_where_it_is(jblast):
    file = write(jblast, "one.wav", recording([[1.23456]]))
    code, found = answer(jblast, file, "--template", template(jblast))
    assert code == 0
    assert tuple(found)[: len(KEYS)] == KEYS
    assert found["detected"]
    (arrival,) = found["arrivals"]
    assert abs(arrival["time_s"] - 1.23456) < 4 * arrival["sigma_s"]
    assert arrival["sigma_s"] < 1e-4
    assert (arrival["channel"], arrival["sensor"]) == (1, "one")
    # 2E/N0 = sum of squares over the noise's variance
    clock = np.arange(4 * RATE) / RATE
    snr_db = 10 * np.log10(np.sum(pulse(clock, 1.0) ** 2) / 0.02**2)
    assert arrival["snr_db"] == pytest.approx(snr_db, abs=1.5)
    assert arrival["snr_db"] > found["threshold_snr_db"] > 10


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


@pytest.fixture
def files(jblast):
    """Files by name: sounds that are none, and a good one."""
    long = np.random.default_rng(0).standard_normal(5 * RATE)
    return {
        "GOOD": write(jblast, "good.wav", recording([[1.0]])),
        "SHAPE": template(jblast),
        "SILENT": write(jblast, "silent.wav", np.zeros(RATE)),
        "TWO": write(jblast, "two.wav", recording([[1.0], [1.0]])),
        "LONG": write(jblast, "long.wav", long),
        "EMPTY": jblast.file("empty.wav", b""),
    }


def test_unsuitable_templates_and_options_are_refused(jblast, files):
    for words, said in OPTIONS:
        words = (files.get(word, word) for word in ("GOOD", *words.split()))
        says(jblast.refused("detect", *words), said)
