"""Do fits of random worlds give the truth back, and which sense buys how much?

    python -m calibration.world_round_trip > calibration/results/world_round_trip.txt

Worlds of one blast are drawn by `jblast.world`, one a seed, and read with all errors:
Student-t of the instruments, and what the laws scatter (`calibration.world_subsets`).
Each subset of their readings is fitted with the priors that the world was drawn by, and
the truth is ranked among draws of the posterior, twice over: as `--posterior auto`
answers (`calibration.world_autos`, which has to be run before), and, of a thousand
worlds, by `fit_many` with importance weights (`calibration.world_weights`, likewise).
If intervals are right, ranks are uniform (Kolmogorov and Smirnov, Holm's correction
over all of a table).
Sharpness is the posterior sd of ln(mass), its median over the worlds, beside the least
sd that data and priors allow (Cramer and Rao, of the same worlds at their truths, in
coordinates in which priors are normal: of what is known by its prior alone it is no
strict bound), and beside the prior's. Writes calibration/results/world_round_trip.png.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from scipy.stats import kstest

from calibration import world_autos, world_weights
from calibration.sbc import WRONG, holm
from calibration.world_answers import Answer, kept
from calibration.world_subsets import SUBSETS
from jblast.report.figure_style import BLUE, INK, VERMILLION, new_figure, quiet, titled

NAMES = ("charge_east_m", "charge_north_m", "charge_mass_kg", "origin_time_s")
GOOD_K = 0.7
"""Below this k-hat weights may be believed (Vehtari et al. 2024)."""
RESULTS = Path(__file__).parent / "results"


class RoundTrip(NamedTuple):
    """What became of the worlds by one subset of readings.

    Attributes:
        rank: Share of the posterior below the truth.
        sd: Posterior sd of ln(mass).
        least: What data and priors allow at best at the truth.
        good: Whether the answer is to be believed: the walk is long enough, or the
            weights' k-hat is below 0.7.
    """

    rank: Float[np.ndarray, "world free"]
    sd: Float[np.ndarray, " world"]
    least: Float[np.ndarray, " world"]
    good: Float[np.ndarray, " world"]


def by_subset(rows: Sequence[Answer]) -> dict[str, RoundTrip]:
    """Put answers together."""
    found = {}
    for subset in SUBSETS:
        some = sorted((r for r in rows if r.subset == subset), key=lambda r: r.world)
        if not some:
            continue
        good = [r.reached if r.method == "walk" else r.k_hat < GOOD_K for r in some]
        found[subset] = RoundTrip(
            np.array([r.rank for r in some]),
            np.array([r.sd for r in some]),
            np.array([r.least for r in some]),
            np.array(good),
        )
    return found


def inside(rank: Float[np.ndarray, " world"]) -> float:
    """Return the share of truths inside the 90 % interval."""
    return float(np.mean((rank > 0.05) & (rank < 0.95)))


def table(found: dict[str, RoundTrip]) -> str:
    """Return ranks and sharpness."""
    rows = [
        (f"{subset:24}{name:18}{len(one.sd):7d}", one.rank[:, i], one.good)
        for subset, one in found.items()
        for i, name in enumerate(NAMES)
    ]
    lines = [f"{'':42}{'worlds':>7}{'inside':>8}{'p':>8}{'Holm':>8}{'of good':>9}"]
    p = np.array([kstest(rank, "uniform").pvalue for _, rank, _ in rows])
    for (name, rank, good), one, corrected in zip(rows, p, holm(p), strict=True):
        told = f"{inside(rank):8.3f}{one:8.3f}{corrected:8.3f}{inside(rank[good]):9.3f}"
        lines.append(name + told)
    least = holm(p).min()
    verdict = "not uniform" if least < WRONG else "nothing against uniform"
    lines += [f"smallest of {len(p)} tests {least:.3f}: {verdict}", ""]
    lines += [f"sd of ln(mass){'':10}{'fits':>8}{'bound':>8}{'good':>8}"]
    lines += [
        f"{subset:24}{np.median(one.sd):8.3f}{np.median(one.least):8.3f}"
        f"{np.mean(one.good):8.3f}"
        for subset, one in found.items()
    ]
    prior = np.log(np.random.default_rng(0).uniform(5, 15, 100_000)).std()
    return "\n".join([*lines, f"{'prior':24}{prior:8.3f}"])


def figure(found: dict[str, RoundTrip]) -> Figure:
    """Draw each subset's ranks, and its sharpness beside the bound."""
    drawn = new_figure(9.0, 3.8)
    left, right = drawn.subplots(1, 2, width_ratios=(1, 1.2))
    for one in found.values():
        share = (np.arange(len(one.sd)) + 0.5) / len(one.sd)
        for rank in one.rank.T:
            left.plot(np.sort(rank), share, color=BLUE, linewidth=0.8, alpha=0.6)
    left.plot([0, 1], [0, 1], color=INK, linewidth=0.8)
    left.set_xlabel("rank of the truth")
    left.set_ylabel("share of worlds")
    titled(left, "Ranks")
    places = np.arange(len(found))[::-1]
    fits = [one.sd for one in found.values()]
    for place, sds in zip(places, fits, strict=True):
        low, middle, high = np.quantile(sds, (0.05, 0.5, 0.95))
        right.plot([low, high], [place, place], color=BLUE, linewidth=2.0)
        label = "fits, 90 %" if place == places[0] else None
        right.plot(middle, place, "o", color=BLUE, label=label)
    bounds = [np.median(one.least) for one in found.values()]
    right.plot(bounds, places, "|", color=VERMILLION, markersize=18, label="bound")
    right.set_yticks(places, list(found))
    right.set_ylim(-0.6, len(found) - 0.4)
    right.set_xlim(left=0.0)
    right.set_xlabel("sd of ln(mass)")
    drawn.legend(frameon=False, fontsize=9, loc="outside lower center", ncols=2)
    titled(right, "Sharpness")
    for axes in (left, right):
        quiet(axes)
    return drawn


def main() -> None:
    """Print both tables, write the figure of the first."""
    autos, many = (by_subset(kept(of.KEPT)) for of in (world_autos, world_weights))
    if not (autos and many):
        raise SystemExit("run calibration.world_autos and calibration.world_weights")
    print("As --posterior auto answers: worlds of one blast, all errors\n")
    print(table(autos))
    print("\nBy fit_many and importance weights\n")
    print(table(many))
    figure(autos).savefig(RESULTS / "world_round_trip.png", dpi=150)


if __name__ == "__main__":
    main()
