"""Is it as fast as it was? Benchmarks of two trees in turn, by processor time.

    python -m calibration.benchmarks_before TREE [--rounds 3] [--name laws fit_many ...]

TREE is a checkout of an earlier commit (`git worktree add TREE COMMIT`); both run with
this Python and its packages. Each benchmark runs in a process of its own, the one tree
after the other, so many rounds; their clock is the processor's, all cores together, so
that what else runs on the machine counts little: rates are those of a second of one
core. Of each row the best round counts. Beside the ratio stands what the rounds of the
earlier tree alone leave open: their best over their second best. Rounds that have ended
are kept in a file and not run again.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from statistics import median

from jblast.files import write_text

HERE = Path(__file__).parents[1]
RESULT = HERE / "calibration" / "results" / "benchmarks_before.txt"
NAMES = ("laws", "fit_many", "flights", "events", "euler")
BY_PROCESSOR = (
    "import runpy, sys, time; time.perf_counter = time.process_time;"
    "runpy.run_module('calibration.benchmarks', run_name='__main__')"
)
COLUMNS = {
    "laws": {"float64": 0, "float32": 1},
    "fit_many": {"": 0},
    "flights": {"": 2},
    "events": {"": 0},
    "euler": {"": 0},
}
"""Which numbers of a row are rates, and what tells them apart."""
COUNTED = {
    "fit_many": r"fits/s(?!.*scipy)",
    "flights": r"JAX float",
    "events": r"copied|composited|converted|grey",
    "euler": r"cell-steps/s",
    "laws": r"arrival|pressure",
}
"""Words of the rows that have rates."""
NUMBER = re.compile(r"(?<=\s)\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?=[\s%]|$)")
NEAR = 0.05


def main() -> None:
    """Run what is missing, print the table and keep it."""
    parser = argparse.ArgumentParser(description="Compare the speed of two trees.")
    parser.add_argument("tree", type=Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--name", nargs="*", default=NAMES)
    parser.add_argument("--kept", type=Path, default=Path("out/benchmarks_before.json"))
    parser.add_argument("--out", type=Path, default=RESULT)
    asked = parser.parse_args()
    asked.kept.parent.mkdir(parents=True, exist_ok=True)
    kept = json.loads(asked.kept.read_text()) if asked.kept.exists() else {}
    for turn in range(asked.rounds):
        for name in asked.name:
            for which, tree in (("before", asked.tree), ("now", HERE)):
                key = f"{name} {which} {turn}"
                if key not in kept:
                    kept[key] = run(tree, name)
                    write_text(asked.kept, json.dumps(kept))
    text = table(kept, commit(asked.tree), commit(HERE))
    write_text(asked.out, text)
    sys.stdout.write(text)


def run(tree: Path, name: str) -> str:
    """Return what a tree's benchmark prints."""
    command = [sys.executable, "-c", BY_PROCESSOR, name]
    env = os.environ | {"PYTHONPATH": str(tree.resolve())}
    done = subprocess.run(command, cwd=tree, env=env, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return done.stdout


def commit(tree: Path) -> str:
    """Return a tree's commit and its day; of a copy without them its name."""
    command = ["git", "log", "-1", "--format=%h of %as"]
    run = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    return run.stdout.strip() or tree.resolve().name


def rates(name: str, printed: str) -> dict[str, float]:
    """Return the rates that a benchmark printed, by row."""
    found, under = {}, ""
    for line in printed.splitlines():
        label = re.split(r"\s{2,}(?=\d)", line.strip())[0]
        rest = line.strip().removeprefix(label)
        numbers = [float(n.replace(",", "")) for n in NUMBER.findall(rest)]
        if not numbers:
            under = f"{label}: " if line.endswith(("form", "random")) else under
        if not re.match(COUNTED[name], label):
            continue
        for which, column in COLUMNS[name].items():
            if column < len(numbers):
                found[f"{under}{label} {which}".strip()] = numbers[column]
    return found


def table(kept: dict[str, str], before: str, now: str) -> str:
    """Return the best rates of both trees, and their ratio."""
    text = f"Benchmarks of {before} (before) and of {now} (now): rates of a second\n"
    text += (
        "of one core, the best of the rounds; spread: before, best over second best\n"
    )
    for name in NAMES:
        runs = {
            which: [
                rates(name, text) for key, text in kept.items() if key.startswith(start)
            ]
            for which in ("before", "now")
            for start in (f"{name} {which} ",)
        }
        if not all(runs.values()):
            continue
        rounds = min(len(some) for some in runs.values())
        text += f"\n{name}, {rounds} rounds{'':34s}before        now  ratio  spread\n"
        ratios = []
        for row in runs["before"][0]:
            if not all(row in one for some in runs.values() for one in some):
                continue
            old, new = (
                sorted((one[row] for one in runs[which]), reverse=True)
                for which in ("before", "now")
            )
            ratios.append(new[0] / old[0])
            spread = old[0] / old[min(1, len(old) - 1)]
            text += f"{row:48s}{old[0]:11.3g}{new[0]:11.3g}"
            text += f"{ratios[-1]:7.2f}{spread:8.2f}\n"
        slower = sum(ratio < 1.0 - NEAR for ratio in ratios)
        text += f"median {median(ratios):.2f}; {slower} of {len(ratios)} rows slower "
        text += f"by more than {100 * NEAR:g} %\n"
    return text


if __name__ == "__main__":
    main()
