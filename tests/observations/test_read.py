import time
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations import QUANTITIES, read
from jblast.quantities import ADDITIVE, TIMED

HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
ROW = "a,air_arrival_s,0.05,0.001,20,0,1.5\n"
FRONT = "sensor,quantity,value,sigma,time_s\n"


@pytest.fixture
def log(tmp_path):
    def write(content):
        path = tmp_path / "log.csv"
        data = content if isinstance(content, bytes) else content.encode()
        path.write_bytes(data)
        return path

    return write


def test_every_column_comes_back_by_name_in_any_order(log):
    observations = read(
        log(
            "# shot 1\n"
            "#measured by hand\n"
            "\n"
            " up_m,quantity, value,north_m,sensor,sigma,east_m,path,shot,clock,time_s\n"
            "1.5,air_arrival_s,0.05,0,a,0.001,20,p,s,c,\n"
            "  \n"
            '1,peak_overpressure_pa, 2e4,-3,"b, outdoors",,4,,s,c,\n'
            "# between\n"
            "0,shock_radius_m,11.1,0,camera,0.1,9,,s,c,1e-4\n"
        )
    )
    assert len(observations) == 3
    assert observations.sensor == ("a", "b, outdoors", "camera")
    assert observations.quantity[1] == "peak_overpressure_pa"
    np.testing.assert_array_equal(observations.value, [0.05, 2e4, 11.1])
    np.testing.assert_array_equal(observations.sigma, [0.001, np.nan, 0.1])
    np.testing.assert_array_equal(
        observations.position, [[20, 0, 1.5], [4, -3, 1], [9, 0, 0]]
    )
    np.testing.assert_array_equal(observations.time, [np.nan, np.nan, 1e-4])
    assert np.isnan(observations.slant_range).all()
    assert observations.path == ("p", "", "")
    assert observations.groups() == ("p", "b, outdoors", "camera")
    assert observations.shot == ("s",) * 3
    assert observations.clock == ("c",) * 3
    assert observations.line == (5, 7, 9)
    assert observations.comments == ("shot 1", "measured by hand", "between")
    assert observations.source.endswith("log.csv")


def test_a_place_may_be_left_to_the_scene(log):
    observations = read(log("sensor,quantity,value,sigma\na,air_arrival_s,1,\n"))
    assert np.isnan(observations.position).all()
    assert observations.clock == ("",)


def test_a_range_stands_for_a_position(log):
    text = "sensor,quantity,value,sigma,range_m\na,air_arrival_s,1,,20\n"
    assert read(log(text)).slant_range[0] == 20


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text.rstrip("\n"),
        lambda text: text.replace(",", ", "),
    ],
    ids=["byte order mark", "CRLF", "CR", "no last line end", "spaces"],
)
def test_what_other_programs_write_is_read_alike(log, change):
    observations = read(log(change(HEADER + ROW)))
    assert observations.sensor == ("a",)
    assert observations.value[0] == 0.05
    assert observations.position[0, 2] == 1.5


def test_times_may_be_negative_and_a_sensor_may_give_a_quantity_twice(log):
    text = HEADER + ROW + ROW.replace("0.05", "-0.05")
    np.testing.assert_array_equal(read(log(text)).value, [0.05, -0.05])


BAD = {
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
    "column in kilometres": (
        "sensor,quantity,value,sigma,range_km\na,air_arrival_s,1,,1\n",
        ["line 1", "'range_km'", "column range_m", "multiply by 1000"],
    ),
    "wide table": (
        "sensor,peak_overpressure_pa\na,1\n",
        ["line 1", "'peak_overpressure_pa'", "quantity, not a column"],
    ),
    "column of another tool": (
        "sensor,range_m,impulse_kPa_ms\na,1,2\n",
        ["line 1", "'impulse_kPa_ms'", "positive_impulse_pa_s", "multiply by 1"],
    ),
    "semicolons": (
        (HEADER + ROW).replace(",", ";"),
        ["line 1", "separated by commas", "got semicolons"],
    ),
    "tabs": ((HEADER + ROW).replace(",", "\t"), ["line 1", "commas", "got tabs"]),
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
    "quantity in kilopascal": (
        HEADER + ROW.replace("air_arrival_s", "overpressure_kPa"),
        ["line 2", "'overpressure_kPa'", "peak_overpressure_pa", "multiply by 1000"],
    ),
    "quantity in milliseconds": (
        HEADER + ROW.replace("air_arrival_s", "arrival_ms"),
        ["line 2", "'arrival_ms'", "ours is air_arrival_s", "multiply by 0.001"],
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
    "no value": (
        HEADER + ROW.replace("0.05", ""),
        ["line 2", "column value", "a finite number", "got nothing"],
    ),
    "decimal comma": (
        HEADER + ROW.replace("0.05", '"0,05"'),
        ["line 2", "column value", "'0,05'", "decimal point"],
    ),
    "Python's underscore": (
        HEADER + ROW.replace("0.05", "1_000"),
        ["line 2", "column value", "'1_000'"],
    ),
    "NaN": (HEADER + ROW.replace("0.05", "NaN"), ["line 2", "column value", "'NaN'"]),
    "NaN sigma": (
        HEADER + ROW.replace("0.001", "nan"),
        ["line 2", "column sigma", "'nan'"],
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
    "UTF-16": ((HEADER + ROW).encode("utf-16"), ["line 1", "UTF-8", "got UTF-16"]),
    "UTF-16 unmarked": ((HEADER + ROW).encode("utf-16-le"), ["line 1", "0x00"]),
    "binary": (
        HEADER.encode() + b"\x7fELF\x00\x01",
        ["line 2", "a CSV file", "0x7f", "binary"],
    ),
    "workbook": (b"PK\x03\x04\x14\x00", ["line 1", "zip archive", "plain text"]),
}


@pytest.mark.parametrize(("content", "said"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_told_by_file_line_column_expectation_and_find(log, content, said):
    with pytest.raises(InputError) as caught:
        read(log(content))
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


def test_a_hundred_thousand_rows_take_seconds_at_most(log):
    rows = [f"s{i % 9},air_arrival_s,{i / 7},0.001,{i},0,1\n" for i in range(100_000)]
    path = log(HEADER + "".join(rows))
    start = time.perf_counter()
    assert len(read(path)) == 100_000
    assert time.perf_counter() - start < 5  # 0.8 s on a free core; CI's are shared


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
