"""Many flights through blasts as a figure: how far, how long, and at which distance."""

from typing import Any

import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.report.figure_style import (
    BLUE,
    INK,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.report.flights.controllers_figure import distances
from jblast.report.flights.figure import HOLD_COLOURS
from jblast.report.numbers import printed_number, unit_for
from jblast.study.flights.records import Flights, Flown
from jblast.study.flights.statistics import flies_on, hold_words, metric

DASHES = ("-", (0, (4, 3)), (0, (1, 1)), (0, (6, 2, 1, 2)))
"""Of as many controllers as there are."""

MOST_POINTS = 4000
"""Of the scatter: more only darken it."""


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
    slowest = max(
        float(np.max(f.metrics.recovery_time_s, where=_back(f), initial=0.0))
        for f in flights.holds.values()
    )
    recovery.set_xlim(-0.01, 1.05 * slowest if slowest > 0 else 1.0)
    for axes in (deviation, recovery):
        axes.set_ylim(0.0, 102.0)
        axes.set_ylabel("vehicles with at most this [%]")
    # below the axes: whatever the curves do, it does not lie over one
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
    # a share stays as it is up to the next value
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
    x = away[:MOST_POINTS]
    y = metric(flown, "peak_deviation_m")[:MOST_POINTS] / size
    crashed = np.asarray(flown.metrics.crashed)[:MOST_POINTS]
    axes.plot(x[~crashed], y[~crashed], ".", color=BLUE, markersize=4, alpha=0.6)
    axes.plot(x[crashed], y[crashed], "x", color=VERMILLION, markersize=5)
    axes.set_xlabel(label)
