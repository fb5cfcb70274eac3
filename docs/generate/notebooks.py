"""Tutorials: the notebooks as pages, with the outputs of `make tutorials` if any."""

import html
import json
from pathlib import Path
from typing import Any

EXECUTED = "out/tutorials"
"""Folder of the executed notebooks."""


def all_of_them(root: Path) -> list[Path]:
    """Return the notebooks in the order in which they are read."""
    return sorted((root / "notebooks").glob("*.ipynb"))


def title(notebook: Path) -> str:
    """Return what a notebook calls itself."""
    heading = next(_source(c) for c in _cells(notebook) if c["cell_type"] == "markdown")
    return heading.splitlines()[0].removeprefix("# ")


def page(notebook: Path) -> str:
    """Write a notebook as a page."""
    cells = _cells(notebook)
    executed = notebook.parents[1] / EXECUTED / notebook.name
    done = _cells(executed) if executed.is_file() else []
    # outputs of another version of the notebook do not belong to this code
    if [_source(cell) for cell in done] == [_source(cell) for cell in cells]:
        cells, outputs = done, "with its outputs"
    else:
        outputs = "without outputs, which `make tutorials docs` adds"
    parts = []
    for cell in cells:
        if cell["cell_type"] == "markdown":
            parts.append(_source(cell))
        else:
            parts.append(f"```python\n{_source(cell)}\n```")
            parts.extend(map(_shown, cell["outputs"]))
    note = (
        f"*This page is `notebooks/{notebook.name}` {outputs}. "
        f"[Download it]({notebook.name}) to run it where jblast is installed.*"
    )
    return "\n\n".join([parts[0], note, *filter(None, parts[1:])]) + "\n"


def _shown(output: dict[str, Any]) -> str:
    """Return an output of a cell: a picture, or else its text."""
    data = output.get("data", {})
    if "image/png" in data:
        picture = "".join(data["image/png"].split())
        return f'<p><img alt="Output" src="data:image/png;base64,{picture}"></p>'
    text = "".join(output.get("text") or data.get("text/plain", ""))
    return f"<pre><code>{html.escape(text.rstrip())}</code></pre>" if text else ""


def _cells(notebook: Path) -> list[dict[str, Any]]:
    return json.loads(notebook.read_text("utf-8"))["cells"]


def _source(cell: dict[str, Any]) -> str:
    return "".join(cell["source"])
