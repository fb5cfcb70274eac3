"""Logs whose clock times are dates and times of day."""

from datetime import UTC, datetime

import numpy as np
import pytest

import jblast
from jblast.errors import InputError
from jblast.observations import write

HEAD = "sensor,quantity,value_utc,value,sigma,range_m\n"
LOG = HEAD + (
    "a,flash_time_s,2020-08-04T15:08:18.310004Z,,0.03,800\n"
    "a,air_arrival_s,2020-08-04T18:08:20.5+03:00,,0.001,800\n"
    "a,peak_overpressure_pa,,900,90,800\n"
)


def read(tmp_path, text, **options):
    path = tmp_path / "log.csv"
    path.write_text(text)
    return jblast.read(path, **options)


def test_values_count_from_the_second_before_the_first(tmp_path):
    log = read(tmp_path, LOG)
    assert log.epoch == datetime(2020, 8, 4, 15, 8, 18, tzinfo=UTC)
    assert log.value.tolist() == [0.310004, 2.5, 900.0]


def test_what_is_written_is_read_again(tmp_path):
    log = read(tmp_path, LOG)
    write(tmp_path / "again.csv", log)
    again = jblast.read(tmp_path / "again.csv")
    assert again.epoch == log.epoch
    assert np.array_equal(again.value, log.value)


def test_what_was_supplied_to_times_or_converted_is_told(tmp_path):
    of_day = LOG.replace("2020-08-04T15:08:18.310004Z", "18:08:18.310004")
    log = read(tmp_path, of_day, date="2020-08-04", zone="Asia/Beirut")
    assert [dict(note.numbers) for note in log.understood] == [
        {"rows": 1, "date": "2020-08-04"},
        {"rows": 1, "zone": "Asia/Beirut"},
        {"rows": 1},
    ]
    assert log.value.tolist() == [0.310004, 2.5, 900.0]


def test_of_times_in_utc_with_dates_there_is_nothing_to_tell(tmp_path):
    in_utc = LOG.replace("18:08:20.5+03:00", "15:08:20.5Z")
    assert read(tmp_path, in_utc, date="2020-08-05", zone="+03:00").understood == ()


def test_a_clock_a_day_off_keeps_its_microseconds(tmp_path):
    log = read(tmp_path, LOG.replace("04T18:08:20.5+", "05T18:08:20.500001+"))
    assert log.value[1] == 86402.500001


def test_a_quantity_beside_a_time_of_the_day_needs_no_unit(tmp_path):
    text = LOG.replace("air_arrival_s", "air_arrival")
    log = read(tmp_path, text)
    assert log.quantity[1] == "air_arrival_s"
    assert log.value[1] == 2.5


def test_of_an_unknown_quantity_with_a_time_of_the_day_one_fault_is_told(tmp_path):
    with pytest.raises(InputError, match="unknown quantity 'bang'") as told:
        read(tmp_path, LOG.replace("air_arrival_s", "bang"))
    assert "no clock time" not in str(told.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2020-08-04T15:08:18.310004Z", "15:08:18.31", r"value_utc: .*date"),
        (".310004Z", ".310004", "column value_utc: expected a zone"),
        ("15:08:18.310004", "15:08:60.310004", "leap second"),
        (",,900,", ",2020-08-04T15:08:18Z,,", "line 4, .*no clock time"),
        ("310004Z,,", "310004Z,1,", "either value or value_utc, got both"),
        ("2020-08-04T15:08:18.310004Z,,", ",0.31,", r"column value: .*value_utc"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused(tmp_path, old, new, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, LOG.replace(old, new))


def test_midnight_within_times_of_day_is_refused(tmp_path):
    text = HEAD + (
        "a,flash_time_s,23:59:59.9,,0.03,800\na,air_arrival_s,00:00:02.1,,0.001,800\n"
    )
    with pytest.raises(InputError, match=r"line 3, .*midnight was between"):
        read(tmp_path, text, date="2020-08-04", zone="UTC")
    dated = text.replace("00:00:02.1", "2020-08-05T00:00:02.1")
    log = read(tmp_path, dated, date="2020-08-04", zone="UTC")
    assert log.value == pytest.approx([0.9, 3.1], abs=0)
