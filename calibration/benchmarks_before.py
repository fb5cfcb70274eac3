"""Is it as fast as it was? Benchmarks of two trees in turn, by processor time.

    python -m calibration.benchmarks_before TREE [--rounds 2] [--name laws] [--note ...]

TREE is a checkout of an earlier commit (`git worktree add TREE COMMIT`); both run with
this Python and its packages. A benchmark runs in two processes at once, one a tree, and
each stretch that it times runs while the other process waits: first a call of the one,
then the same call of the other. Their clock is the processor's, all cores together:
rates are those of a second of one core. Of each row the best round counts; beside the
ratio stands what the rounds of the earlier tree alone leave open: their best over their
second best. Rounds that have ended are kept in a file and not run again.

    python calibration/benchmarks_before.py timed NAME TURN DONE

is one of the two processes, with its tree on PYTHONPATH. TURN and DONE are file
descriptors: where a benchmark reads its clock for the first time a byte is written to
DONE and one is read from TURN; where it reads it again, a byte is written to DONE. For
a tree without this benchmark the one beside this file runs, on the tree's package.
"""

import argparse
import contextlib
import importlib.util
import itertools
import json
import os
import re
import runpy
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median

HERE = Path(__file__).parents[1]
RESULT = HERE / "calibration" / "results" / "benchmarks_before.txt"
NAMES = ("laws", "fit_many", "flights", "events", "picks")
COLUMNS = {
    "laws": {"float64": 0, "float32": 1},
    "fit_many": {"": 0},
    "flights": {"": 2},
    "events": {"": 0},
    "picks": {"": 0},
}
"""Which numbers of a row are rates, and what tells them apart."""
COUNTED = {
    "fit_many": r"fits/s(?!.*scipy)",
    "flights": r"JAX float",
    "events": r"copied|composited|converted|grey",
    "laws": r"arrival|pressure",
    "picks": r"records/s",
}
"""Words of the rows that have rates."""
NUMBER = re.compile(r"(?<=\s)\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?=[\s%]|$)")
NEAR = 0.05


def main() -> None:
    """Run what is missing, print the table and keep it."""
    parser = argparse.ArgumentParser(description="Compare the speed of two trees.")
    parser.add_argument("tree", type=Path)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--name", nargs="*", default=NAMES)
    parser.add_argument("--kept", type=Path, default=Path("out/benchmarks_before.json"))
    parser.add_argument("--out", type=Path, default=RESULT)
    parser.add_argument("--note", default="", help="said below: where each was run")
    asked = parser.parse_args()
    asked.kept.parent.mkdir(parents=True, exist_ok=True)
    kept = json.loads(asked.kept.read_text()) if asked.kept.exists() else {}
    for turn in range(asked.rounds):
        for name in asked.name:
            keys = [f"{name} {which} {turn}" for which in ("before", "now")]
            if not all(key in kept for key in keys):
                kept |= zip(keys, in_turns((asked.tree, HERE), name), strict=True)
                asked.kept.write_text(json.dumps(kept))
    text = table(kept, commit(asked.tree), commit(HERE))
    text += f"\n{asked.note}\n" if asked.note else ""
    asked.out.write_text(text)
    sys.stdout.write(text)


def in_turns(trees: Sequence[Path], name: str) -> list[str]:
    """Return what the benchmark of each tree prints, timed calls in turn."""
    with contextlib.ExitStack() as stack:
        runs = [stack.enter_context(Run(tree, name)) for tree in trees]
        turns = itertools.cycle(runs)
        # each is waited for: none compiles while another is timed
        while waiting := [one for one in runs if one.waits()]:
            next(one for one in turns if one in waiting).take_turn()
        return [one.printed() for one in runs]


class Run(contextlib.AbstractContextManager["Run"]):
    """A benchmark of a tree in a process of its own, which asks before it is timed."""

    def __init__(self, tree: Path, name: str):
        theirs, self._turn = os.pipe()
        self._done, done = os.pipe()
        self._output = tempfile.TemporaryFile("w+")  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, __file__, "timed", name, str(theirs), str(done)],
            cwd=tree,
            env=os.environ | {"PYTHONPATH": path_with(tree)},
            stdout=self._output,
            stderr=subprocess.STDOUT,
            text=True,
            pass_fds=(theirs, done),
        )
        os.close(theirs)
        os.close(done)
        self._is_waiting = False

    def waits(self) -> bool:
        """Whether it waits for its turn, once it does or has ended."""
        if not self._is_waiting:
            self._is_waiting = bool(os.read(self._done, 1))
        return self._is_waiting

    def take_turn(self) -> None:
        """Let it make the call that is timed."""
        os.write(self._turn, b".")
        os.read(self._done, 1)
        self._is_waiting = False

    def printed(self) -> str:
        """Return what it printed."""
        failed = self._process.wait()
        self._output.seek(0)
        printed = self._output.read()
        if failed:
            raise RuntimeError(printed.strip().splitlines()[-1])
        return printed

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self._output.close()
        os.close(self._turn)
        os.close(self._done)


def path_with(tree: Path) -> str:
    """Return where Python looks for modules: in a tree first, else as here."""
    here = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return os.pathsep.join([str(tree.resolve()), *filter(None, here)])


def taking_turns(turn: int, done: int) -> Callable[[], float]:
    """Return a clock [s]; the first, third ... time it is read it waits for its turn.

    Args:
        turn: File descriptor of the bytes that give this process its turn.
        done: File descriptor that gets a byte when it waits, and when it has ended.
    """
    is_ours = False

    def now() -> float:
        nonlocal is_ours
        caller = os.path.basename(sys._getframe(1).f_code.co_filename)
        if not (caller.startswith("benchmark_") or caller == "timing.py"):
            return time.process_time()
        is_ours = not is_ours
        if not is_ours:
            end = time.process_time()
            os.write(done, b".")
            return end
        os.write(done, b".")
        os.read(turn, 1)
        return time.process_time()

    return now


def run_timed(name: str, turn: str, done: str) -> None:
    """Run a benchmark by such a clock."""
    sys.path.pop(0)
    time.perf_counter = taking_turns(int(turn), int(done))
    sys.argv = ["benchmarks", name]
    if importlib.util.find_spec(f"calibration.benchmark_{name}"):
        runpy.run_module("calibration.benchmarks", run_name="__main__")
    else:
        mine = Path(__file__).with_name(f"benchmark_{name}.py")
        runpy.run_path(str(mine), run_name="__main__")


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
    run_timed(*sys.argv[2:]) if sys.argv[1:2] == ["timed"] else main()
