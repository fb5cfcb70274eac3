r"""Which instants of a simulated explosion are rendered, and what they stand for.

A frame stands for a phase: time since the burst over the fireball's duration. The law's
radius grows with a time constant of a 258th of that (1 kg), so growth is over where the
fire has hardly begun; the simulation is as long in steps as the eye wants it, and a
table says which phase a step stands for. Pictures are scaled to the law's radius, so
that only shapes come from here.
"""

import math
from typing import NamedTuple

import numpy as np

from jblast.errors import InputError, argument, shown

STEPS = (1.0, 7.0, 14.0, 38.0, 60.0)
"""Steps of the simulation at which phases are given; ln phase is linear between."""

PHASES = (0.0004, 0.016, 0.08, 1.0, 3.5)
"""What these steps stand for: burst, growth over, fire in full, fire out, smoke."""

LAST = int(STEPS[-1])
"""Step with which the simulation ends."""

FADES = (0.85, 1.5)
"""Phases between which the last embers go out."""


class Instant(NamedTuple):
    """A frame of a set.

    Attributes:
        step: Of the simulation, from 1.
        phase: Time since the burst over the fireball's duration.
        fade: Factor of its heat: embers go out at last.
    """

    step: int
    phase: float
    fade: float


def timeline(number: int) -> list[Instant]:
    """Return the instants of so many frames, at even steps of the simulation.

    Raises:
        InputError: There would be fewer than two, or more than there are steps.
    """
    if not 2 <= number <= LAST:
        raise InputError(
            f"{argument('frames')}: expected 2 to {LAST} frames, got {shown(number)}"
        )
    steps = np.rint(np.linspace(1, LAST, number)).astype(int)
    logs = np.interp(steps, STEPS, np.log(PHASES))
    out, gone = FADES
    return [
        Instant(
            step=int(step),
            phase=float(f"{math.exp(log):.4g}"),
            fade=min(1.0, max(0.0, (gone - math.exp(log)) / (gone - out))),
        )
        for step, log in zip(steps, logs, strict=True)
    ]
