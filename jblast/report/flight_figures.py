"""Figures of flights."""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.figures import (
    BLUE,
    COLOURS,
    GRID,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.words import printed_number, unit_for
from jblast.study.flight_results import (
    Flights,
    Flown,
    flies_on,
    hold_words,
    metric,
    quantiles,
    share_interval,
    target_of,
    trajectory_of,
)
from jblast.vehicle import path_error

DASHES = ("-", (0, (4, 3)), (0, (1, 1)), (0, (6, 2, 1, 2)))
"""Line styles, one for each of four controllers."""
MAX_POINTS = 4000
"""Largest number of points of a scatter plot: more of them only darken it."""
MAX_GROUPS, MIN_VEHICLES = 8, 12
"""Largest number of groups by distance, and least number of vehicles in each: with
fewer than 12 the 90 % interval of a share spans half of the axis."""
HOLD_COLOURS = (BLUE, VERMILLION, COLOURS[2], INK)
"""Colours, one for each of four controllers."""
BEFORE_S, AFTER_S = 0.01, 0.05
"""Enlarged interval before and after the first blast's arrival [s]: the positive phases
of kilograms at metres last a few milliseconds."""


def distribution_figure(flights: Flights) -> Figure:
    """Draw shares of the vehicles against deviation and recovery, and each vehicle."""
    figure = new_figure(13.0, 4.6)
    deviation, recovery, places = figure.subplots(1, 3)
    for axes in (deviation, recovery, places):
        quiet(axes)
    tolerance = flights.options.tolerance_m
    most = max(
        float(np.nanmax(f.metrics.peak_deviation_m)) for f in flights.holds.values()
    )
    unit = unit_for("path_error_m", most)
    styles = zip(flights.holds.items(), HOLD_COLOURS, DASHES, strict=False)
    for (name, flown), colour, dashes in styles:
        share = 100 * np.mean(flies_on(flown))
        _shares(
            deviation,
            metric(flown, "peak_deviation_m") / unit.size,
            colour,
            dashes,
            f"{hold_words(name)}, {share:.4g} % fly on",
        )
        _shares(
            recovery, metric(flown, "recovery_time_s"), colour, dashes, hold_words(name)
        )
    first = next(iter(flights.holds))
    _vehicles(places, flights, first, unit.size)
    deviation.axvline(
        tolerance / unit.size, color=INK, linewidth=0.9, linestyle=(0, (1, 2))
    )
    deviation.set_xscale("log")
    log_ticks(deviation.xaxis, deviation.get_xlim())
    deviation.set_xlabel(f"peak deviation [{unit.symbol}]; dotted: tolerance")
    recovery.set_xlabel("recovery time [s]")
    # the recovery time is infinite for a vehicle that does not recover
    slowest = max(
        float(np.max(f.metrics.recovery_time_s, where=_back(f), initial=0.0))
        for f in flights.holds.values()
    )
    recovery.set_xlim(-0.01, 1.05 * slowest if slowest > 0 else 1.0)
    for axes in (deviation, recovery):
        axes.set_ylim(0.0, 102.0)
        axes.set_ylabel("vehicles with at most this [%]")
    # below the axes, as no corner is free of curves in every study
    deviation.legend(
        frameon=False, fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.16)
    )
    titled(deviation, "Peak deviation")
    titled(
        recovery,
        "Recovery time",
        f"0: never outside {printed_number('tolerance_m', tolerance)}",
    )
    titled(places, "Each vehicle", f"{hold_words(first)}; cross: crashed")
    places.set_yscale("log")
    log_ticks(places.yaxis, places.get_ylim())
    places.set_ylabel(f"peak deviation [{unit.symbol}]")
    return figure


def _back(flown: Flown) -> Bool[np.ndarray, " vehicle"]:
    return np.isfinite(flown.metrics.recovery_time_s)


def _shares(
    axes: Axes, values: np.ndarray, colour: str, dashes: Any, label: str
) -> None:
    """Draw the share of all vehicles that have at most each value."""
    ordered = np.sort(values[np.isfinite(values)])
    shares = 100 * np.arange(1, ordered.size + 1) / values.size
    # an empirical distribution function is constant up to the next value
    axes.step(
        ordered,
        shares,
        where="post",
        color=colour,
        linestyle=dashes,
        linewidth=1.8,
        label=label,
    )


def _vehicles(axes: Axes, flights: Flights, name: str, size: float) -> None:
    """Draw deviation against the first blast's scaled distance, or its distance."""
    flown = flights.holds[name]
    away, label = distances(flights)
    x = away[:MAX_POINTS]
    y = metric(flown, "peak_deviation_m")[:MAX_POINTS] / size
    crashed = np.asarray(flown.metrics.crashed)[:MAX_POINTS]
    axes.plot(x[~crashed], y[~crashed], ".", color=BLUE, markersize=4, alpha=0.6)
    axes.plot(x[crashed], y[crashed], "x", color=VERMILLION, markersize=5)
    axes.set_xlabel(label)


def controllers_figure(flights: Flights) -> Figure:
    """Draw the share that flies on, and peak deviation, against the first distance.

    Vehicles are in groups of equal size by distance from the first blast. Bars are 90 %
    intervals of the share, and 5 to 95 % quantiles of the deviations.
    """
    figure = new_figure(11.5, 4.8)
    on, thrown = figure.subplots(1, 2)
    away, label = distances(flights)
    number = max(1, min(MAX_GROUPS, away.size // MIN_VEHICLES))
    # stable: equal distances give the same groups on every platform
    groups = np.array_split(np.argsort(away, kind="stable"), number)
    x = np.array([np.median(away[group]) for group in groups])
    most = max(
        float(np.nanmax(metric(f, "peak_deviation_m"))) for f in flights.holds.values()
    )
    unit = unit_for("path_error_m", most)
    count = len(flights.holds)
    for n, (name, flown) in enumerate(flights.holds.items()):
        # shifted by 3 % each, so that the bars of controllers do not overlap
        at = x * 1.03 ** (n - (count - 1) / 2)
        style = {
            "color": HOLD_COLOURS[n],
            "marker": "o",
            "markersize": 4,
            "linewidth": 1.3,
            "elinewidth": 0.9,
            "capsize": 2,
            "label": hold_words(name),
        }
        flags = flies_on(flown)
        share = np.array([np.mean(flags[group]) for group in groups])
        ends = np.array([share_interval(flags[group]) for group in groups]).T
        bars = 100 * np.abs(ends - share)
        on.errorbar(at, 100 * share, bars, **style)
        peaks = metric(flown, "peak_deviation_m") / unit.size
        low, middle, high = np.array([quantiles(peaks[group]) for group in groups]).T
        thrown.errorbar(at, middle, (middle - low, high - middle), **style)
    for axes in (on, thrown):
        quiet(axes)
        axes.set_xscale("log")
        axes.set_xlabel(label)
        log_ticks(axes.xaxis, axes.get_xlim())
    thrown.set_yscale("log")
    log_ticks(thrown.yaxis, thrown.get_ylim())
    on.set_ylim(-2.0, 104.0)
    on.set_ylabel("vehicles that fly on [%]")
    thrown.set_ylabel(f"peak deviation [{unit.symbol}]")
    on.legend(
        frameon=False,
        fontsize=8.5,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=2,
    )
    titled(on, "Vehicles that fly on", "bars: 90 % interval")
    titled(thrown, "Displacement", "bars: 5 to 95 % of the vehicles")
    return figure


def distances(flights: Flights) -> tuple[Float[np.ndarray, " vehicle"], str]:
    """Return the distance of each vehicle from its first blast, and the axis label."""
    encounter = next(iter(flights.holds.values())).encounter
    first = np.argmin(encounter.arrival_s, axis=-1)[:, None]
    scaled = flights.options.profile is None
    where = np.asarray(encounter.scaled_distance if scaled else encounter.distance_m)
    label = "scaled distance [m/kg$^{1/3}$]" if scaled else "distance of the charge [m]"
    return np.take_along_axis(where, first, axis=-1)[:, 0], label


def loads_figure(flights: Flights) -> Figure:
    """Draw all forces and moments with the first controller, and the blast enlarged."""
    name = next(iter(flights.holds))
    trajectory = trajectory_of(flights, name)
    time = np.asarray(trajectory.time_s)
    arrivals = np.asarray(flights.holds[name].encounter.arrival_s)
    first = float(arrivals.min())
    figure = new_figure(11.0, 6.4)
    grid = figure.subplots(2, 2, width_ratios=[1.5, 1.0])
    # the scale is that of rows without a blast, whose loads are some 100 times larger
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
    titled(grid[0][1], "At the first blast's arrival", "full scale")
    titled(grid[1][0], "All moments, body axes", "blasts are cut off")
    for axes in grid[1]:
        axes.set_xlabel("time [s]; dashed: a blast arrives")
    return figure


def error_figure(flights: Flights) -> Figure:
    """Draw the path error with each controller, its tolerance and its recovery."""
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
    """Return the recovery of a vehicle, as text."""
    if metrics.crashed:
        return "crashed"
    recovery = float(metrics.recovery_time_s)
    if recovery == 0:
        return "never outside"
    if np.isinf(recovery):
        return "outside at the end"
    return f"recovered after {printed_number('recovery_time_s', recovery, 3)}"


def _arrival_lines(axes: Axes, arrivals: Float[np.ndarray, " blast"]) -> None:
    # the arrival is infinite if the blast does not reach the vehicle
    for arrival in arrivals[np.isfinite(arrivals)]:
        axes.axvline(float(arrival), color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
