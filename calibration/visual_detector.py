"""How often the visual detector sees a blast, how soon, and how often one that is none.

    python -m calibration.visual_detector [without a blast] [with one] [--workers N]

Beside it stands algorithm 5 in both readings. All see the same sequences of 160 x 120
pixels at 1,000 frames a second (`calibration.flash_trials`): eight kinds of scenes
without a blast in turn, and the renderer's fireballs, half of them smooth balls, half
the explosion that comes with jblast. Thresholds are for so many false alarms an hour of
such scenes, by the tail of the greatest value of each sequence
(`jblast.signals.flash.search`). Written to `results/visual_detector.txt` and `.png`.
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float

from calibration.films import KINDS, SECONDS
from calibration.flash_trials import (
    BALL,
    METHODS,
    OURS,
    PICTURES,
    SOON_S,
    Told,
    asked,
    with_a_blast,
    without_a_blast,
)
from jblast.files import write_text
from jblast.report.colours import BLUE, COLOURS, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, titled, write_figure
from jblast.report.view import aligned
from jblast.signals.flash.search import Tail
from jblast.signals.matched_filter import HOUR_S

RESULTS = Path(__file__).parent / "results"
RATES = (0.1, 1.0, 10.0, 100.0)
"""False alarms an hour."""
LOCAL = ("ego-motion", "lamps", "passing car", "sun glints", "muzzle flashes")
"""Scenes where light does not change all over the image."""
SMALL = (3.0, 4.0, 5.0, 6.0, 8.0)
"""Radii of smaller fireballs that are looked at beside the others [px]."""


def summary(
    greatest: dict[str, np.ndarray], told: list[Told], small: dict
) -> list[str]:
    """Return the table."""
    tails = tails_of(greatest)
    trials = tails[0].trials
    lines = [
        f"{trials:,} sequences of {SECONDS:g} s without a blast, "
        f"{60 * tails[0].hours:.3g} minutes, "
        f"{trials // len(KINDS)} of each of {len(KINDS)} kinds;",
        f"{len(told):,} blasts of 1 to 1,000 kg, 10 to 50 px, half smooth balls, half "
        "pictures; 160 x 120 px, 1,000 frames/s",
        "",
        "Tails of the greatest value of a sequence: nu(h) = nu_u (1 + shape (h - u) / "
        "scale)^(-1/shape);",
        "the greatest counts as passed once in all of it, and beyond it the same scale",
    ]
    rows: list[tuple[str, ...]] = [
        ("method", "u", "scale", "shape", "nu_u [1/h]", "greatest")
    ]
    for method, tail in enumerate(tails):
        top = max(values[method].max() for values in greatest.values())
        rows.append(
            (
                METHODS[method],
                f"{tail.level:.4g}",
                f"{tail.scale:.4g}",
                f"{tail.shape:.3f}",
                f"{tail.per_hour:.4g}",
                f"{top:.4g}",
            )
        )
    lines += [*aligned(rows, right={1, 2, 3, 4, 5}), "", "Greatest value by kind"]
    rows = [("kind", *METHODS)]
    rows += [(k, *(f"{v.max():.4g}" for v in greatest[k])) for k in KINDS]
    lines += [*aligned(rows, right={1, 2, 3}), ""]
    lines.append(
        f"Seen within {1e3 * SOON_S:g} ms of the burst; medians of all seen [ms]"
    )
    head = (
        "false alarms an hour",
        "method",
        "threshold",
        "seen",
        "missed",
        "median",
        "90 %",
    )
    rows = [head]
    for rate in RATES:
        for method, tail in enumerate(tails):
            height = tail.threshold(rate)
            latency = np.array([one.latency(method, height) for one in told])
            soon = latency <= SOON_S
            rows.append(
                (
                    f"{rate:g}",
                    METHODS[method],
                    f"{height:.4g}",
                    f"{soon.mean():.3f}",
                    f"{(~soon).sum()} of {len(told)}",
                    *(
                        _ms(np.quantile(latency, q, method="higher"))
                        for q in (0.5, 0.9)
                    ),
                )
            )
    lines += [*aligned(rows, right={0, 2, 3, 4, 5, 6}), ""]
    lines.append("At one false alarm an hour of " + ", ".join(LOCAL) + " alone")
    rows = [("method", "threshold", "seen")]
    for method, tail in enumerate(tails_of({kind: greatest[kind] for kind in LOCAL})):
        height = tail.threshold(1.0)
        soon = [one.is_seen(method, height) for one in told]
        rows.append((METHODS[method], f"{height:.4g}", f"{np.mean(soon):.3f}"))
    lines += [*aligned(rows, right={1, 2}), ""]
    height = tails[0].threshold(1.0)
    lines.append(f"{OURS} at one false alarm an hour, by charge and by radius")
    rows = [("of", "from", "to", "blasts", "seen", "median [ms]")]
    for shown in (BALL, PICTURES):
        some = [t for t in told if t.shown == shown]
        rows.append((shown, "", "", f"{len(some)}", *_share(some, height)))
    for name, edges in (
        ("charge [kg]", (1, 3, 10, 100, 1000)),
        ("radius [px]", (10, 15, 25, 50)),
    ):
        for low, high in pairwise(edges):
            value = [t.charge_kg if "kg" in name else t.radius_px for t in told]
            some = [t for t, v in zip(told, value, strict=True) if low <= v <= high]
            rows.append(
                (name, f"{low}", f"{high}", f"{len(some)}", *_share(some, height))
            )
    rows += [
        ("radius [px]", f"{r:g}", f"{r:g}", f"{len(few)}", *_share(few, height))
        for r, few in small.items()
    ]
    return [*lines, *aligned(rows, right={1, 2, 3, 4, 5})]


def fitted_tail(
    greatest: Float[np.ndarray, " trial"], seconds: float, share: float = 0.05
) -> Tail:
    """Return the tail of the largest statistics of sequences without a blast.

    The Pareto shape is that of L-moments (Hosking and Wallis 1987, eq. 9). A shape
    below 0 is set to 0, since it would give the tail an upper bound.

    Args:
        greatest: Largest statistic of each sequence.
        seconds: Length of each [s].
        share: Share of the sequences in the tail.
    """
    ordered = np.sort(greatest)
    count = max(round(share * len(ordered)), 8)
    level = float(ordered[-count - 1])
    excess = ordered[-count:] - level
    # most sequences have no evidence at all: values equal to the level are no excess
    if excess.max() > 0.0:
        excess = excess[excess > 0.0]
        count = len(excess)
    mean = float(excess.mean())
    # plotting positions of Hosking and Wallis, (i - 0.35) / n
    weights = (np.arange(count) + 0.65) / count
    second = float((excess * (1.0 - weights)).mean())
    shape = -(mean / (mean - 2.0 * second) - 2.0) if mean > 2.0 * second else 0.0
    shape = max(shape, 0.0)
    scale = mean * (1.0 - shape) if shape < 1.0 else mean
    hours = len(ordered) * seconds / HOUR_S
    rate, largest = count / hours, float(ordered[-1])
    return Tail(level, scale, shape, rate, len(ordered), hours, largest)


def tails_of(greatest: dict[str, np.ndarray]) -> list[Tail]:
    """Return the tail of each method over all kinds."""
    whole = np.concatenate(list(greatest.values()), axis=1)
    return [fitted_tail(values, SECONDS) for values in whole]


def _share(some: list[Told], height: float) -> tuple[str, str]:
    """Return the share that is seen, and the median of how long it takes."""
    if not some:
        return "-", "-"
    latency = [one.latency(0, height) for one in some]
    seen = np.mean(np.array(latency) <= SOON_S)
    return f"{seen:.3f}", _ms(np.quantile(latency, 0.5, method="higher"))


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.1f}" if np.isfinite(seconds) else "never"


def drawn(greatest: dict[str, np.ndarray], told: list[Told], small: dict):
    """Draw how much is seen at how many false alarms, how soon, and how small."""
    figure = new_figure(11.0, 3.8)
    rates, soon, size = figure.subplots(1, 3)
    tails = tails_of(greatest)
    asked = np.geomspace(0.01, 1e4, 61)
    for method, colour in enumerate((BLUE, VERMILLION, MUTED)):
        share = [
            np.mean([one.is_seen(method, h) for one in told])
            for h in (tails[method].threshold(rate) for rate in asked)
        ]
        rates.semilogx(asked, share, color=colour, label=METHODS[method])
        height = tails[method].threshold(1.0)
        latency = np.sort([one.latency(method, height) for one in told])
        soon.plot(1e3 * latency, np.arange(1, len(told) + 1) / len(told), color=colour)
    height = tails[0].threshold(1.0)
    for shown, colour in zip((BALL, PICTURES), COLOURS[-2:], strict=True):
        latency = np.sort([t.latency(0, height) for t in told if t.shown == shown])
        share = np.arange(1, len(latency) + 1) / max(len(latency), 1)
        soon.plot(1e3 * latency, share, "--", color=colour, label=shown)
    soon.legend(frameon=False, fontsize=8, loc="lower right")
    counted_from = 1.0 / tails[0].hours
    rates.axvline(counted_from, color=MUTED, linewidth=0.8, linestyle=":")
    rates.set(
        xlabel="false alarms an hour", ylabel="seen within 20 ms", ylim=(-0.02, 1.02)
    )
    rates.legend(frameon=False, fontsize=8, loc="center left")
    titled(rates, "left of the dots by the tail")
    soon.axvline(1e3 * SOON_S, color=MUTED, linewidth=0.8, linestyle="--")
    soon.set(
        xlabel="since the first light [ms]",
        ylabel="share seen",
        xlim=(0, 40),
        ylim=(-0.02, 1.02),
    )
    titled(soon, "at one false alarm an hour")
    height = tails[0].threshold(1.0)
    radius = np.array([one.radius_px for one in told])
    seen = np.array([one.is_seen(0, height) for one in told])
    edges = np.array([10, 15, 22, 33, 50.001])
    which = np.digitize(radius, edges)
    points = [
        (r, np.mean([t.is_seen(0, height) for t in few])) for r, few in small.items()
    ]
    points += [
        (float(np.sqrt(a * b)), float(seen[which == i].mean()))
        for i, (a, b) in enumerate(pairwise(edges), 1)
        if (which == i).any()
    ]
    size.semilogx(*zip(*points, strict=True), "o-", color=BLUE, ms=4)
    size.axvline(10.0, color=MUTED, linewidth=0.8, linestyle="--")
    size.set(
        xlabel="radius of the fireball [px]",
        ylabel="seen within 20 ms",
        ylim=(-0.02, 1.02),
    )
    size.set_xticks([3, 5, 10, 20, 40], ["3", "5", "10", "20", "40"], minor=False)
    size.minorticks_off()
    titled(size, f"{OURS}, one an hour")
    for axes in (rates, soon, size):
        quiet(axes)
    return figure


def main() -> None:
    """Run all of it; print and keep the table and the picture."""
    how = asked(__doc__)
    few = range(50_000, 50_000 + max(how.blasts // 100, 1))
    trials = [(seed, None) for seed in range(how.blasts)]
    trials += [(seed, radius) for radius in SMALL for seed in few]
    said = with_a_blast(trials, how.workers)
    told, rest = said[: how.blasts], iter(said[how.blasts :])
    small = {radius: [next(rest) for _ in few] for radius in SMALL}
    greatest = without_a_blast(how.without, how.workers)
    text = "\n".join(summary(greatest, told, small)) + "\n"
    sys.stdout.write(text)
    write_text(RESULTS / "visual_detector.txt", text)
    write_figure(drawn(greatest, told, small), RESULTS / "visual_detector.png")


if __name__ == "__main__":
    main()
