"""Figures of flights: one flight over time, many vehicles, and the map of a mission."""

from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from jblast.autopilot.estimator import PLACE
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
from jblast.report.maps import Feature, Map, point
from jblast.report.numbers import printed_number, unit_for
from jblast.study.flight_results import (
    Flights,
    flies_on,
    hold_words,
    metric,
    target_of,
    trajectory_of,
)
from jblast.study.missions import MissionFlight, above_ground
from jblast.vehicle import Trajectory, path_error

HOLD_COLOURS = (BLUE, VERMILLION, COLOURS[2], INK)
DASHES = ("-", (0, (4, 3)), (0, (1, 1)), (0, (6, 2, 1, 2)))
"""Colours and line styles, one for each of four controllers."""
MAX_POINTS = 4000
"""Largest number of points of a plot: about two for each pixel."""
BEFORE_S, AFTER_S = 0.01, 0.05
"""Enlarged interval before and after the first blast's arrival [s]: the positive phases
of kilograms at metres last a few milliseconds."""
BELOW: dict[str, Any] = {"frameon": False, "fontsize": 8.5, "loc": "upper center"}
BELOW |= {"bbox_to_anchor": (0.5, -0.16)}
"""Legend below the axes, as no corner is free of curves in every study."""


def time_figure(flown: Flights | MissionFlight) -> Figure:
    """Draw path error, height, forces and moments of one flight over time.

    Forces and moments are those with the first controller, and are also drawn enlarged
    at the first arrival.
    """
    trajectories, errors, aim = _over_time(flown)
    first = next(iter(trajectories.values()))
    time = np.asarray(first.time_s)
    arrivals = _arrivals(flown)
    figure = new_figure(11.0, 9.6)
    panels = figure.subplot_mosaic(
        [
            *(["error"] * 2, ["height"] * 2),
            *(["force", "near_force"], ["moment", "near_moment"]),
        ],
        width_ratios=[1.5, 1.0],
        height_ratios=[1.5, 1.0, 1.0, 1.0],
    )
    tolerance = flown.options.tolerance_m
    most = max(tolerance, *(float(np.nanmax(error)) for error in errors.values()))
    unit = unit_for("path_error_m", most)
    error_axes, height_axes = panels["error"], panels["height"]
    error_axes.axhspan(0.0, tolerance / unit.size, color=GRID, zorder=0)
    # a mission of ten minutes has 150,000 rows
    thin = slice(None, None, max(1, time.size // MAX_POINTS))
    for (name, error), colour in zip(errors.items(), HOLD_COLOURS, strict=False):
        error_axes.plot(time[thin], error[thin] / unit.size, color=colour, label=name)
    for one, colour in zip(trajectories.values(), HOLD_COLOURS, strict=False):
        height = np.asarray(one.position_m)[:, 2]
        height_axes.plot(time[thin], height[thin], color=colour, linewidth=1.2)
    height_axes.plot(time[thin], aim[thin], color=MUTED, alpha=0.45, linewidth=3.0)
    # the scale is that of rows without a blast, whose loads are some 100 times larger
    calm = ~((time[:, None] >= arrivals) & (time[:, None] <= arrivals + AFTER_S)).any(1)
    for name, label, values, parts in (
        ("force", "force [N]", first.force_n, ("east", "north", "up")),
        ("moment", "moment [N m]", first.moment_n_m, "xyz"),
    ):
        loads = np.asarray(values)
        most_calm = float(np.nanmax(np.abs(loads[calm]), initial=1e-9))
        panels[name].set_ylim(-1.2 * most_calm, 1.6 * most_calm)
        panels[name].set_ylabel(label)
        for axes in (panels[name], panels[f"near_{name}"]):
            for part, colour, load in zip(parts, COLOURS, loads.T, strict=False):
                axes.plot(time, load, color=colour, linewidth=1.2, label=part)
        panels[name].legend(frameon=False, fontsize=9, ncols=3, loc="upper right")
    near = float(arrivals.min(initial=np.inf))
    for name, axes in panels.items():
        quiet(axes)
        for arrival in arrivals:
            axes.axvline(arrival, color=INK, linewidth=0.9, linestyle=DASHES[1])
        axes.set_xlim(0.0, float(time[-1]))
        if name.startswith("near") and np.isfinite(near):
            axes.set_xlim(max(near - BEFORE_S, 0.0), near + AFTER_S)
        if name.endswith("moment"):
            axes.set_xlabel("time [s]; dashed: a blast arrives")
    error_axes.set_ylim(0.0, 1.2 * most / unit.size)
    error_axes.set_ylabel(f"path error [{unit.symbol}]")
    error_axes.legend(frameon=False, fontsize=9, loc="upper right")
    height_axes.set_ylabel("height [m]")
    grey = f"grey: within {printed_number('tolerance_m', tolerance)}"
    titled(error_axes, f"{flown.vehicle.model.capitalize()}: path error", grey)
    titled(height_axes, "Height", "grey: set point")
    titled(panels["force"], "All forces", "blasts are cut off")
    titled(panels["near_force"], "At the first blast", "full scale")
    titled(panels["moment"], "All moments, body axes", "blasts are cut off")
    return figure


def _over_time(
    flown: Flights | MissionFlight,
) -> tuple[dict[str, Trajectory], dict[str, np.ndarray], np.ndarray]:
    """Return trajectories and path errors by their labels, and the height to hold."""
    if isinstance(flown, MissionFlight):
        errors = {"path error": np.asarray(flown.path_error_m)}
        if flown.followed is not None:
            off = np.asarray(flown.followed.error)[:, PLACE]
            errors["error of the estimate"] = np.linalg.norm(off, axis=1)
        aim = np.asarray(above_ground(flown.guided.set_point_m))[:, 2]
        return {"": flown.trajectory}, errors, aim
    target = target_of(flown.vehicle)
    trajectories = {name: trajectory_of(flown, name) for name in flown.holds}
    errors = {
        f"{hold_words(name)}: {_recovery_words(flown.holds[name].metrics)}": np.asarray(
            path_error(trajectory, target)
        )
        for name, trajectory in trajectories.items()
    }
    rows = np.asarray(next(iter(trajectories.values())).time_s).size
    return trajectories, errors, np.full(rows, target[2])


def _recovery_words(metrics: Any) -> str:
    recovery = float(metrics.recovery_time_s)
    if metrics.crashed or np.isinf(recovery):
        return "crashed" if metrics.crashed else "outside at the end"
    if recovery == 0:
        return "never outside"
    return f"recovered after {printed_number('recovery_time_s', recovery, 3)}"


def _arrivals(flown: Flights | MissionFlight) -> Float[np.ndarray, " blast"]:
    """Return the arrivals of one flight; those of blasts without a time are absent."""
    is_mission = isinstance(flown, MissionFlight)
    met = (flown if is_mission else next(iter(flown.holds.values()))).encounter
    arrivals = np.asarray(met.arrival_s)
    return arrivals[(arrivals >= 0) & (arrivals <= flown.seconds)]


def distribution_figure(flights: Flights) -> Figure:
    """Draw shares of the vehicles against deviation and recovery, and each vehicle."""
    figure = new_figure(13.0, 4.6)
    deviation, recovery, each = figure.subplots(1, 3)
    tolerance = flights.options.tolerance_m
    peaks = {n: metric(f, "peak_deviation_m") for n, f in flights.holds.items()}
    unit = unit_for("path_error_m", max(map(np.nanmax, peaks.values())))
    away, label = _distances(flights)
    slowest = 0.0
    for (name, flown), colour, dashes in zip(
        flights.holds.items(), HOLD_COLOURS, DASHES, strict=False
    ):
        peak, on = peaks[name] / unit.size, flies_on(flown)
        words = f"{hold_words(name)}, {100 * np.mean(on):.4g} % fly on"
        style: dict[str, Any] = {"color": colour, "linestyle": dashes, "label": words}
        back = metric(flown, "recovery_time_s")
        # the recovery time is infinite for a vehicle that does not recover
        slowest = max(slowest, float(np.max(back, where=np.isfinite(back), initial=0)))
        for axes, values in ((deviation, peak), (recovery, back)):
            ordered = np.sort(values[np.isfinite(values)])
            shares = 100 * np.arange(1, ordered.size + 1) / values.size
            # an empirical distribution function is constant up to the next value
            axes.step(ordered, shares, where="post", linewidth=1.8, **style)
        for chosen, mark in ((on, "."), (~on, "x")):
            few = np.flatnonzero(chosen)[:MAX_POINTS]
            each.plot(away[few], peak[few], mark, color=colour, alpha=0.6, markersize=5)
    for axes in (deviation, recovery, each):
        quiet(axes)
    for axes in (deviation, recovery):
        axes.set_ylim(0.0, 102.0)
        axes.set_ylabel("vehicles with at most this [%]")
    deviation.axvline(tolerance / unit.size, color=INK, linewidth=0.9, linestyle=":")
    deviation.set_xscale("log")
    log_ticks(deviation.xaxis, deviation.get_xlim())
    deviation.set_xlabel(f"peak deviation [{unit.symbol}]; dotted: tolerance")
    deviation.legend(**BELOW)
    recovery.set_xlabel("recovery time [s]")
    recovery.set_xlim(-0.01, 1.05 * slowest if slowest > 0 else 1.0)
    each.set_yscale("log")
    log_ticks(each.yaxis, each.get_ylim())
    each.set_xlabel(label)
    each.set_ylabel(f"peak deviation [{unit.symbol}]")
    titled(deviation, "Peak deviation")
    limit = printed_number("tolerance_m", tolerance)
    titled(recovery, "Recovery time", f"0: never outside {limit}")
    titled(each, "Each vehicle", "cross: does not fly on")
    return figure


def _distances(flights: Flights) -> tuple[Float[np.ndarray, " vehicle"], str]:
    """Return the distance of each vehicle from its first blast, and the axis label."""
    encounter = next(iter(flights.holds.values())).encounter
    first = np.argmin(encounter.arrival_s, axis=-1)[:, None]
    scaled = flights.options.profile is None
    where = np.asarray(encounter.scaled_distance if scaled else encounter.distance_m)
    label = "scaled distance [m/kg$^{1/3}$]" if scaled else "distance of the charge [m]"
    return np.take_along_axis(where, first, axis=-1)[:, 0], label


def mission_map(flight: MissionFlight) -> Map:
    """Return the map of a mission: plan, flown path, waypoints, home and blasts."""
    flown = np.asarray(flight.trajectory.position_m)
    paths = {
        "planned": np.asarray(above_ground(flight.guided.set_point_m)),
        # up to a divergence
        "flown": flown[np.isfinite(flown).all(axis=1)],
    }
    features = [
        Feature(kind, kind, [[path[:: max(1, len(path) // MAX_POINTS)]]])
        for kind, path in paths.items()
    ]
    features.append(point("home", "home", flight.mission.home_m))
    numbered: set[int] = set()
    for one in flight.waypoints:
        words = "reached" if one.reached else "missed"
        # an item that is flown again has one number; one at home would hide it
        is_new = one.item.number not in numbered and np.hypot(*one.goal_m[:2]) > 0.5
        numbered.add(one.item.number)
        features.append(
            point(
                "waypoint" if one.reached else "missed",
                f"{one.item.words}: {words}",
                one.goal_m,
                label=str(one.item.number) if is_new else "",
            )
        )
    for one, place in zip(flight.disturbances, flight.places_m, strict=True):
        features.append(point("blast", one.charge or "blast", place, label=one.charge))
    reached = sum(one.reached for one in flight.waypoints)
    end = flight.crash or f"{reached} of {len(flight.waypoints)} waypoints reached"
    title = f"Mission of the {flight.vehicle.model.capitalize()}"
    return Map(features, flight.mission.frame, title, end)
