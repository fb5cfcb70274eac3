"""Quantities made of others: by each law that gives all the parts."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from jblast.quantities import components
from jblast.waves.waveform import friedlander_decay


@dataclass(frozen=True)
class Combination:
    """How a quantity is made of others.

    Attributes:
        parts: The others.
        function: Of their values, in that order.
        holds: Where it makes sense, of its own value.
        range: Where it holds, in words.
    """

    parts: tuple[str, ...]
    function: Callable[..., Any]
    holds: Callable[[Any], Any]
    range: str


COMBINATIONS = {
    "arrival_difference_s": Combination(
        parts=tuple(part for part, _ in components("arrival_difference_s")),
        function=lambda air, ground: air - ground,
        holds=lambda difference: difference > 0.0,
        range="where both of its arrivals hold and the air's is the later",
    ),
    "friedlander_decay": Combination(
        parts=("peak_overpressure_pa", "positive_impulse_pa_s", "positive_duration_s"),
        function=friedlander_decay,
        # below -1 the three do not belong to one Friedlander pulse
        holds=lambda decay: decay > -1.0,
        range="where its pressure, impulse and duration hold, and b > -1",
    ),
}


def combined_of(known: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Return the combinations whose parts are known, each under the parts' law name.

    Args:
        known: Pairs of quantity and law name.
    """
    known = tuple(known)
    names = dict.fromkeys(name for _, name in known)
    return tuple(
        (quantity, name)
        for quantity, combination in COMBINATIONS.items()
        for name in names
        if all((part, name) in known for part in combination.parts)
    )
