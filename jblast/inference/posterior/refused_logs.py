"""Logs that no posterior is made of: rows without any error, and more than is held."""

from collections.abc import Mapping

import numpy as np

from jblast.errors import InputError
from jblast.observations import Observations
from jblast.registry import law_for
from jblast.scene import Scene
from jblast.sensors import Layout
from jblast.sensors.layout import components
from jblast.sensors.record import count_effects

HELD = 30_000_000
"""Rows times shared effects, of which a few times as many numbers (0.24 GB each) are
held in memory: a log with more is refused."""
WORK = 5_000_000_000
"""Rows times the square of the effects, gone through several times for each density:
with four times as much a fit took more than five minutes on two cores."""


def refuse_exact(
    observations: Observations, scatter: bool, laws: Mapping[str, str]
) -> None:
    """Refuse a row that neither its instrument nor its law gives any error.

    Raises:
        InputError: As said; the message names the first such row.
    """
    for quantity in dict.fromkeys(observations.quantity):
        of_law = [law_for(q, laws[q]) for q, _ in components(quantity)]
        if scatter and not all(law.is_exact() for law in of_law):
            continue
        of_kind = np.array([q == quantity for q in observations.quantity])
        for row in np.flatnonzero(of_kind & ~(observations.sigma > 0)):
            why = (
                f"{' and '.join(law.name for law in of_law)} is exact"
                if scatter
                else "the scene says scatter = false"
            )
            raise InputError(
                f"{observations.source or 'observations'}: "
                f"{observations.sensor[row]}, {quantity}: expected a sigma, since "
                f"{why}; got none"
            )


def refuse_vast(
    observations: Observations,
    scene: Scene,
    layout: Layout,
    laws: Mapping[str, str],
    shared_errors: int,
) -> None:
    """Refuse a log whose rows and effects of paths no memory holds.

    Raises:
        InputError: As said; the message counts them.
    """
    rows = len(observations)
    effects = count_effects(scene, layout, laws) + shared_errors
    if rows * effects > HELD or rows * effects**2 > WORK:
        raise InputError(
            f"{observations.source or 'observations'}: {rows} rows of "
            f"{len(set(layout.group))} paths share {effects} effects; expected rows "
            f"times effects to be at most {HELD:.0e}, and times their square "
            f"{WORK:.0e}: put the mean of a path's readings, and its sigma, in place "
            "of them all; or name a law that does not scatter from path to path"
        )
