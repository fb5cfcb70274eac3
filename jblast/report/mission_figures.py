"""The path of a mission, planned and flown, as a figure and as KML."""

import math
from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.autopilot.estimator import PLACE
from jblast.missions.mission import geodetic
from jblast.report.figures import (
    BLUE,
    GRID,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.kml import add_text, coordinates, document_text, new_document
from jblast.report.words import printed_number, unit_for
from jblast.study.missions import MissionFlight

PLANNED, FLOWN, BLAST = "ff666666", "ffb27200", "ff005ed5"
"""Colours; KML orders the bytes alpha, blue, green, red."""
MAX_POINTS = 5000
"""Largest number of points of a path: about two for each pixel of the figure."""
MAX_NUMBERED = 64
"""Largest number of waypoints drawn with numbers: more numbers overlap."""


def mission_kml(flight: MissionFlight) -> str:
    """Return the text of a KML document with the paths, waypoints and blasts.

    Heights of the plan's home and the scene's position are written as above sea level.
    """
    frame = flight.mission.frame
    root, document = new_document(f"Mission: {flight.mission.plan.source}")
    for name, path, colour in (
        ("planned", planned_path(flight), PLANNED),
        ("flown", flown_path(flight), FLOWN),
    ):
        mark = ET.SubElement(document, "Placemark")
        add_text(mark, "name", name)
        style = ET.SubElement(ET.SubElement(mark, "Style"), "LineStyle")
        add_text(style, "color", colour)
        add_text(style, "width", 3)
        line = ET.SubElement(mark, "LineString")
        add_text(line, "altitudeMode", "absolute")
        add_text(line, "coordinates", _written(geodetic(frame, path)))
    folder = ET.SubElement(document, "Folder")
    add_text(folder, "name", "Waypoints")
    for one in flight.waypoints:
        words = "reached" if one.reached else "missed"
        _point(folder, f"{one.item.words}: {words}", geodetic(frame, one.goal_m), "")
    folder = ET.SubElement(document, "Folder")
    add_text(folder, "name", "Blasts")
    for one, place in zip(flight.disturbances, flight.places_m, strict=True):
        _point(folder, one.charge or "blast", geodetic(frame, place), BLAST)
    return document_text(root)


def _point(
    parent: ET.Element, name: str, place: Float[np.ndarray, "3"], colour: str
) -> None:
    mark = ET.SubElement(parent, "Placemark")
    add_text(mark, "name", name)
    if colour:
        icon = ET.SubElement(ET.SubElement(mark, "Style"), "IconStyle")
        add_text(icon, "color", colour)
    point = ET.SubElement(mark, "Point")
    add_text(point, "altitudeMode", "absolute")
    add_text(point, "coordinates", _written(place[None]))


def _written(places: Float[np.ndarray, "place 3"]) -> str:
    """Return latitude, longitude [degree] and height [m] in the order of KML."""
    return coordinates(places[:, [1, 0, 2]])


def map_figure(flight: MissionFlight) -> Figure:
    """Draw the plan and the flown path by latitude and longitude."""
    figure = new_figure(8.6, 7.4)
    axes = figure.subplots()
    draw_map(axes, flight)
    axes.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    titled(axes, f"Mission of the {flight.vehicle.model.capitalize()}", _end(flight))
    return figure


def draw_map(axes: Axes, flight: MissionFlight, *, labels: bool = True) -> None:
    """Draw a mission's map into axes: plan, path, waypoints, charges.

    Args:
        axes: Axes of the map.
        flight: The mission.
        labels: Whether waypoints have their numbers.
    """
    frame = flight.mission.frame

    def there(places: Float[np.ndarray, "place 3"]) -> np.ndarray:
        return geodetic(frame, places)

    quiet(axes)
    planned, flown = planned_path(flight), flown_path(flight)
    for path, style in (
        (planned, {"color": MUTED, "linewidth": 3.5, "alpha": 0.45, "label": "plan"}),
        (flown, {"color": BLUE, "linewidth": 1.2, "label": "flown"}),
    ):
        lat, lon, _ = there(path).T
        axes.plot(lon, lat, **style)
    goals = there(np.stack([one.goal_m for one in flight.waypoints]))
    ok = np.array([one.reached for one in flight.waypoints])
    axes.plot(*goals[ok][:, 1::-1].T, "o", color=INK, markersize=4, label="waypoint")
    if not ok.all():
        axes.plot(
            *goals[~ok][:, 1::-1].T, "x", color=VERMILLION, label="waypoint, missed"
        )
    home = there(flight.mission.home_m[None])[0]
    axes.plot(home[1], home[0], "s", color=INK, markersize=7, label="home")
    blasts = there(flight.places_m)
    axes.plot(*blasts[:, 1::-1].T, "*", color=VERMILLION, markersize=12, label="blast")
    if labels and len(goals) <= MAX_NUMBERED:
        named: set[int] = set()
        for one, (lat, lon, _) in zip(flight.waypoints, goals, strict=True):
            if one.item.number not in named and np.hypot(*one.goal_m[:2]) > 0.5:
                axes.annotate(
                    str(one.item.number),
                    (lon, lat),
                    xytext=(4, 4),
                    textcoords="offset points",
                    fontsize=8,
                    color=INK,
                )
            named.add(one.item.number)
    axes.set_aspect(1 / math.cos(math.radians(home[0])), adjustable="datalim")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(axis="x", labelrotation=30)
    axes.set_xlabel("longitude [degree]")
    axes.set_ylabel("latitude [degree]")


def error_figure(flight: MissionFlight) -> Figure:
    """Draw path error, height and speed over time, with the blasts' arrivals."""
    time = np.asarray(flight.trajectory.time_s)
    rows = slice(None, None, max(1, time.size // MAX_POINTS))
    time = time[rows]
    error = flight.path_error_m[rows]
    peak = float(np.nanmax(flight.path_error_m))
    tolerance = flight.options.tolerance_m
    unit = unit_for("path_error_m", max(peak, tolerance))
    figure = new_figure(11.0, 6.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
    for axes in (upper, lower):
        quiet(axes)
        for arrival in np.asarray(flight.encounter.arrival_s):
            if 0 <= arrival <= flight.seconds:
                axes.axvline(arrival, color=VERMILLION, linewidth=1.0, linestyle="--")
    upper.axhspan(0.0, tolerance / unit.size, color=GRID, zorder=0)
    if flight.followed is not None:
        off = np.linalg.norm(np.asarray(flight.followed.error)[rows, PLACE], axis=1)
        upper.plot(
            time, off / unit.size, color=MUTED, linewidth=1.0, label="estimate error"
        )
    upper.plot(time, error / unit.size, color=BLUE, linewidth=1.2, label="path error")
    if flight.followed is not None:
        upper.legend(frameon=False, fontsize=9, loc="upper left")
    upper.set_ylabel(f"path error [{unit.symbol}]")
    upper.set_ylim(0.0)
    note = f"grey: within {printed_number('tolerance_m', tolerance)}"
    titled(upper, "Distance from the set point", f"{note}; dashed: a blast arrives")
    aim = np.maximum(np.asarray(flight.guided.set_point_m)[rows, 2], 0.0)
    lower.plot(time, aim, color=MUTED, linewidth=3.0, alpha=0.45, label="set point")
    height = np.asarray(flight.trajectory.position_m)[rows, 2]
    lower.plot(time, height, color=BLUE, linewidth=1.2, label="flown")
    lower.set_ylabel("height [m]")
    lower.set_xlabel("time [s]")
    lower.legend(frameon=False, fontsize=9, loc="upper left")
    return figure


def planned_path(flight: MissionFlight) -> Float[np.ndarray, "place 3"]:
    """Return the path of the set point above the ground: east, north, up [m]."""
    set_point = np.asarray(flight.guided.set_point_m)
    return _thinned(np.maximum(set_point, [-np.inf, -np.inf, 0.0]))


def flown_path(flight: MissionFlight) -> Float[np.ndarray, "place 3"]:
    """Return the path of the vehicle up to a divergence: east, north, up [m]."""
    place = np.asarray(flight.trajectory.position_m)
    return _thinned(place[np.isfinite(place).all(axis=1)])


def _thinned(path: Float[np.ndarray, "time 3"]) -> Float[np.ndarray, "place 3"]:
    return path[:: max(1, len(path) // MAX_POINTS)]


def _end(flight: MissionFlight) -> str:
    if flight.crash:
        return flight.crash
    reached = sum(one.reached for one in flight.waypoints)
    return f"{reached} of {len(flight.waypoints)} waypoints reached"
