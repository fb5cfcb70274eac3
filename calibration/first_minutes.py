"""How long a newcomer waits: set-up, `make fit` and `make test` on a fresh clone.

    python3 calibration/first_minutes.py [--slow] [--out FILE]

Needs git and make alone, and a network. Clones the last commit into an empty folder and
runs there with empty caches, as on a machine that has never seen the project; prints
seconds and J, how long `import jax` takes (tests/tools/import_time.py): machines differ
threefold. The second runs of the Python of the README and of the same fit by the
command compare the library with the command. With `--slow` the slow tests as well.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
ANSWERED = "Reports and figures"
"""Begins the line that `make fit` prints after its last answer."""
CACHES = ("XDG_CACHE_HOME", "UV_CACHE_DIR", "PIP_CACHE_DIR")


class Clone:
    """A fresh clone, whose home and caches are empty folders."""

    def __init__(self, folder: Path):
        self.tree = folder / "jblast"
        cache = folder / "cache"
        own = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
        self.env = own | {"HOME": str(folder)} | dict.fromkeys(CACHES, str(cache))
        command = ["git", "clone", "--quiet", str(ROOT), str(self.tree)]
        subprocess.run(command, check=True)

    def make(self, target: str) -> tuple[float, float, str]:
        """Run a target.

        Returns:
            Seconds until it had answered (`ANSWERED`) and in all, and its last line.
        """
        begun = time.perf_counter()
        answered, last = 0.0, ""
        run = subprocess.Popen(
            ["make", target, f"PYTHON={sys.executable}"],
            cwd=self.tree,
            env=self.env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert run.stdout is not None
        for line in run.stdout:
            if line.startswith(ANSWERED):
                answered = time.perf_counter() - begun
            last = line.strip() or last
        if run.wait():
            print(f"make {target} failed: {last}")
        whole = time.perf_counter() - begun
        return answered or whole, whole, last

    def timed(self, *words: str) -> float:
        """Return the time of the second of two runs of a program of `.venv` [s]."""
        command = [str(self.tree / ".venv/bin" / words[0]), *words[1:]]
        seconds = 0.0
        for _ in range(2):
            begun = time.perf_counter()
            subprocess.run(
                command, cwd=self.tree, env=self.env, check=True, capture_output=True
            )
            seconds = time.perf_counter() - begun
        return seconds

    def import_time(self) -> float:
        """Return J [s]."""
        run = subprocess.run(
            [".venv/bin/python", "tests/tools/import_time.py"],
            cwd=self.tree,
            env=self.env,
            check=True,
            capture_output=True,
            text=True,
        )
        return float(run.stdout)


def main() -> None:
    """Measure, and print a table."""
    options = argparse.ArgumentParser(description="Time a newcomer's wait.")
    options.add_argument("--slow", action="store_true", help="the slow tests as well")
    options.add_argument("--out", type=Path, help="write the table here too")
    asked = options.parse_args()
    rows: list[tuple[str, float, int]] = []
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
        clone = Clone(Path(one))
        set_up = clone.make(".venv/run")[1]
        rows.append(("set-up of `make fit`", set_up, 0))
        answered, whole, _ = clone.make("fit")
        rows.append(("first `make fit`, to the answer", set_up + answered, 100))
        rows.append(("first `make fit`, with its reports", set_up + whole, 0))
        answered, whole, _ = clone.make("fit")
        rows.append(("second `make fit`, to the answer", answered, 0))
        rows.append(("second `make fit`, with its reports", whole, 30))
        unit = clone.import_time()
        data = "calibration/data/hta_1"
        fitted = clone.timed("jblast", "fit", f"{data}.csv", "--scene", f"{data}.toml")
        rows.append(("second `jblast fit` of the log of the README", fitted, 0))
        readme = (clone.tree / "README.md").read_text()
        python = re.findall(r"^```python\n(.*?)^```", readme, re.M | re.S)[0]
        called = clone.timed("python", "-c", python)
        rows.append(
            ("second run of the README's Python", called, round(1.5 * fitted / unit))
        )
        clone = Clone(Path(two))
        _, seconds, last = clone.make("test")
        rows.append((f"first `make test`: {last.strip('= ')}", seconds, 400))
        _, seconds, last = clone.make("test")
        rows.append((f"second `make test`: {last.strip('= ')}", seconds, 250))
        if asked.slow:
            _, seconds, last = clone.make("test-slow")
            rows.append((f"`make test-slow`: {last.strip('= ')}", seconds, 1200))
    lines = [
        f"J = {unit:.2f} s, {os.cpu_count()} cores; a fresh clone, empty caches",
        "",
    ]
    lines += [f"{'':>8s}  {'J':>6s}  {'asked':>6s}"]
    for what, seconds, bound in rows:
        wanted = f"{bound:d}" if bound else ""
        lines.append(f"{seconds:6.0f} s  {seconds / unit:6.0f}  {wanted:>6s}  {what}")
    text = "\n".join(lines) + "\n"
    print(text, end="")
    if asked.out:
        asked.out.write_text(text)


if __name__ == "__main__":
    main()
