"""What a log must not say is told by file, line, column, expectation and find."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations import QUANTITIES, read
from jblast.quantities import ADDITIVE, TIMED
from tests.observations.rows import HEADER, ROW

FRONT = "sensor,quantity,value,sigma,time_s\n"
BAD = {
    "column of another tool": (
        "sensor,range_m,impulse_kPa_ms\na,1,2\n",
        [
            "line 1",
            "'impulse_kPa_ms'",
            "positive_impulse_pa_s",
            "write positive_impulse_kpa_ms",
        ],
    ),
    "empty file": ("", ["line 1", "empty", "sensor,quantity,value,sigma"]),
    "comments only": ("# nothing\n\n", ["line 1", "empty"]),
    "header only": ("# c\n" + HEADER, ["line 2", "after the header", "measurement"]),
    "missing column": (
        "sensor,quantity,value\na,air_arrival_s,1\n",
        ["line 1", "missing column sigma", "expected sensor, quantity, value, sigma"],
    ),
    "unknown column": (
        HEADER.replace("sigma", "sgima") + ROW,
        ["line 1", "unknown column 'sgima'", "did you mean sigma?"],
    ),
    "column twice": (
        HEADER.replace("up_m", "north_m") + ROW,
        ["line 1", "north_m once", "twice"],
    ),
    "wide table": (
        "sensor,peak_overpressure_pa\na,1\n",
        ["line 1", "'peak_overpressure_pa'", "quantity, not a column"],
    ),
    "part of a position, by column": (
        "sensor,quantity,value,sigma,east_m,up_m\na,air_arrival_s,1,,2,3\n",
        ["line 1", "missing column north_m", "east_m, north_m, up_m"],
    ),
    "part of a position, by row": (
        HEADER + ROW + "b,air_arrival_s,1,,2,,3\n",
        ["line 3", "column north_m", "all of east_m, north_m, up_m", "got nothing"],
    ),
    "position and range": (
        HEADER.replace("\n", ",range_m\n") + ROW.replace("\n", ",20\n"),
        ["line 2", "column range_m", "either range_m or east_m", "got both"],
    ),
    "negative range": (
        "sensor,quantity,value,sigma,range_m\na,air_arrival_s,1,,-20\n",
        ["line 2", "column range_m", "positive", "got -20"],
    ),
    "unknown quantity": (
        HEADER + ROW + ROW.replace("air_arrival_s", "air_arival_s"),
        ["line 3", "column quantity", "'air_arival_s'", "did you mean air_arrival_s?"],
    ),
    "no quantity": (
        HEADER + ROW.replace("air_arrival_s", ""),
        ["line 2", "column quantity", "unknown quantity ''"],
    ),
    "no sensor": (
        HEADER + ROW[1:],
        ["line 2", "column sensor", "a name", "got nothing"],
    ),
    "no number": (
        HEADER + ROW.replace("0.05", "fast"),
        ["line 2", "column value", "a finite number", "got 'fast'"],
    ),
    "Python's underscore": (
        HEADER + ROW.replace("0.05", "1_000"),
        ["line 2", "column value", "'1_000'"],
    ),
    "infinity": (
        HEADER + ROW.replace("20", "-inf"),
        ["line 2", "column east_m", "a finite number", "'-inf'"],
    ),
    "overflow": (HEADER + ROW.replace("20", "1e999"), ["line 2", "'1e999'"]),
    "zero sigma": (
        HEADER + ROW.replace("0.001", "0"),
        ["line 2", "column sigma", "a positive number", "got 0"],
    ),
    "negative sigma": (
        HEADER + ROW.replace("0.001", "-0.1"),
        ["line 2", "column sigma", "a positive number", "got -0.1"],
    ),
    "negative duration": (
        HEADER + ROW + ROW.replace("air_arrival_s,", "positive_duration_s,-"),
        ["line 3", "column value", "a positive positive_duration_s", "got -0.05"],
    ),
    "duplicate": (
        HEADER + ROW + "# c\n" + ROW.replace("20,", "20.0,"),
        ["line 4", "a duplicate of line 2"],
    ),
    "ragged row": (
        HEADER + ROW + "b,air_arrival_s,1\n",
        ["line 3", "expected 7 fields", "got 3"],
    ),
    "row too long": (
        HEADER + ROW.replace("0.05", "0,05"),
        ["line 2", "expected 7 fields", "got 8", "decimal comma"],
    ),
    "radius without time": (
        FRONT + "c,shock_radius_m,11,,1e-4\nc,shock_radius_m,12,,\n",
        ["line 3", "column time_s", "the time at which", "got nothing"],
    ),
    "time of what has none": (
        FRONT + "a,air_arrival_s,1,,2\n",
        ["line 2", "column time_s", "expected nothing", "got 2 for air_arrival_s"],
    ),
    "fireball without time": (
        FRONT + "c,fireball_radius_m,11,,\n",
        ["line 2", "column time_s", "at which fireball_radius_m was", "got nothing"],
    ),
    "bearing in degrees": (
        HEADER + "a,bearing_rad,225,1,1,2,3\n",
        ["line 2", "column value", "within 6.28319 rad", "got 225", "degrees"],
    ),
    "elevation past the zenith": (
        HEADER + "a,elevation_rad,-1.6,,1,2,3\n",
        ["line 2", "column value", "within 1.5708 rad", "got -1.6"],
    ),
    "unclosed quote": (
        HEADER + ROW + '"b' + ROW + ROW,
        ["line 3", "quote"],
    ),
    "quote over two lines": (
        HEADER + '"a\nb"' + ROW[1:],
        ["line 2", "quote that is not closed"],
    ),
    "stray quote": (HEADER + '"a"b' + ROW[1:], ["line 2", "quote"]),
    "Latin-1": (
        (HEADER + ROW + ROW.replace("a,", "caf\u00e9,", 1)).encode("latin-1"),
        ["line 3", "UTF-8", "0xe9"],
    ),
    "UTF-16 unmarked": (
        (HEADER + ROW).encode("utf-16-le"),
        ["line 1", "0x00", "UTF-16 without its mark"],
    ),
    "binary": (
        HEADER.encode() + b"\x7fELF\x00\x01",
        ["line 2", "a CSV file", "0x7f", "binary"],
    ),
    "workbook": (b"PK\x03\x04\x14\x00", ["line 1", "zip archive", "plain text"]),
}


@pytest.mark.parametrize(("content", "said"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_told_by_file_line_column_expectation_and_find(log, content, said):
    refused(log(content), said)


def refused(path, said):
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert "log.csv: " in message
    for words in said:
        assert words in message, message
    assert "\n" not in message


def test_a_quote_that_swallows_the_file_is_named_where_it_opens(log):
    with pytest.raises(InputError, match=r"line 3: .*quote"):
        read(log(HEADER + ROW + '"b,' + ROW * 10_000))


@pytest.mark.parametrize(
    "quantity", [q for q in QUANTITIES if q not in ADDITIVE and q not in TIMED]
)
@pytest.mark.parametrize("value", ["0", "-1"])
def test_what_errs_in_ln_must_be_positive(log, quantity, value):
    with pytest.raises(InputError, match=f"a positive {quantity}, got {value}"):
        read(log(HEADER + f"a,{quantity},{value},,1,2,3\n"))


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: no such file; expected a CSV"):
        read(tmp_path / "none.csv")


def test_a_directory_is_told(tmp_path):
    with pytest.raises(InputError, match="is a directory"):
        read(tmp_path)


@pytest.mark.parametrize("path", ["a\0b.csv", "x" * 5000])
def test_an_impossible_path_is_told(path):
    with pytest.raises(InputError, match="cannot be read"):
        read(path)


FUZZ = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@FUZZ
@given(st.binary(max_size=200))
def test_random_bytes_raise_nothing_but_input_errors(log, data):
    with pytest.raises(InputError):
        read(log(data))


FIELD = st.one_of(
    st.sampled_from(["a", "air_arrival_s", "shock_radius_m", "1", "-1", "", "nan"]),
    st.text(max_size=6),
    st.floats().map(repr),
)


@FUZZ
@given(
    st.lists(st.sampled_from(["range_m", "time_s", "path", "shot", "clock", "x"])),
    st.lists(st.lists(FIELD, min_size=4, max_size=7).map(",".join), max_size=4),
)
def test_random_rows_raise_nothing_but_input_errors(log, more, rows):
    header = ",".join(["sensor", "quantity", "value", "sigma", *more])
    text = "\n".join([header, *rows]).encode("utf-8", "replace")
    with suppress(InputError):
        assert np.isfinite(read(log(text)).value).all()
