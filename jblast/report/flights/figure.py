"""One flight through blasts against time: loads, and path error."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.figure_style import (
    BLUE,
    COLOURS,
    GRID,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.numbers import printed_number, unit_for
from jblast.study.flights.records import Flights
from jblast.study.flights.statistics import hold_words, target_of, trajectory_of
from jblast.vehicle import path_error

HOLD_COLOURS = (BLUE, VERMILLION, COLOURS[2], INK)
"""Of as many controllers as there are."""
BEFORE_S, AFTER_S = 0.01, 0.05
"""Around the blast's arrival, where its loads are drawn large."""


def loads_figure(flights: Flights) -> Figure:
    """Draw all force and moment on the first hold's vehicle, the blast's large."""
    name = next(iter(flights.holds))
    trajectory = trajectory_of(flights, name)
    time = np.asarray(trajectory.time_s)
    arrivals = np.asarray(flights.holds[name].encounter.arrival_s)
    first = float(arrivals.min())
    figure = new_figure(11.0, 6.4)
    grid = figure.subplots(2, 2, width_ratios=[1.5, 1.0])
    # rows of the blasts themselves, beside which nothing else would be seen
    calm = np.all(
        (time[:, None] < arrivals) | (time[:, None] > arrivals + AFTER_S), axis=1
    )
    rows = (
        ("force [N]", np.asarray(trajectory.force_n), ("east", "north", "up")),
        ("moment [N m]", np.asarray(trajectory.moment_n_m), ("x", "y", "z")),
    )
    for (left, right), (label, values, parts) in zip(grid, rows, strict=True):
        for axes in (left, right):
            quiet(axes)
            for part, colour, values_of in zip(parts, COLOURS, values.T, strict=False):
                axes.plot(time, values_of, color=colour, linewidth=1.2, label=part)
            _arrival_lines(axes, arrivals)
        left.set_ylabel(label)
        left.legend(frameon=False, fontsize=9, ncols=3, loc="upper right")
        left.set_xlim(0.0, flights.seconds)
        most = float(np.nanmax(np.abs(values[calm]), initial=0.0))
        left.set_ylim(*(np.array([-1.2, 1.6]) * max(most, 1e-9)))
        right.set_xlim(max(first - BEFORE_S, 0.0), first + AFTER_S)
    titled(grid[0][0], f"All forces, {hold_words(name)}", "blasts are cut off")
    titled(grid[0][1], "As the first blast comes", "whole")
    titled(grid[1][0], "All moments, body axes", "blasts are cut off")
    for axes in grid[1]:
        axes.set_xlabel("time [s]; dashed: a blast arrives")
    return figure


def error_figure(flights: Flights) -> Figure:
    """Draw the path error of each hold, its tolerance and its recovery."""
    tolerance = flights.options.tolerance_m
    target = target_of(flights.vehicle)
    errors = {
        name: np.asarray(path_error(trajectory_of(flights, name), target))
        for name in flights.holds
    }
    most = max(float(np.nanmax(error)) for error in errors.values())
    unit = unit_for("path_error_m", max(most, tolerance))
    figure = new_figure(10.0, 4.6)
    axes = figure.subplots()
    quiet(axes)
    axes.axhspan(0.0, tolerance / unit.size, color=GRID, zorder=0)
    axes.text(
        flights.seconds,
        tolerance / unit.size,
        f"tolerance {printed_number('tolerance_m', tolerance)} ",
        color=MUTED,
        fontsize=9,
        ha="right",
        va="bottom",
    )
    for (name, error), colour in zip(errors.items(), HOLD_COLOURS, strict=False):
        flown = flights.holds[name]
        time = np.asarray(trajectory_of(flights, name).time_s)
        axes.plot(
            time,
            error / unit.size,
            color=colour,
            linewidth=1.6,
            label=f"{hold_words(name)}: {_recovery_words(flown.metrics)}",
        )
        recovery = float(flown.metrics.recovery_time_s)
        if 0 < recovery < np.inf:
            at = float(flown.encounter.arrival_s.min()) + recovery
            axes.plot(at, tolerance / unit.size, "o", color=colour, markersize=7)
    first = next(iter(flights.holds.values()))
    _arrival_lines(axes, np.asarray(first.encounter.arrival_s))
    axes.set_xlim(0.0, flights.seconds)
    axes.set_ylim(0.0, 1.25 * max(most, tolerance) / unit.size)
    axes.set_xlabel("time [s]; dashed: a blast arrives")
    axes.set_ylabel(f"distance from the target [{unit.symbol}]")
    titled(axes, f"Path error of the {flights.vehicle.model.capitalize()}")
    axes.legend(frameon=False, fontsize=9, loc="upper right")
    return figure


def _recovery_words(metrics) -> str:
    """Return what became of a vehicle."""
    if metrics.crashed:
        return "crashed"
    recovery = float(metrics.recovery_time_s)
    if recovery == 0:
        return "never outside"
    if np.isinf(recovery):
        return "outside at the end"
    return f"recovered after {printed_number('recovery_time_s', recovery, 3)}"


def _arrival_lines(axes: Axes, arrivals: Float[np.ndarray, " blast"]) -> None:
    for arrival in arrivals[np.isfinite(arrivals)]:  # one may never come
        axes.axvline(float(arrival), color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
