"""Counts of the package: modules, lines of code and what they consist of.

    python tests/tools/counts.py [FOLDER]

Code is what is neither docstring, import, comment nor blank. A function is referenced
once if its name occurs a single time in the package besides its definition and imports;
names of methods that classes share are not counted. A numeric constant is a name in
capitals that a module sets to a number, or to a tuple of numbers.
"""

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).parents[2] / "jblast"
NUMBERS = (int, float)


class Lines(NamedTuple):
    """Lines of a module by kind."""

    code: int
    imports: int
    comments: int
    docstrings: int


def lines_of(text: str) -> Lines:
    """Return the lines of a module by kind; a line with code is code."""
    imports, docstrings = _lines_of(ast.parse(text))
    written: set[int] = set()
    comments: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comments.add(token.start[0])
        elif token.string.strip():
            written |= {*range(token.start[0], token.end[0] + 1)}
    code = written - imports - docstrings
    return Lines(len(code), len(imports), len(comments - written), len(docstrings))


def _lines_of(tree: ast.Module) -> tuple[set[int], set[int]]:
    """Return the numbers of the lines of imports, and of those of docstrings."""
    imports: set[int] = set()
    docstrings: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            imports |= {*range(node.lineno, (node.end_lineno or 0) + 1)}
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docstrings |= {*range(node.lineno, (node.end_lineno or 0) + 1)}
    return imports, docstrings


def functions_of(tree: ast.Module) -> list[str]:
    """Return the names of the functions of a module, without special methods."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    names = [node.name for node in ast.walk(tree) if isinstance(node, kinds)]
    return [name for name in names if not name.startswith("__")]


def constants_of(tree: ast.Module) -> list[str]:
    """Return the names of the numeric constants of a module."""
    found = []
    for node in tree.body:
        if not isinstance(node, ast.Assign):
            continue
        names = [
            name.id
            for target in node.targets
            for name in ast.walk(target)
            if isinstance(name, ast.Name) and name.id.strip("_").isupper()
        ]
        calculated = any(isinstance(part, ast.Call) for part in ast.walk(node.value))
        values = [p.value for p in ast.walk(node.value) if isinstance(p, ast.Constant)]
        numeric = values and all(type(value) in NUMBERS for value in values)
        if numeric and not calculated and not isinstance(node.value, ast.Dict):
            found += names
    return found


def counts(folder: Path = PACKAGE) -> dict[str, str]:
    """Return the counts of a package."""
    texts = [path.read_text() for path in sorted(folder.rglob("*.py"))]
    trees = [ast.parse(text) for text in texts]
    each = [lines_of(text) for text in texts]
    whole = Lines(*(sum(column) for column in zip(*each, strict=True)))
    functions = Counter(name for tree in trees for name in functions_of(tree))
    words = Counter(
        word for text in texts for word in re.findall(r"\w+", _without_imports(text))
    )
    own = [name for name, times in functions.items() if times == 1]
    once = [name for name in own if words[name] == 2]
    constants = sum(len(constants_of(tree)) for tree in trees)
    written = sum(whole)
    return {
        "modules": f"{len(texts)}",
        "lines of code": f"{whole.code:,}",
        "imports, of lines that are not blank": f"{whole.imports / written:.1%}",
        "comments on lines of their own": f"{whole.comments / written:.1%}",
        "docstrings": f"{whole.docstrings / written:.1%}",
        "functions": f"{len(own):,}",
        "referenced once": f"{len(once) / max(len(own), 1):.1%}",
        "numeric constants": f"{constants}",
    }


def _without_imports(text: str) -> str:
    """Return the code of a module, without imports, comments and docstrings."""
    lines = text.splitlines()
    for number in set().union(*_lines_of(ast.parse(text))):
        lines[number - 1] = ""
    return "\n".join(line.partition("  # ")[0] for line in lines)


def main() -> None:
    """Print the counts of a folder."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else PACKAGE
    for name, value in counts(folder).items():
        sys.stdout.write(f"{name:40}{value:>8}\n")


if __name__ == "__main__":
    main()
