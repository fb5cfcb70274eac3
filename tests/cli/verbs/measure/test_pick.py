"""`jblast pick`: from records to a log, and what it says where it cannot."""

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from jblast.observations import read

EXAMPLE = Path(__file__).parents[4] / "calibration" / "data" / "records_example"
SILENT = "time_s,pressure_pa\n" + "".join(f"{k},0\n" for k in range(20))


def test_silence_is_nothing_found(jblast):
    code, out, err = jblast("pick", jblast.file("a.csv", SILENT))
    assert (code, err) == (3, "")
    assert out == "Nothing found in 1 record\n"
    code, out, _ = jblast("pick", jblast.path("a.csv"), "--json")
    assert code == 3
    document = json.loads(out)
    assert document["picks"] == []
    assert document["nothing_found"] == ["a"]


def test_what_cannot_be_read_is_one_message(jblast):
    expected = "a.mp3: expected a record of samples, its name ending in"
    assert expected in jblast.refused("pick", jblast.file("a.mp3", "ID3"))
    assert "a.wav: is empty" in jblast.refused("pick", jblast.file("a.wav", ""))


def test_a_bad_file_costs_the_others_nothing(jblast):
    good, bad = jblast.file("a.csv", SILENT), jblast.file("b.csv", "time_s,p_pa\n0,1\n")
    code, out, err = jblast("pick", good, bad)
    assert code == 2
    assert out == "Nothing found in 1 record\n"
    assert "b.csv: line 2, column time_s: expected at least two samples" in err
    several = jblast.refused("pick", bad, jblast.file("c.csv", "x\n"))
    assert "files cannot be read for 2 causes: " in several


@pytest.mark.slow  # the fit of a pulse is compiled
def test_the_example_becomes_a_log_a_page_and_an_answer(jblast):
    stations, log = str(EXAMPLE / "STATIONS.csv"), jblast.path("picks.csv")
    report = jblast.path("report")
    words = ("pick", str(EXAMPLE), "--positions", stations, "--out", log)
    code, out, _ = jblast(*words, "--report", report, "--json")
    assert code == 0
    document = json.loads(out)
    assert [pick["record"] for pick in document["picks"]] == [
        f"g{k:02d}" for k in range(1, 11)
    ]
    rows = read(log)
    assert len(rows) >= 36  # a pick that is poor gives no rows
    truth = np.loadtxt(EXAMPLE / "STATIONS.csv", delimiter=",", skiprows=2, usecols=1)
    assert {float(x) for x in rows.position[:, 0]} <= set(truth.tolist())
    names = {path.name for path in Path(report).iterdir()}
    assert names >= {"picks.json", "picks.csv", "report.html", "records_1.png"}
    page = (Path(report) / "report.html").read_text()
    assert "g10" in page
    assert "SIMULATED" not in page
    free = "charge_east_m,charge_north_m,origin_time_s"
    code, out, _ = jblast("fit", log, "--free", free, "--json")
    assert code == 0
    mass = json.loads(out)["estimates"]["charge_mass_kg"]
    assert mass["q05"] < 15.0 < mass["q95"]


@pytest.mark.slow  # the fit of a pulse is compiled
def test_sound_without_full_scale_tells_times_alone(jblast):
    samples = np.loadtxt(EXAMPLE / "g01.csv", delimiter=",", skiprows=4, usecols=1)
    path = jblast.path("phone.wav")
    soundfile.write(path, samples / 1e4, 20_000, subtype="PCM_24")
    code, out, _ = jblast("pick", path, "--json", "--out", jblast.path("log.csv"))
    assert code == 0
    (told,) = json.loads(out)["picks"]
    assert told["peak_overpressure_pa"] is None
    # cut from 25 ms before the front
    assert told["air_arrival_s"]["value"] == pytest.approx(0.025, abs=1e-4)
    assert read(jblast.path("log.csv")).quantity == ("air_arrival_s",)
    code, out, _ = jblast("pick", path, "--full-scale", "10000", "--json")
    (told,) = json.loads(out)["picks"]
    assert told["peak_overpressure_pa"]["value"] == pytest.approx(4760.0, rel=0.01)


@pytest.mark.slow  # the fit of a pulse is compiled
def test_picks_made_before_a_bad_file_are_kept(jblast):
    bad, log = jblast.file("c.wav", bytes(range(128, 256))), jblast.path("picks.csv")
    good = [str(EXAMPLE / f"g0{k}.csv") for k in (1, 2)]
    code, out, err = jblast("pick", *good, bad, "--out", log)
    assert code == 2
    assert "2 picks in 2 records" in out
    assert "c.wav: " in err
    assert "expected a sound file" in err
    assert set(read(log).sensor) == {"g01", "g02"}
