"""What a reader understood of a log that is not in our own words, to be told once."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Understood:
    """Something that was converted, skipped or supplied while a log was read.

    Findings are typed here and worded in `report.understood`.
    """
