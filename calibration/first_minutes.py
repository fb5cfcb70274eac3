"""How long a newcomer waits: set-up, `make fit` and `make test` on a fresh clone.

    python3 calibration/first_minutes.py > calibration/results/first_minutes.txt

Needs git and make alone, and a network. Clones the last commit into an empty folder and
runs there with empty caches, as on a machine that has never seen the project; prints
seconds and J, how long `import jax` takes (tests/tools/import_time.py): machines differ
threefold. The second runs of the Python of the README and of the same fit by the
command compare the library with the command.
"""

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

    def run(self, *words: str) -> tuple[float, str]:
        """Return the time of a program of `.venv` [s], and its output."""
        command, begun = [f".venv/bin/{words[0]}", *words[1:]], time.perf_counter()
        options = {"cwd": self.tree, "env": self.env, "check": True}
        done = subprocess.run(command, capture_output=True, text=True, **options)
        return time.perf_counter() - begun, done.stdout

    def second(self, *words: str) -> float:
        """Return the time of the second of two runs [s]."""
        return [self.run(*words)[0] for _ in range(2)][1]


def main() -> None:
    """Measure, and print a table."""
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
        unit = float(clone.run("python", "tests/tools/import_time.py")[1])
        data = "calibration/data/hta_1"
        fitted = clone.second("jblast", "fit", f"{data}.csv", "--scene", f"{data}.toml")
        rows.append(("second `jblast fit` of the log of the README", fitted, 0))
        readme = (clone.tree / "README.md").read_text()
        python = re.findall(r"^```python\n(.*?)^```", readme, re.M | re.S)[0]
        called = clone.second("python", "-c", python)
        rows.append(
            ("second run of the README's Python", called, round(1.5 * fitted / unit))
        )
        clone = Clone(Path(two))
        _, seconds, last = clone.make("test")
        rows.append((f"first `make test`: {last.strip('= ')}", seconds, 400))
        _, seconds, last = clone.make("test")
        rows.append((f"second `make test`: {last.strip('= ')}", seconds, 250))
    lines = [
        f"J = {unit:.2f} s, {os.cpu_count()} cores; a fresh clone, empty caches",
        "",
    ]
    lines += [f"{'':>8s}  {'J':>6s}  {'asked':>6s}"]
    for what, seconds, bound in rows:
        wanted = f"{bound:d}" if bound else ""
        lines.append(f"{seconds:6.0f} s  {seconds / unit:6.0f}  {wanted:>6s}  {what}")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
