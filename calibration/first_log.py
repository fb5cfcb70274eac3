"""The picture of the first tutorial: a log, its scene and the answer.

    python -m calibration.first_log > calibration/results/first_log.txt

Fits the simulated log of five microphones as `jblast fit` does and prints the estimates
next to the truth. `calibration/results/first_log.png` shows three rows of the log,
the sensors and the estimated charge on the ground, and the 90 % intervals.
"""

import csv
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

from jblast.cli.jax_start import start_jax
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import BLUE, INK, MUTED, VERMILLION, new_figure, quiet

if TYPE_CHECKING:
    from jblast.inference import Fit

DATA = Path(__file__).parent / "data"
FIGURE = Path(__file__).parent / "results" / "first_log.png"
SHOWN_ROWS = 4
"""Rows of the log in the picture: more do not fit at a readable size."""
NAMES = {
    "charge_mass_kg": ("mass", "kg", 1.0),
    "charge_east_m": ("east", "m", 1.0),
    "charge_north_m": ("north", "m", 1.0),
    "origin_time_s": ("time", "ms", 1e3),
}
"""Estimate -> label, printed unit and its value in SI units, inverted."""


def main() -> None:
    """Fit the log, print the estimates and draw the picture."""
    from jblast.inference import fit
    from jblast.observations import read
    from jblast.scene import read_scene

    start_jax(quick=True)
    log = DATA / "five_microphones.csv"
    found = fit(read(log), read_scene(log.with_suffix(".toml")))
    truth = true_values()
    print("estimate            value     5 %    95 %   truth")
    for name, (_, unit, scale) in NAMES.items():
        one = found.summary.estimates[name]
        assert one.value is not None
        numbers = (one.value, one.q05, one.q95, truth[name])
        row = " ".join(f"{scale * number:7.1f}" for number in numbers)
        print(f"{name:16s} {row} {unit}")
    draw_figure(found, truth, rows_of(log))


def true_values() -> dict[str, float]:
    """Return the parameters from which the log was simulated."""
    text = (DATA / "five_microphones_truth.toml").read_text("utf-8")
    charge = tomllib.loads(text)["charge"]
    east, north, _ = charge["position_m"]
    values = (charge["mass_kg"], east, north, charge["time_s"])
    return dict(zip(NAMES, values, strict=True))


def rows_of(log: Path) -> list[dict[str, str]]:
    """Return the rows of a log, without its comments."""
    lines = log.read_text("utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def draw_figure(
    found: "Fit", truth: dict[str, float], rows: list[dict[str, str]]
) -> None:
    """Draw the log, the positions and the intervals next to each other."""
    figure = new_figure(11.0, 3.4)
    grid = figure.add_gridspec(len(NAMES), 3, width_ratios=(1.5, 1.0, 1.1))
    table, ground = (figure.add_subplot(grid[:, column]) for column in range(2))
    intervals = [figure.add_subplot(grid[row, 2]) for row in range(len(NAMES))]
    draw_log(table, rows)
    draw_ground(ground, found, rows)
    for axes, name in zip(intervals, NAMES, strict=True):
        draw_interval(axes, found, name, truth[name])
    intervals[0].set_title("Answer: 90 % intervals", color=INK, fontsize=10)
    write_figure(figure, FIGURE)


def draw_log(axes: Axes, rows: list[dict[str, str]]) -> None:
    """Draw the first rows of the log as a table."""
    axes.set_axis_off()
    axes.set_title("Log: one measurement per row", color=INK, fontsize=10)
    columns = ("sensor", "quantity", "value", "sigma", "east_m", "north_m")
    cells = [
        [
            row[key] if key in columns[:2] else f"{float(row[key]):.4g}"
            for key in columns
        ]
        for row in rows[:SHOWN_ROWS]
    ]
    drawn = axes.table(
        [*cells, ["..."] * len(columns)],
        colLabels=columns,
        colWidths=[0.11, 0.39, 0.13, 0.13, 0.12, 0.13],
        cellLoc="left",
        edges="horizontal",
        bbox=Bbox.from_bounds(0.0, 0.15, 1.0, 0.8),
    )
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(8)


def draw_ground(axes: Axes, found: "Fit", rows: list[dict[str, str]]) -> None:
    """Draw the sensors and the estimated position of the charge."""
    axes.set_title("Scene: charge unknown", color=INK, fontsize=10)
    for row in rows[::2]:  # two rows a sensor
        east, north = float(row["east_m"]), float(row["north_m"])
        axes.plot(east, north, "o", color=BLUE)
        axes.annotate(row["sensor"], (east, north), (5, 4), textcoords="offset points")
    east, north = (found.summary.estimates[name].value for name in list(NAMES)[1:3])
    assert east is not None
    assert north is not None
    axes.plot(east, north, "*", color=VERMILLION, markersize=12)
    axes.annotate(
        "charge", (east, north), (8, -4), textcoords="offset points", color=VERMILLION
    )
    axes.set_aspect("equal")
    axes.margins(0.15)
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    quiet(axes)


def draw_interval(axes: Axes, found: "Fit", name: str, truth: float) -> None:
    """Draw the estimate of one parameter, its interval and the truth."""
    label, unit, scale = NAMES[name]
    one = found.summary.estimates[name]
    assert one.value is not None
    axes.plot([scale * one.q05, scale * one.q95], [0, 0], color=BLUE, linewidth=3)
    axes.plot(scale * one.value, 0, "o", color=BLUE)
    axes.plot(scale * truth, 0, "|", color=VERMILLION, markersize=16, markeredgewidth=2)
    axes.set_yticks([0], [f"{label} [{unit}]"], color=MUTED)
    axes.margins(0.2)
    quiet(axes)


if __name__ == "__main__":
    main()
