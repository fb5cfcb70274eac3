"""Measures a page in a browser at the widths of a telephone, a tablet and screens."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

WIDTHS = (400, 768, 1100, 1600)
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
needs_browser = pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
MEASURE = """<script>
addEventListener("load", () => {
  const measured = [...document.querySelectorAll("iframe")].map(frame => {
    const page = frame.contentDocument
    const rows = [...page.querySelectorAll("tr")].map(row => row.offsetHeight)
    return [page.documentElement.scrollWidth, Math.max(...rows)]
  })
  document.body.textContent = JSON.stringify(measured)
})
</script>"""


def widths_and_rows(page: str, folder: Path) -> dict[int, tuple[int, int]]:
    """Return the width of a page's content and its tallest table row, by window width.

    Lengths are in pixels.
    """
    frames = "".join(
        f'<iframe width="{width}" height="800" style="border: 0" '
        f'srcdoc="{html.escape(page)}"></iframe>'
        for width in WIDTHS
    )
    path = folder / "frames.html"
    path.write_text(f"<!doctype html><body>{frames}{MEASURE}</body>", "utf-8")
    assert BROWSER is not None
    words = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"]
    done = subprocess.run(
        [*words, path.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    body = re.search(r"<body>(\[.*\])</body>", done.stdout, re.DOTALL)
    assert body is not None, done.stdout[-500:]
    return dict(zip(WIDTHS, map(tuple, json.loads(body[1])), strict=True))


def check_legible(page: str, folder: Path, row_px: int = 130) -> None:
    """Check that a page does not scroll sideways and has no row above five lines.

    A line has 23 pixels, a row has 11 beside its lines."""
    found = widths_and_rows(page, folder)
    assert {w for w, (content, _) in found.items() if content > w} == set()
    assert {w: row for w, (_, row) in found.items() if row > row_px} == {}
