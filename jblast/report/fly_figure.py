"""One flight through blasts as figures: path, loads, path error."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

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
from jblast.study.fly import Flights
from jblast.study.fly_summary import hold_words, target_of
from jblast.vehicle import Trajectory, path_error

SHADOW = "#d0d0d0"
HOLD_COLOURS = (BLUE, VERMILLION)
BEFORE_S, AFTER_S = 0.01, 0.05
"""Around the blast's arrival, where its loads are drawn large."""


def path_figure(flights: Flights) -> Figure:
    """Draw the first hold's path from its target, coloured by the distance from it."""
    name = next(iter(flights.holds))
    target = target_of(flights.vehicle)
    away = np.asarray(_trajectory(flights, name).position_m) - target
    away = away[np.isfinite(away).all(axis=1)]
    error = np.linalg.norm(away, axis=1)
    unit = unit_for("path_error_m", float(error.max()))
    path = away / unit.size
    # a vehicle that nothing moved still has a picture
    size = max(float(np.ptp(path, axis=0).max()), 1e-3)
    ways = _blast_ways(flights)
    tails = -0.45 * size * ways
    drawn = np.concatenate([path, np.zeros((1, 3)), tails])
    middle = (drawn.min(axis=0) + drawn.max(axis=0)) / 2
    half = 0.55 * float(np.ptp(drawn, axis=0).max())
    figure = new_figure(9.0, 6.8)
    axes = figure.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    _equal_axes(axes, middle, half, unit.symbol)
    floor = np.full(len(path), middle[2] - half)
    axes.plot(path[:, 0], path[:, 1], floor, color=SHADOW, linewidth=1.5)
    line = Line3DCollection(
        list(np.stack([path[:-1], path[1:]], axis=1)), cmap="viridis", linewidth=2.5
    )
    line.set_array(error[1:] / unit.size)
    axes.add_collection3d(line)
    for tail in tails:
        axes.plot(*np.stack([tail, 0 * tail], axis=1), color=VERMILLION, linewidth=1.8)
    axes.plot(*np.zeros((3, 1)), "o", color=INK, markersize=6)
    axes.plot(*path[-1:].T, "s", color=MUTED, markersize=6)
    axes.legend(
        handles=[
            Line2D([], [], color=INK, marker="o", linestyle="", label="target"),
            Line2D([], [], color=MUTED, marker="s", linestyle="", label="end"),
            Line2D([], [], color=VERMILLION, label="from where the blast comes"),
            Line2D([], [], color=SHADOW, label="shadow on the floor"),
        ],
        frameon=False,
        fontsize=9,
        loc="upper right",
    )
    bar = figure.colorbar(line, ax=axes, shrink=0.6, pad=0.1)
    bar.set_label(f"distance from the target [{unit.symbol}]", color=INK)
    figure.suptitle(
        f"Path of the {flights.vehicle.model.capitalize()}, {hold_words(name)}",
        x=0.04,
        ha="left",
        fontsize=11,
        color=INK,
        fontweight="bold",
    )
    return figure


def loads_figure(flights: Flights) -> Figure:
    """Draw all force and moment on the first hold's vehicle, the blast's large."""
    name = next(iter(flights.holds))
    trajectory = _trajectory(flights, name)
    time = np.asarray(trajectory.time_s)
    arrivals = np.asarray(flights.holds[name].meeting.arrival_s)
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
        name: np.asarray(path_error(_trajectory(flights, name), target))
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
    for (name, error), colour in zip(errors.items(), HOLD_COLOURS, strict=True):
        flown = flights.holds[name]
        time = np.asarray(_trajectory(flights, name).time_s)
        axes.plot(
            time,
            error / unit.size,
            color=colour,
            linewidth=1.6,
            label=f"{hold_words(name)}: {_recovery_words(flown.metrics)}",
        )
        recovery = float(flown.metrics.recovery_time_s)
        if 0 < recovery < np.inf:
            at = float(flown.meeting.arrival_s.min()) + recovery
            axes.plot(at, tolerance / unit.size, "o", color=colour, markersize=7)
    first = next(iter(flights.holds.values()))
    _arrival_lines(axes, np.asarray(first.meeting.arrival_s))
    axes.set_xlim(0.0, flights.seconds)
    axes.set_ylim(0.0, 1.25 * max(most, tolerance) / unit.size)
    axes.set_xlabel("time [s]; dashed: a blast arrives")
    axes.set_ylabel(f"distance from the target [{unit.symbol}]")
    titled(axes, f"Path error of the {flights.vehicle.model.capitalize()}")
    axes.legend(frameon=False, fontsize=9, loc="upper right")
    return figure


def _trajectory(flights: Flights, name: str) -> Trajectory:
    trajectory = flights.holds[name].trajectory
    assert trajectory is not None, "a batch keeps no trajectories"
    return trajectory


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
    for arrival in arrivals:
        axes.axvline(float(arrival), color=INK, linewidth=0.9, linestyle=(0, (4, 3)))


def _blast_ways(flights: Flights) -> Float[np.ndarray, "blast 3"]:
    """Return the directions in which blasts blow at the target, of length 1."""
    way = target_of(flights.vehicle) - flights.places_m
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return (way / np.where(length > 0, length, 1.0))[length[:, 0] > 0]


def _equal_axes(
    axes: Axes3D, middle: Float[np.ndarray, "3"], half: float, symbol: str
) -> None:
    """Make a quiet cube about a place."""
    for letter, word, centre in zip(
        "xyz", ("east", "north", "up"), middle, strict=True
    ):
        getattr(axes, f"set_{letter}lim")(centre - half, centre + half)
        getattr(axes, f"set_{letter}label")(f"{word} of target [{symbol}]", color=INK)
        axis = getattr(axes, f"{letter}axis")
        axis.set_pane_color((1, 1, 1, 0))
        axis.set_major_locator(MaxNLocator(5))
    axes.set_zlabel(f"above target [{symbol}]", color=INK)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=-60)
    axes.tick_params(labelsize=8, labelcolor=INK)
