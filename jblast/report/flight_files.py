"""Output files of `jblast fly`, for position holds and for missions.

Numbers (JSON, CSV, KML) are written before figures. A figure that cannot be drawn
gives a warning, and the other files are still written.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jblast.files import save_text, writing
from jblast.report.figure_files import write_drawn
from jblast.report.flight_figures import (
    controllers_figure,
    distribution_figure,
    error_figure,
    loads_figure,
)
from jblast.report.flights import flights_csv, trajectory_csv
from jblast.report.mission_figures import (
    error_figure as mission_error_figure,
    map_figure,
    mission_kml,
)
from jblast.study.flight_results import Flights, hold_words, target_of, trajectory_of
from jblast.study.flights import BOTH_HOLDS
from jblast.study.missions import MissionFlight, above_ground
from jblast.vehicle import Trajectory, path_error

JSON = "fly.json"
ONE: dict[str, Callable[[Flights], Figure]] = {
    "loads.png": loads_figure,
    "error.png": error_figure,
}
MANY = {"distribution.png": distribution_figure}
CONTROLLERS = {"controllers.png": controllers_figure}
"""Additional figure of many flights, if other controllers than the two are compared."""
TABLES = ("flight.csv", "flights.csv")
ROW_S = 0.02
"""Least interval of a mission's rows [s]: a mission of ten minutes has 30,000 rows."""
FLIGHT, MISSION_KML = TABLES[0], "mission.kml"
MISSION_FIGURES: dict[str, Callable[[MissionFlight], Figure]] = {
    "map.png": map_figure,
    "mission.png": mission_error_figure,
}


def write_flights(flights: Flights, text: str, directory: Path) -> list[str]:
    """Write flights into a directory; return the names of the files.

    A figure that cannot be drawn is left out, with a warning.

    Args:
        flights: The flights.
        text: The JSON of the answer.
        directory: Output directory; created if missing.

    Raises:
        InputError: It cannot be written to.
    """
    several = flights.count > 1
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        # figures of an earlier run next to new numbers would mislead
        for name in (JSON, *TABLES, *ONE, *MANY, *CONTROLLERS):
            (directory / name).unlink(missing_ok=True)
    table = flights_csv(flights) if several else flight_csv(flights)
    written = [JSON, TABLES[several]]
    for name, content in zip(written, (text, table), strict=True):
        save_text(content, directory / name)
    drawn = MANY if several else ONE
    if several and set(flights.holds) != set(BOTH_HOLDS):
        drawn = MANY | CONTROLLERS
    for name, draw in drawn.items():
        if write_drawn(partial(draw, flights), directory / name) is not None:
            written.append(name)
    return written


def flight_csv(flights: Flights) -> str:
    """Return the flight with the first position controller, as CSV."""
    name = next(iter(flights.holds))
    trajectory = trajectory_of(flights, name)
    error = np.asarray(path_error(trajectory, target_of(flights.vehicle)))
    comment = (
        f"{flights.vehicle.model}, position hold {hold_words(name)}, clock of the scene"
    )
    return trajectory_csv(trajectory, error, comment)


def write_mission(flight: MissionFlight, text: str, directory: Path) -> list[str]:
    """Write a mission into a directory; return the names of the files.

    A figure that cannot be drawn is left out, with a warning.

    Args:
        flight: The flight.
        text: The JSON of the answer.
        directory: Output directory; created if missing.

    Raises:
        InputError: It cannot be written to.
    """
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name in (JSON, *TABLES, MISSION_KML, *ONE, *MANY, *MISSION_FIGURES):
            (directory / name).unlink(missing_ok=True)
    whole = {JSON: text, FLIGHT: mission_csv(flight), MISSION_KML: mission_kml(flight)}
    for name, content in whole.items():
        save_text(content, directory / name)
    written = list(whole)
    for name, draw in MISSION_FIGURES.items():
        if write_drawn(partial(draw, flight), directory / name) is not None:
            written.append(name)
    return written


def mission_csv(flight: MissionFlight) -> str:
    """Return the rows of a mission at least `ROW_S` apart, as CSV."""
    every = max(1, round(ROW_S / flight.options.step_s))
    whole = flight.trajectory
    parts = {
        name: getattr(whole, name)[::every]
        for name in whole.__dataclass_fields__
        if name != "lost"
    }
    thinned = Trajectory(**parts, lost=whole.lost)
    comment = f"{flight.vehicle.model}, mission, clock of the scene"
    aim = above_ground(flight.guided.set_point_m)[::every]
    return trajectory_csv(thinned, flight.path_error_m[::every], comment, aim)
