from pathlib import Path

import numpy as np
import pytest
import soundfile

from jblast.errors import InputError
from jblast.observations import read, write
from jblast.observations.records.formats import Scaling
from jblast.signals.picks.pick_log import picked_log
from tests.signals.records import test_flawed as flawed

EXAMPLE = Path(__file__).parents[3] / "calibration/data/records_example"
HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m,record\n"


def made(tmp_path, *rows):
    """A log of the example's records, beside them."""
    for name in ("g01", "g02"):
        text = (EXAMPLE / f"{name}.csv").read_text()
        (tmp_path / f"{name}.csv").write_text(text)
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "".join(row + "\n" for row in rows))
    return path


TWO = (
    "g01,overpressure_record,,,50,0,0,g01.csv",
    "g02,overpressure_record,,,0,80,0,g02.csv",
)


def test_rows_of_samples_are_read_and_written(tmp_path):
    path = made(tmp_path, *TWO, "m,air_arrival_s,0.3,1e-3,0,150,0,")
    log = read(path)
    assert log.quantity[:2] == ("overpressure_record",) * 2
    assert np.isnan(log.value[:2]).all()
    assert log.record == ("g01.csv", "g02.csv", "")
    write(tmp_path / "again.csv", log)
    again = read(tmp_path / "again.csv")
    assert again.quantity == log.quantity
    assert again.record == log.record


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("g01,overpressure_record,5,,50,0,0,g01.csv", "column value: expected nothing"),
        ("g01,overpressure_record,,,50,0,0,", "column record: expected a file"),
    ],
)
def test_a_value_or_no_file_is_refused(tmp_path, row, message):
    with pytest.raises(InputError, match=message):
        read(made(tmp_path, row))


def test_a_log_written_elsewhere_still_finds_its_samples(tmp_path):
    (tmp_path / "sub").mkdir()
    write(tmp_path / "sub/log.csv", read(made(tmp_path, *TWO)))
    assert read(tmp_path / "sub/log.csv").record == ("../g01.csv", "../g02.csv")


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ((TWO[0], TWO[0].replace("50", "60")), "in another row, too"),
        ((TWO[0].replace("01.csv", "77.csv"),), r"line 2, column record: .*g77\.csv"),
    ],
)
def test_rows_without_samples_of_their_own_are_refused(tmp_path, rows, said):
    with pytest.raises(InputError, match=said):
        picked_log(read(made(tmp_path, *rows)))


def test_all_rows_that_are_refused_are_told_where_that_is_asked_for(tmp_path):
    faults = []
    rows = [one.replace("g0", "g7") for one in TWO]
    log = read(made(tmp_path, *rows, "m,air_arrival_s,0.3,1e-3,0,150,0,"))
    picked = picked_log(log, faults=faults)
    assert [str(fault).split(":")[1] for fault in faults] == [
        " line 2, column record",
        " line 3, column record",
    ]
    assert picked.quantity == ("air_arrival_s",)


def test_samples_of_full_scale_are_refused_until_it_is_said(tmp_path):
    samples = np.loadtxt(EXAMPLE / "g01.csv", delimiter=",", skiprows=4)
    log = read(made(tmp_path, TWO[0].replace("g01.csv", "g01.wav")))
    soundfile.write(tmp_path / "g01.wav", samples[:, 1] / 1e4, 20_000, "FLOAT")
    with pytest.raises(InputError, match=r"without a unit; add .*full_scale"):
        picked_log(log)
    loud = picked_log(log, Scaling(full_scale_pa=1e4))
    twice = picked_log(log, Scaling(full_scale_pa=2e4))
    np.testing.assert_allclose(twice.value[[1, 3]], 2 * loud.value[[1, 3]], rtol=1e-6)


def test_each_record_becomes_four_rows_with_their_covariance(tmp_path):
    log = read(made(tmp_path, *TWO, "m,air_arrival_s,0.3,1e-3,0,150,0,"))
    picked = picked_log(log)
    assert len(picked) == 9
    assert picked.record[1:] == ("g01.csv",) * 4 + ("g02.csv",) * 4
    assert [of.record for of in picked.covariances] == [
        "g01.csv",
        "g02.csv",
    ]
    np.testing.assert_array_equal(picked.position[5:, 1], 80.0)


def test_quantities_that_a_record_does_not_identify_have_no_row(tmp_path):
    log = made(tmp_path, TWO[0])
    lines = (tmp_path / "g01.csv").read_text().splitlines(keepends=True)
    # 10 ms of a positive phase of 13 ms from 0.2022 s on
    (tmp_path / "g01.csv").write_text(
        "".join(lines[: 4 + int((0.2122 - 0.17715) * 20_000)])
    )
    picked = picked_log(read(log))
    assert picked.quantity == ("air_arrival_s", "peak_overpressure_pa")
    assert picked.covariances[0].quantities == picked.quantity


def test_a_record_of_which_only_the_onset_is_known_gives_its_arrival(tmp_path):
    samples = flawed.made("rings")
    time = np.arange(samples.size) / flawed.RATE
    table = np.stack([time, samples], axis=1)
    np.savetxt(
        tmp_path / "r.csv", table, "%.9g", ",", header="time_s,pressure_pa", comments=""
    )
    log = made(tmp_path, TWO[0].replace("g01.csv", "r.csv"))
    picked = picked_log(read(log))
    assert picked.quantity == ("air_arrival_s",)
    assert abs(picked.value[0] - flawed.ARRIVAL) < 4 * flawed.RESOLVED
