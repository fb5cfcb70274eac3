"""Names beside the places of a map, where they hide neither each other nor a place."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from jblast.report.figure_style import INK
from jblast.report.fit.place.view import View

SIZE = 8.5
"""Of the letters [point]."""
LONGEST = 18
GAP, FAR = 6.0, 9.0
"""From a place to its name, and from one that is ringed [point]."""
HALO = [withStroke(linewidth=2.5, foreground="white")]
"""Behind letters that stand on lines."""


Box = tuple[float, ...]
"""Left, lower, right, upper [point]."""


class Side(NamedTuple):
    """How a name stands beside its place: offset [point] and alignment."""

    dx: float
    dy: float
    ha: Literal["left", "right", "center"]
    va: Literal["bottom", "top", "center"]


@dataclass(frozen=True)
class Label:
    """A name at a place (east, north) [m], in a colour."""

    name: str
    east: float
    north: float
    colour: str = INK
    needed: bool = False


def draw_labels(axes: Axes, view: View, width: float, labels: Sequence[Label]) -> None:
    """Write names beside their places; one that finds no room is left out.

    Args:
        axes: Where to.
        view: What they show.
        width: How wide they are drawn [point].
        labels: The names; those that are `needed` are always written.
    """
    scale = width / view.width
    marks = [(label.east * scale, label.north * scale) for label in labels]
    frame = tuple(
        scale * edge for edge in (view.west, view.south, view.east, view.north)
    )
    taken: list[Box] = []
    for label, mark in sorted(
        zip(labels, marks, strict=True), key=lambda pair: not pair[0].needed
    ):
        name = label.name if len(label.name) <= LONGEST else label.name[:17] + "…"
        room = _room(name, mark, FAR if label.needed else GAP, frame, taken, marks)
        if room is None and not label.needed:
            continue
        side, box = room or _sides(name, mark, FAR)[0]
        taken.append(box)
        axes.annotate(
            name,
            (label.east, label.north),
            xytext=(side.dx, side.dy),
            textcoords="offset points",
            ha=side.ha,
            va=side.va,
            fontsize=SIZE,
            color=label.colour,
            parse_math=False,
            path_effects=HALO,
            zorder=6,
        )


def _room(name, mark, gap, frame: Box, taken: list[Box], marks):
    """Return the first side of a place where its name hides nothing, else None."""
    for side, box in _sides(name, mark, gap):
        inside = (
            frame[0] <= box[0]
            and frame[1] <= box[1]
            and box[2] <= frame[2]
            and box[3] <= frame[3]
        )
        if inside and not _hides(box, taken, marks, mark):
            return side, box
    return None


def _sides(name: str, mark: tuple[float, float], gap: float) -> list[tuple[Side, Box]]:
    """Return where a name may stand beside its place: right, left, above, below."""
    wide, high = 0.62 * SIZE * len(name), 1.15 * SIZE
    x, y = mark
    return [
        (
            Side(gap, 0.0, "left", "center"),
            (x + gap, y - high / 2, x + gap + wide, y + high / 2),
        ),
        (
            Side(-gap, 0.0, "right", "center"),
            (x - gap - wide, y - high / 2, x - gap, y + high / 2),
        ),
        (
            Side(0.0, gap, "center", "bottom"),
            (x - wide / 2, y + gap, x + wide / 2, y + gap + high),
        ),
        (
            Side(0.0, -gap, "center", "top"),
            (x - wide / 2, y - gap - high, x + wide / 2, y - gap),
        ),
    ]


def _hides(box, taken, marks, own) -> bool:
    """Return whether a box lies over another name, or over another place."""
    left, low, right, high = box
    over = any(
        left < other[2] and other[0] < right and low < other[3] and other[1] < high
        for other in taken
    )
    return over or any(
        left - 3 < x < right + 3 and low - 3 < y < high + 3
        for x, y in marks
        if (x, y) != own
    )
