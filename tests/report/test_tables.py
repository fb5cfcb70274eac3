"""Columns that line up, bars and commas that stay what they are."""

import csv

import pytest

from jblast.report.words import aligned, comma_separated, markdown

ROWS = [
    ("method", "error", ""),
    ("wu_hao", "12 %", "the reference"),
    ("euler", "-", ""),
]


def test_columns_are_as_wide_as_their_widest_cell_and_lines_end_in_no_space():
    assert aligned(ROWS) == [
        "method  error",
        "wu_hao  12 %   the reference",
        "euler   -",
    ]


def test_columns_end_below_one_another_where_that_is_asked_for():
    assert aligned(ROWS, right=(1,)) == [
        "method  error",
        "wu_hao   12 %  the reference",
        "euler       -",
    ]


def test_a_column_is_no_narrower_than_asked_for_and_wider_where_it_must_be():
    assert aligned(ROWS, right=(1,), least=(3, 8)) == [
        "method     error",
        "wu_hao      12 %  the reference",
        "euler          -",
    ]


def test_no_rows_are_no_lines():
    assert aligned([]) == []


def test_rows_of_unlike_length_are_a_mistake():
    with pytest.raises(ValueError, match="shorter"):
        aligned([("a", "b"), ("c",)])


def test_markdown_keeps_a_bar_within_a_cell():
    table = markdown(("", "term", "share"), [("*", "|u| u", "3 %")], right=(2,))
    assert table.splitlines() == [
        "| | term | share |",
        "|---|---|---:|",
        r"| * | \|u\| u | 3 % |",
    ]


def test_csv_reads_back_whatever_stands_in_a_cell():
    rows = [["log", "error"], ['a "b", c', "two\nlines"], ["", 0.1]]
    text = comma_separated(rows)
    assert list(csv.reader(text.splitlines(keepends=True))) == [
        ["log", "error"],
        ['a "b", c', "two\nlines"],
        ["", "0.1"],
    ]
    assert "\r" not in text
    assert comma_separated([["a"], [None]]) == 'a\n""\n'
