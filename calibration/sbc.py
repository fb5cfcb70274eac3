r"""Is a 90 % interval right for 90 % of blasts? Seven cases, 500 logs each.

    python -m calibration.sbc [LOGS] > calibration/results/sbc.txt

Truths are drawn from the priors of each file in `calibration/scenes/`, a log of each is
simulated with the errors `jblast fit` assumes (Student-t; normal scatter of laws),
and the truth is ranked among weighted draws of the posterior (theory below). Log i has
seed i. If intervals are right, ranks are
uniform: that is tested by chi-squared in 20 bins (10 for few logs), for each unknown of
each case, with Holm's correction over all. "inside" is the share of truths inside the
90 % interval. Writes calibration/results/sbc.png and sbc.csv (every rank).

Simulation-based calibration (Talts, Betancourt, Simpson, Vehtari & Gelman 2018,
arXiv:1804.06788): a truth $\theta \sim p(\theta)$ and a log $y \sim p(y \mid
\theta)$ are one draw of the joint density, and so is $\theta' \sim p(\theta \mid y)$
with the same $y$. So among $L$ independent draws of the posterior the truth takes each
of the $L + 1$ ranks equally often.

Drawn is the share of truths that rank below r, less the share expected. Inside the
grey band lie 95 % of all curves that uniform ranks make, each as a whole (Saeilynoja,
Buerkner & Vehtari 2022, Stat. Comput. 32:32), found by simulation.
"""

import sys
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from matplotlib.figure import Figure
from scipy.stats import chisquare

from calibration import run_part
from jblast.cli.jax_start import start_jax
from jblast.files import table_text, write_text
from jblast.inference.density import density_of
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.sample import solve
from jblast.observations import Observations
from jblast.report.colours import BLUE, INK
from jblast.report.figures import new_figure, quiet, titled
from jblast.scene import UncertainScene, read_scene, with_laws
from jblast.sensors import observe, planned_layout, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import written

SCENES = Path(__file__).parent / "scenes"
DRAWS = 99
"""So many posterior draws a truth is ranked among: its rank is 0 to 99."""


class Ranked(NamedTuple):
    """What became of the logs of a scene.

    Attributes:
        names: What was unknown.
        ranks: Rank of the truth among weighted draws.
        reliable: Whether the weights can be believed.
        effective: Effective number of draws.
    """

    names: tuple[str, ...]
    ranks: Int[np.ndarray, "log free"]
    reliable: Bool[np.ndarray, " log"]
    effective: Float[np.ndarray, " log"]


CURVES = 4000
"""Sets of uniform ranks simulated for the band."""


CASES = (
    "arrivals",
    "flash_and_air",
    "four_microphones",
    "impulse_and_duration",
    "pressure",
    "burial",
    "camera_and_bang",
)
LOGS = 500
BINS = (20, 10)
"""The first of which five ranks a bin are expected; fewer ranks are not tested."""
WRONG = 0.05
"""Chance at which right intervals are called wrong, for all tests together."""
RESULTS = Path(__file__).parent / "results"
AT_ONCE = 25
"""Logs that a process takes at a time."""


def chance(ranks: Int[np.ndarray, " log"]) -> float:
    """Return the chance that uniform ranks are as uneven; nan of too few."""
    bins = next((bins for bins in BINS if len(ranks) >= 5 * bins), 0)
    if not bins:
        return np.nan
    counts = np.bincount(ranks * bins // (DRAWS + 1), minlength=bins)
    return float(chisquare(counts).pvalue)


def holm(p: Float[np.ndarray, " test"]) -> Float[np.ndarray, " test"]:
    """Correct p-values for their number (Holm 1979, Scand. J. Statist. 6:65)."""
    order = np.argsort(p)
    scaled = (len(p) - np.arange(len(p))) * p[order]
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return corrected


def inside(ranks: Int[np.ndarray, " log"]) -> float:
    """Return the share of truths inside the 90 % interval."""
    return float(np.mean((ranks >= 5) & (ranks < 95)))


def all_ranks(logs: int) -> dict[str, Ranked]:
    """Rank the truths of every case, on all cores."""
    parts = [
        (case, range(first, min(first + AT_ONCE, logs)))
        for first in range(0, logs, AT_ONCE)
        for case in CASES
    ]
    with ProcessPoolExecutor(
        cpu_count(), mp_context=get_context("spawn"), initializer=start_jax
    ) as pool:
        found = pool.map(rank_truths, *zip(*parts, strict=True))
        done: dict[str, list[Ranked]] = {case: [] for case in CASES}
        for (case, part), ranked in zip(parts, found, strict=True):
            done[case].append(ranked)
            print(f"{case}: {part.stop} of {logs} logs", file=sys.stderr, flush=True)
    return {case: _joined(ranked) for case, ranked in done.items()}


def _joined(parts: list[Ranked]) -> Ranked:
    names, *_ = parts[0]
    columns = zip(*(part[1:] for part in parts), strict=True)
    return Ranked(names, *map(np.concatenate, columns))


def table(ranked: dict[str, Ranked]) -> str:
    """Return the table."""
    lines = [f"{'':46}{'logs':>5}{'inside':>8}{'p':>8}{'Holm':>8}"]
    rows = [
        (f"{case:24}{name:22}", r.ranks[:, i])
        for case, r in ranked.items()
        for i, name in enumerate(r.names)
    ]
    p = np.array([chance(ranks) for _, ranks in rows])
    tested = np.isfinite(p)
    corrected = np.full(len(p), np.nan)
    corrected[tested] = holm(p[tested])
    for (name, ranks), one, all_in_all in zip(rows, p, corrected, strict=True):
        told = f"{one:8.3f}{all_in_all:8.3f}" if one == one else "  too few"
        lines.append(f"{name}{len(ranks):5d}{inside(ranks):8.3f}{told}")
    least = np.min(corrected, where=tested, initial=1.0)
    verdict = "not uniform" if least < WRONG else "nothing against uniform"
    lines += [f"smallest of {tested.sum()} tests {least:.3f}: {verdict}", ""]
    lines += [
        f"{case:24}weights reliable in {np.mean(r.reliable):.3f} of the logs; "
        f"effective draws {np.median(r.effective):.0f} (fewest {r.effective.min():.0f})"
        for case, r in ranked.items()
    ]
    return "\n".join(lines)


def keep(ranked: dict[str, Ranked]) -> None:
    """Write every rank to a file."""
    columns = ("case", "log", "unknown", "rank", "reliable")
    rows = (
        (case, log, name, r.ranks[log, i], int(reliable))
        for case, r in ranked.items()
        for log, reliable in enumerate(r.reliable)
        for i, name in enumerate(r.names)
    )
    write_text(RESULTS / "sbc.csv", table_text([columns, *rows]))


def main(logs: int = LOGS) -> None:
    """Rank, print the table, write the figure."""
    start_jax()
    ranked = all_ranks(logs)
    print(table(ranked))
    keep(ranked)
    figure(ranked).savefig(RESULTS / "sbc.png", dpi=150)


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
    drawn = new_figure(11.0, 5.4)
    panels = drawn.subplots(2, 4, sharex=True, sharey=True)
    share = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    for axes, (case, r) in zip(panels.flat, ranked.items(), strict=False):
        wide = band(len(r.ranks))
        axes.fill_between(share, -wide, wide, color=INK, alpha=0.12, linewidth=0)
        for rank in r.ranks.T:
            axes.plot(share, away(rank), color=BLUE, linewidth=1.0)
        quiet(axes)
        titled(axes, case.replace("_", " "))
    for axes in panels.flat[len(ranked) :]:
        axes.set_visible(False)
    for axes in panels[1]:
        axes.set_xlabel("rank of the truth")
    for axes in panels[:, 0]:
        axes.set_ylabel("share below, less expected")
    return drawn


def rank_truths(scene: str, logs: range) -> Ranked:
    """Draw truths, simulate a log of each, and rank the truth by the posterior.

    Args:
        scene: Name of a file in `scenes/`; every uncertain number has a prior.
        logs: Their numbers; each is the seed of all that is random about its log.
    """
    uncertain = read_scene(SCENES / f"{scene}.toml")
    layout, sigma, sensors = planned_layout(uncertain.scene)
    laws = law_names(resolve_laws(uncertain.scene, layout))
    uncertain = with_laws(uncertain, laws)
    parameters = parameters_of(uncertain)

    @eqx.filter_jit
    def simulated(key):
        of_truth, of_errors = jax.random.split(key)
        # every prior is normal in its coordinate
        z = jax.random.normal(of_truth, (len(parameters.names),))
        read = observe(of_errors, parameters.scene_at(z), layout, laws, sigma)
        return jnp.stack([*parameters.values(z).values()]), read

    rows = []
    for seed in logs:
        truth, read = map(np.asarray, simulated(jax.random.key(seed)))
        log = written(uncertain.scene, layout, read, np.asarray(sigma), sensors)
        rows.append(_ranks(log, uncertain, truth, seed))
    return Ranked(parameters.names, *map(np.array, zip(*rows, strict=True)))


def _ranks(
    log: Observations,
    uncertain: UncertainScene,
    truth: Float[np.ndarray, " name"],
    seed: int,
):
    """Return one row of `Ranked`."""
    _, draws = solve(density_of(log, uncertain), seed)
    return (
        np.sum(draws.values[draws.resampled(DRAWS, seed)] < truth, axis=0),
        draws.reliable,
        draws.effective,
    )


if __name__ == "__main__":
    run_part({"ranks": lambda: main(*map(int, sys.argv[1:]))})
