"""Logs whose clock times are dates and times of day."""

from datetime import UTC, date, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jblast
from jblast.errors import InputError
from jblast.observations import write
from jblast.observations.instants import (
    NotAnInstant,
    day_named,
    instant,
    zone_named,
)

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


def test_a_clock_a_day_off_keeps_its_microseconds(tmp_path):
    log = read(tmp_path, LOG.replace("04T18:08:20.5+", "05T18:08:20.500001+"))
    assert log.value[1] == 86402.500001


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


NOON = datetime(2020, 8, 4, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    "text",
    [
        "2020-08-04T12:00:00Z",
        "2020-08-04 12:00:00.000000000Z",
        "2020-08-04T15:00:00+03:00",
        "2020-08-04T15:00+0300",
        "2020-08-04T02:00:00,000-10",
        "15:00:00+03:00",
        "14:00:00",
    ],
)
def test_one_instant_is_written_in_many_ways(text):
    assert instant(text, date(2020, 8, 4), zone_named("Europe/Paris")) == NOON


def test_microseconds_are_kept():
    for text in ("2020-08-04T12:00:00.123456Z", "2020-08-04T12:00:00,1234569Z"):
        assert instant(text, None, None) - NOON == timedelta(microseconds=123456)


@settings(max_examples=200, deadline=None)
@given(
    st.datetimes(datetime(1900, 1, 1), datetime(2200, 1, 1)),
    st.integers(-14 * 60, 14 * 60),
)
def test_the_standard_library_reads_the_same(when, minutes):
    zone = timezone(timedelta(minutes=minutes))
    text = when.replace(tzinfo=zone).isoformat()
    read = instant(text, None, None)
    assert read == datetime.fromisoformat(text)
    assert read.tzinfo is UTC


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("15:08:18", "a date, as in .*date. YYYY-MM-DD for all .and .zone"),
        ("2020-08-04T15:08:18", "a zone, as in"),
        ("2016-12-31T23:59:60.5Z", "leap second"),
        ("2020-02-30T00:00:00Z", "day is out of range"),
        ("2020-08-04T25:00:00Z", "hour must be in"),
        ("2020-08-04", "a time as"),
        ("2020-08-04T15:08:18 EST", "a time as"),
        ("2020-08-04T15:08:18+99:00", "a time as"),
        ("1596542400.0", "a time as"),
        ("9999-12-31T23:59:59-12:00", "a year from"),
    ],
)
def test_what_is_no_instant_is_told(text, said):
    with pytest.raises(NotAnInstant, match=said):
        instant(text, None, None)


def test_a_local_time_that_never_was_or_came_twice_is_told():
    paris = zone_named("Europe/Paris")
    with pytest.raises(NotAnInstant, match="skipped when they were put forward"):
        instant("2024-03-31T02:30:00", None, paris)
    with pytest.raises(NotAnInstant, match=r"add \+0200 or \+0100 to it"):
        instant("2024-10-27T02:30:00", None, paris)
    summer = instant("2024-10-27T02:30:00+0200", None, paris)
    winter = instant("2024-10-27T02:30:00+0100", None, paris)
    assert winter - summer == timedelta(hours=1)


def test_an_offset_of_half_a_minute_counts():
    # Monrovia was 44 min 30 s behind until 7 January 1972
    text, zone = "1971-06-01T12:00:00", zone_named("Africa/Monrovia")
    behind = instant(text, None, zone) - instant(f"{text}Z", None, None)
    assert behind == timedelta(minutes=44, seconds=30)


def test_zones_and_days_that_are_none_are_told():
    with pytest.raises(InputError, match="did you mean Europe/Paris"):
        zone_named("Europe/Pari")
    for name in ("", "+25:00", "../etc"):
        with pytest.raises(InputError, match="zone: expected"):
            zone_named(name)
    for text in ("4.8.2020", "2020-13-01", "2020-8-4"):
        with pytest.raises(InputError, match="date: expected a day"):
            day_named(text)
