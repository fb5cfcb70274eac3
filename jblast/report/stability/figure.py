"""The map of where each method breaks, as one figure."""

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jblast.report.figure_style import BLUE, MUTED, new_figure
from jblast.report.stability.law_map import RESPONSE_COLOURS, law_map
from jblast.report.stability.panels import PANELS, shares
from jblast.verification.stability.failure import FailureMode


def stability_figure(modes: Mapping[str, Sequence[FailureMode]]) -> Figure:
    """Draw the laws over scaled distance, and a panel for each other area.

    Args:
        modes: Failure modes by area; what was not measured is not drawn.
    """
    beside = [area for area in PANELS if area in modes]
    every = [mode for found in modes.values() for mode in found]
    counts = sum(bool(mode.cases) for mode in every)
    mapped = "laws" in modes
    rows = -(-len(beside) // 2)
    heights = [1.0] * rows + [0.28 * counts] * bool(counts)
    height = max(10.5, 1.9 * sum(heights))
    figure = new_figure(8.0 * mapped + 8.6 * bool(beside or counts) or 8.0, height)
    columns = ([0.92] if mapped else []) + ([1.0] if beside or counts else [])
    parts = figure.subfigures(
        1, max(len(columns), 1), squeeze=False, width_ratios=columns or None
    )
    parts = list(parts[0])
    if mapped:
        axes = parts.pop(0).subplots()
        law_map(axes, modes["laws"])
        _key(axes)
    if not parts:
        return figure
    grid = parts[0].add_gridspec(len(heights) or 1, 2, height_ratios=heights or None)
    for place, area in enumerate(beside):
        alone = place % 2 == 0 and place == len(beside) - 1
        across = slice(None) if alone else place % 2
        PANELS[area](parts[0].add_subplot(grid[place // 2, across]), modes[area])
    if counts:
        shares(parts[0].add_subplot(grid[-1, :]), every)
    return figure


def _key(axes) -> None:
    entries = [
        Patch(color=BLUE, alpha=0.75, label="holds"),
        Patch(color="#d8d8d8", label="goes on, marked"),
    ]
    entries += [
        Line2D([], [], color=RESPONSE_COLOURS[response], linewidth=2.0, label=words)
        for response, words in (("marks", "edge: marked"), ("holds", "edge avoided"))
    ]
    axes.legend(
        handles=entries,
        loc="upper center",
        bbox_to_anchor=(0.45, -0.06),
        ncols=4,
        frameon=False,
        fontsize=9,
        labelcolor=MUTED,
    )
