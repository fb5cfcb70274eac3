"""What `jblast fly` writes of a mission: the numbers first, then the figures."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jblast.cli.arguments.flights.files import JSON, MANY, ONE, TABLES
from jblast.cli.arguments.paths import save_text, writing
from jblast.report.figure_files import write_drawn
from jblast.report.flights import trajectory_csv
from jblast.report.mission_figures import error_figure, map_figure, mission_kml
from jblast.study.missions.records import MissionFlight
from jblast.vehicle import Trajectory

ROW_S = 0.02
"""Between two rows of the table, at least."""
FLIGHT, KML = TABLES[0], "mission.kml"
FIGURES: dict[str, Callable[[MissionFlight], Figure]] = {
    "map.png": map_figure,
    "mission.png": error_figure,
}


def write_mission(flight: MissionFlight, text: str, directory: Path) -> list[str]:
    """Write a mission into a directory; return the names of the files.

    A figure that cannot be drawn costs nothing but itself: a warning names it.

    Args:
        flight: What was flown.
        text: Its JSON.
        directory: Where to; made if it is not there.

    Raises:
        InputError: It cannot be written to.
    """
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name in (JSON, *TABLES, KML, *ONE, *MANY, *FIGURES):
            (directory / name).unlink(missing_ok=True)  # an earlier run's
    comment = f"{flight.vehicle.model}, mission, clock of the scene"
    table = trajectory_csv(*_thinned(flight), comment)
    whole = {JSON: text, FLIGHT: table, KML: mission_kml(flight)}
    for name, content in whole.items():
        save_text(content, directory / name)
    written = list(whole)
    for name, draw in FIGURES.items():
        if write_drawn(partial(draw, flight), directory / name) is not None:
            written.append(name)
    return written


def _thinned(flight: MissionFlight) -> tuple[Trajectory, np.ndarray]:
    """Return rows some time apart, and their path errors."""
    every = max(1, round(ROW_S / flight.options.step_s))
    whole = flight.trajectory
    parts = {
        name: getattr(whole, name)[::every]
        for name in whole.__dataclass_fields__
        if name != "lost"
    }
    return Trajectory(**parts, lost=whole.lost), flight.path_error_m[::every]
