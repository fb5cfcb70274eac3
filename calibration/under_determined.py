"""Do logs that leave something open end with exit code 4 and a sentence?

    python -m calibration.under_determined [--logs 1000] [--workers 2]

fits so many random logs (`calibration.under_determined_logs`). A worker takes all logs
of a kind, since they share its programs, and writes a line as each ends; begun again,
it goes on with those that are missing. When all have ended the table is written to
calibration/results/under_determined.txt.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration.under_determined_logs import KINDS, ended, fault, logs
from jblast.cli.jax_start import start_jax
from jblast.files import write_text

RESULT = Path(__file__).parent / "results" / "under_determined.txt"
AS_ASKED = "ok"


def main() -> None:
    """Fit what is missing, by so many processes, and write the table."""
    parser = argparse.ArgumentParser(description="Fit logs that leave something open.")
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--lines", type=Path, default=Path("out/under_determined.csv"))
    parser.add_argument("--out", type=Path, default=RESULT)
    parser.add_argument("--kind", type=int, help="fit this kind alone, here")
    asked = parser.parse_args()
    if asked.kind is not None:
        fit_kind(asked.kind, asked.logs, asked.seed, asked.lines)
        return
    asked.lines.parent.mkdir(parents=True, exist_ok=True)
    for code in side_by_side(asked.workers):
        if code:
            sys.exit(f"a worker ended with exit code {code}; begin again to go on")
    text = table(read(asked.lines), asked.logs, asked.seed)
    write_text(asked.out, text)
    sys.stdout.write(text)


def side_by_side(workers: int) -> list[int]:
    """Fit each kind in a process of its own, so many at a time; return exit codes."""
    waiting, running, codes = list(range(len(KINDS))), [], []
    while waiting or running:
        while waiting and len(running) < workers:
            kind = str(waiting.pop(0))
            command = [sys.executable, "-m", "calibration.under_determined"]
            command += [*sys.argv[1:], "--kind", kind]
            running.append(subprocess.Popen(command))
        time.sleep(0.5)
        codes += [one.returncode for one in running if one.poll() is not None]
        running = [one for one in running if one.poll() is None]
    return codes


def fit_kind(kind: int, count: int, seed: int, lines: Path) -> None:
    """Fit the logs of a kind that have no line yet, and add their lines."""
    start_jax(quick=True)
    done = read(lines)
    for i, (of, made) in enumerate(logs(count, len(KINDS), seed), start=1):
        if KINDS.index(of) != kind or i in done:
            continue
        begun = time.process_time()
        said = fault(ended(made)).replace("\n", " ") or AS_ASKED
        line = f"{i},{time.process_time() - begun:.2f},{said}\n"
        with lines.open("a") as file:
            file.write(line)
        sys.stdout.write(line)
        sys.stdout.flush()


def read(lines: Path) -> dict[int, tuple[float, str]]:
    """Return processor seconds and end of each log that has a line."""
    if not lines.exists():
        return {}
    rows = [line.split(",", 2) for line in lines.read_text().splitlines()]
    return {int(i): (float(seconds), said) for i, seconds, said in rows}


def table(found: dict[int, tuple[float, str]], count: int, seed: int) -> str:
    """Return how many of each kind end as they should, and which do not."""
    numbers = [i for i in range(1, count + 1) if i in found]
    text = "Under-determined logs: how many end with exit code 4 and a sentence\n\n"
    text += "right   of  median s    most  kind\n"
    for k, kind in enumerate(KINDS):
        of_kind = [found[i] for i in numbers if (i - 1) % len(KINDS) == k]
        text += _row(of_kind, str(kind))
    text += _row([found[i] for i in numbers], "all")
    text += f"\nLogs 1 to {count}, seed {seed}; seconds are the processor's, the most\n"
    text += "with the programs of a kind's first log compiled or read.\n"
    wrong = [f"{i}: {found[i][1]}\n" for i in numbers if found[i][1] != AS_ASKED]
    return text + ("\nNot as asked\n" + "".join(wrong) if wrong else "")


def _row(ends: Sequence[tuple[float, str]], name: str) -> str:
    seconds = [end[0] for end in ends] or [np.nan]
    right = sum(said == AS_ASKED for _, said in ends)
    median, most = np.median(seconds), np.max(seconds)
    return f"{right:5d} {len(ends):4d} {median:9.2f} {most:7.1f}  {name}\n"


if __name__ == "__main__":
    main()
