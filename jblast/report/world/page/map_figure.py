"""A world on the ground: its blasts, who perceived them, the vehicle's path."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.world.page.answers import ShotAnswer
from jblast.report.world.page.folder import RunFolder
from jblast.scene import Scene


def map_figure(run: RunFolder, scene: Scene, answers: Sequence[ShotAnswer]) -> Figure:
    """Draw where everything was; a blast's mark is as large as its mass.

    Args:
        run: The world.
        scene: Where its sensors stand.
        answers: Whose ellipses are drawn.
    """
    figure = new_figure(7.2, 6.4)
    axes = figure.subplots()
    quiet(axes)
    for sensor in scene.sensors:
        if not sensor.mount:
            east, north = np.asarray(sensor.position_m)[:2]
            axes.plot(east, north, "^", color=INK, markersize=6)
            _named(axes, sensor.name, east, north, INK)
    if scene.camera is not None and not scene.camera.mount:
        east, north = np.asarray(scene.camera.position)[:2]
        axes.plot(east, north, "v", color=INK, markersize=6)
        _named(axes, "camera", east, north, INK, below=True)
    if run.flight is not None:
        path = run.flight[["east_m", "north_m"]].to_numpy()
        axes.plot(*path.T, color=BLUE, linewidth=1.4, label="path of the vehicle")
        axes.plot(*path[:1].T, "s", color=BLUE, markersize=5)
    label = "blast, and its mass"
    for blast in run.document["blasts"]:
        east, north, _ = blast["position_m"]
        size = 5.0 + 4.0 * blast["mass_kg"] ** (1.0 / 3.0)
        axes.plot(
            *(east, north, "o"), color=VERMILLION, markersize=min(size, 24.0),
            alpha=0.75, linestyle="", label=label,
        )  # fmt: skip
        label = None
        said = f"{blast['shot']}: {blast['mass_kg']:.3g} kg, {blast['time_s']:.2f} s"
        _named(axes, said, east, north, VERMILLION)
    label = "90 % of the answer"
    for answer in answers:
        if answer.ellipse is not None:
            rim = answer.ellipse.outline()
            rim = np.vstack([rim, rim[:1]])
            axes.plot(*rim.T, color=MUTED, linewidth=1.3, label=label)
            label = None
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.12)
    axes.set(xlabel="east [m]", ylabel="north [m]")
    titled(axes, "Where it was", "triangles: sensors")
    axes.legend(frameon=False, fontsize=9, labelcolor=MUTED, loc="best")
    return figure


def _named(
    axes, words: str, east: float, north: float, colour: str, *, below: bool = False
) -> None:
    axes.annotate(
        words, (east, north), (7, -12 if below else 5), textcoords="offset points",
        fontsize=8.5, color=colour,
    )  # fmt: skip
