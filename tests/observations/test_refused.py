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
    "zero sigma": (
        HEADER + ROW.replace("0.001", "0"),
        ["line 2", "column sigma", "a positive number", "got 0"],
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
    "bearing in degrees": (
        HEADER + "a,bearing_rad,225,1,1,2,3\n",
        ["line 2", "column value", "within 6.28319 rad", "got 225", "degrees"],
    ),
    "elevation past the zenith": (
        HEADER + "a,elevation_rad,-1.6,,1,2,3\n",
        ["line 2", "column value", "within 1.5708 rad", "got -1.6"],
    ),
    "quote over two lines": (
        HEADER + '"a\nb"' + ROW[1:],
        ["line 2", "quote that is not closed"],
    ),
    "UTF-16 unmarked": (
        (HEADER + ROW).encode("utf-16-le"),
        ["line 1", "0x00", "UTF-16 without its mark"],
    ),
    "binary": (
        HEADER.encode() + b"\x7fELF\x00\x01",
        ["line 2", "a CSV file", "0x7f", "binary"],
    ),
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


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("none.csv", "no such file; expected a CSV"),
        ("", "is a directory"),
        ("a\0b.csv", "cannot be read"),
        ("x" * 5000, "cannot be read"),
    ],
)
def test_a_path_that_leads_to_no_file_is_told(tmp_path, name, said):
    with pytest.raises(InputError, match=said):
        read(f"{tmp_path}/{name}")


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


SEVERAL = (
    HEADER
    + ROW
    + "b,air_arival_s,fast,-1,1,2,3\n"
    + "c,air_arrival_s,1,,1,,3\n"
    + ROW
    + "d,air_arrival_s,2,0.1,5,6,7\n"
)


def test_every_fault_is_gathered_line_by_line(log):
    faults: list[InputError] = []
    observations = read(log(SEVERAL), faults=faults)
    said = [str(fault).partition("log.csv: ")[2] for fault in faults]
    assert [text.partition(":")[0] for text in said] == [
        "line 3, column quantity",
        "line 3, column value",
        "line 3, column sigma",
        "line 4, column north_m",
        "line 5",
    ]
    assert observations.sensor == ("a", "d")
    assert observations.line == (2, 6)


def test_a_file_in_which_nothing_can_be_read_is_a_log_without_rows(tmp_path):
    faults: list[InputError] = []
    assert len(read(tmp_path / "none.csv", faults=faults)) == 0
    assert "no such file" in str(faults[0])
