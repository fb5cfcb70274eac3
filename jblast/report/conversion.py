"""What was done to a log, as comments of the one that was made of it."""

from pathlib import Path

import jblast
from jblast.observations import Observations
from jblast.report.understood import understood_lines


def conversion_comments(log: Observations) -> list[str]:
    """Return provenance: where a log comes from, and what was understood of it."""
    lines = [f"converted from {Path(log.source).name} by jblast {jblast.__version__}"]
    lines += understood_lines(log.understood)
    return [" ".join(line.split()) for line in lines]


def conversion_text(log: Observations, out: str) -> str:
    """Return what was written where, and what was done, for the terminal."""
    rows = "1 measurement" if len(log) == 1 else f"{len(log):,} measurements"
    done = understood_lines(log.understood) or ["nothing had to be converted"]
    return "".join(f"{line}\n" for line in (f"wrote {out}: {rows}", *done))
