"""A chart of cost against error as a table: Markdown to read, CSV to work with."""

from collections.abc import Sequence
from pathlib import Path

from jblast.fidelity.timing import machine
from jblast.files import write_text
from jblast.report.benchmark.figure import chart_figure
from jblast.report.figure_files import write_figure
from jblast.report.tables import comma_separated, markdown
from jblast.report.words import capitalised
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    on_pareto_front,
    panels,
)

COLUMNS = ("method", "cost_s", "error", "on_front", "range")
HEAD = ("", "method", "cost [s]", "error", "over")


def chart_markdown(benchmark: Benchmark, points: Sequence[BenchmarkPoint]) -> str:
    """Return the table of every panel, the cheapest method first."""
    lines = [
        f"## {benchmark.title}",
        "",
        f"Cost: {benchmark.cost}. Error: {benchmark.error}. {machine()}. A star marks "
        "the methods that no other beats in both.",
    ]
    front = {
        id(point)
        for point, on in zip(points, on_pareto_front(points), strict=True)
        if on
    }
    for panel, within in panels(points).items():
        lines += ["", f"### {capitalised(panel)}", ""] if panel else [""]
        cheapest_first = sorted(within, key=lambda p: p.cost_s)
        rows = [_row(point, id(point) in front) for point in cheapest_first]
        lines.append(markdown(HEAD, rows, right=(2, 3)))
    return "\n".join(lines) + "\n"


def _row(point: BenchmarkPoint, is_on_front: bool) -> tuple[str, ...]:
    error = f"{point.error:.2g}" + (" (the reference)" if point.is_reference else "")
    star = "*" if is_on_front else ""
    return star, point.method, f"{point.cost_s:.2g}", error, point.range


def chart_csv(points: Sequence[BenchmarkPoint]) -> str:
    """Return all points, a row each."""
    rows = [
        (
            point.method,
            f"{point.cost_s:.4g}",
            f"{point.error:.4g}",
            str(bool(on)).lower(),
            point.range,
        )
        for point, on in zip(points, on_pareto_front(points), strict=True)
    ]
    return comma_separated([COLUMNS, *rows])


def write_chart(
    benchmark: Benchmark, points: Sequence[BenchmarkPoint], directory: Path
) -> None:
    """Write TOPIC.png, TOPIC.csv and TOPIC.md."""
    directory.mkdir(parents=True, exist_ok=True)
    write_text(directory / f"{benchmark.name}.csv", chart_csv(points))
    write_text(directory / f"{benchmark.name}.md", chart_markdown(benchmark, points))
    write_figure(chart_figure(benchmark, points), directory / f"{benchmark.name}.png")
