"""The Ford shots heard inside Z = 40, against Kingery and Bulmash and `ford_2021`.

Data: calibration/data/acoustic_ford2021.csv. Surface burst, Sachs-scaled with the air
of each shot. `ford_2021` was fitted to these records among others, so it is no test of
that law (`leave_out.py` is one); it shows what its ground term explains.

The text, of which every number is computed, is part 2 of `calibration.gauges`.
"""

import textwrap
from typing import NamedTuple

import numpy as np
from scipy.stats import rankdata

from calibration.ford_2021 import QUANTITIES, Records, read_records
from jblast.waves.laws.ford_2021 import (
    ford_2021_duration,
    ford_2021_form,
    ford_2021_impulse,
)
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
)
from jblast.waves.regression import log_scaled_place, packaged, softplus
from jblast.waves.scaling import scaled_distance

FARTHEST = 40.0
"""Where the tables of Kingery and Bulmash end [m/kg^(1/3)]."""

SHALLOW = -0.2
"""Shots deeper than this h/W^(1/3) are left out of the second summary, as in
`leave_out.py` [m/kg^(1/3)]."""

KINGERY_BULMASH = dict(
    zip(QUANTITIES, (kingery_bulmash_impulse, kingery_bulmash_duration), strict=True)
)
FORD = dict(zip(QUANTITIES, (ford_2021_impulse, ford_2021_duration), strict=True))


IMPULSE, DURATION = QUANTITIES
LAWS = {"KB": QUANTITIES, "KB, ground": (IMPULSE,), "ford": QUANTITIES}
"""Of which quantities each is compared."""


class Shot(NamedTuple):
    """Medians over the records of one shot inside Z = 40.

    Attributes:
        name: Of the shot.
        scaled_range: Of the records, nearest and farthest [m/kg^(1/3)].
        scaled_height: h/W^(1/3) [m/kg^(1/3)].
        n_records: How many.
        ratio: By law and quantity, observed over predicted.
    """

    name: str
    scaled_range: tuple[float, float]
    scaled_height: float
    n_records: int
    ratio: dict[str, dict[str, float]]


def near_records() -> Records:
    """Return the records inside Z = 40."""
    records = read_records()
    return records.where(_scaled(records) <= FARTHEST)


def _scaled(records: Records) -> np.ndarray:
    place = (records.slant_range, records.charge_mass, records.ambient_pressure)
    return np.asarray(scaled_distance(*place))


def _ground_factor(records: Records) -> np.ndarray:
    """Return what the ground leaves of an impulse, by the term of `ford_2021`.

    High above ground it is one. The term of duration is nearly a straight line there,
    which no law of a surface burst can be multiplied with.
    """
    _, _, b3, b4 = packaged("ford_2021", ford_2021_form)[IMPULSE].coefficients
    _, height = log_scaled_place(
        records.slant_range,
        records.charge_mass,
        records.height_of_burst,
        records.ambient_pressure,
    )
    return np.exp(-b4 * softplus(-b3 * np.asarray(height)))


def ratios(records: Records) -> dict[str, dict[str, np.ndarray]]:
    """Return observed over predicted of each record, by law and quantity."""
    told: dict[str, dict[str, np.ndarray]] = {law: {} for law in LAWS}
    for quantity in QUANTITIES:
        seen = records.value[quantity]
        place = (records.slant_range, records.charge_mass)
        air = (records.ambient_pressure, records.sound_speed)
        plain = seen / np.asarray(KINGERY_BULMASH[quantity](*place, *air))
        told["KB"][quantity] = plain
        if quantity == IMPULSE:
            told["KB, ground"][quantity] = plain / _ground_factor(records)
        ford = FORD[quantity](*place, records.height_of_burst, *air)
        told["ford"][quantity] = seen / np.asarray(ford)
    return told


def shots() -> list[Shot]:
    """Return every shot that was heard inside Z = 40, highest first."""
    found = []
    near = near_records()
    for name in dict.fromkeys(near.shot.tolist()):
        mine = near.where(near.shot == name)
        z = _scaled(mine)
        ratio = {
            law: {quantity: float(np.median(x)) for quantity, x in told.items()}
            for law, told in ratios(mine).items()
        }
        height = float(mine.scaled_height()[0])
        reach = (float(z.min()), float(z.max()))
        found.append(Shot(name, reach, height, len(z), ratio))
    return sorted(found, key=lambda shot: -shot.scaled_height)


def log_ratio(some: list[Shot], law: str, quantity: str) -> np.ndarray:
    """Return ln observed over predicted of each shot."""
    return np.log([shot.ratio[law][quantity] for shot in some])


def spread(some: list[Shot], law: str, quantity: str) -> float:
    """Return the standard deviation over shots, in ln."""
    return float(np.std(log_ratio(some, law, quantity), ddof=1))


def rank_correlation(some: list[Shot], law: str, quantity: str) -> float:
    """Return Spearman's correlation of a shot's ratio with its scaled height."""
    height = rankdata([shot.scaled_height for shot in some])
    ratio = rankdata(log_ratio(some, law, quantity))
    return float(np.corrcoef(height, ratio)[0, 1])


def explained(some: list[Shot], law: str, quantity: str) -> float:
    """Return the share of the variance about Kingery and Bulmash that a law takes."""
    return 1 - (spread(some, law, quantity) / spread(some, "KB", quantity)) ** 2


def shallow(some: list[Shot]) -> list[Shot]:
    """Return the shots that are not deep."""
    return [shot for shot in some if shot.scaled_height > SHALLOW]


def shots_table(some: list[Shot]) -> str:
    """Return a line a shot."""
    lines = [
        "                                         impulse seen over     duration over",
        "  shot     n    Z           h/W^1/3     KB  KB,ground   ford      KB   ford",
    ]
    for shot in some:
        low, high = (f"{z:.1f}" for z in shot.scaled_range)
        z = low if low == high else f"{low} to {high}"
        ratio = shot.ratio
        lines.append(
            f"  {shot.name:7s}{shot.n_records:3d}    {z:13s}{shot.scaled_height:+6.2f}"
            f"{ratio['KB'][IMPULSE]:8.2f}{ratio['KB, ground'][IMPULSE]:11.2f}"
            f"{ratio['ford'][IMPULSE]:7.2f}"
            f"{ratio['KB'][DURATION]:8.2f}{ratio['ford'][DURATION]:7.2f}"
        )
    return "\n".join(lines)


def summary(some: list[Shot]) -> str:
    """Return scatter over shots and its correlation with height, by law."""
    lines = ["             quantity   median   sd of ln   rank correlation with height"]
    for law, quantities in LAWS.items():
        for quantity in quantities:
            lines.append(
                f"  {law:11s}{quantity.split('_')[1]:11s}"
                f"{np.exp(np.median(log_ratio(some, law, quantity))):6.2f}"
                f"{spread(some, law, quantity):11.2f}"
                f"{rank_correlation(some, law, quantity):+31.2f}"
            )
    return "\n".join(lines)


def explanation(some: list[Shot]) -> str:
    """Return what explains the rest."""
    upper = shallow(some)
    high, low = some[0], some[-1]
    of_ford = np.exp(np.median(log_ratio(some, "ford", IMPULSE)))
    return textwrap.fill(
        f"Height or depth of burst, which Kingery and Bulmash do not have, explains "
        f"the "
        f"impulse: from {high.name} at {high.scaled_height:+.2f} to {low.name} at "
        f"{low.scaled_height:+.2f} m/kg^(1/3) it falls from "
        f"{high.ratio['KB'][IMPULSE]:.2f} to {low.ratio['KB'][IMPULSE]:.2f} of theirs, "
        f"and the ranks of the two are correlated by "
        f"{rank_correlation(some, 'KB', IMPULSE):+.2f}. The ground term of ford_2021 "
        f"takes {100 * explained(some, 'KB, ground', IMPULSE):.0f} % of the variance "
        f"in "
        f"ln, {100 * explained(upper, 'KB, ground', IMPULSE):.0f} % over the "
        f"{len(upper)} shots above {SHALLOW}, and leaves a median of "
        f"{np.exp(np.median(log_ratio(some, 'KB, ground', IMPULSE))):.2f}. Duration "
        f"scatters less, by {spread(some, 'KB', DURATION):.2f}; ford_2021 takes "
        f"{100 * explained(some, 'ford', DURATION):.0f} % of its variance "
        f"({100 * explained(upper, 'ford', DURATION):.0f} % above {SHALLOW}): the two "
        f"deepest last as long as those on the ground. Of its impulses by ford_2021 "
        f"the "
        f"records keep {of_ford:.2f}: these are its nearest, where the bend of the "
        f"curve "
        f"that was left out (ford_2021.py) would be felt.",
        88,
    )


def ford_text() -> str:
    """Return everything that is printed of the Ford shots."""
    some = shots()
    upper = shallow(some)
    title = (
        f"Ford shots: medians of the records inside Z = {FARTHEST:.0f}, "
        f"{len(some)} of {len(set(read_records().shot))} shots, surface burst\n"
        "KB, ground: times the ground term of ford_2021"
    )
    return "\n".join(
        (
            title,
            shots_table(some),
            f"over all {len(some)} shots",
            summary(some),
            f"over the {len(upper)} shots above h/W^(1/3) = {SHALLOW}",
            summary(upper),
            "",
            explanation(some),
        )
    )
