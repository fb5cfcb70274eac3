"""Faults of one token each, and whether the tests of their package notice.

    python tests/tools/mutants.py draw            # until each package has six
    python tests/tools/mutants.py run [NUMBER...] # those not run yet; record the killer
    python tests/tools/mutants.py run killed      # all that were killed: 1 if one lives

A mutant changes one operator, comparison or number in the body of a function. It is
run against the test that killed it before, if there is one, and then against default
tests, until one fails: those whose name or imports contain its module, then the others
of its package. After `LIMIT` seconds no further test begins.
One that lives is judged by hand in the last column: whether it changes anything at all,
or which test is missing. Lines are found by their text, so a mutant stays the same
while its file changes elsewhere. One whose line vanished is replaced by one of the same
kind in the new code.
"""

import ast
import csv
import itertools
import os
import random
import re
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
PER_PACKAGE = 6
LIMIT = 150.0
"""Seconds after which no test of a mutant begins."""
ENDLESS = 600.0
"""Seconds after which a mutant counts as killed: it does not end."""

OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
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


def candidates(file: Path) -> list[tuple[int, str, int, str, str]]:
    """Return every possible change of a module: line, text, column, old, new."""
    source = file.read_text()
    lines = source.splitlines()
    found = []
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for statement in function.body:
            for node in ast.walk(statement):
                found += _of(node, lines)
    return sorted(
        (n, text := lines[n - 1].strip(), at - lines[n - 1].index(text), old, new)
        for n, at, old, new in set(found)
    )


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


def _package_of(file: Path) -> str:
    """Return the package of a module, below the root; "" for those at jblast/."""
    return file.parts[1] if len(file.parts) > 2 else ""


def draw(there: list[Mutant]) -> list[Mutant]:
    """Draw for each package what it lacks, in modules with the fewest; fixed seed."""
    rng = random.Random(len(there))
    modules: dict[str, list[str]] = {}
    for path in sorted((ROOT / "jblast").rglob("*.py")):
        file = path.relative_to(ROOT)
        if path.read_text().isascii() and candidates(path):
            modules.setdefault(_package_of(file), []).append(file.as_posix())
    mutants = list(there)
    for package, files in modules.items():
        known = [m.file for m in there if _package_of(Path(m.file)) == package]
        rng.shuffle(files)
        files.sort(key=known.count)
        lacking = range(PER_PACKAGE - len(known))
        for file, _ in zip(itertools.cycle(files), lacking, strict=False):
            taken = {(m.text, m.column) for m in mutants if m.file == file}
            free = [c for c in candidates(ROOT / file) if c[1:3] not in taken]
            number = max(m.number for m in mutants) + 1
            mutants.append(Mutant(number, file, *rng.choice(free)))
    return mutants


def tests_of(file: str) -> list[str]:
    """Return test files: those that import a module, then others of its package."""
    module = Path(file).with_suffix("")
    package = _package_of(Path(file))
    start = rf"from {re.escape('.'.join(module.parent.parts))} import [^.]*"
    imports = re.compile(
        rf"{re.escape('.'.join(module.parts))}\b|{start}\b{module.name}\b"
    )
    tests = ROOT / "tests"
    near = (tests / package).glob("**/test_*.py" if package else "test_*.py")
    users = [t for t in tests.rglob("test_*.py") if imports.search(t.read_text())]
    order = sorted(
        {*near, *users}, key=lambda t: (t not in users, module.name not in str(t), t)
    )
    return [test.relative_to(ROOT).as_posix() for test in order]


def killer(mutant: Mutant) -> str:
    """Return the test that fails with a mutant, in a copy of the tree."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        kept = shutil.ignore_patterns(".*", "site", "out")
        shutil.copytree(ROOT, tree, ignore=kept)
        (tree / ".jax_cache").symlink_to((ROOT / ".jax_cache").resolve())
        file = tree / mutant.file
        file.write_text(mutant.applied(file.read_text()))
        whole = tests_of(mutant.file)
        known = "::" in mutant.killed_by
        try:
            run = _tests(tree, [mutant.killed_by] if known else whole)
            if known and run.returncode != 1:  # it passes, or is a slow test by now
                run = _tests(tree, whole)
        except subprocess.TimeoutExpired:
            return f"no end within {ENDLESS:g} s"
    if run.returncode == 0:
        return "lives"
    failed = [s for s in run.stdout.splitlines() if s.startswith(("FAILED", "ERROR"))]
    if not failed:
        raise SystemExit(f"mutant {mutant.number}: no test ran:\n{run.stdout[-2000:]}")
    return failed[0].split(" - ")[0].split(" ", 1)[1]


def _tests(tree: Path, tests: list[str]) -> subprocess.CompletedProcess[str]:
    """Run default tests of a tree until one fails."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
    command += ["-p", "no:cacheprovider", "--no-header", "--tb=no"]
    command += [f"--until={time.time() + LIMIT}"]
    return subprocess.run(
        [*command, *tests],
        cwd=tree,
        capture_output=True,
        text=True,
        timeout=ENDLESS,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": ""},
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
        names = [f.name for f in fields(Mutant)]
        rows = csv.DictWriter(file, names, lineterminator="\n")
        rows.writeheader()
        rows.writerows(asdict(m) for m in mutants)


def run(words: list[str]) -> int:
    """Run mutants, one on each core; return 1 if one that was killed lives now."""
    mutants = read()
    chosen = [
        m
        for m in mutants
        if ("::" in m.killed_by if words == ["killed"] else str(m.number) in words)
        or not (words or m.killed_by)
    ]
    before = [m.killed_by for m in chosen]
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for mutant, by in zip(chosen, pool.map(killer, chosen), strict=True):
            mutant.killed_by = by
            write(mutants)
            print(f"{mutant.number:3d} {mutant.file}:{mutant.line} {by}", flush=True)
    lives = [m.killed_by == "lives" for m in chosen]
    print(f"{len(chosen) - sum(lives)} of {len(chosen)} killed")
    return int(any("::" in by and live for by, live in zip(before, lives, strict=True)))


if __name__ == "__main__":
    if sys.argv[1:] == ["draw"]:
        write(draw(read()))
    elif sys.argv[1:2] == ["run"]:
        sys.exit(run(sys.argv[2:]))
    else:
        sys.exit(__doc__)
