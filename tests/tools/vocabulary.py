"""Words that the package and its pages avoid, each with the plain term.

    python tests/tools/vocabulary.py [PATH ...]     # default: jblast docs README.md

The mechanical part of the vocabulary: each line that has such a word is printed with
the term to write in its place. The exit code is 1 if there is one.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
DEFAULT = ("jblast", "docs", "README.md")
AVOIDED = {
    # `file.tell()` is Python's own name
    r"(?<!\.)\b(?:told|tells?|said|says?)\b": "report, identify, state, contain",
    r"\basked\b": "requested, required",
    r"\b(?:borne|heeded)\b": "accepted, honoured",
    r"draws' worth": "effective sample size",
    r"\banew\b": "again",
    r"\b(?:whereto|whereof|thereof|hitherto)\b": "a noun, or a sentence of its own",
    r"\bseldom(?:er)?\b": "rarely, or the rate",
    r"\bgot others\b": "got Y: the first offending value, with its row",
}
"""Patterns, and what to write."""
ANY = re.compile("|".join(AVOIDED), re.IGNORECASE)
CLAUSE = re.compile(r"(?:What|Where|Who|Whose|How|Whether)\b")
"""How a docstring's summary does not begin: a noun phrase is shorter."""
ALLOWED = re.compile(r'"key": "(?:asked|said)"')
"""JSON keys, which stay as they are: programs of users read them."""


class Found(NamedTuple):
    """A place that has an avoided word.

    Attributes:
        path: Of the file, relative to the root of the repository.
        line: Number of the line.
        text: The line.
        term: What to write in its place.
    """

    path: str
    line: int
    text: str
    term: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text.strip()}  [{self.term}]"


def words_in(text: str, path: str) -> Iterator[Found]:
    """Yield the avoided words of a text."""
    for number, line in enumerate(text.splitlines(), 1):
        if not ANY.search(line):
            continue
        for pattern, term in AVOIDED.items():
            if re.search(pattern, ALLOWED.sub("", line), re.IGNORECASE):
                yield Found(path, number, line, term)


def summaries_in(text: str, path: str) -> Iterator[Found]:
    """Yield the docstrings of a module that begin with a clause."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            summary = (ast.get_docstring(node) or "").partition("\n")[0]
            if CLAUSE.match(summary):
                line = getattr(node, "lineno", 1)
                yield Found(path, line, summary, "a noun phrase")


def files_of(paths: list[str]) -> Iterator[Path]:
    """Yield modules and pages below paths."""
    for path in map(ROOT.joinpath, paths):
        if path.is_file():
            yield path
        else:
            yield from sorted(
                file for end in ("py", "md") for file in path.rglob(f"*.{end}")
            )


def found_in(paths: list[str]) -> list[Found]:
    """Return what modules and pages below paths have of avoided words."""
    found: list[Found] = []
    for file in files_of(paths):
        path, text = file.relative_to(ROOT).as_posix(), file.read_text("utf-8")
        found += words_in(text, path)
        if file.suffix == ".py":
            found += summaries_in(text, path)
    return found


if __name__ == "__main__":
    places = found_in(sys.argv[1:] or list(DEFAULT))
    sys.stdout.write("".join(f"{place}\n" for place in places))
    sys.exit(bool(places))
