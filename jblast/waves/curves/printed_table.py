"""The printed tables in `data/`: CSV beneath a head of comments with its provenance."""

import csv
from importlib.resources import files


def data_rows(name: str) -> list[dict[str, str]]:
    """Read the rows of a table, by column name.

    Args:
        name: Of the file in `data/`, without its ending.
    """
    text = files("jblast.waves").joinpath(f"data/{name}.csv").read_text()
    lines = (line for line in text.splitlines() if not line.startswith("#"))
    return list(csv.DictReader(lines))
