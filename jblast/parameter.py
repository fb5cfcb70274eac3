"""What there is to say of a number of a scene."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from jblast.bounds import UNBOUNDED, Bounds


@dataclass(frozen=True)
class Key:
    """Where a number stands in a scene file.

    Attributes:
        table: The table, or tables.
        name: Of the key.
        index: Its place in the key's list, None where it stands alone.
    """

    table: str
    name: str
    index: int | None = None


class Spread(NamedTuple):
    """How far searches for a free number begin from where it is expected.

    Attributes:
        amount: One standard deviation.
        of: What the amount is counted in: "factor" multiplies the number; "unit" is the
            number's own; "layout" is how far the sensors stand from one another, or
            from the charge; "travel" is the time sound takes over that.
    """

    amount: float
    of: Literal["factor", "unit", "layout", "travel"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number of a scene.

    Attributes:
        name: As in answers and on the command line; it ends in the unit.
        unit: SI unit, "1" if there is none.
        words: What a sentence calls it.
        attribute: Where it lives in a scene of one charge; of a tuple there, the place
            in it is the key's.
        key: Where it stands in a scene file.
        spread: Of the starts of a search for it.
        default: Where a fit starts if nothing else is said.
        bounds: Where it may lie.
        takes_the_place_of: Numbers that are not used where it is given.
        decides: Whether it decides which method suffices for a scene.
        opening: How a sentence about it begins; "" leaves it to the words.
    """

    name: str
    unit: str
    words: str
    attribute: str
    key: Key
    spread: Spread
    default: float = 0.0
    bounds: Bounds = UNBOUNDED
    takes_the_place_of: tuple[str, ...] = ()
    decides: bool = False
    opening: str = ""

    @property
    def of_charge(self) -> bool:
        """Whether each charge has its own."""
        return self.key.table == "charge"

    @property
    def positive(self) -> bool:
        """Whether it is fitted in ln: what is positive is looked for by factors."""
        return self.spread.of == "factor"


@dataclass(frozen=True, kw_only=True)
class DerivedNumber:
    """What follows from the numbers of a scene; fields as in `Parameter`."""

    name: str
    unit: str
    words: str
    opening: str = ""
