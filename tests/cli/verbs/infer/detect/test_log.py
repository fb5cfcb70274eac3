"""The log that `jblast detect` writes, and what a fit makes of it."""

import json

import numpy as np

from jblast.observations import read
from tests.cli.verbs.infer.detect.sounds import recording, template, write

PLACES = np.array([[60.0, 0, 1.5], [-20, 70, 1.5], [-50, -40, 1.5], [30, -80, 1.5]])


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
    log, found = log_of(jblast, file, stations(jblast, names_of("far", 4), PLACES))
    assert log.quantity == ("air_arrival_s",) * 4
    by_name = dict(zip(log.sensor, log.value, strict=True))
    np.testing.assert_allclose(
        [by_name[name] for name in names_of("far", 4)], times, atol=1e-4
    )
    np.testing.assert_array_equal(log.position[log.sensor.index("far.2")], PLACES[1])
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
    log, _ = log_of(jblast, file, stations(jblast, names_of("far", 2), PLACES[:2]))
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
    where = stations(jblast, names, PLACES[:3], clocks=("p", "q", "r"))
    words = ("--template", template(jblast), "--positions", where)
    assert jblast("detect", *files, *words, "--out", jblast.path("out"))[0] == 0
    log = read(jblast.path("out/observations.csv"))
    assert dict(zip(log.sensor, log.clock, strict=True)) == dict(
        zip(names, "pqr", strict=True)
    )
    assert log.shot == ("", "", "")
