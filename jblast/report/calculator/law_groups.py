"""Laws that say the same as one line: groups of them, their key, what holds nowhere."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from jblast.report.calculator.law_curves import LAW_COLOURS
from jblast.report.figure_style import COLOURS, INK, MUTED
from jblast.sensors.calculator.forward import Calculated

COINCIDE = 0.02
"""Relative difference up to which laws, wherever both hold, are one line to the eye."""
FIRST = "kingery_bulmash"
"""Leads its group, as it does the choice of laws where it holds."""
LETTERS = 40
"""Of a line of a key."""

Curves = Mapping[str, Calculated]


def groups(by_law: Curves, names: Iterable[str]) -> list[list[str]]:
    """Return some laws in groups that coincide where they hold, the first one leading.

    Two that hold nowhere together are two.
    """
    found: list[list[str]] = []
    for name in names:
        for group in found:
            if _coincide(by_law[group[0]], by_law[name]):
                group.append(name)
                break
        else:
            found.append([name])
    return found


def holding(by_law: Curves, first: str = FIRST) -> list[str]:
    """Return the laws that hold somewhere, one before all, then those that hold most.

    Args:
        by_law: What each says.
        first: The one, if it holds.
    """
    return sorted(
        (name for name, of_law in by_law.items() if of_law.valid.any()),
        key=lambda name: (name != first, -int(by_law[name].valid.sum())),
    )


def leader_colours(panels: Iterable[Sequence[Sequence[str]]]) -> dict[str, str]:
    """Return a colour for the first law of every group, the same in all panels."""
    leaders = dict.fromkeys(group[0] for groups in panels for group in groups)
    palette = tuple(dict.fromkeys((INK, *COLOURS, *LAW_COLOURS)))
    return {name: palette[i % len(palette)] for i, name in enumerate(leaders)}


def group_words(group: Sequence[str]) -> str:
    """Return the entry of a key: who leads, and who says the same."""
    if len(group) == 1:
        return group[0]
    same = f"= {', '.join(group[1:])} (within\xa0{100 * COINCIDE:g}\xa0%)"
    lines = textwrap.wrap(same, LETTERS, break_on_hyphens=False)
    return "\n  ".join([group[0], *lines])


def outside_entry(by_law: Curves) -> Line2D | None:
    """Return the entry of a key for laws that hold nowhere in sight; None of none."""
    names = [name for name, of_law in by_law.items() if not of_law.valid.any()]
    if not names:
        return None
    whose = "its" if len(names) == 1 else "their"
    words = f"outside {whose} range: {', '.join(names)}"
    lines = textwrap.wrap(words, LETTERS, break_on_hyphens=False)
    look = {"color": MUTED, "linewidth": 1.0, "linestyle": (0, (3, 2.5)), "alpha": 0.7}
    return Line2D([], [], label="\n  ".join(lines), **look)


def draw_key(axes: Axes, by_law: Curves, size: int) -> None:
    """Write the key of a panel where it covers least, what holds nowhere at its end."""
    handles, _ = axes.get_legend_handles_labels()
    outside = outside_entry(by_law)
    handles += [] if outside is None else [outside]
    axes.legend(handles=handles, fontsize=size, frameon=False, loc="best")


def _coincide(one: Calculated, other: Calculated) -> bool:
    both: Bool[np.ndarray, " point"] = one.valid & other.valid
    if not both.any():
        return False
    a, b = one.value[both], other.value[both]
    return bool(np.all(np.abs(a - b) <= COINCIDE * np.abs(a)))
