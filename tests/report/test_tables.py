"""Columns that line up, bars and commas that stay what they are."""

import csv

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
