"""Sequences without a blast, as many as wanted: each kind as often as the others."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, UInt8

from jblast.verification.cases.flash.background import (
    RATE_HZ,
    ImageSensor,
    random_background,
)
from jblast.verification.cases.flash.lookalikes import EVERYDAY, LOOKALIKES

SECONDS = 0.3
"""Of a sequence; what looks like a flash begins in it, once or several times."""
KINDS = tuple(LOOKALIKES)
OTHERS = tuple(EVERYDAY)
"""Kinds that the test was not set by."""

Sequence = tuple[Float[np.ndarray, " frame"], UInt8[np.ndarray, "frame height width"]]


def negative(kind: str, seed: int, rate_hz: float = RATE_HZ) -> Sequence:
    """Return times [s] and linear grey frames of 8 bits without a blast.

    Args:
        kind: One of `KINDS` or `OTHERS`.
        seed: Another seed is another scene.
        rate_hz: Frames a second [Hz].
    """
    rng = np.random.default_rng([(KINDS + OTHERS).index(kind), seed])
    behind = random_background(rng, moving=1.0 if kind == "ego-motion" else 0.7)
    sensor = ImageSensor()
    if kind == "noise":
        worse = rng.uniform(1.0, 5.0)
        sensor = ImageSensor(0.008 * worse, 2e-4 * worse**2, 10 ** rng.uniform(-4, -2))
    disturbance = (LOOKALIKES | EVERYDAY)[kind](rng)
    times = np.arange(round(SECONDS * rate_hz)) / rate_hz
    frames = [
        sensor.seen(rng, disturbance(float(t), behind.light(float(t)))) for t in times
    ]
    return times, np.stack(frames)


def negatives(count: int, first: int = 0) -> Iterator[tuple[str, Sequence]]:
    """Return sequences of all kinds in turn, and what each is.

    Args:
        count: How many.
        first: Number of the first, so that work can be split.
    """
    for number in range(first, first + count):
        kind = KINDS[number % len(KINDS)]
        yield kind, negative(kind, number // len(KINDS))
