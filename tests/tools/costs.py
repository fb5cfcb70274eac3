"""What tests cost a processor: compilation first of all, which belongs to who asks.

    python -m pytest -p tests.tools.costs --costs=FILE ...  # in one process, cold
    python tests/tools/costs.py FILE [FILE]                 # by room, before and after

As a plugin it appends a line for each test: seconds of processor time, with those of
processes that it started, and its name. What is busy beside it moves these seconds far
less than those of a clock. The first test to ask for a program pays for it, so compare
files or rooms, each run from an empty `.jax_cache`.
"""

import os
import sys
from collections import defaultdict
from pathlib import Path


def used() -> float:
    """Return the processor time of this process and of those it waited for [s]."""
    return sum(os.times()[:4])


def pytest_addoption(parser) -> None:
    parser.addoption("--costs", type=Path, metavar="FILE", help="append costs there")


def pytest_configure(config) -> None:
    file = config.getoption("--costs")
    if file:
        config.pluginmanager.register(Costs(file), "costs-report")


class Costs:
    """Notes what each test used, from the end of the one before to its own.

    Attributes:
        file: Where to.
        last: Processor time until then [s].
    """

    def __init__(self, file: Path):
        self.file, self.last = file, 0.0

    def pytest_collection_finish(self) -> None:
        self._note("collecting")

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self._note(nodeid)

    def _note(self, name: str) -> None:
        now = used()
        with self.file.open("a", encoding="utf-8") as file:
            file.write(f"{now - self.last:.3f}\t{name}\n")
        self.last = now


def by_room(lines: list[str]) -> defaultdict[str, float]:
    """Add up the seconds of each room; tests of none count together."""
    seconds: defaultdict[str, float] = defaultdict(float)
    for line in lines:
        cost, name = line.split("\t", 1)
        file = name.partition("::")[0]
        folder, _, rest = file.removeprefix("tests/").partition("/")
        room = folder if rest else "tests/*.py"
        seconds["collecting" if name == "collecting" else room] += float(cost)
    return seconds


def main(files: list[str]) -> None:
    """Print a table, a column for each file."""
    runs = [by_room(Path(f).read_text(encoding="utf-8").splitlines()) for f in files]
    rooms = sorted(set().union(*runs), key=lambda room: -runs[0][room])
    for room in rooms:
        row = "".join(f"{run[room]:8.1f}" for run in runs)
        sys.stdout.write(f"{row}  {room}\n")
    row = "".join(f"{sum(run.values()):8.1f}" for run in runs)
    sys.stdout.write(f"{row}  in all [s]\n")


if __name__ == "__main__":
    main(sys.argv[1:]) if sys.argv[1:] else sys.exit(__doc__)
