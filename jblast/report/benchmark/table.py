"""A chart of cost against error as a table: Markdown to read, CSV to work with."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from jblast.fidelity.timing import machine
from jblast.files import write_text
from jblast.report.benchmark.figure import chart_figure
from jblast.report.figure_files import write_figure
from jblast.report.words import capitalised
from jblast.verification.benchmark.chart import Point, Topic, on_front, panels

COLUMNS = ("method", "cost_s", "error", "on_front", "range")


def chart_markdown(topic: Topic, points: Sequence[Point]) -> str:
    """Return the table of every panel, the cheapest method first."""
    lines = [
        f"## {topic.title}",
        "",
        f"Cost: {topic.cost}. Error: {topic.error}. {machine()}. A star marks the "
        "methods that no other beats in both.",
    ]
    front = {
        id(point) for point, on in zip(points, on_front(points), strict=True) if on
    }
    for panel, within in panels(points).items():
        lines += ["", f"### {capitalised(panel)}", ""] if panel else [""]
        lines += ["| | method | cost [s] | error | over |", "|---|---|---:|---:|---|"]
        for point in sorted(within, key=lambda p: p.cost_s):
            star = "*" if id(point) in front else ""
            error = f"{point.error:.2g}" + (
                " (the reference)" if point.is_reference else ""
            )
            lines.append(
                f"| {star} | {point.method} | {point.cost_s:.2g} | {error} | "
                f"{point.range} |"
            )
    return "\n".join(lines) + "\n"


def chart_csv(points: Sequence[Point]) -> str:
    """Return all points, a row each."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for point, on in zip(points, on_front(points), strict=True):
        table.writerow(
            [
                point.method,
                f"{point.cost_s:.4g}",
                f"{point.error:.4g}",
                str(bool(on)).lower(),
                point.range,
            ]
        )
    return text.getvalue()


def write_chart(topic: Topic, points: Sequence[Point], directory: Path) -> None:
    """Write TOPIC.png, TOPIC.csv and TOPIC.md."""
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / f"{topic.name}.csv", chart_csv(points))
    write_text(directory / f"{topic.name}.md", chart_markdown(topic, points))
    write_figure(chart_figure(topic, points), directory / f"{topic.name}.png")
