"""How long tests take, and how to end in time.

A plugin of pytest: prints the ten slowest tests in J (`import_time.py`), and with
`--until` begins none after that moment: it names those it left out. With `--order` each
file comes first some time.
"""

import os
import time
from collections import defaultdict
from hashlib import sha256
from pathlib import Path

import pytest

from tests.tools.import_time import import_time

SLOWEST = 10
LEFT_OUT = "no time left"


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("minutes")
    group.addoption(
        "--until",
        type=float,
        metavar="EPOCH",
        help="begin no test after this moment (seconds since 1970), and name the rest",
    )
    group.addoption(
        "--first",
        default="",
        metavar="PATHS",
        help="files or folders whose tests come first, with spaces between",
    )
    group.addoption(
        "--order",
        default="",
        metavar="WORD",
        help="files of each of both groups in an order that follows from this word",
    )


def pytest_configure(config: pytest.Config) -> None:
    # one for the controller; workers only skip
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Minutes(config), "minutes-report")


def pytest_collection_modifyitems(config: pytest.Config, items: list) -> None:
    first = [Path(path).resolve() for path in str(config.getoption("--first")).split()]
    order = str(config.getoption("--order"))

    def place(item: pytest.Item) -> tuple[bool, bytes]:
        other = not any(item.path.is_relative_to(p) for p in first)
        name = f"{order} {item.path.relative_to(config.rootpath)}"
        return other, sha256(name.encode()).digest() if order else b""

    items.sort(key=place)


def pytest_runtest_setup(item: pytest.Item) -> None:
    until = item.config.getoption("--until")
    if until is not None and time.time() > until:
        pytest.skip(LEFT_OUT)


class Minutes:
    """Adds up how long each test took, and says so at the end.

    Attributes:
        seconds: By test.
        left_out: Tests that were not begun.
    """

    def __init__(self, config: pytest.Config):
        self.unit = _unit_of(config)
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self.left_out: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] += report.duration
        if report.skipped and LEFT_OUT in str(report.longrepr):
            self.left_out.append(report.nodeid)

    def pytest_terminal_summary(self, terminalreporter) -> None:
        write = terminalreporter.write_line
        if self.seconds:
            write(
                f"The slowest, in J: how long import jax takes, {self.unit:.2f} s here"
            )
        slowest = sorted(self.seconds.items(), key=lambda item: -item[1])
        for name, seconds in slowest[:SLOWEST]:
            write(f"{seconds / self.unit:6.1f} J  {name}")
        if self.left_out:
            write(f"NOT RUN, no time was left: {len(self.left_out)} tests")
            for name in self.left_out:
                write(f"  {name}")


def _unit_of(config: pytest.Config) -> float:
    """Return J, measured once for each environment: before the workers start."""
    kept = config.rootpath / ".jax_cache" / "import_time_s"
    if not kept.is_file() or os.environ.get("CI"):
        kept.parent.mkdir(exist_ok=True)
        kept.write_text(f"{import_time():.3f}\n")
    return float(kept.read_text())
