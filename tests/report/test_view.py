"""Views: the same blocks on a terminal, on a page and in Markdown."""

import argparse
import json
from dataclasses import dataclass

import pytest

from jblast.errors import InputError
from jblast.report.figures import new_figure
from jblast.report.output import Answer, deliver
from jblast.report.view import (
    Column,
    Facts,
    Lines,
    Picture,
    Table,
    Text,
    View,
    aligned,
    markdown,
    terminal,
)
from jblast.results import Document, filled


@dataclass(frozen=True)
class Mass(Document):
    """A mass.

    Attributes:
        mass_kg: Mass.
    """

    mass_kg: float


def line():
    figure = new_figure(3.0, 2.0)
    figure.subplots().plot([1, 2])
    return figure


ROWS = [("a|b", 1.23456), ("<c>", 2.0)]
COLUMNS = [
    Column("name", lambda row: row[0]),
    Column("mass", lambda row: f"{row[1]:.2f}", right=True),
    Column("empty", lambda row: ""),
]
VIEW = View(
    "Two masses",
    [
        Table(COLUMNS, ROWS, "Masses", note=lambda row: "light" if row[1] < 2 else ""),
        Facts([("place", "east"), ("time", "")]),
        Lines("Warnings", ["first", "", "second", "first"], most=1),
        Lines("Nothing", []),
        Lines("Details", ["all"], where="detail"),
        Picture("line.png", line, "A line", alt="Axes."),
        Text("The scene", "x = 1\n"),
    ],
    problems=["it is poor"],
)


def options(**more) -> argparse.Namespace:
    return argparse.Namespace(**{"verb": "weigh", "json": False} | more)


def test_a_terminal_has_the_blocks_with_content():
    assert terminal(VIEW) == (
        "Two masses\nit is poor\n\nMasses\n  name  mass\n  a|b   1.23\n    light\n"
        "  <c>   2.00\n\nplace  east\n\nWarnings\n  first\n  and 1 more\n"
    )
    assert terminal(VIEW, verbose=True).endswith("second\n\nDetails\n  all\n")


def test_a_long_last_column_is_broken_behind_the_others():
    column = Column("", lambda row: "word " * 30)
    lines = terminal(View("", [Table([COLUMNS[0], column], ROWS)])).splitlines()
    assert max(map(len, lines)) <= 96
    assert {line[:5] for line in lines[3:5]} == {"     ", "a|b  "}


def test_markdown_escapes_bars():
    table = Table(COLUMNS, ROWS, most=1)
    assert markdown(table) == "| name | mass |\n|---|---:|\n| a\\|b | 1.23 |"


def test_an_answer_is_written_as_document_figures_and_page(tmp_path, capsys):
    (tmp_path / "old.png").touch()
    answer = Answer(Mass(3.0), VIEW, {"a/log.csv": "x\n"})
    code = deliver(answer, options(), folder=str(tmp_path), names=["old.png"])
    assert code == 4  # a problem is never an exit code of 0
    assert json.loads((tmp_path / "weigh.json").read_text())["mass_kg"] == 3.0
    assert not (tmp_path / "old.png").exists()
    page = (tmp_path / "report.html").read_text()
    for part in ("&lt;c&gt;", "data:image/png", "it is poor", "second", "x = 1"):
        assert part in page
    assert "weigh.json, a/log.csv, line.png, report.html\n" in capsys.readouterr().out


def test_json_is_alone_on_stdout(tmp_path, capsys):
    assert deliver(Answer(Mass(3.0), View("")), options(json=True)) == 0
    assert json.loads(capsys.readouterr().out) == {"schema": 1, "mass_kg": 3.0}


def test_a_figure_that_fails_loses_no_numbers(tmp_path):
    def fail():
        raise ValueError("no axes")

    answer = Answer(Mass(3.0), View("", [Picture("line.png", fail)]))
    with pytest.warns(UserWarning, match="line.png was not drawn.*no axes"):
        deliver(answer, options(), folder=str(tmp_path))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report.html", "weigh.json"]


def test_what_cannot_be_written_is_printed_all_the_same(tmp_path, capsys):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        deliver(Answer(Mass(3.0), VIEW), options(), folder=str(tmp_path / "file"))
    assert "Two masses" in capsys.readouterr().out


def test_a_document_is_filled_from_the_first_source_with_a_field():
    assert filled(Mass, object(), {"mass_kg": 1.0}, {"mass_kg": 2.0}) == Mass(1.0)
    assert filled(Mass, {"mass_kg": 1.0}, mass_kg=3.0) == Mass(3.0)
    with pytest.raises(TypeError, match="mass_kg"):
        filled(Mass, object())


def test_aligned_rows_end_in_no_space():
    rows = [("method", "error", ""), ("wu_hao", "12 %", "the reference")]
    assert aligned(rows, right=(1,)) == [
        "method  error",
        "wu_hao   12 %  the reference",
    ]
    assert aligned([]) == []


def test_a_word_at_the_right_margin_is_not_broken():
    wide, word = "x" * 90, "extrapolated"
    cells = [Column("", lambda row: row[0]), Column("", lambda row: row[1])]
    text = terminal(View("Title", [Table(cells, [(wide, word)])]))
    assert f"{wide}  {word}\n" in text
