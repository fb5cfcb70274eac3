"""Positions of the rows of a table, in metres or in degrees.

The frame of positions in degrees has its origin at the mean of the positions in space.
Heights are counted from one datum (`alt_m`) or from level ground (`up_m`), never both.
Positions more than 1,000 km from the others are refused: a sign or the order of
latitude and longitude is wrong.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.observations.places import MAX_DISTANCE, Frame, mean_frame
from jblast.observations.rules import Rows, Rule
from jblast.parameters import PLACE_LIMITS
from jblast.results import Note, conversion

METRES = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg")


class Positions(NamedTuple):
    """Positions of rows.

    Attributes:
        enu: East, north, up [m]; NaN in a row without a position.
        frame: Their origin on the Earth; None for a table in metres.
        notes: Conversions.
    """

    enu: Float[np.ndarray, "row 3"]
    frame: Frame | None = None
    notes: tuple[Note, ...] = ()


def positions(rows: Rows) -> Positions:
    """Return east, north, up of rows, in degrees about the middle of their places.

    Heights are `alt_m`, above the ellipsoid or any one datum, or `up_m`, above the
    ground, which is then level; without heights all positions are on the ground. A row
    with half a position, or an impossible one, is refused, as are latitudes beside
    metres, and heights of two kinds.

    Args:
        rows: The table; faults are added to it.
    """
    given = {name: rows.given(name) for name in (*METRES, *DEGREES, "alt_m")}
    degrees = given["lat_deg"] | given["lon_deg"]
    if not degrees.any():
        return Positions(np.stack([rows.number(name) for name in METRES], axis=1))
    numbers = {name: rows.number(name) for name in (*PLACE_LIMITS, "up_m")}
    for name, limits in PLACE_LIMITS.items():
        least, most = limits.at_least, limits.at_most
        bad = (numbers[name] < least) | (numbers[name] > most)
        swapped = "; are lat_deg and lon_deg swapped?" if name == "lat_deg" else ""
        message = f"a number between {least:g} and {most:g}, got {{got}}{swapped}"
        rows.refuse([Rule(name, bad, message)])
        numbers[name] = np.where(bad, np.nan, numbers[name])
    metres = given["east_m"] | given["north_m"]
    alt, up = given["alt_m"], given["up_m"]
    # the first row decides the kind of height; errors then name the rows that differ
    heights = alt + 2 * up
    odd = degrees & (heights != heights[np.argmax(degrees)])
    rows.refuse(
        [
            Rule(
                "east_m" if given["east_m"].any() else "north_m",
                metres,
                "all places as lat_deg, lon_deg or all as east_m, north_m; got metres "
                "beside degrees",
            ),
            Rule(
                "up_m",
                alt & up,
                "alt_m, the height above the ellipsoid, or up_m, that above the "
                "ground; got both",
            ),
            *(Rule(x, degrees & ~given[x], "lat_deg and lon_deg") for x in DEGREES),
            Rule("alt_m" if alt.any() else "up_m", odd, "the height as in rows before"),
        ]
    )
    height = np.where(up, numbers["up_m"], np.where(alt, numbers["alt_m"], 0.0))
    places = np.stack([numbers["lat_deg"], numbers["lon_deg"], height], axis=-1)
    sound, position = np.isfinite(places).all(axis=1), np.full(places.shape, np.nan)
    if not sound.any():
        return Positions(position, Frame(0.0, 0.0))
    # each position once, so that the origin does not depend on the number of readings
    frame = mean_frame(*np.unique(places[sound], axis=0).T)
    # heights above level ground: the altitude of the ground is unknown, and taken as 0
    if up.any():
        frame = Frame(frame.lat_deg, frame.lon_deg)
    position[sound] = frame.to_enu(*places[sound].T)
    # After the conversion, since distances in degrees depend on the latitude. A median
    # is not moved by a few wrong positions, which are to be found.
    away = np.linalg.norm(position - np.nanmedian(position, axis=0), axis=1)

    def far(row: int) -> str:
        return (
            f"expected a place within {MAX_DISTANCE / 1e3:g} km of the other sensors, "
            f"got one {away[row] / 1e3:.4g} km away; is a sign missing, or are lat_deg "
            "and lon_deg swapped?"
        )

    rows.refuse([Rule("lat_deg", away > MAX_DISTANCE, far)])
    west = int((numbers["lon_deg"] > 180.0).sum())
    notes = (conversion("longitudes_wrapped", rows=west),) if west else ()
    return Positions(position, frame, notes)
