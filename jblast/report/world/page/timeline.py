"""Every sense of a world on one time axis, as the thesis has it in figures 4.7 and 4.8.

Path from the place that is held, path error, force, moment, what sensors sampled,
events, and a strip of frames; dashed lines are the blasts themselves.
"""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from jblast.report.figure_style import (
    BLUE,
    COLOURS,
    INK,
    MUTED,
    new_figure,
    quiet,
    titled,
)
from jblast.report.numbers import unit_for
from jblast.report.world.page.folder import RunFolder, Waveform

MOST_WAVEFORMS, FRAMES = 6, 8
"""Sensors and frames drawn; the others stand in their files."""
BINS = 400
"""Of the rate of events."""
CUT = 99.5
"""Percentile of loads that fills half of their plot: blasts would hide all else."""

Row = tuple[str, str, Callable[[Axes], None]]


def timeline_figure(run: RunFolder) -> Figure | None:
    """Draw all senses, one below the other; None where nothing flew, or was sampled."""
    rows = [*_flight_rows(run), *map(_sampled, run.waveforms[:MOST_WAVEFORMS])]
    if len(run.events_s):
        rows.append(("Events", "per second", lambda axes: _events(axes, run)))
    if not rows:
        return None
    figure = new_figure(10.5, 1.45 * (len(rows) + bool(run.frames)) + 0.4)
    heights = [len(rows), *([1.0] if run.frames else [])]
    parts = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)
    plots = parts[0, 0].subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, label, draw) in zip(plots, rows, strict=True):
        quiet(axes)
        draw(axes)
        axes.set_ylabel(label)
        titled(axes, title)
        for blast in run.document["blasts"]:
            axes.axvline(
                blast["time_s"], color=INK, linewidth=0.9, linestyle=(0, (4, 3))
            )
    plots[-1].set_xlim(0.0, run.document["seconds"])
    plots[-1].set_xlabel("time [s] on the common clock; dashed: a blast")
    if run.frames:
        _strip(parts[1, 0], run)
    return figure


def _flight_rows(run: RunFolder) -> list[Row]:
    table = run.flight
    if table is None:
        return []
    time = table["time_s"].to_numpy()
    target = run.document["flight"]["target_m"]
    world, body = ("east", "north", "up"), "xyz"

    away = table[[f"{axis}_m" for axis in world]].to_numpy() - target
    error = table["path_error_m"].to_numpy()
    unit = unit_for("path_error_m", float(error.max()))

    def path(axes: Axes) -> None:
        for part, axis, colour in zip(away.T, world, COLOURS, strict=False):
            axes.plot(time, part / unit.size, color=colour, label=axis)
        _key(axes)

    def distance(axes: Axes) -> None:
        axes.plot(time, error / unit.size, color=BLUE)
        axes.set_ylim(bottom=0.0)

    def loads(columns: list[str], names) -> Callable[[Axes], None]:
        def draw(axes: Axes) -> None:
            values = table[columns].to_numpy()
            for part, name, colour in zip(values.T, names, COLOURS, strict=False):
                axes.plot(time, part, color=colour, linewidth=1.0, label=name)
            most = 2.0 * float(np.percentile(np.abs(values), CUT)) or 1.0
            axes.set_ylim(-most, most)
            _key(axes)

        return draw

    forces = [f"force_{axis}_n" for axis in world]
    moments = [f"moment_{axis}_n_m" for axis in body]
    return [
        ("Path, from the place that is held", f"[{unit.symbol}]", path),
        ("Path error", f"[{unit.symbol}]", distance),
        ("All forces; blasts are cut off", "[N]", loads(forces, world)),
        ("All moments, body axes; blasts are cut off", "[N m]", loads(moments, body)),
    ]


def _sampled(wave: Waveform) -> Row:
    def draw(axes: Axes) -> None:
        axes.fill_between(
            wave.time_s, wave.least, wave.greatest, color=BLUE, linewidth=0.6
        )

    return wave.title, wave.unit, draw


def _events(axes: Axes, run: RunFolder) -> None:
    seconds = run.document["seconds"]
    count, edges = np.histogram(run.events_s, bins=BINS, range=(0.0, seconds))
    axes.stairs(count / np.diff(edges), edges, color=BLUE, fill=True)
    axes.set_yscale("symlog", linthresh=100.0)


def _strip(figure: SubFigure, run: RunFolder) -> None:
    """Draw frames in a row: the first, and those soon after each blast."""
    from matplotlib.image import imread

    times = np.array([time for time, _ in run.frames])
    bursts = [blast["time_s"] for blast in run.document["blasts"]]
    shown = max(FRAMES // max(len(bursts), 1), 1)
    numbers = [
        int(np.searchsorted(times, burst)) + step
        for burst in bursts
        for step in np.unique(np.geomspace(1.0, 60.0, shown).astype(int)) - 1
    ]
    numbers = sorted({n for n in numbers if n < len(times)} or {0})[:FRAMES]
    plots = figure.subplots(1, len(numbers), squeeze=False)[0]
    for axes, number in zip(plots, numbers, strict=True):
        time, file = run.frames[number]
        axes.imshow(imread(file))
        axes.set_axis_off()
        axes.set_title(f"{time:.3f} s", fontsize=8.5, color=MUTED)


def _key(axes: Axes) -> None:
    axes.legend(
        frameon=False, fontsize=8.5, ncols=3, loc="upper right", labelcolor=MUTED
    )
