"""Compile well or compile quickly: what each costs a fit, and what it changes.

    python -m calibration.compiling [--out DIR]

XLA can be asked for little optimisation (`jblast.cli.jax_start`, `quick`). Each way
runs in a process of its own with an empty cache: a fit of a new log, the same log
again, and a walk over it (emcee), which computes for long. Prints a table and draws
what is waited for, against how often the work is repeated. Nothing but the rounding
may differ.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jblast.inference.fitting.uncertainty import Method

DATA = Path(__file__).parent / "data"
LOG = "hta_1"
WAYS = {"optimised": False, "quick": True}


WORK: "tuple[tuple[str, Method], ...]" = (
    ("first fit", "laplace"),
    ("second fit", "laplace"),
    ("first walk", "emcee"),
    ("second walk", "emcee"),
)


def measured() -> dict[str, float]:
    """Time what a way is asked, in this process."""
    from jblast.inference import fit
    from jblast.observations import read
    from jblast.scene import read_scene

    log, scene = read(DATA / f"{LOG}.csv"), read_scene(DATA / f"{LOG}.toml")
    seconds = {}
    for name, posterior in WORK:
        begun = time.perf_counter()
        answer = fit(log, scene, posterior=posterior).summary
        seconds[name] = time.perf_counter() - begun
        if name == "first fit":
            seconds["kg"] = answer.estimates["charge_mass_kg"].value
    return seconds


def of_way(name: str) -> dict[str, float]:
    """Time a way in a process of its own, its cache empty."""
    with tempfile.TemporaryDirectory() as cache:
        run = subprocess.run(
            [sys.executable, "-m", "calibration.compiling", "--way", name],
            env={**os.environ, "XDG_CACHE_HOME": cache},
            check=True,
            capture_output=True,
            text=True,
        )
    return json.loads(run.stdout)


def text_of(found: dict[str, dict[str, float]]) -> str:
    """Put the ways side by side."""
    columns = [name for name in found["quick"] if name != "kg"]
    lines = [f"{'seconds':12s}" + "".join(f"{name:>14s}" for name in columns)]
    for way, seconds in found.items():
        row = "".join(f"{seconds[name]:14.2f}" for name in columns)
        lines.append(f"{way:12s}{row}")
    apart = found["quick"]["kg"] / found["optimised"]["kg"] - 1.0
    lines.append(f"charge mass, quick against optimised: {apart:+.1e}")
    return "\n".join(lines) + "\n"


def figure_of(found: dict[str, dict[str, float]], file: Path) -> None:
    """Draw seconds waited against how often the work is repeated."""
    import matplotlib.pyplot as plt
    import numpy as np

    from jblast.report.figure_style import BLUE, VERMILLION, quiet, titled

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), dpi=150, layout="constrained")
    for axis, work in zip(axes, ("fit", "walk"), strict=True):
        times = np.arange(1, 61 if work == "fit" else 13)
        for colour, (way, seconds) in zip(
            (VERMILLION, BLUE), found.items(), strict=True
        ):
            first, second = seconds[f"first {work}"], seconds[f"second {work}"]
            waited = first + second * (times - 1)
            axis.plot(times, waited, color=colour, label=f"compiled {way}")
        axis.set_xlabel(f"{work}s of one layout in one process")
        axis.set_ylabel("seconds waited")
        axis.set_ylim(bottom=0)
        titled(axis, "A normal approximation" if work == "fit" else "Walkers (emcee)")
        quiet(axis)
    axes[0].legend(frameon=False)
    figure.savefig(file)


def main() -> None:
    """Measure both ways, print the table, and draw it."""
    options = argparse.ArgumentParser(description="Compile well, or quickly?")
    options.add_argument("--out", type=Path, help="folder of the table and the figure")
    options.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    asked = options.parse_args()
    if asked.way:
        from jblast.cli.jax_start import start_jax

        start_jax(quick=WAYS[asked.way])
        print(json.dumps(measured()))
        return
    found = {name: of_way(name) for name in WAYS}
    text = text_of(found)
    print(text, end="")
    if asked.out:
        asked.out.mkdir(parents=True, exist_ok=True)
        (asked.out / "compiling.txt").write_text(text)
        figure_of(found, asked.out / "compiling.png")


if __name__ == "__main__":
    main()
