"""Controllers side by side: which flies on through which blast, and how far thrown."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from jblast.report.figure_style import log_ticks, new_figure, quiet, titled
from jblast.report.flights.figure import HOLD_COLOURS
from jblast.report.numbers import unit_for
from jblast.study.flights.records import Flights
from jblast.study.flights.statistics import (
    flies_on,
    hold_words,
    metric,
    quantiles,
    share_interval,
)

GROUPS, LEAST = 8, 12
"""Most groups of vehicles by distance, and fewest vehicles in each."""


def controllers_figure(flights: Flights) -> Figure:
    """Draw who flies on, and peak deviation, against the first blast's distance.

    Vehicles are grouped by distance, as many in each; bars are 90 % intervals of the
    share, and 5 to 95 % of the vehicles' deviations about their median.
    """
    figure = new_figure(11.5, 4.8)
    on, thrown = figure.subplots(1, 2)
    away, label = distances(flights)
    groups = groups_of(away)
    x = np.array([np.median(away[group]) for group in groups])
    most = max(
        float(np.nanmax(metric(f, "peak_deviation_m"))) for f in flights.holds.values()
    )
    unit = unit_for("path_error_m", most)
    count = len(flights.holds)
    for n, (name, flown) in enumerate(flights.holds.items()):
        # side by side, or their bars would hide one another
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
    titled(on, "Who flies on", "bars: 90 % interval")
    titled(thrown, "How far thrown", "bars: 5 to 95 % of the vehicles")
    return figure


def distances(flights: Flights) -> tuple[Float[np.ndarray, " vehicle"], str]:
    """Return how far the first blast of each vehicle was, and what to call that."""
    encounter = next(iter(flights.holds.values())).encounter
    first = np.argmin(encounter.arrival_s, axis=-1)[:, None]
    scaled = flights.options.profile is None
    where = np.asarray(encounter.scaled_distance if scaled else encounter.distance_m)
    label = "scaled distance [m/kg$^{1/3}$]" if scaled else "distance of the charge [m]"
    return np.take_along_axis(where, first, axis=-1)[:, 0], label


def groups_of(away: Float[np.ndarray, " vehicle"]) -> list[np.ndarray]:
    """Return numbers of vehicles, group by group from near to far."""
    count = max(1, min(GROUPS, away.size // LEAST))
    return np.array_split(np.argsort(away, kind="stable"), count)
