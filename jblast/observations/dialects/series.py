"""A record of pressure over time is no log: it is told so, and where it belongs."""

import numpy as np

from jblast.errors import InputError
from jblast.observations.dialects.table import Table
from jblast.units import unit_spelt
from jblast.units.spelling import spelt, words_of

LOG_COLUMNS = ("sensor", "quantity", "value", "value_utc")
MOST_LOOKED_AT = 1000
FEWEST = 3


def refuse_series(table: Table) -> None:
    """Refuse samples: a column of times that grows, and no word of a log.

    Raises:
        InputError: It is one.
    """
    keys = [spelt(name) for name in table.header]
    if any(name in keys for name in LOG_COLUMNS) or len(keys) < 2:
        return
    timed = [i for i, name in enumerate(table.header) if _is_time(name)]
    headless = all(_is_number(name) for name in table.header)
    if not timed and not headless:
        return
    try:
        texts = table.columns[timed[0] if timed else 0][:MOST_LOOKED_AT]
        times = np.array([float(text.replace(",", ".")) for text in texts])
    except ValueError:
        return
    if len(times) >= FEWEST and np.all(times[1:] > times[:-1]):
        raise InputError(
            f"{table.at(table.header_line)}: got {', '.join(table.header[:4])} over "
            f"{len(table.lines):,} growing times: a record of samples, not a log of "
            "measurements; pick its arrival and peak first (jblast pick)"
        )


def _is_time(name: str) -> bool:
    """Return whether a column's name says time, with or without a unit."""
    words = [word.lower() for word in words_of(name)]
    if not words or words[0] not in ("time", "t", "zeit"):
        return False
    rest = words[1:]
    return not rest or any(
        unit.dimension == "time" for unit in unit_spelt("_".join(rest))
    )


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
