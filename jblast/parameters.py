"""Table of all numbers of a scene that may be fixed, free or uncertain.

A row has the name, the SI unit, the position in a scene file, the default and the
bounds of a number, and the spread of the starts of a search. The table is pure data
without JAX. Its users are the reader of scene files, `--help`, fits (starting points)
and reports (names). A number of one of several charges is named `NAME.CHARGE`; the
offset of a sensor's or recorder's clock is `clock_offset_s.CLOCK`.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple, overload

from jblast.constants import (
    AIR_HEAT_CAPACITY_RATIO,
    GRANITE_P_SPEED,
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    STANDARD_TEMPERATURE,
)

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
        other_units: Units in which values are given by mistake, with their sizes.
    """

    above: float = -math.inf
    at_least: float = -math.inf
    at_most: float = math.inf
    other_units: tuple[tuple[str, float], ...] = ()

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
        if math.isfinite(self.at_most):
            return f"between {self.at_least:g} and {self.at_most:g}"
        if self.above == 0:
            return "positive"
        if math.isfinite(self.above):
            return f"above {self.above:g}"
        return "not negative" if self.at_least == 0 else f"at least {self.at_least:g}"

    def hint(self, value: float) -> str:
        """Return how a refused value reads in another unit; "" if it fits none."""
        for unit, size in self.other_units:
            if self.allows(value * size):
                return f"; {value:g} {unit} is {value * size:g}"
        return ""


POSITIVE = Bounds(above=0.0)
UNBOUNDED = Bounds()
# Air temperatures are those of Earth's troposphere, with a margin; the standard
# atmosphere's lowest layer ends at 11 km. No wind on the ground reaches 100 m/s.
TEMPERATURES = Bounds(at_least=150.0, at_most=400.0)
ALTITUDES = Bounds(at_least=-500.0, at_most=11_000.0)
# The standard atmosphere has 107 kPa at the lowest of these altitudes and 22.6 kPa at
# the highest; weather changes it by 5 %.
PRESSURES = Bounds(
    at_least=20e3,
    at_most=120e3,
    other_units=(("hPa", 100.0), ("kPa", 1e3), ("bar", 1e5)),
)
WINDS = Bounds(at_least=-100.0, at_most=100.0)


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
    "lat_deg": Bounds(at_least=-90.0, at_most=90.0),
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
class Parameter:
    """A number of a scene.

    Attributes:
        name: Name in results and on the command line; its suffix is the unit.
        unit: SI unit, "1" if there is none.
        words: Name in sentences.
        attribute: Attribute path in a scene of one charge; a tuple there is indexed by
            the key's index.
        key: Position in a scene file.
        spread: Spread of the starts of a search.
        default: Start of a fit unless the scene gives another.
        bounds: Bounds of its values.
        takes_the_place_of: Numbers that it replaces if it is given.
        decides: True if the choice of a sufficient method for a scene depends on it.
        opening: Start of a sentence about it; "" for one formed from `words`.
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
        """True if each charge has its own value."""
        return self.key.table == "charge"

    @property
    def positive(self) -> bool:
        """True if it is fitted in ln: positive numbers are searched by factors."""
        return self.spread.of == "factor"


# Spreads are declared: wide for a mass, which may be grams or kilotonnes, narrow for a
# state of the air, which is known to a few per cent.
_ROWS = (
    Parameter(
        name="charge_mass_kg",
        unit="kg",
        words="charge mass",
        attribute="charge.mass_kg",
        key=Key("charge", "mass_kg"),
        spread=Spread(100.0, "factor"),
        default=1.0,
        bounds=POSITIVE,
        decides=True,
        opening="The charge was {} of TNT",
    ),
    Parameter(
        name="tnt_factor",
        unit="1",
        words="TNT factor",
        attribute="charge.tnt_factor",
        key=Key("charge", "tnt_factor"),
        spread=Spread(1.5, "factor"),
        default=1.0,
        bounds=POSITIVE,
        decides=True,
    ),
    Parameter(
        name="charge_east_m",
        unit="m",
        words="charge east",
        attribute="charge.position_m",
        key=Key("charge", "position_m", 0),
        spread=Spread(1.0, "layout"),
        decides=True,
        opening="It stood at east {}",
    ),
    Parameter(
        name="charge_north_m",
        unit="m",
        words="charge north",
        attribute="charge.position_m",
        key=Key("charge", "position_m", 1),
        spread=Spread(1.0, "layout"),
        decides=True,
        opening="It stood at north {}",
    ),
    Parameter(
        name="charge_up_m",
        unit="m",
        words="charge up",
        attribute="charge.position_m",
        key=Key("charge", "position_m", 2),
        # Charges are near the ground, while sensors may be far away.
        spread=Spread(0.1, "layout"),
        decides=True,
        opening="It stood at height {}",
    ),
    Parameter(
        name="charge_range_m",
        unit="m",
        words="range of the charge",
        attribute="charge.range_m",
        key=Key("charge", "range_m"),
        spread=Spread(10.0, "factor"),
        default=100.0,
        bounds=POSITIVE,
        takes_the_place_of=("charge_east_m", "charge_north_m"),
        decides=True,
        opening="It stood {} from the sensor",
    ),
    Parameter(
        name="origin_time_s",
        unit="s",
        words="origin time",
        attribute="charge.time_s",
        key=Key("charge", "time_s"),
        spread=Spread(1.0, "travel"),
        opening="It exploded at {} on the sensors' clock",
    ),
    Parameter(
        name="air_temperature_k",
        unit="K",
        words="air temperature",
        attribute="air.temperature",
        key=Key("air", "temperature_k"),
        spread=Spread(1.05, "factor"),
        default=STANDARD_TEMPERATURE,
        bounds=TEMPERATURES,
    ),
    Parameter(
        name="air_pressure_pa",
        unit="Pa",
        words="air pressure",
        attribute="air.pressure",
        key=Key("air", "pressure_pa"),
        spread=Spread(1.1, "factor"),
        default=STANDARD_PRESSURE,
        bounds=PRESSURES,
        decides=True,
    ),
    Parameter(
        name="air_relative_humidity",
        unit="1",
        words="relative humidity",
        attribute="air.relative_humidity",
        key=Key("air", "relative_humidity"),
        spread=Spread(1.5, "factor"),
        default=0.5,
        bounds=Bounds(at_least=0.0, at_most=1.0),
    ),
    Parameter(
        name="air_altitude_m",
        unit="m",
        words="altitude",
        attribute="air.altitude",
        key=Key("air", "altitude_m"),
        spread=Spread(1000.0, "unit"),
        bounds=ALTITUDES,
        takes_the_place_of=("air_temperature_k", "air_pressure_pa"),
        decides=True,
    ),
    Parameter(
        name="air_sound_speed_m_s",
        unit="m/s",
        words="air sound speed",
        attribute="air.sound_speed",
        key=Key("air", "sound_speed_m_s"),
        spread=Spread(1.05, "factor"),
        default=STANDARD_SOUND_SPEED,
        bounds=POSITIVE,
        opening="The speed of sound in the air was {}",
    ),
    Parameter(
        name="wind_east_m_s",
        unit="m/s",
        words="wind to the east",
        attribute="air.wind_east",
        key=Key("air", "wind_m_s", 0),
        spread=Spread(5.0, "unit"),
        bounds=WINDS,
    ),
    Parameter(
        name="wind_north_m_s",
        unit="m/s",
        words="wind to the north",
        attribute="air.wind_north",
        key=Key("air", "wind_m_s", 1),
        spread=Spread(5.0, "unit"),
        bounds=WINDS,
    ),
    Parameter(
        name="ground_p_speed_m_s",
        unit="m/s",
        words="ground P-wave speed",
        attribute="ground.p_speed",
        key=Key("ground", "p_speed_m_s"),
        spread=Spread(1.5, "factor"),
        default=GRANITE_P_SPEED,
        bounds=POSITIVE,
        opening="The P-wave speed of the ground was {}",
    ),
    Parameter(
        name="sedov_gamma",
        unit="1",
        words="ratio of specific heats",
        attribute="sedov_gamma",
        key=Key("law", "sedov_gamma"),
        spread=Spread(1.05, "factor"),
        default=AIR_HEAT_CAPACITY_RATIO,
        # At 1 the energy of the air in the strong shock would be infinite.
        bounds=Bounds(above=1.0),
    ),
    Parameter(
        name="fireball_growth_s",
        unit="s",
        words="growth time of the fireball",
        attribute="fireball_growth",
        key=Key("law", "fireball_growth_s"),
        spread=Spread(10.0, "factor"),
        default=2.5e-3,  # growth time of a fireball of 15 kg
        bounds=POSITIVE,
    ),
)
PARAMETERS: dict[str, Parameter] = {row.name: row for row in _ROWS}
"""Numbers of a scene of one charge by name, except those of clocks."""
CLOCK = Parameter(
    name=CLOCK_OFFSET,
    unit="s",
    words="clock offset",
    attribute="clock_offset_s",
    key=Key("sensor", "clock_offset_s"),
    spread=Spread(1.0, "travel"),
)
"""Offset of a clock; a scene may have several."""


@dataclass(frozen=True, kw_only=True)
class DerivedNumber:
    """A number computed from those of a scene; fields as in `Parameter`."""

    name: str
    unit: str
    words: str
    opening: str = ""


DERIVED_NUMBERS: dict[str, DerivedNumber] = {
    row.name: row
    for row in (
        DerivedNumber(
            name="charge_tnt_mass_kg",
            unit="kg",
            words="TNT mass of the charge",
            opening="The charge was worth {} of TNT",
        ),
        DerivedNumber(
            name="charge_tnt_mass_by_impulse_kg", unit="kg", words="TNT mass by impulse"
        ),
        DerivedNumber(
            name="charge_energy_j",
            unit="J",
            words="energy",
            opening="Its energy was {}",
        ),
    )
}
"""Numbers that a result adds to a fitted mass."""


def described(name: str) -> Parameter | DerivedNumber | None:
    """Return the row of a number by any of its names; None if the name is unknown."""
    # The suffix names the charge or the clock.
    base = name.partition(".")[0]
    if base == CLOCK_OFFSET:
        return CLOCK
    return PARAMETERS.get(base) or DERIVED_NUMBERS.get(base)
