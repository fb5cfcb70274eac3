"""`jblast fit` of records: picks and fits in one go."""

import json
from pathlib import Path

import pytest

from docs.generate.documents import schema
from jblast.observations import read
from tests.test_schemas import check

EXAMPLE = Path(__file__).parents[4] / "calibration" / "data" / "records_example"
STATIONS = "sensor,east_m,north_m,up_m\na,10,0,0\n"
SILENT = "time_s,pressure_pa\n" + "".join(f"{k},0\n" for k in range(20))


def test_a_record_that_cannot_be_read_is_not_left_out_in_silence(jblast):
    bad = jblast.file("b.csv", "time_s,p_pa\n0,1\n1,\n")
    words = ("fit", jblast.file("a.csv", SILENT), bad)
    stations = jblast.file("stations", STATIONS)
    code, printed, said = jblast(*words, "--positions", stations)
    # the picks of the other files come before the error
    assert (code, printed.splitlines()[0]) == (2, "Nothing found in 1 record")
    assert "b.csv: line 3, column p_pa: expected a number, got nothing" in said


def test_the_picks_of_an_earlier_fit_are_refused(jblast):
    out = jblast.directory / "out"
    (out / "picks").mkdir(parents=True)
    old = jblast.file("out/picks/picks.csv", "old")
    words = ("fit", jblast.file("a.csv", SILENT), "--out", str(out))
    stations = jblast.file("stations", STATIONS)
    refused = jblast.refused(*words, "--positions", stations)
    assert f"{old}: exists already" in refused


@pytest.mark.slow  # the fit of a pulse is compiled
def test_ten_records_tell_mass_place_and_time(jblast):
    out = jblast.path("out")
    words = ("fit", str(EXAMPLE), "--positions", str(EXAMPLE / "STATIONS.csv"))
    code, said, _ = jblast(*words, "--out", out)
    assert code == 0
    assert "10 picks in 10 records" in said
    assert "also free: charge east, charge north" in " ".join(said.split())
    document = json.loads((Path(out) / "fit.json").read_text())
    check(schema("fit"), document)
    assert len(document["picks"]) == 10
    told = document["estimates"]
    # what `calibration/data/records_example_truth.toml` says
    truth = {"charge_mass_kg": 15.0, "charge_east_m": 14.0, "charge_north_m": -9.0}
    for name, value in (truth | {"origin_time_s": 0.05}).items():
        assert told[name]["q05"] < value < told[name]["q95"], name
    assert (Path(out) / "records_1.png").stat().st_size > 10_000
    page = (Path(out) / "report.html").read_text()
    assert "<h2>10 picks in 10 records</h2>" in page
    kept = read(Path(out) / "picks" / "picks.csv")
    assert len(kept.covariances) >= 9
