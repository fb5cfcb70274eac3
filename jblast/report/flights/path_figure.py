"""The path of one flight through blasts, in three dimensions."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from jblast.report.figure_style import INK, MUTED, VERMILLION, new_figure
from jblast.report.numbers import unit_for
from jblast.study.flights.records import Flights
from jblast.study.flights.statistics import hold_words, target_of, trajectory_of

SHADOW = "#d0d0d0"


def path_figure(flights: Flights) -> Figure:
    """Draw the first hold's path from its target, coloured by the distance from it."""
    name = next(iter(flights.holds))
    target = target_of(flights.vehicle)
    away = np.asarray(trajectory_of(flights, name).position_m) - target
    away = away[np.isfinite(away).all(axis=1)]
    error = np.linalg.norm(away, axis=1)
    unit = unit_for("path_error_m", float(error.max()))
    path = away / unit.size
    # a vehicle that nothing moved still has a picture
    size = max(float(np.ptp(path, axis=0).max()), 1e-3)
    ways = _blast_ways(flights)
    tails = -0.45 * size * ways
    drawn = np.concatenate([path, np.zeros((1, 3)), tails])
    middle = (drawn.min(axis=0) + drawn.max(axis=0)) / 2
    half = 0.55 * float(np.ptp(drawn, axis=0).max())
    figure = new_figure(9.0, 6.8)
    axes = figure.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    _equal_axes(axes, middle, half, unit.symbol)
    floor = np.full(len(path), middle[2] - half)
    axes.plot(path[:, 0], path[:, 1], floor, color=SHADOW, linewidth=1.5)
    line = Line3DCollection(
        list(np.stack([path[:-1], path[1:]], axis=1)), cmap="viridis", linewidth=2.5
    )
    line.set_array(error[1:] / unit.size)
    axes.add_collection3d(line)
    for tail in tails:
        axes.plot(*np.stack([tail, 0 * tail], axis=1), color=VERMILLION, linewidth=1.8)
    axes.plot(*np.zeros((3, 1)), "o", color=INK, markersize=6)
    axes.plot(*path[-1:].T, "s", color=MUTED, markersize=6)
    axes.legend(
        handles=[
            Line2D([], [], color=INK, marker="o", linestyle="", label="target"),
            Line2D([], [], color=MUTED, marker="s", linestyle="", label="end"),
            Line2D([], [], color=VERMILLION, label="from where the blast comes"),
            Line2D([], [], color=SHADOW, label="shadow on the floor"),
        ],
        frameon=False,
        fontsize=9,
        loc="upper right",
    )
    bar = figure.colorbar(line, ax=axes, shrink=0.6, pad=0.1)
    bar.set_label(f"distance from the target [{unit.symbol}]", color=INK)
    figure.suptitle(
        f"Path of the {flights.vehicle.model.capitalize()}, {hold_words(name)}",
        x=0.04,
        ha="left",
        fontsize=11,
        color=INK,
        fontweight="bold",
    )
    return figure


def _blast_ways(flights: Flights) -> Float[np.ndarray, "blast 3"]:
    """Return the directions in which blasts blow at the target, of length 1."""
    way = target_of(flights.vehicle) - flights.places_m
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return (way / np.where(length > 0, length, 1.0))[length[:, 0] > 0]


def _equal_axes(
    axes: Axes3D, middle: Float[np.ndarray, "3"], half: float, symbol: str
) -> None:
    """Make a quiet cube about a place."""
    for letter, word, centre in zip(
        "xyz", ("east", "north", "up"), middle, strict=True
    ):
        getattr(axes, f"set_{letter}lim")(centre - half, centre + half)
        getattr(axes, f"set_{letter}label")(f"{word} of target [{symbol}]", color=INK)
        axis = getattr(axes, f"{letter}axis")
        axis.set_pane_color((1, 1, 1, 0))
        axis.set_major_locator(MaxNLocator(5))
    axes.set_zlabel(f"above target [{symbol}]", color=INK)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=-60)
    axes.tick_params(labelsize=8, labelcolor=INK)
