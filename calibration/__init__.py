"""Questions asked of real, published or simulated data: a script each, and its table.

`INDEX.md` lists every script with its question, data, kept result and page. A script
that answers several questions has parts, chosen by the first word of its command line.
"""

import csv
import sys
from collections.abc import Callable, Mapping
from pathlib import Path


def run_part(parts: Mapping[str, Callable[[], object]]) -> None:
    """Run the part named by the first word of the command line.

    The words after it are left in `sys.argv`, for the part's own options.

    Args:
        parts: By name; the first is the default.
    """
    names = list(parts)
    words = sys.argv[1:]
    if words[:1] in (["-h"], ["--help"]):
        print(sys.modules["__main__"].__doc__)
        print(f"parts: {', '.join(names)} (default: {names[0]})")
        return
    parts[sys.argv.pop(1) if words and words[0] in parts else names[0]]()


def table_rows(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table whose comments begin with #."""
    with file.open(encoding="utf-8") as lines:
        return list(csv.DictReader(line for line in lines if line[:1] != "#"))
