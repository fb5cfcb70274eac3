"""Faults of one token each, and whether the tests of their room notice.

    python tests/tools/mutants.py draw            # add five of each room to the list
    python tests/tools/mutants.py run [NUMBER...] # those not run yet; note what killed

A mutant changes one operator, comparison or number in the body of a function. It is
met by the test that killed it before, if one did, and then by the default tests of its
own room, those of its own file first, until one fails.
One that lives is judged by hand in the last column: whether it changes anything at all,
and which slow test, if any, kills it. Lines are found by their text, so a mutant stays
what it is while its file changes elsewhere.
"""

import ast
import csv
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_suffix(".csv")
ROOMS = ("waves", "inference", "sensors", "vehicle")
PER_ROOM = 5
LIMIT = 600.0
"""Seconds after which a mutant counts as killed: it does not end."""

OPERATORS = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Lt: ("<", ">"),
    ast.Gt: (">", "<"),
    ast.LtE: ("<=", ">"),
    ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}


@dataclass
class Mutant:
    """A token to change, and what came of it.

    Attributes:
        number: From 1.
        file: Under the root.
        line: From 1, when it was drawn.
        text: Of that line, without what indents it.
        column: From 0, in characters of the text.
        old: The token.
        new: What takes its place.
        killed_by: The test that failed; "lives" if none did; "" before a run.
        judged: Of one that lives: why no test can see it, or that one should.
    """

    number: int
    file: str
    line: int
    text: str
    column: int
    old: str
    new: str
    killed_by: str = ""
    judged: str = ""

    def applied(self, source: str) -> str:
        """Return the source with the token changed."""
        lines = source.splitlines(keepends=True)
        same = [n for n, line in enumerate(lines, 1) if line.strip() == self.text]
        if not same:
            raise SystemExit(
                f"mutant {self.number}: {self.file} has no line {self.text!r}: "
                "remove the mutant, or move it by hand"
            )
        place = min(same, key=lambda n: abs(n - self.line)) - 1
        start = lines[place].index(self.text) + self.column
        stop = start + len(self.old)
        lines[place] = lines[place][:start] + self.new + lines[place][stop:]
        return "".join(lines)


def candidates(file: Path) -> list[tuple[int, int, str, str]]:
    """Return every token of a source that could be changed, and into what."""
    source = file.read_text()
    lines = source.splitlines()
    found = []
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for statement in function.body:
            for node in ast.walk(statement):
                found += _of(node, lines)
    return sorted(set(found))


def _of(node: ast.AST, lines: list[str]) -> list[tuple[int, int, str, str]]:
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return _between(node.left, node.right, *OPERATORS[type(node.op)], lines)
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OPERATORS:
        first = node.comparators[0]
        return _between(node.left, first, *OPERATORS[type(node.ops[0])], lines)
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        line = lines[node.lineno - 1]
        old = line[node.col_offset : node.end_col_offset]
        value = node.value
        if isinstance(value, bool):
            return []
        more = value + 1 if isinstance(value, int) else 1.1 * value
        new = repr(more or 1.0)
        return [(node.lineno, node.col_offset, old, new)]
    return []


def _between(left, right, old: str, new: str, lines: list[str]):
    """Find an operator between its operands, where all are on one line."""
    if left.end_lineno != right.lineno:
        return []
    line = lines[right.lineno - 1]
    column = line.find(old, left.end_col_offset, right.col_offset)
    return [] if column < 0 else [(right.lineno, column, old, new)]


def draw(there: list[Mutant]) -> list[Mutant]:
    """Draw as many more of each room, at most one a file; the seed is their number."""
    rng = random.Random(len(there))
    drawn: list[Mutant] = []
    for room in ROOMS:
        files = sorted((ROOT / "jblast" / room).rglob("*.py"))
        files = [file for file in files if file.read_text().isascii()]
        rng.shuffle(files)
        with_some = (file for file in files if candidates(file))
        for file, _ in zip(with_some, range(PER_ROOM), strict=False):
            line, column, old, new = rng.choice(candidates(file))
            number = len(there) + len(drawn) + 1
            name = file.relative_to(ROOT).as_posix()
            whole = file.read_text().splitlines()[line - 1]
            text = whole.strip()
            column -= whole.index(text)
            drawn.append(Mutant(number, name, line, text, column, old, new))
    return there + drawn


def killer(mutant: Mutant) -> str:
    """Return the test that fails with a mutant, in a copy of the tree."""
    folders, stem = Path(mutant.file).parts[1:-1], Path(mutant.file).stem
    room = folders[0] if folders else f"test_{stem}.py"
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for name in ("jblast", "calibration", "tests"):
            shutil.copytree(
                ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        for name in ("pyproject.toml", "README.md", "CITATION.cff"):
            shutil.copy(ROOT / name, tree)
        (tree / ".jax_cache").symlink_to(ROOT / ".jax_cache")
        file = tree / mutant.file
        file.write_text(mutant.applied(file.read_text()))
        tests = tree / "tests" / room
        own = [str(t) for t in sorted(tests.rglob(f"test_*{stem}*.py"))]
        whole = [f"--first={' '.join(own)}", f"tests/{room}"]
        known = "::" in mutant.killed_by
        try:
            run = _tests(tree, [mutant.killed_by] if known else whole)
            if known and run.returncode != 1:  # it passes, or is a slow test by now
                run = _tests(tree, whole)
        except subprocess.TimeoutExpired:
            return f"no end within {LIMIT:g} s"
    if run.returncode == 0:
        return "lives"
    failed = [s for s in run.stdout.splitlines() if s.startswith(("FAILED", "ERROR"))]
    if not failed:
        raise SystemExit(f"mutant {mutant.number}: no test ran:\n{run.stdout[-2000:]}")
    return failed[0].split(" - ")[0].split(" ", 1)[1]


def _tests(tree: Path, asked: list[str]) -> subprocess.CompletedProcess[str]:
    """Run default tests of a tree until one fails."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
    command += ["-p", "no:cacheprovider", "--no-header", "--tb=no"]
    return subprocess.run(
        [*command, *asked],
        cwd=tree,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        env={**os.environ, "PYTHONPATH": str(tree)},
    )


def read() -> list[Mutant]:
    """Read the list."""
    with LIST.open(newline="") as file:
        next(file)  # names of the columns
        return [
            Mutant(int(number), name, int(line), text, int(column), *rest)
            for number, name, line, text, column, *rest in csv.reader(file)
        ]


def write(mutants: list[Mutant]) -> None:
    """Write the list."""
    with LIST.open("w", newline="") as file:
        rows = csv.DictWriter(file, [f.name for f in fields(Mutant)])
        rows.writeheader()
        rows.writerows(asdict(m) for m in mutants)


def run(numbers: list[int]) -> None:
    """Run mutants, one on each core there is for us, and keep what killed them."""
    mutants = read()
    chosen = [m for m in mutants if m.number in numbers or not (numbers or m.killed_by)]
    begun = time.monotonic()
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for mutant, by in zip(chosen, pool.map(killer, chosen), strict=True):
            mutant.killed_by = by
            write(mutants)
            print(f"{mutant.number:3d} {mutant.file}:{mutant.line} {by}", flush=True)
    lives = sum(m.killed_by == "lives" for m in chosen)
    minutes = (time.monotonic() - begun) / 60
    print(f"{len(chosen) - lives} of {len(chosen)} killed in {minutes:.0f} minutes")


if __name__ == "__main__":
    if sys.argv[1:2] == ["draw"]:
        write(draw(read()))
    elif sys.argv[1:2] == ["run"]:
        run([int(number) for number in sys.argv[2:]])
    else:
        sys.exit(__doc__)
