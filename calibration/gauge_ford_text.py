"""What Ford's shots say of the laws, as text: every number in it is computed."""

import textwrap

import numpy as np

from calibration.ford_records import read_records
from calibration.gauge_ford import (
    DURATION,
    FARTHEST,
    IMPULSE,
    LAWS,
    SHALLOW,
    Shot,
    explained,
    log_ratio,
    rank_correlation,
    shallow,
    shots,
    spread,
)


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
