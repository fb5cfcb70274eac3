"""Figures of a world: all records on one time axis, a map, and frames of the film."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.inference import Fit
from jblast.report.colours import COLOURS, INK, MUTED
from jblast.report.figures import envelope, new_figure, quiet, titled
from jblast.report.fit_map import likely_places
from jblast.report.listen import pictures, read_samples, read_table
from jblast.report.map_figures import map_figure
from jblast.report.maps import Feature, Map, point
from jblast.report.numbers import split_name, unit_for
from jblast.report.view import Picture
from jblast.report.world import ShotFit, WorldAnswer
from jblast.scene import Scene
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.study.run_files import FILM, FLIGHT, SOUND

MAX_WAVEFORMS = 6
"""Largest number of sensors in the timeline; the page draws more by themselves."""
BINS = 400
"""Bins of the event rate over the whole run: about two pixels each."""


def run_pictures(
    document: WorldAnswer, directory: Path, scene: Scene, fits: Sequence[ShotFit]
) -> Iterator[Picture]:
    """Yield the figures of a run, which are read from its files."""
    # read now, so that a broken file is an error, not a figure that is missing
    rows = _timeline(document, directory)
    if rows:
        yield Picture(
            "timeline.png",
            partial(timeline_figure, document, rows),
            "All recordings on the common clock",
            "Dashed: a blast.",
            "Flight, samples and camera events against time on one axis.",
        )
    features = [*_features(document, directory, scene, fits)]
    if features:
        yield Picture(
            "map.png",
            lambda: map_figure(Map(features)),
            "Map",
            "Dashed: 90 % area of a fit." if fits else "",
            "Map of blasts, sensors and the vehicle's path.",
        )
    if document.sound is not None:
        yield from pictures(document.sound, directory / SOUND)
    sheet = directory / FILM / "contact_sheet.png"
    if sheet.exists():
        yield Picture(
            "film.png",
            partial(_sheet_figure, sheet),
            "Film",
            "Times since the first blast.",
            "Frames of the camera around the first blast.",
        )


class Plot(NamedTuple):
    """A plot of the timeline: its title, label and contents."""

    title: str
    label: str
    draw: Callable[[Axes], None]


def _timeline(document: WorldAnswer, directory: Path) -> list[Plot]:
    """Return the plots of all records; of a flight as in figure 4.7 of the thesis."""
    plots = []
    if document.flight or document.mission:
        plots += _flight_plots(document, read_table(directory / FLIGHT))
    sensors = document.sound.sensors if document.sound else {}
    for name, record in [*sensors.items()][:MAX_WAVEFORMS]:
        samples = read_samples(directory / SOUND, record)
        column = SENSOR_KINDS[record.kind].column
        title = f"{name}: {split_name(column)[0].replace('_', ' ')}"
        unit = unit_for(column, 1.0).symbol
        draw = partial(envelope, samples=samples, rate_hz=record.rate_hz)
        plots.append(Plot(title, f"[{unit}]", draw))
    if document.camera is not None:
        from jblast.sensors.camera.files.event_files import read_events

        events = read_events(directory / FILM / "events.h5")
        times = (events.t + events.t_offset) * 1e-6
        draw = partial(_event_rate, times, document.seconds)
        plots.append(Plot("Events", "per second", draw))
    return plots


def _flight_plots(document: WorldAnswer, table: pd.DataFrame) -> Iterator[Plot]:
    time = table["time_s"].to_numpy()
    world, body = ("east", "north", "up"), ("x", "y", "z")
    aim: Any = document.flight and document.flight.target_m
    if aim is None:  # a mission has set points that move
        aim = table[[f"set_point_{axis}_m" for axis in world]].to_numpy()
    away = table[[f"{axis}_m" for axis in world]].to_numpy() - aim
    error = table["path_error_m"].to_numpy()
    unit = unit_for("path_error_m", float(error.max()))

    def curves(columns: Float[np.ndarray, "row 3"], names: Sequence[str]):
        def draw(axes: Axes) -> None:
            for part, name, colour in zip(columns.T, names, COLOURS, strict=False):
                axes.plot(time, part, color=colour, linewidth=1.0, label=name)
            style = {"frameon": False, "fontsize": 8.5, "labelcolor": MUTED}
            axes.legend(ncols=3, loc="upper right", **style)

        return draw

    forces = table[[f"force_{axis}_n" for axis in world]].to_numpy()
    moments = table[[f"moment_{axis}_n_m" for axis in body]].to_numpy()
    label = f"[{unit.symbol}]"
    yield Plot("Path relative to the set point", label, curves(away / unit.size, world))
    yield Plot("Path error", label, curves(error[:, None] / unit.size, ["error"]))
    yield Plot("All forces", "[N]", curves(forces, world))
    yield Plot("All moments, body axes", "[N m]", curves(moments, body))


def _event_rate(times_s: np.ndarray, seconds: float, axes: Axes) -> None:
    count, edges = np.histogram(times_s, bins=BINS, range=(0.0, seconds))
    axes.stairs(count / np.diff(edges), edges, fill=True)
    # most bins are empty between blasts, and a logarithm has no zero
    axes.set_yscale("symlog", linthresh=100.0)


def timeline_figure(document: WorldAnswer, rows: Sequence[Plot]) -> Figure:
    """Draw all records on one time axis."""
    figure = new_figure(10.5, 1.45 * len(rows) + 0.4)
    plots = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, row in zip(plots, rows, strict=True):
        quiet(axes)
        row.draw(axes)
        axes.set_ylabel(row.label)
        titled(axes, row.title)
        for blast in document.blasts:
            axes.axvline(blast.time_s, color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
    plots[-1].set_xlim(0.0, document.seconds)
    plots[-1].set_xlabel("time [s] on the common clock")
    return figure


def _features(
    document: WorldAnswer, directory: Path, scene: Scene, fits: Sequence[ShotFit]
) -> Iterator[Feature]:
    """Yield sensors, blasts, the vehicle's path and likely places of fits."""
    for sensor in scene.sensors:
        if not sensor.mount and np.isfinite(sensor.position_m).all():
            yield point("sensor", sensor.name, sensor.position_m, label=sensor.name)
    if scene.camera is not None and not scene.camera.mount:
        yield point("camera", "camera", scene.camera.position, label="camera")
    if document.flight or document.mission:
        table = read_table(directory / FLIGHT)
        path = table[["east_m", "north_m", "up_m"]].dropna().to_numpy()
        yield Feature("flown", "vehicle", [[path]])
    for blast in document.blasts:
        words = f"{blast.shot}: {blast.mass_kg:.3g} kg, {blast.time_s:.2f} s"
        yield point("blast", blast.shot, blast.position_m, label=words)
    for one in fits:
        if isinstance(one.found, Fit):
            for feature in likely_places(one.found):
                yield replace(feature, name=f"fit of {one.blast.shot}", dashed=True)


def _sheet_figure(sheet: Path) -> Figure:
    from matplotlib.image import imread

    image = imread(sheet)
    figure = new_figure(10.5, 10.5 * image.shape[0] / image.shape[1])
    axes = figure.subplots()
    axes.imshow(image)
    axes.set_axis_off()
    return figure
