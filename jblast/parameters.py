"""Table of all numbers of a scene that may be fixed, free or uncertain.

`parameters.csv` has a row for each: its position in a scene file, default (a number or
the name of a constant) and bounds, and the spread of the starts of a search. The table
is pure data without JAX. Its users are the reader of scene files, `--help`, fits
(starting points) and reports (names). A number of one of several charges is named
`NAME.CHARGE`; the offset of a sensor's or recorder's clock is `clock_offset_s.CLOCK`.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, overload

from jblast import constants
from jblast.errors import require, shown
from jblast.quantities import UNITS, rows_of, unit_suffix

# The command line checks options by these bounds before NumPy is imported.
if TYPE_CHECKING:
    import numpy as np

CHARGE_POSITION = ("charge_east_m", "charge_north_m", "charge_up_m")
CLOCK_OFFSET = "clock_offset_s"
"""`clock_offset_s.NAME` is the offset of a sensor's, or of a recorder's, clock."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of a number. An absent bound accepts everything, also NaN.

    Attributes:
        above: Exclusive lower bound.
        at_least: Lower bound.
        at_most: Upper bound.
        other_units: Units in which values are given by mistake, after their dimension.
        advice: Advice on values out of bounds.
    """

    above: float = -math.inf
    at_least: float = -math.inf
    at_most: float = math.inf
    other_units: tuple[str, ...] = ()
    advice: str = ""

    @overload
    def allows(self, value: float) -> bool: ...

    @overload
    def allows(self, value: "np.ndarray") -> "np.ndarray": ...

    def allows(self, value):
        """Return whether a number is within the bounds, elementwise for arrays."""
        return (
            # `|` and `&`, so that arrays are compared elementwise.
            ((value > self.above) | (self.above == -math.inf))
            & ((value >= self.at_least) | (self.at_least == -math.inf))
            & ((value <= self.at_most) | (self.at_most == math.inf))
        )

    def words(self) -> str:
        """Return the bounds in words."""
        if math.isfinite(self.at_most) and math.isfinite(self.above):
            return f"above {self.above:g} and at most {self.at_most:g}"
        if math.isfinite(self.at_most):
            return f"between {self.at_least:g} and {self.at_most:g}"
        if self.above == 0:
            return "positive"
        if math.isfinite(self.above):
            return f"above {self.above:g}"
        return "not negative" if self.at_least == 0 else f"at least {self.at_least:g}"

    def that_is(self) -> str:
        """Return " that is positive", or other bounds in words; "" without bounds."""
        return "" if self == UNBOUNDED else f" that is {self.words()}"

    def checked(
        self, value: float, where: str, what: str = "a number", got: Any = None
    ) -> float:
        """Return a number within the bounds.

        Args:
            value: The number.
            where: File, key or argument, for the message.
            what: Noun of the number, for the message.
            got: The number as it is written; None: the number.

        Raises:
            InputError: It is out of bounds; the message names a unit that fits.
        """
        actual = f"{value:g}" if got is None else shown(got)
        expected = f"{what} that is {self.words()}"
        require(self.allows(value), where, expected, f"{actual}{self.hint(value)}")
        return value

    def hint(self, value: float) -> str:
        """Return how a refused value reads in another unit, or the advice."""
        from jblast.units import to_si  # imports NumPy

        for unit in self.other_units[1:]:
            in_si = to_si(value, unit, self.other_units[0])
            if self.allows(in_si):
                return f"; {value:g} {unit} is {in_si:g}"
        return self.advice and f"; {self.advice}"


POSITIVE = Bounds(above=0.0)
NOT_NEGATIVE = Bounds(at_least=0.0)
UNBOUNDED = Bounds()
NUMBER_SIZES = (1e-30, 1e30)
"""Bounds of a number other than 0: beyond them its powers overflow, or are 0."""


class Place(NamedTuple):
    """A position on the Earth, WGS84.

    Attributes:
        lat_deg: Geodetic latitude [degree].
        lon_deg: Longitude, east positive [degree].
        alt_m: Height above the ellipsoid, or above the common datum of all heights [m].
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0


# The lowest land is 0.43 km below the sea; 100 km is the edge of the atmosphere.
PLACE_LIMITS = {
    "lat_deg": Bounds(
        at_least=-90.0, at_most=90.0, advice="are latitude and longitude swapped?"
    ),
    "lon_deg": Bounds(at_least=-180.0, at_most=360.0),
    "alt_m": Bounds(at_least=-1e3, at_most=1e5),
}
"""Bounds of latitudes, longitudes (-180 to 180, or 0 to 360) and heights."""


@dataclass(frozen=True)
class Key:
    """Position of a number in a scene file.

    Attributes:
        table: The table, or tables.
        name: Name of the key.
        index: Index in the key's list; None for a key with a single number.
    """

    table: str
    name: str
    index: int | None = None


class Spread(NamedTuple):
    """Spread of the starts of a search for a free number about its expected value.

    Attributes:
        amount: One standard deviation.
        of: Unit of the amount: "factor" multiplies the number; "unit" is the number's
            own; "layout" is the distance of the sensors from one another, or from the
            charge; "travel" is the travel time of sound over that distance.
    """

    amount: float
    of: Literal["factor", "unit", "layout", "travel"]


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number of a scene, or one computed from them.

    Attributes:
        name: Name in results and on the command line; its suffix is the unit.
        words: Name in sentences.
    """

    name: str
    words: str

    @property
    def unit(self) -> str:
        """SI unit, "1" if there is none."""
        return UNITS[unit_suffix(self.name)] or "1"


@dataclass(frozen=True, kw_only=True)
class Parameter(Number):
    """A number of a scene.

    Attributes:
        attribute: Attribute path in a scene of one charge; a tuple there is indexed by
            the key's index.
        key: Position in a scene file.
        spread: Spread of the starts of a search.
        default: Start of a fit unless the scene gives another.
        bounds: Bounds of its values.
        takes_the_place_of: Numbers that it replaces if it is given.
        decides: True if the choice of a sufficient method for a scene depends on it.
    """

    attribute: str
    key: Key
    spread: Spread
    default: float = 0.0
    bounds: Bounds = UNBOUNDED
    takes_the_place_of: tuple[str, ...] = ()
    decides: bool = False

    @property
    def of_charge(self) -> bool:
        """True if each charge has its own value."""
        return self.key.table == "charge"

    @property
    def positive(self) -> bool:
        """True if it is fitted in ln: positive numbers are searched by factors."""
        return self.spread.of == "factor"


def _number(row: dict[str, str]) -> Number:
    if not row["table"]:
        return Number(name=row["name"], words=row["words"])
    of: Any = row["of"]
    default = row["default"]
    bounds = Bounds(
        above=float(row["above"] or -math.inf),
        at_least=float(row["at_least"] or -math.inf),
        at_most=float(row["at_most"] or math.inf),
        other_units=tuple(row["other_units"].split()),
    )
    return Parameter(
        name=row["name"],
        words=row["words"],
        attribute=row["attribute"],
        key=Key(row["table"], row["key"], int(row["index"]) if row["index"] else None),
        spread=Spread(float(row["spread"]), of),
        default=getattr(constants, default) if default.isupper() else float(default),
        bounds=bounds,
        takes_the_place_of=tuple(row["replaces"].split()),
        decides=row["decides"] == "yes",
    )


# Spreads are declared: wide for a mass, which may be grams or kilotonnes, narrow for a
# state of the air, which is known to a few per cent. The height of a charge has a
# tenth of the layout, because charges are near the ground, while sensors may be far
# away. The growth time of a fireball is that of 15 kg.
# Bounds of the air are those of Earth's troposphere, with a margin: the lowest layer of
# the standard atmosphere ends at 11 km, with 22.6 kPa, and no wind on the ground
# reaches 100 m/s. At a ratio of specific heats of 1 the energy of the air in the strong
# shock would be infinite.
_TABLE = [_number(row) for row in rows_of(Path(__file__).with_suffix(".csv"))]
PARAMETERS = {
    row.name: row
    for row in _TABLE
    if isinstance(row, Parameter) and row.name != CLOCK_OFFSET
}
"""Numbers of a scene of one charge by name, except those of clocks."""
(CLOCK,) = (
    row for row in _TABLE if isinstance(row, Parameter) and row.name == CLOCK_OFFSET
)
"""Offset of a clock; a scene may have several."""
DERIVED_NUMBERS = {row.name: row for row in _TABLE if not isinstance(row, Parameter)}
"""Numbers that a result adds to a fitted mass."""


def described(name: str) -> Number | None:
    """Return the row of a number by any of its names; None if the name is unknown."""
    # The suffix names the charge or the clock.
    base = name.partition(".")[0]
    return next((row for row in _TABLE if row.name == base), None)
