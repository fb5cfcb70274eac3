"""Tutorials: the notebooks as pages, their code as it stands and nothing run."""

import json
from pathlib import Path


def all_of_them(root: Path) -> list[Path]:
    """Return the notebooks in the order in which they are read."""
    return sorted((root / "notebooks").glob("*.ipynb"))


def title(notebook: Path) -> str:
    """Return what a notebook calls itself."""
    heading = next(text for kind, text in _cells(notebook) if kind == "markdown")
    return heading.splitlines()[0].removeprefix("# ")


def page(notebook: Path) -> str:
    """Write a notebook as a page."""
    parts = []
    for kind, text in _cells(notebook):
        parts.append(text if kind == "markdown" else f"```python\n{text}\n```")
    note = (
        f"*This page is `notebooks/{notebook.name}` without outputs. "
        f"[Download it]({notebook.name}) to run it where jblast is installed.*"
    )
    return "\n\n".join([parts[0], note, *parts[1:]]) + "\n"


def _cells(notebook: Path) -> list[tuple[str, str]]:
    """Return kind and text of each cell."""
    cells = json.loads(notebook.read_text("utf-8"))["cells"]
    return [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
