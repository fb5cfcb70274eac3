"""Draw how far the shares of ranks are from uniform, for each unknown of each case.

What is drawn is the share of truths that rank below r, less the share expected. Inside
the grey band lie 95 % of all curves that uniform ranks make, each as a whole
(Saeilynoja, Buerkner & Vehtari 2022, Stat. Comput. 32:32), found by simulation.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int
from matplotlib.figure import Figure

from calibration.sbc_logs import DRAWS, Ranked
from jblast.report.figure_style import BLUE, INK, VERMILLION, new_figure, quiet, titled

CURVES = 4000
"""Sets of uniform ranks simulated for the band."""
FEWEST = 50
"""Fewer logs that the normal approximation answered are not drawn."""


def away(ranks: Int[np.ndarray, "*set log"]) -> Float[np.ndarray, "*set rank"]:
    """Return the share of ranks below each rank less what is expected."""
    below = np.stack(
        [np.mean(ranks < r, axis=-1) for r in range(1, DRAWS + 1)], axis=-1
    )
    return below - np.arange(1, DRAWS + 1) / (DRAWS + 1)


def band(logs: int) -> Float[np.ndarray, " rank"]:
    """Return how far 95 % of the curves of uniform ranks stay from none."""
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    sd = np.sqrt(share * (1 - share) / logs)
    ranks = np.random.default_rng(0).integers(0, DRAWS + 1, (CURVES, logs))
    farthest = np.max(np.abs(away(ranks)) / sd, axis=1)
    return np.quantile(farthest, 0.95) * sd


def figure(ranked: Mapping[str, Ranked]) -> Figure:
    """Return the figure, a panel for each case."""
    drawn = new_figure(9.0, 5.4)
    panels = drawn.subplots(2, 3, sharex=True, sharey=True)
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    for axes, (case, r) in zip(panels.flat, ranked.items(), strict=True):
        wide = band(len(r.emcee))
        axes.fill_between(share, -wide, wide, color=INK, alpha=0.12, linewidth=0)
        for i in range(len(r.names)):
            axes.plot(share, away(r.emcee[:, i]), color=BLUE, linewidth=1.0)
        if r.holds.sum() >= FEWEST:
            wide = band(int(r.holds.sum()))
            axes.plot(share, wide, ":", color=VERMILLION, linewidth=0.8)
            axes.plot(share, -wide, ":", color=VERMILLION, linewidth=0.8)
            for i in range(len(r.names)):
                axes.plot(
                    share, away(r.laplace[r.holds, i]), color=VERMILLION, linewidth=1.0
                )
        quiet(axes)
        titled(axes, case.replace("_", " "))
    for axes in panels[1]:
        axes.set_xlabel("rank of the truth")
    for axes in panels[:, 0]:
        axes.set_ylabel("share below, less expected")
    return drawn
