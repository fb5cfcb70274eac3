"""What there is to say of a quantity that can be measured or calculated."""

import math
from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "flash",
    "arrival",
    "time difference",
    "pressure",
    "impulse",
    "duration",
    "shock radius",
    "fireball radius",
    "direction",
    "speed",
    "displacement",
    "shape",
]
CLOCK_KINDS = ("flash", "arrival")
TIME_KINDS = (*CLOCK_KINDS, "time difference")
PULSE_KINDS = ("impulse", "duration")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """Something that can be measured, or calculated.

    Attributes:
        name: As in observation files, scene files and answers; it ends in the unit.
        unit: SI unit, "1" if there is none.
        words: What a sentence calls it.
        meaning: What it is.
        kind: Of which kind it is; flashes and arrivals are readings of a clock.
        largest: It lies within this either way, in its unit.
        circular: Whether it is the same after a full circle.
        placeless: Whether it is the same wherever its sensor stands.
        by_camera: Whether the scene's camera sees it.
        by_vehicle: Whether it is what happens to the scene's vehicle.
        default_sigma: Error of one more datum of it where no sensor says, in seconds or
            relative; None where none is proposed.
        parts: Quantities with a law, and their signs, whose sum it is.
    """

    name: str
    unit: str
    words: str
    meaning: str
    kind: Kind
    largest: float = math.inf
    circular: bool = False
    placeless: bool = False
    by_camera: bool = False
    by_vehicle: bool = False
    default_sigma: float | None = None
    parts: tuple[tuple[str, float], ...] = ()

    def with_article(self) -> str:
        """Return what one of it is called: "an air arrival"."""
        return f"{'an' if self.words[0] in 'aeiou' else 'a'} {self.words}"

    @property
    def tnt_factor(self) -> Literal["pressure", "impulse", "energy"]:
        """Which of an explosive's factors in TNT holds for it.

        Times go with them: an arrival follows the speed of the shock, so its pressure;
        a duration is the length of what the impulse sums.
        """
        if self.kind in PULSE_KINDS:
            return "impulse"
        return "energy" if self.kind == "shock radius" else "pressure"

    @property
    def feels_wind(self) -> bool:
        """Whether it changes with the speed of sound, and so with the wind."""
        return self.kind in (*TIME_KINDS, *PULSE_KINDS)
