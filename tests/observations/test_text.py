"""Text of other programs is read as it was meant, long or wide, or refused."""

import io
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations import read
from jblast.units import LENGTHS, PRESSURES, TIMES, our_name, overpressure, si_factor
from tests.observations.rows import HEADER, ROW

SEMICOLONS = (HEADER + ROW).replace(",", ";")


def notes(log):
    return {note.kind: note.numbers for note in log.understood}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (SEMICOLONS, ["semicolons"]),
        (SEMICOLONS.replace(";", "\t"), ["tabs"]),
        ("sep=;\r\n" + SEMICOLONS, ["semicolons"]),
        ((HEADER + ROW).encode("utf-16"), ["UTF-16"]),
        (b"\xfe\xff" + SEMICOLONS.encode("utf-16-be"), ["UTF-16", "semicolons"]),
        ("\ufeff" + HEADER + ROW.replace("\n", "\r\n"), []),
        (HEADER.replace("sensor", '"sensor"') + ROW, []),
        (" Sensor , QUANTITY,Value,SIGMA\u00a0,East_m,north M, up_m\n" + ROW, []),
        (("# Z\u00fcrich\n" + HEADER + ROW).encode("cp1252"), ["Windows-1252"]),
    ],
)
def test_a_dialect_is_recognised_and_named(log, content, told):
    log = read(log(content))
    assert (log.sensor, log.value[0], log.sigma[0]) == (("a",), 0.05, 0.001)
    np.testing.assert_array_equal(log.position, [[20, 0, 1.5]])
    assert [next(iter(n.values())) for n in notes(log).values()] == told


def test_decimal_commas_are_read_where_one_number_shows_them(log):
    text = SEMICOLONS.replace(".", ",") + "b;air_arrival_s;1,234;0,5;1,5;0;0\n"
    log = read(log(text))
    np.testing.assert_array_equal(log.value, [0.05, 1.234])
    shown = {"text": "0,05", "place": "line 2, column value"}
    assert notes(log)["decimal_comma"] == shown


def test_quoted_decimal_commas_are_read_between_commas(log):
    text = HEADER + 'a,air_arrival_s,"0,05","0,001",20,0,"1,5"\n'
    assert read(log(text)).value[0] == 0.05


@pytest.mark.parametrize(
    ("value", "sigma", "said"),
    [
        ("1,234", "1", "expected 1.234 .* or 1234"),
        ("1.234", "1", "expected 1.234 .* or 1234"),
        ("1,234", "0.5", "line 2, column sigma has 0.5"),
        ("1.234", "0,5", "line 2, column sigma has 0,5"),
        ("1.234,5", "1", "without marks between thousands"),
        ("1,234,567", "1", "without marks between thousands"),
        ("0,25", "0.5", "one decimal mark in the file"),
        ("1 234", "1", "a finite number, got '1 234'"),
        ("1 234,5", "0,5", "got '1 234,5'; write it without marks between thousands"),
        ("1\u00a0234", "1", "without marks between thousands"),
        ("1'234", "1", "without marks between thousands"),
    ],
)
def test_what_can_be_read_two_ways_is_refused_with_both(log, value, sigma, said):
    text = f"sensor;quantity;value;sigma;range_m\na;air_arrival_s;{value};{sigma};20\n"
    with pytest.raises(InputError, match="line 2, column value.*" + said):
        read(log(text))


def test_a_minus_of_typesetters_is_one(log):
    signed = read(log(HEADER + "a,air_arrival_s,0.05,,\u221220.5,0,\u22121e1\n"))
    np.testing.assert_array_equal(signed.position, [[-20.5, 0.0, -10.0]])


def test_empty_values_are_left_out_and_counted(log):
    words = ("", "NA", "n/a", "NaN", "-", "null", "Empty", "None")
    rows = [f"a,air_arrival_s,{word},1,1,2,3\n" for word in words]
    log = read(log(HEADER + "".join(rows[:4]) + ROW + "".join(rows[4:])))
    assert len(log) == 1
    assert notes(log)["empty_skipped"]["lines"] == [*"2345789", "10"]


def test_a_height_left_out_is_zero_and_said(log):
    head = "sensor,quantity,value,sigma,east_m,north_m\n"
    log = read(log(head + "a,air_arrival_s,1,,2,3\nb,air_arrival_s,1,,,\n"))
    np.testing.assert_array_equal(log.position, [[2, 3, 0], [np.nan] * 3])
    assert "height_taken" in notes(log)


def test_a_separator_within_quotes_is_none(log):
    text = SEMICOLONS.replace("\na;", '\n"a;b";')
    assert read(log(text)).sensor == ("a;b",)


def test_buffers_of_text_and_of_bytes_are_read(log):
    for source in (io.StringIO(SEMICOLONS), io.BytesIO(SEMICOLONS.encode("utf-16"))):
        assert read(source).value[0] == 0.05
    with pytest.raises(InputError, match="got the byte 0xed"):
        read(io.StringIO(HEADER + "\ud800" + ROW))
    with log(HEADER + ROW).open(encoding="utf-8") as file:
        assert read(file).source.endswith("log.csv")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("log.docx", "expected a log in one of .csv"),
        ("shot.wav", "got .wav; of a recording"),
        ("shot.xls", "expected a log in one of"),
    ],
)
def test_a_name_that_says_it_is_no_table_is_refused(tmp_path, name, said):
    (tmp_path / name).write_text(HEADER + ROW)
    with pytest.raises(InputError, match=said):
        read(tmp_path / name)


PLAIN = settings(deadline=None, max_examples=60)
NUMBERS = st.floats(1e-6, 1e9, allow_nan=False).map(lambda x: float(f"{x:.12g}"))
UNITS = st.one_of(
    st.sampled_from([("peak_overpressure", unit) for unit in PRESSURES]),
    st.sampled_from([("positive_duration", unit) for unit in TIMES]),
    st.sampled_from([("ground_displacement", unit) for unit in LENGTHS]),
    st.builds(
        lambda pressure, time: ("positive_impulse", f"{pressure}_{time}"),
        st.sampled_from(list(PRESSURES)),
        st.sampled_from(list(TIMES)),
    ),
)
GROUPED = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")


@PLAIN
@given(
    UNITS,
    st.lists(NUMBERS, min_size=1, max_size=4, unique=True),
    st.sampled_from([",", ";", "\t"]),
    st.sampled_from([".", ","]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_a_log_is_the_same_in_any_dialect(named, values, separator, decimal, encoding):
    word, unit = named
    texts = [repr(value).replace(".", decimal) for value in values]
    rows = [
        f'a{separator}{word}_{unit}{separator}"{text}"{separator}' for text in texts
    ]
    header = separator.join(["sensor", "quantity", "value", "sigma"])
    file = io.BytesIO("\n".join([header, *rows]).encode(encoding))
    marked = [text for text in texts if decimal in text]
    unsure = bool(marked) and all(GROUPED.fullmatch(text) for text in marked)
    if unsure and (decimal == "," or separator == ";"):
        with pytest.raises(InputError, match="may be either"):
            read(file)
        return
    np.testing.assert_allclose(
        read(file).value, np.array(values) * si_factor(unit), rtol=1e-15
    )


@PLAIN
@given(st.floats(-50, 220), st.floats(0.01, 20))
def test_a_level_and_its_error_are_straight_in_ln(level, sigma):
    text = f"sensor,quantity,value,sigma\na,peak_level_db,{level!r},{sigma!r}\n"
    found = read(io.StringIO(text))
    pressure = overpressure(np.array([level, level + sigma]))
    np.testing.assert_allclose(found.value, pressure[:1], rtol=1e-14)
    up = math.log(pressure[1] / pressure[0])
    np.testing.assert_allclose(found.error_scale(), up, rtol=1e-9)


@PLAIN
@given(st.text(max_size=25))
def test_any_name_is_ours_in_a_unit_or_none_and_nothing_else_happens(name):
    found = our_name(name)
    assert found is None or found.factor > 0 or found.dimension == "level"


WIDE = (
    "sensor,east_m,north_m,up_m,air_arrival_s,peak_overpressure_kpa,"
    "sigma_peak_overpressure_kpa\n"
    "a,1,2,3,0.1,>5,0.5\n"
    "b,4,5,6,,6,\n"
)


def test_a_row_is_made_for_each_measurement(log):
    found = read(log(WIDE), wide=True)
    assert found.sensor == ("a", "a", "b")
    assert found.line == (2, 2, 3)
    assert found.quantity[1:] == ("peak_overpressure_pa",) * 2
    np.testing.assert_array_equal(found.value, [0.1, 5000, 6000])
    np.testing.assert_array_equal(found.sigma, [np.nan, 500, np.nan])
    np.testing.assert_array_equal(found.position[:, 0], [1, 1, 4])
    assert found.bounds().tolist() == [False, True, False]


def test_units_may_stand_in_a_row(log):
    text = (
        "sensor;range;air_arrival;Sigma air arrival;shock_radius;time\n"
        ";ft;ms;ms;m;s\n"
        "a;10;12,5;0,5;7,25;0,001\n"
    )
    found = read(log(text), wide=True)
    np.testing.assert_allclose(found.value, [0.0125, 7.25])
    np.testing.assert_allclose(found.sigma, [0.0005, np.nan])
    np.testing.assert_array_equal(found.time, [np.nan, 0.001])


def test_one_column_of_shares_is_that_of_all_errors_that_are_shares(log):
    text = (
        "sensor;range_m;air_arrival_ms;peak_overpressure_kpa;Sigma (%);Note\n"
        "a;10;12,4;>12,4;7;1.5\n"
        "b;20;40,5;5;NA;\n"
    )
    found = read(log(text), wide=True)
    assert found.value[0] == 0.0124
    np.testing.assert_array_equal(found.sigma, [np.nan, 868, np.nan, np.nan])
    notes = {note.kind: note.numbers for note in found.understood}
    assert notes["share"]["rows"] == 1
    assert notes["no_errors"] == {"names": ["air_arrival_ms"]}
