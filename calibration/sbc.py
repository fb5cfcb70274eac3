"""Is a 90 % interval right for 90 % of blasts? Six cases, 500 logs each.

    python -m calibration.sbc [LOGS] > calibration/results/sbc.txt

Truths are drawn from the priors of each file in `calibration/scenes/`, a log of each is
simulated with the errors `jblast fit` assumes (Student-t, and what the laws scatter),
and the truth is ranked among draws of the posterior (`sbc_logs.py` has the theory): of
emcee for every log, of Laplace's approximation where its diagnostic let it answer.
Log i has seed i. If intervals are right, ranks are uniform: that is tested by
chi-squared in 20 bins (10 for few logs), for each unknown of each case, with Holm's
correction over all. "inside" is the share of truths inside the 90 % interval. Writes
calibration/results/sbc.png and sbc.csv (every rank).
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.stats import chisquare

from calibration.sbc_figure import figure
from calibration.sbc_logs import DRAWS, Ranked, rank_truths
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.words import comma_separated

CASES = (
    "arrivals",
    "flash_and_air",
    "four_microphones",
    "impulse_and_duration",
    "pressure",
    "burial",
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
    """Return both tables, of emcee and of Laplace's approximation."""
    lines = []
    for title, ranks_of in (
        ("emcee", lambda r: r.emcee),
        ("Laplace, where its diagnostic let it answer", lambda r: r.laplace[r.holds]),
    ):
        lines += [title, f"{'':46}{'logs':>5}{'inside':>8}{'p':>8}{'Holm':>8}"]
        rows = [
            (f"{case:24}{name:22}", ranks_of(r)[:, i])
            for case, r in ranked.items()
            for i, name in enumerate(r.names)
        ]
        p = np.array([chance(ranks) for _, ranks in rows])
        tested = np.isfinite(p)
        corrected = np.full(len(p), np.nan)
        corrected[tested] = holm(p[tested])
        for (name, ranks), one, all_in_all in zip(rows, p, corrected, strict=True):
            if not len(ranks):
                continue
            told = f"{one:8.3f}{all_in_all:8.3f}" if one == one else "  too few"
            lines.append(f"{name}{len(ranks):5d}{inside(ranks):8.3f}{told}")
        least = np.min(corrected, where=tested, initial=1.0)
        verdict = "not uniform" if least < WRONG else "nothing against uniform"
        lines += [f"smallest of {tested.sum()} tests {least:.3f}: {verdict}", ""]
    for case, r in ranked.items():
        lines.append(
            f"{case:24}{np.mean(r.converged):.3f} of the walks reached their "
            f"precision; steps {np.median(r.steps):.0f} (most {r.steps.max()}), "
            f"autocorrelation time {np.median(r.tau):.0f} (longest {r.tau.max():.0f})"
        )
    return "\n".join(lines)


def keep(ranked: dict[str, Ranked]) -> None:
    """Write every rank to a file."""
    columns = ("case", "log", "unknown", "emcee", "laplace", "laplace_holds")
    rows = (
        (case, log, name, r.emcee[log, i], r.laplace[log, i], int(holds))
        for case, r in ranked.items()
        for log, holds in enumerate(r.holds)
        for i, name in enumerate(r.names)
    )
    write_text(RESULTS / "sbc.csv", comma_separated([columns, *rows]))


def main(logs: int = LOGS) -> None:
    """Rank, print the tables, write the figure."""
    start_jax()
    ranked = all_ranks(logs)
    print(table(ranked))
    keep(ranked)
    figure(ranked).savefig(RESULTS / "sbc.png", dpi=150)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
