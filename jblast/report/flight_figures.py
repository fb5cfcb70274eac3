"""Figures of flights: one flight over time, and many vehicles."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from jblast.report.colours import COLOURS, GRID, INK, MUTED
from jblast.report.figures import log_ticks, new_figure, quiet, titled
from jblast.report.flights import MAX_POINTS
from jblast.report.numbers import printed_number, unit_for
from jblast.study.flight_results import (
    Flights,
    flies_on,
    hold_words,
    metric,
)
from jblast.vehicle import Trajectory

BEFORE_S, AFTER_S = 0.01, 0.05
"""Enlarged interval before and after the first blast's arrival [s]: the positive phases
of kilograms at metres last a few milliseconds."""
BELOW: dict[str, Any] = {"frameon": False, "fontsize": 8.5, "loc": "upper center"}
BELOW |= {"bbox_to_anchor": (0.5, -0.16)}
"""Legend below the axes, as no corner is free of curves in every study."""


def time_figure(flown: Flights) -> Figure:
    """Draw path error and height of one flight, and the loads of its first blast.

    Forces and moments are those with the first controller.
    """
    trajectories, errors, aim = _over_time(flown)
    first = next(iter(trajectories.values()))
    time, arrivals = np.asarray(first.time_s), _arrivals(flown)
    whole = near = (0.0, float(time[-1]))
    if arrivals.size:
        near = (max(arrivals.min() - BEFORE_S, 0.0), arrivals.min() + AFTER_S)
    tolerance = flown.options.tolerance_m
    unit = unit_for("path_error_m", tolerance, *map(np.nanmax, errors.values()))
    errors = {name: error / unit.size for name, error in errors.items()}
    heights = {n: np.asarray(one.position_m)[:, 2] for n, one in trajectories.items()}
    forces, moments = np.asarray(first.force_n).T, np.asarray(first.moment_n_m).T
    figure = new_figure(11.0, 8.4)
    panels = figure.subplot_mosaic(
        [["error"] * 2, ["height"] * 2, ["force", "moment"]],
        height_ratios=[1.5, 1.0, 1.2],
    )
    panels["error"].axhspan(0.0, tolerance / unit.size, color=GRID, zorder=0)
    panels["height"].plot(time, aim, color=MUTED, alpha=0.45, linewidth=3.0)
    model = flown.vehicle.model.capitalize()
    grey = f"grey: within {printed_number('tolerance_m', tolerance)}"
    forces = dict(zip(("east", "north", "up"), forces, strict=True))
    moments = dict(zip("xyz", moments, strict=True))
    first_blast, clock = "", "time [s]"
    if arrivals.size:
        first_blast, clock = "at the first blast", "time [s]; dashed: a blast arrives"
    for name, curves, (start, end), label, title, note in (
        ("error", errors, whole, unit.symbol, f"{model}: path error", grey),
        ("height", heights, whole, "m", "Height", "grey: set point"),
        ("force", forces, near, "N", "Force", first_blast),
        ("moment", moments, near, "N m", "Moment, body axes", first_blast),
    ):
        axes = panels[name]
        shown = np.flatnonzero((time >= start) & (time <= end))
        # a mission of ten minutes has 150,000 rows
        shown = shown[:: max(1, shown.size // MAX_POINTS)]
        for (part, curve), colour in zip(curves.items(), COLOURS, strict=False):
            axes.plot(
                time[shown], curve[shown], color=colour, linewidth=1.2, label=part
            )
        for arrival in arrivals:
            axes.axvline(arrival, color=INK, linewidth=0.9, linestyle="--")
        axes.set(xlim=(start, end), xlabel=clock, ylabel=f"{name} [{label}]")
        if len(curves) > 1:
            axes.legend(frameon=False, fontsize=9, loc="upper right")
        titled(axes, title, note)
        quiet(axes)
    return figure


def _over_time(
    flown: Flights,
) -> tuple[dict[str, Trajectory], dict[str, np.ndarray], np.ndarray]:
    """Return trajectories and path errors by their labels, and heights of the aim."""
    flights = {
        hold_words(name): one.trajectory
        for name, one in flown.holds.items()
        if one.trajectory is not None
    }
    errors = {name: np.asarray(one.path_error_m) for name, one in flights.items()}
    first = flown.trajectory
    if flown.mission is not None:
        errors = {"path error": np.asarray(first.path_error_m)}
    if flown.mission is not None and flown.options.estimator:
        off = np.asarray(first.estimate_m) - np.asarray(first.position_m)
        errors["error of the estimate"] = np.linalg.norm(off, axis=1)
    return flights, errors, np.asarray(first.set_point_m)[:, 2]


def _arrivals(flown: Flights) -> Float[np.ndarray, " blast"]:
    """Return the arrivals of one flight; those of blasts without a time are absent."""
    arrivals = np.asarray(flown.first.encounter.arrival_s)
    return arrivals[(arrivals >= 0) & (arrivals <= flown.seconds)]


def distribution_figure(flights: Flights) -> Figure:
    """Draw shares of the vehicles against deviation and recovery, and each vehicle."""
    figure = new_figure(13.0, 4.6)
    deviation, recovery, each = figure.subplots(1, 3)
    tolerance = flights.options.tolerance_m
    peaks = {n: metric(f, "peak_deviation_m") for n, f in flights.holds.items()}
    unit = unit_for("path_error_m", max(map(np.nanmax, peaks.values())))
    away, label = _distances(flights)
    for (name, flown), colour in zip(flights.holds.items(), COLOURS, strict=False):
        peak, on = peaks[name] / unit.size, flies_on(flown)
        words = f"{hold_words(name)}, {100 * np.mean(on):.4g} % fly on"
        # those that do not recover remain below 100 %
        for axes, values in (
            (deviation, peak),
            (recovery, metric(flown, "recovery_time_s")),
        ):
            ordered = np.sort(values[np.isfinite(values)])
            shares = 100 * np.arange(1, ordered.size + 1) / values.size
            # an empirical distribution function is constant up to the next value
            axes.step(ordered, shares, where="post", color=colour, label=words)
        for chosen, mark in ((on, "."), (~on, "x")):
            few = np.flatnonzero(chosen)[:MAX_POINTS]
            each.plot(away[few], peak[few], mark, color=colour, alpha=0.6, markersize=5)
    for axes in (deviation, recovery, each):
        quiet(axes)
    for axes in (deviation, recovery):
        axes.set(ylim=(0.0, 102.0), ylabel="vehicles with at most this [%]")
    peak_label = f"peak deviation [{unit.symbol}]"
    deviation.axvline(tolerance / unit.size, color=INK, linewidth=0.9, linestyle=":")
    deviation.set(xscale="log", xlabel=f"{peak_label}; dotted: tolerance")
    deviation.legend(**BELOW)
    recovery.set_xlabel("recovery time [s]")
    recovery.set_xlim(left=-0.01)
    each.set(yscale="log", xlabel=label, ylabel=peak_label)
    log_ticks(deviation.xaxis, deviation.get_xlim())
    log_ticks(each.yaxis, each.get_ylim())
    titled(deviation, "Peak deviation")
    limit = printed_number("tolerance_m", tolerance)
    titled(recovery, "Recovery time", f"0: never outside {limit}")
    titled(each, "Each vehicle", "cross: does not fly on")
    return figure


def _distances(flights: Flights) -> tuple[Float[np.ndarray, " vehicle"], str]:
    """Return the distance of each vehicle from its first blast, and the axis label."""
    encounter = flights.first.encounter
    first = np.argmin(encounter.arrival_s, axis=-1)[:, None]
    scaled = flights.options.profile is None
    where = np.asarray(encounter.scaled_distance if scaled else encounter.distance_m)
    label = "scaled distance [m/kg$^{1/3}$]" if scaled else "distance of the charge [m]"
    return np.take_along_axis(where, first, axis=-1)[:, 0], label
