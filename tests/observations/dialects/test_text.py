"""Text of other programs is read as it was meant, or refused with both readings."""

import io

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import read
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


def test_a_word_for_nothing_elsewhere_is_an_empty_field(log):
    log = read(log(HEADER + "a,air_arrival_s,1,NA,-,n/a,NaN\n"))
    assert np.isnan(log.sigma).all()
    assert np.isnan(log.position).all()


def test_a_height_left_out_is_zero_and_said(log):
    head = "sensor,quantity,value,sigma,east_m,north_m\n"
    log = read(log(head + "a,air_arrival_s,1,,2,3\nb,air_arrival_s,1,,,\n"))
    np.testing.assert_array_equal(log.position, [[2, 3, 0], [np.nan] * 3])
    assert "height_taken" in notes(log)


def test_notes_empty_columns_and_empty_lines_are_left_aside(log):
    text = (
        "sensor;quantity;value;sigma;Note;\n"
        "# by hand;;;;;\n;;;;;\n"
        "a;air_arrival_s;1;;windy, loud;\n;;;;;\n"
    )
    log = read(log(text))
    assert len(log) == 1
    assert notes(log)["columns_ignored"] == {"names": ["Note"]}


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


def test_a_file_that_is_too_large_is_refused_unread(tmp_path):
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.truncate(10_000_000_000)  # sparse: holds nothing
    with pytest.raises(InputError, match=r"1 GB at most.*got 10 GB"):
        read(path)
