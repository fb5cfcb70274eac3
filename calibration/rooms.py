"""How is the house built, and how far does one question walk through it?

    python -m calibration.rooms

No random numbers. Reads every import of the package, then runs four small commands,
each in a process of its own with every call of ours recorded (what runs while modules
are imported is left out). Prints both tables and draws who imports whom.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from statistics import median
from types import FrameType

import numpy as np

from calibration.imports import PACKAGE, ROOMS, imported, package_of
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import INK, MUTED, new_figure, titled

FIGURE = Path(__file__).parent / "results" / "rooms.png"
SCENE = """
[charge]
mass_kg = 1.0
position_m = [0.0, 0.0, 0.0]
[camera]
position_m = [15.0, -20.0, 1.5]
look_at_m = [0.0, 0.0, 2.0]
width = 64
height = 48
focal_px = 100.0
frames_hz = 100.0
[vehicle]
model = "crazyflie"
position_m = [5.0, 0.0, 2.0]
[[sensor]]
name = "gauge"
position_m = [20.0, 0.0, 1.0]
records = { air_arrival_s = 1e-3 }
"""
LOG = """sensor,quantity,value,sigma,range_m
a,peak_overpressure_pa,31000,0.1,20
b,peak_overpressure_pa,9000,0.1,40
c,peak_overpressure_pa,4900,0.1,60
d,peak_overpressure_pa,2900,0.1,90
"""
WALKS = {
    "fit": "log.csv",
    "fly": "scene.toml --seconds 0.5 --out flight",
    "render": "scene.toml --times 0:0.05 --out film",
    "choose": "scene.toml --quantity air_arrival_s --tolerance 0.01",
}
"""A log of four rows and one unknown; one vehicle; five frames; one quantity."""
BEFORE = {
    "fit": (111, 12700, 479, 217, 134, 1920, 249),
    "fly": (105, 11500, 417, 187, 140, 4269, 302),
    "render": (68, 7300, 215, 100, 65, 3675, 286),
    "choose": (67, 7400, 188, 100, 64, 475, 248),
}
"""The same, walked before there were rooms (4b8d7e4, 22 November 2026)."""


def room_of(path: Path) -> str:
    """Return the room of a file; "" of what stands above all rooms."""
    first = path.relative_to(PACKAGE).parts[0]
    return first if first in ROOMS else ""


def imports_between() -> Counter[tuple[str, str]]:
    """Count import statements from a room to another, or to the root's files ("")."""
    found: Counter[tuple[str, str]] = Counter()
    for path in PACKAGE.rglob("*.py"):
        for module, _ in imported(path.read_text(), package_of(path)):
            top, _, rest = module.partition(".")
            other = rest.partition(".")[0]
            if top == "jblast":
                found[room_of(path), other if other in ROOMS else ""] += 1
    return found


class Tracer:
    """Which files of ours run, and which calls which."""

    def __init__(self):
        self.functions: set[tuple[str, str]] = set()
        self.calls: Counter[tuple[str, str]] = Counter()
        self._importing = 0

    def __call__(self, frame: FrameType, event: str, _) -> None:
        """Take note of a call (`sys.setprofile`)."""
        code = frame.f_code
        if event not in ("call", "return") or not _is_ours(code.co_filename):
            return
        if code.co_name == "<module>":
            self._importing += 1 if event == "call" else -1
        elif event == "call" and not self._importing:
            self.functions.add((code.co_filename, code.co_qualname))
            caller = frame.f_back
            while caller is not None and not _is_ours(caller.f_code.co_filename):
                caller = caller.f_back
            if caller is not None and caller.f_code.co_filename != code.co_filename:
                self.calls[caller.f_code.co_filename, code.co_filename] += 1

    def counted(self) -> dict[str, int]:
        """Return what was seen, and how many modules of ours are loaded."""
        files = {file for file, _ in self.functions}
        return {
            "files": len(files),
            "lines": sum(Path(file).read_text().count("\n") for file in files),
            "functions": len(self.functions),
            "arrows": len(self.calls),
            "in one folder": sum(
                Path(a).parent == Path(b).parent for a, b in self.calls
            ),
            "calls": self.calls.total(),
            "loaded": sum(name.split(".")[0] == "jblast" for name in sys.modules),
        }


def _is_ours(file: str) -> bool:
    return file.startswith(f"{PACKAGE}{os.sep}")


def walk(words: list[str]) -> dict[str, int]:
    """Run a command in this process and return what it walked through."""
    from jblast.cli.main import main

    tracer, out = Tracer(), sys.stdout
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (until the end of the process)
    sys.setprofile(tracer)
    code = main(words, progress=False)
    sys.setprofile(None)
    sys.stdout = out
    if code:
        raise SystemExit(f"jblast {' '.join(words)} ended with {code}")
    return tracer.counted()


def walked(verb: str) -> dict[str, int]:
    """Return what a verb walks through, in a process and a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "scene.toml").write_text(SCENE)
        Path(folder, "log.csv").write_text(LOG)
        run = subprocess.run(
            [sys.executable, "-m", "calibration.rooms", verb, *WALKS[verb].split()],
            env={
                **os.environ,
                "PYTHONPATH": str(PACKAGE.parent),
                "JBLAST_KEEP_PROGRAMS": "0",  # a program that is kept calls nothing
            },
            cwd=folder,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
    return json.loads(run.stdout)


def rooms_table(between: Counter[tuple[str, str]]) -> str:
    """Return a line a room: files, lines, and what it imports from other rooms."""
    lines = [f"{'room':13s} folders  files   lines  median  longest  imports others"]
    for room in ROOMS:
        files = sorted((PACKAGE / room).rglob("*.py"))
        long = [path.read_text().count("\n") for path in files]
        folders = len({path.parent for path in files})
        others = sum(
            n for (a, b), n in between.items() if a == room and b not in (room, "")
        )
        lines.append(
            f"{room:13s} {folders:7d} {len(files):6d} {sum(long):7d} "
            f"{median(long):7.0f} {max(long):8d} {others:15d}"
        )
    return "\n".join(lines)


def walks_table(walks: dict[str, dict[str, int]]) -> str:
    """Return two lines a command: now, and before there were rooms."""
    heads = list(next(iter(walks.values())))
    lines = ["".join([f"{'command':15s}", *(f"{head:>15s}" for head in heads)])]
    for verb, found in walks.items():
        now = [found[head] for head in heads]
        for name, numbers in ((verb, now), ("  before rooms", BEFORE[verb])):
            lines.append("".join([f"{name:15s}", *(f"{n:15d}" for n in numbers)]))
    return "\n".join(lines)


def draw(between: Counter[tuple[str, str]]) -> None:
    """Draw the imports as a matrix: nothing stands above its diagonal."""
    counts = np.array([[between[a, b] for b in ROOMS] for a in ROOMS], float)
    others = np.where((counts > 0) & ~np.eye(len(ROOMS), dtype=bool), counts, np.nan)
    figure = new_figure(7.2, 6.2)
    axes = figure.subplots()
    axes.imshow(np.log(others), cmap="Blues", vmin=-1.0, vmax=7.0)
    for row, column in np.argwhere(counts > 0):
        colour = MUTED if row == column else INK
        count = f"{counts[row, column]:.0f}"
        axes.text(column, row, count, ha="center", va="center", size=9, color=colour)
    axes.set_xticks(range(len(ROOMS)), ROOMS, rotation=45, ha="left")
    axes.set_yticks(range(len(ROOMS)), ROOMS)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, labelsize=9, labelcolor=INK)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("imports from", color=MUTED)
    titled(axes, "Who imports whom", "import statements; on the diagonal within a room")
    write_figure(figure, FIGURE)


if __name__ == "__main__":
    if sys.argv[1:]:
        counted = walk(sys.argv[1:])
        print(json.dumps(counted))
    else:
        imports = imports_between()
        print(
            rooms_table(imports), walks_table({v: walked(v) for v in WALKS}), sep="\n\n"
        )
        draw(imports)
