"""The tables of a world: its blasts, and who perceived what of them when."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jblast.report.tables import comma_separated, commented
from jblast.scene import Charge
from jblast.world import DrawnWorld, Perceived

BLASTS = ("shot", "time_s", "east_m", "north_m", "up_m", "mass_kg")
PERCEIVED = ("shot", "entity", "sense", "time_s")


def blast_numbers(charge: Charge) -> list[float]:
    """Return time, east, north, up and mass of a charge."""
    numbers = (charge.time_s, *charge.position_m, charge.mass_kg)
    return [float(np.asarray(number)) for number in numbers]


def blasts_csv(world: DrawnWorld, comments: Sequence[str]) -> str:
    """Return a row for each blast, in order of time, with 12 digits."""
    rows: list[list[Any]] = [list(BLASTS)]
    for charge in world.charges:
        numbers = [f"{number:.12g}" for number in blast_numbers(charge)]
        rows.append([charge.name, *numbers])
    return commented(comments) + comma_separated(rows)


def perceived_csv(perceived: Sequence[Perceived], comments: Sequence[str]) -> str:
    """Return a row for each sense and blast, in order of time, with 12 digits."""
    rows = [list(PERCEIVED)]
    rows += [[p.shot, p.entity, p.sense, f"{p.time_s:.12g}"] for p in perceived]
    return commented(comments) + comma_separated(rows)
