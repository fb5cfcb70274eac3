"""Every notebook tells its story from top to bottom."""

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def read(path) -> Any:
    """Return a notebook."""
    return nbformat.read(path, as_version=4)


@each
def test_outputs_are_stripped(path):
    for cell in read(path).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.slow
@each
def test_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    # the kernel is started by this Python, in the notebook's folder, as a reader would
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    run = NotebookClient(
        read(path),
        timeout=900,  # a cell takes seconds, minutes on a busy machine
        kernel_name="python3",
        resources={"metadata": {"path": str(path.parent)}},
    ).execute()  # raises on the first error
    printed = [
        output
        for cell in run.cells
        for output in cell.get("outputs", [])
        if output.get("name") == "stderr"
    ]
    assert printed == []
