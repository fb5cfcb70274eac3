"""Results: a page for each file that a script of calibration/ wrote and kept."""

import posixpath
import re
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

KEPT = "calibration/results"
INDEX = "calibration/INDEX.md"
BENCHMARK = "benchmark_"
WIDE = "---\nhide: [toc]\n---\n\n"
"""Front matter of a page whose tables need all the width there is."""


@dataclass(frozen=True)
class Result:
    """A kept file that becomes a page.

    Attributes:
        uri: Where the page stands on the site.
        source: The file in the repository.
        title: What the navigation calls it.
        script: The script that writes it, "" if the page names it.
        question: That of the index; without a script, the first sentence of the
            file.
        text: What the file holds.
        pictures: Those of the same name, beside it.
    """

    uri: str
    source: str
    title: str
    script: str
    question: str
    text: str
    pictures: tuple[str, ...]


def all_of_them(root: Path) -> list[Result]:
    """Return every kept page and table, pages first."""
    kept = root / KEPT
    files = [
        *sorted(kept.glob("*.md")),
        *sorted(kept.glob("*.txt")),
    ]
    return [_result(root, path) for path in files]


def index_rows(root: Path) -> list[tuple[str, str, list[str], list[str], list[str]]]:
    """Return the rows of the index that keep results.

    Returns:
        For each: command, question, data, results and pages.
    """
    rows = []
    for line in (root / INDEX).read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and len(cells) == 5:
            lists = [
                [one.strip(" `") for one in cell.split(",") if one.strip()]
                for cell in cells[2:]
            ]
            rows.append((cells[0].strip("`"), cells[1], *lists))
    return rows


def page(result: Result) -> str:
    """Write the page of a result: unchanged, or its question and its table."""
    if result.source.endswith(".md"):
        return result.text
    question = f"{result.question}\n\n" if result.question else ""
    written = f"Written by `{result.script}`.\n\n" if result.script else ""
    pictures = "".join(f"![{result.title}]({name})\n\n" for name in result.pictures)
    body = f"```text\n{result.text.rstrip()}\n```\n"
    return f"{WIDE}# {result.title}\n\n{question}{written}{pictures}{body}"


def index(root: Path) -> str:
    """Write the list of all results."""
    rows = [
        f"| [{result.title}]({_beside(result.source)}) | {result.question} |"
        for result in all_of_them(root)
    ]
    return "\n".join(
        [
            "# Results",
            "",
            "Output of the scripts in `calibration/`, from `calibration/results`. "
            "Each script can be run again. `make check` compares the figures quoted "
            "in this manual with these files (`calibration/figures.csv`).",
            "",
            "| result | question |",
            "|---|---|",
            *rows,
            "",
        ]
    )


def _result(root: Path, path: Path) -> Result:
    name = path.relative_to(root / KEPT).as_posix()
    uri = f"results/{name.rpartition('.')[0]}.md"
    text = path.read_text("utf-8")
    pictures = path.with_suffix(".png")
    beside = (pictures.name,) if pictures.exists() else ()
    module, question = _script(root, name) if name.endswith(".txt") else ("", "")
    question = question or _first_sentence(text)
    return Result(
        uri, f"{KEPT}/{name}", _title(name, text), module, question, text, beside
    )


def _first_sentence(text: str) -> str:
    """Return how a file begins beneath its title, without links and pictures."""
    paragraphs = [" ".join(one.split()) for one in text.split("\n\n")]
    prose = (one for one in paragraphs if one and one[0] not in "#!|<`")
    sentence = re.split(r"(?<=[.])\s", next(prose, ""))[0]
    return re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", sentence).rstrip(":.") + "."


def _title(name: str, text: str) -> str:
    if name.endswith(".md"):
        heading = next(line for line in text.splitlines() if line.startswith("#"))
        return heading.lstrip("# ")
    return name.removesuffix(".txt").replace("_", " ").capitalize()


def _script(root: Path, name: str) -> tuple[str, str]:
    """Return the command that writes a file, and its question, by the index."""
    for command, question, _, kept, _ in index_rows(root):
        if any(fnmatch(name, pattern) for pattern in kept):
            if name.startswith(BENCHMARK) and command.startswith(BENCHMARK):
                subject = name.removeprefix(BENCHMARK).partition(".")[0]
                subject = subject.removesuffix("_gpu")
                return f"python -m calibration.benchmarks {subject}", question
            return f"python -m calibration.{command}", question
    return "", ""


def _beside(source: str) -> str:
    return posixpath.relpath(source, KEPT)
