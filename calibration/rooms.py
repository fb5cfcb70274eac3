"""How large is the package, and how much of it does one command use?

    python -m calibration.rooms > calibration/results/rooms.txt

No random numbers. Counts every module, reads every import of the package, then runs
five small commands, each in a process of its own with every call of ours recorded (what
runs while modules are imported is left out): "cold" without programs kept from earlier
runs, "warm" with those of a run before. Prints the tables and draws which package
imports which. The anchors were counted in the same way from their own files.

`imported` and its neighbours are the one reader of import statements, those inside
functions too, that the tests of the import order share.
"""

import ast
import io
import json
import os
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from types import FrameType
from typing import NamedTuple, TypeGuard

import numpy as np

import jblast
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import INK, MUTED, new_figure, titled

PACKAGE = Path(jblast.__file__).parent
ROOMS = (
    *("scene", "waves", "fidelity", "vehicle", "observations", "sensors"),
    *(
        "signals",
        "world",
        "missions",
        "autopilot",
        "environments",
        "inference",
        "discovery",
        "study",
        "verification",
        "report",
        "cli",
    ),
)
"""In the order of their imports; what stands above all rooms is in none."""


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
PULSE = """
[charge]
mass_kg = 1.0
[[sensor]]
name = "ear"
kind = "microphone"
position_m = [20.0, 0.0, 1.0]
rate_hz = 8000
"""
STUDY = """
scene = "scene.toml"
samples = 16
outcomes = ["air_arrival_s"]
"""
INPUTS = {
    "scene.toml": SCENE,
    "log.csv": LOG,
    "pulse.toml": PULSE,
    "study.toml": STUDY,
}
WALKS = {
    "calc": "--mass 15 --range 20",
    "fit": "log.csv",
    "listen": "pulse.toml --seconds 0.2 --out sound",
    "render": "scene.toml --times 0:0.05 --out film",
    "study": "study.toml --out study.zarr",
}
"""A log of four rows and one unknown; a microphone; five frames; 16 arrivals."""
ANCHORS = {
    "optimistix": ("34", "7.6", "218/397/645", "4", "7.5", "4.9"),
    "diffrax": ("63", "16.5", "140/685/1543", "5", "6.4", "7.7"),
    "JAX-Fluids": ("384", "58.6", "93/419/1545", "65", "4.5", "3.5"),
    "TORAX": ("264", "54.5", "147/542/1070", "40", "4.5", "12.2"),
    "newton": ("346", "273", "399/1975/13077", "54", "1.6", "7.1"),
    "ObsPy core": ("32", "24.1", "487/1268/3749", "4", "1.6", "4.6"),
}
"""Modules, thousands of lines, lines of a module (median/90 %/largest), folders, and
shares of import and comment lines in per cent, counted on 26 November 2026."""


class Size(NamedTuple):
    """What stands in some modules.

    Attributes:
        modules: Number of files.
        folders: That hold them.
        lines: All lines.
        code: Lines that are neither blank, nor comment, documentation or import.
        imports: Lines of import statements.
        comments: Lines with nothing but a comment.
        each: Lines of each module.
    """

    modules: int
    folders: int
    lines: int
    code: int
    imports: int
    comments: int
    each: list[int]


def size_of(files: list[Path]) -> Size:
    """Count lines by kind."""
    code = imports = comments = 0
    each = []
    for path in files:
        text = path.read_text()
        tree = ast.parse(text)
        lines = text.splitlines()
        each.append(len(lines))
        imported_at, told_at = set(), set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                imported_at |= {*range(node.lineno, (node.end_lineno or 0) + 1)}
            elif _is_text(node):
                told_at |= {*range(node.lineno, (node.end_lineno or 0) + 1)}
        remarks = {
            token.start[0]
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type == tokenize.COMMENT
            and lines[token.start[0] - 1].lstrip().startswith("#")
        }
        blank = {i for i, line in enumerate(lines, 1) if not line.strip()}
        imports += len(imported_at)
        comments += len(remarks)
        code += len(lines) - len(imported_at | told_at | remarks | blank)
    folders = len({path.parent for path in files})
    return Size(len(files), folders, sum(each), code, imports, comments, each)


def _is_text(node: ast.AST) -> TypeGuard[ast.Expr]:
    """Tell whether a node is a statement of text alone: documentation."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def single_uses() -> dict[str, int]:
    """Count functions of modules that are named once, and modules imported once."""
    names: Counter[str] = Counter()
    functions: Counter[str] = Counter()
    importers: dict[str, set[str]] = {}
    for path in PACKAGE.rglob("*.py"):
        text, module = path.read_text(), module_of(path)
        tree = ast.parse(text)
        functions.update(
            node.name for node in tree.body if isinstance(node, ast.FunctionDef)
        )
        for node in ast.walk(tree):
            if isinstance(node, ast.Name):
                names[node.id] += 1
            elif isinstance(node, ast.Attribute):
                names[node.attr] += 1
        for other, taken in imported(text, package_of(path)):
            for name in (other, *(f"{other}.{part}" for part in taken)):
                importers.setdefault(name, set()).add(module)
    modules = [module_of(path) for path in PACKAGE.rglob("*.py")]
    return {
        "functions of modules": functions.total(),
        "of these named once": sum(names[name] == 1 for name in functions),
        "modules with one importer": sum(
            len(importers.get(name, ())) == 1 for name in modules
        ),
    }


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


def walked(verb: str, *, warm: bool) -> dict[str, int]:
    """Return what a verb walks through, in a process and a folder of its own.

    Args:
        verb: Of the command.
        warm: Whether programs are kept from a run before.
    """
    with tempfile.TemporaryDirectory() as folder:
        env = {
            **os.environ,
            "PYTHONPATH": str(PACKAGE.parent),
            "XDG_CACHE_HOME": str(Path(folder, "cache")),
            "JBLAST_KEEP_PROGRAMS": str(int(warm)),
        }
        printed = ""
        for number in range(1 + warm):
            place = Path(folder, str(number))
            place.mkdir()
            for name, text in INPUTS.items():
                (place / name).write_text(text)
            printed = subprocess.run(
                [sys.executable, "-m", "calibration.rooms", verb, *WALKS[verb].split()],
                env=env,
                cwd=place,
                stdout=subprocess.PIPE,
                text=True,
                check=True,
            ).stdout
    return json.loads(printed)


def rooms_table(between: Counter[tuple[str, str]]) -> str:
    """Return a line a package: files, lines, and what it imports from others."""
    lines = [
        f"{'package':13s} folders modules   lines    code  median  longest  "
        "imports others"
    ]
    for room in ROOMS:
        size = size_of(sorted((PACKAGE / room).rglob("*.py")))
        others = sum(
            n for (a, b), n in between.items() if a == room and b not in (room, "")
        )
        lines.append(
            f"{room:13s} {size.folders:7d} {size.modules:7d} {size.lines:7d} "
            f"{size.code:7d} {median(size.each):7.0f} {max(size.each):8d} {others:15d}"
        )
    return "\n".join(lines)


def size_table() -> str:
    """Return a line for the package and for each of the anchors."""
    size = size_of(sorted(PACKAGE.rglob("*.py")))
    middle, tenth = np.quantile(size.each, [0.5, 0.9])
    ours = (
        f"{size.modules}",
        f"{size.lines / 1e3:.1f}",
        f"{middle:.0f}/{tenth:.0f}/{max(size.each)}",
        f"{size.folders}",
        f"{100 * size.imports / size.lines:.1f}",
        f"{100 * size.comments / size.lines:.1f}",
    )
    heads = (
        "modules",
        "1000 lines",
        "of a module",
        "folders",
        "imports %",
        "remarks %",
    )
    rows = {"": heads, **ANCHORS, "jblast": ours}
    lines = [
        "".join([f"{name:12s}", *(f"{entry:>16s}" for entry in row)])
        for name, row in rows.items()
    ]
    lines.append("of a module: lines, median/90 %/largest")
    counts = single_uses()
    lines.append(f"lines of code: {size.code}")
    scripts = size_of(sorted((PACKAGE.parent / "calibration").glob("*.py")))
    lines.append(
        f"calibration: {scripts.modules} modules, {scripts.code} lines of code"
    )
    lines += [f"{name}: {count}" for name, count in counts.items()]
    return "\n".join(lines)


def walks_table(walks: dict[tuple[str, bool], dict[str, int]]) -> str:
    """Return two lines a command: without programs that are kept, and with them."""
    heads = list(next(iter(walks.values())))
    lines = ["".join([f"{'command':15s}", *(f"{head:>15s}" for head in heads)])]
    for (verb, warm), found in walks.items():
        name = f"{verb}, {'warm' if warm else 'cold'}"
        lines.append(
            "".join([f"{name:15s}", *(f"{found[head]:15d}" for head in heads)])
        )
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


def module_of(path: Path, root: Path = PACKAGE.parent) -> str:
    """Return the dotted name of a source file; a face's is that of its folder."""
    name = ".".join(path.relative_to(root).with_suffix("").parts)
    return name.removesuffix(".__init__")


def package_of(path: Path, root: Path = PACKAGE.parent) -> str:
    """Return the dotted name of the folder of a source file."""
    return ".".join(path.parent.relative_to(root).parts)


def imported(source: str, package: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the module of each import by its full name, and what is taken from it.

    Args:
        source: Python.
        package: The folder it stands in, which leading dots are counted from.
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, ()) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            above = parts[: len(parts) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield base, tuple(alias.name for alias in node.names)


if __name__ == "__main__":
    if sys.argv[1:]:
        counted = walk(sys.argv[1:])
        print(json.dumps(counted))
    else:
        imports = imports_between()
        walks = {
            (v, warm): walked(v, warm=warm) for v in WALKS for warm in (False, True)
        }
        print(size_table(), rooms_table(imports), walks_table(walks), sep="\n\n")
        draw(imports)
