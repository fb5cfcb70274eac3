"""Random blasts of a scene: number, position, mass and time, fixed or with a prior."""

import math
from typing import Literal, NamedTuple

from jblast.scene.uncertain import Prior, Uniform
from jblast.types import (
    Array,
    ArrayLike,
    Float,
    Module,
    Scalar,
    as_numbers,
    field,
    number,
)

About = Literal["world", "vehicle"]
ABOUT: tuple[About, ...] = ("world", "vehicle")
"""Centres of a region: the origin, or the target position of the vehicle."""
COUNT, GAP_S = 5, 0.5
"""Defaults of the number of blasts and the minimum time between two [s]; declared."""
AROUND = (-50.0, -50.0, 0.0), (50.0, 50.0, 0.0)
"""Default corners of the region of blasts [m]; declared."""
Number = Scalar | Prior
"""A number of a world: fixed, or the prior that it is sampled from."""


def _number(value: ArrayLike | Prior) -> Number:
    return value if isinstance(value, Prior) else as_numbers(value)


class Box(Module):
    """Region of positions, uniform between two corners.

    Attributes:
        low: Minimum east, north, up [m].
        high: Maximum east, north, up [m]; up may equal the minimum.
    """

    low: Float[Array, "3"] = field(converter=as_numbers)
    high: Float[Array, "3"] = field(converter=as_numbers)


class Ring(Module):
    """Region of positions on the ground, uniform over the area of a ring.

    Attributes:
        inner: Minimum horizontal distance [m].
        outer: Maximum horizontal distance [m].
    """

    inner: Scalar = number()
    outer: Scalar = number()


class ByCount(Module):
    """A fixed number of blasts, with uniform times given the gaps.

    Attributes:
        count: Number of blasts.
    """

    count: int = field(static=True)


class ByRate(Module):
    """Waiting times beyond the gap are exponential.

    Attributes:
        rate: Rate of the exponential distribution, 1 over its mean [1/s].
    """

    rate: Number = field(converter=_number)


class ByTick(NamedTuple):
    """At each tick a blast occurs with a fixed probability (thesis, algorithm 4).

    Attributes:
        probability: Probability of a blast at a tick after the gap [-].
        tick: Time between ticks [s].
    """

    probability: float
    tick: float


class WorldSpec(Module):
    """Distribution of random blasts, which `jblast.world` samples.

    Attributes:
        occurrence: Their number and the distribution of their times.
        region: Region of their positions.
        about: Centre of the region.
        mass: Mass of each charge [kg].
        time: Time of each blast on the common clock [s]; for `ByRate` and `ByTick` a
            `Uniform` over the interval with blasts.
        gap: Minimum time between two blasts [s]; one number per world.
    """

    occurrence: ByCount | ByRate | ByTick = field(
        default_factory=lambda: ByCount(COUNT)
    )
    region: Box | Ring = field(default_factory=lambda: Box(*AROUND))
    about: About = field(static=True, default="world")
    mass: Number = field(converter=_number, default_factory=lambda: Uniform(5.0, 15.0))
    time: Number = field(converter=_number, default_factory=lambda: Uniform(1.0, 20.0))
    # The gap keeps the waves of two blasts apart in a record.
    gap: Number = field(converter=_number, default=GAP_S)

    @property
    def window(self) -> tuple[float, float]:
        """Interval with blasts [s]; infinite for a prior that is not uniform."""
        # Only a uniform prior has bounds: others may give any time.
        if isinstance(self.time, Uniform):
            return float(self.time.lo), float(self.time.hi)
        if not isinstance(self.time, Prior):
            return float(self.time), float(self.time)
        return -math.inf, math.inf
