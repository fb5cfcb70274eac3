"""Results: a page for each file that a script of calibration/ wrote and kept."""

import re
from fnmatch import fnmatch
from pathlib import Path

KEPT = "calibration/results"
INDEX = "calibration/INDEX.md"
WIDE = "---\nhide: [toc]\n---\n\n"
"""Front matter of a page whose tables need the whole width."""


def all_of_them(root: Path) -> list[Path]:
    """Return every kept page and table, pages first."""
    kept = root / KEPT
    return [*sorted(kept.glob("*.md")), *sorted(kept.glob("*.txt"))]


def index_rows(root: Path) -> list[tuple[str, str, list[str], list[str], list[str]]]:
    """Return command, question, data, results and pages of the index's rows."""
    rows = []
    for line in (root / INDEX).read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and len(cells) == 5:
            data, results, pages = (
                [one.strip(" `") for one in cell.split(",") if one.strip()]
                for cell in cells[2:]
            )
            rows.append((cells[0].strip("`"), cells[1], data, results, pages))
    return rows


def title(path: Path) -> str:
    """Return the heading of a page, or the name of a table as words."""
    if path.suffix == ".md":
        return re.findall(r"^#+ (.*)", path.read_text("utf-8"), re.M)[0]
    return path.stem.replace("_", " ").capitalize()


def page(root: Path, path: Path) -> str:
    """Return the page of a result: unchanged, or its question and its table."""
    text = path.read_text("utf-8")
    if path.suffix == ".md":
        return text
    command, question = _source(root, path)
    picture = path.with_suffix(".png")
    parts = [
        f"{WIDE}# {title(path)}",
        question,
        f"Written by `{command}`." if command else "",
        f"![{title(path)}]({picture.name})" if picture.exists() else "",
        f"```text\n{text.rstrip()}\n```\n",
    ]
    return "\n\n".join(filter(None, parts))


def index(root: Path) -> str:
    """Return the list of all results."""
    head = (
        "# Results\n\nOutput of the scripts in `calibration/`, from "
        "`calibration/results`; the page of a result names its script, perhaps one "
        "of the history. `make check` compares the figures quoted in this manual with "
        "these files (`calibration/figures.csv`).\n\n| result | question |\n|---|---|\n"
    )
    rows = (
        f"| [{title(path)}]({path.name}) | {_source(root, path)[1]} |\n"
        for path in all_of_them(root)
    )
    return head + "".join(rows)


def _source(root: Path, path: Path) -> tuple[str, str]:
    """Return the command that writes a file and its question, by the index.

    Without a row in the index, the question is the first sentence of the file.
    """
    for command, question, _, kept, _ in index_rows(root):
        if path.suffix == ".txt" and any(fnmatch(path.name, one) for one in kept):
            shown = command.startswith("git ")
            return command if shown else f"python -m calibration.{command}", question
    paragraphs = [" ".join(x.split()) for x in path.read_text("utf-8").split("\n\n")]
    prose = (one for one in paragraphs if one and one[0] not in "#!|<`")
    sentence = re.split(r"(?<=[.])\s", next(prose, ""))[0]
    # links as text
    return "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", sentence).rstrip(":.") + "."
