"""Figures of discovery: data against integrated equations."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.discovery.discover import Discovery, Replay
from jblast.report.discovery import doubts, equation_text
from jblast.report.figures import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)

DATA = "#b0b0b0"


def discovery_figure(
    found: Discovery,
    again: Replay,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
) -> Figure:
    """Draw each state with its integrated equation, and the inclusion of each term."""
    rows = len(found.states)
    figure = new_figure(11.0, 0.8 + 3.0 * rows)
    grid = figure.subplots(rows, 2, squeeze=False, width_ratios=[2.6, 1.0])
    for state, (left, right) in enumerate(grid):
        name = found.states[state]
        quiet(left)
        left.plot(time_s, states[:, state], ".", color=DATA, markersize=5)
        left.plot(time_s, again.states[:, state], color=BLUE, linewidth=1.3)
        spread = np.ptp(states[:, state])
        left.set_ylim(
            np.min(states[:, state]) - 0.25 * spread,
            np.max(states[:, state]) + 0.25 * spread,
        )
        left.set_ylabel(name)
        titled(left, _cut(equation_text(found, state)))
        left.text(0.01, 0.96, "data", color=MUTED, transform=left.transAxes, va="top")
        doubtful = bool(doubts(found, again, state))
        left.text(
            0.09,
            0.96,
            "equations, "
            + (
                "nearest trajectory"
                if again.nearest
                else "integrated from the first row"
            )
            + (": DOUBTFUL" if doubtful else ""),
            color=VERMILLION if doubtful else BLUE,
            transform=left.transAxes,
            va="top",
        )
        _inclusion(right, found, state)
    grid[-1][0].set_xlabel("time [s]")
    grid[-1][1].set_xlabel("share of the ensemble with the term")
    return figure


def _inclusion(axes: Axes, found: Discovery, state: int) -> None:
    """Draw a bar a term: its share of the ensemble."""
    quiet(axes)
    kept = found.coefficients[state] != 0.0
    share = found.inclusion[state]
    shown = np.flatnonzero(kept | (share > 0.0))[::-1]
    places = np.arange(len(shown))
    colours = [BLUE if kept[place] else "#c8c8c8" for place in shown]
    axes.barh(places, share[shown], height=0.6, color=colours)
    axes.set_yticks(places, [found.candidates.names[place] for place in shown])
    axes.set_ylim(-0.6, max(len(shown), 3) - 0.4)
    axes.set_xlim(0.0, 1.0)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    if not len(shown):
        axes.text(0.5, 1.0, "no term", ha="center", color=INK)


def _cut(words: str, longest: int = 84) -> str:
    """Return a title shortened at a term to the width of its plot [characters]."""
    if len(words) <= longest:
        return words
    kept = words[: longest - 4]
    return kept[: max(kept.rfind(" + "), kept.rfind(" - "))] + " ..."
