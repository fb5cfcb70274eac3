"""Latitude, longitude and altitude as east, north and up in a local frame.

The frame touches the WGS84 ellipsoid at its origin, the mean of the sensors' positions
in space, and its axes are straight. Distances between positions are exact at any range;
ground at the height of the origin lies $d^2/2R$ below the plane at a distance $d$.
Heights are counted from one datum (`alt_m`) or from level ground (`up_m`), never both.
Positions more than 1,000 km from the others are refused: a sign or the order of
latitude and longitude is wrong. The transformations are those of pymap3d.
"""

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import ArrayLike, Bool, Float

from jblast.parameters import PLACE_LIMITS

METRES = ("east_m", "north_m")
DEGREES = ("lat_deg", "lon_deg")
DEGREE_DIGITS, HEIGHT_DIGITS = 12, 6
"""Decimals of geodetic positions: 1e-12 degrees are 0.1 um. Conversion to metres and
back is exact to 1e-13 degrees and 1e-8 m within 50 km."""
HEIGHTS = ("alt_m", "up_m")
"""Above the one datum of all heights, and above the ground there."""
MAX_DISTANCE = 1e6
"""Largest distance of a position from the others, or from the place of a scene [m].

Beyond it a sign, or the order of latitude and longitude, is probably wrong, and laws of
travel time along straight paths do not hold."""


@runtime_checkable
class Columns(Protocol):
    """The columns of a table: `observations.rows.Rows` is one."""

    @property
    def texts(self) -> MutableMapping[str, list[str]]:
        """Each column as it was written."""
        ...

    def number(self, column: str) -> Float[np.ndarray, " row"]:
        """Return a column of numbers, NaN where it has none."""
        ...

    def refuse(
        self,
        bad: Bool[np.ndarray, " row"] | list[bool],
        column: str,
        expected: Callable[[int], str],
    ) -> None:
        """Report bad rows, with the expected content of the column."""
        ...


@dataclass(frozen=True)
class Frame:
    """Local frame of east, north and up, tangent to the ellipsoid at its origin.

    The axes are straight: ground at the origin's height lies $d^2 / 2R$ below the plane
    at a distance $d$. Distances between positions are straight lines, exact at any
    range (`inference.fitting.assumptions.flat_ground` has the error of flat ground).

    Attributes:
        lat_deg: Geodetic latitude of the origin, WGS84 [degree].
        lon_deg: Its longitude, east positive [degree].
        alt_m: Its height above the ellipsoid, or above the one datum that all heights
            are counted from [m].

    Example:
        `Frame(33.9, 35.5, 10.0).to_enu(33.91, 35.5, 12.0)`
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0

    def to_enu(
        self,
        lat_deg: Float[ArrayLike, "*place"],
        lon_deg: Float[ArrayLike, "*place"],
        alt_m: Float[ArrayLike, "*place"],
    ) -> Float[np.ndarray, "*place 3"]:
        """Return east, north, up of places [m].

        Args:
            lat_deg: Geodetic latitudes [degree].
            lon_deg: Longitudes, of any turn [degree].
            alt_m: Heights by the datum of the origin's [m].
        """
        # imported here: it takes 0.2 s, and few logs are in degrees
        from pymap3d import geodetic2enu

        lat, lon, alt = np.broadcast_arrays(
            *(np.asarray(x, float) for x in (lat_deg, lon_deg, alt_m))
        )
        enu = geodetic2enu(lat, lon, alt, self.lat_deg, self.lon_deg, self.alt_m)
        return np.stack([np.asarray(axis, float) for axis in enu], axis=-1)

    def to_geodetic(
        self, enu_m: Float[ArrayLike, "*place 3"]
    ) -> Float[np.ndarray, "*place 3"]:
        """Return latitude, longitude (-180 to 180) [degree] and height of places [m].

        They are rounded to `DEGREE_DIGITS` and `HEIGHT_DIGITS`.

        Args:
            enu_m: East, north, up [m].
        """
        from pymap3d import enu2geodetic

        east, north, up = np.moveaxis(np.asarray(enu_m, float), -1, 0)
        lat, lon, alt = enu2geodetic(
            east, north, up, self.lat_deg, self.lon_deg, self.alt_m
        )
        # one turn: libraries return longitudes up to 360 degrees
        lon = (np.asarray(lon, float) + 180.0) % 360.0 - 180.0
        # the conversion's own rounding is below, so that positions are written as read
        places = [(lat, DEGREE_DIGITS), (lon, DEGREE_DIGITS), (alt, HEIGHT_DIGITS)]
        return np.stack([np.round(np.asarray(x), n) for x, n in places], axis=-1)


def places_of(rows: Columns) -> tuple[Float[np.ndarray, "row 3"], Frame | None]:
    """Return east, north, up of rows [m], and their frame if they are in degrees.

    Raises:
        InputError: As `places_in_degrees`.
    """
    on_earth = places_in_degrees(rows)
    if on_earth is not None:
        return on_earth
    return np.stack([rows.number(name) for name in (*METRES, "up_m")], axis=1), None


def places_in_degrees(
    rows: Columns,
) -> tuple[Float[np.ndarray, "row 3"], Frame] | None:
    """Return east, north, up of rows about the middle of their places, and that frame.

    Heights are `alt_m`, above the ellipsoid or any one datum, or `up_m`, above the
    ground, which is then level; without heights all positions are on the ground.

    Args:
        rows: The table.

    Returns:
        Positions [m], NaN where a row has no place; None if no row is in degrees.

    Raises:
        InputError: A row has half a position, or an impossible one, or the rows mix
            latitudes with metres, or heights above the datum with those above the
            ground; unless faults are gathered.
    """
    given = {name: _given(rows, name) for name in (*METRES, *DEGREES, *HEIGHTS)}
    degrees = given["lat_deg"] | given["lon_deg"]
    if not degrees.any():
        return None
    _refuse_mixed(rows, given)
    lat, lon, alt = (_within(rows, name) for name in PLACE_LIMITS)
    for name in DEGREES:
        rows.refuse(
            degrees & ~given[name], name, lambda _: "lat_deg and lon_deg, got nothing"
        )
    height = np.where(given["up_m"], rows.number("up_m"), alt)
    height = np.where(given["up_m"] | given["alt_m"], height, 0.0)
    sound = np.isfinite(lat) & np.isfinite(lon) & np.isfinite(height)
    if not sound.any():
        return np.full((len(degrees), 3), np.nan), Frame(0.0, 0.0)
    places = np.stack([lat, lon, height], axis=-1)
    # each position once, so that the origin does not depend on the number of readings
    distinct = np.unique(places[sound], axis=0)
    frame = mean_frame(*distinct.T)
    # heights above level ground: the altitude of the ground is unknown, and taken as 0
    if given["up_m"].any():
        frame = Frame(frame.lat_deg, frame.lon_deg)
    position = np.full(places.shape, np.nan)
    position[sound] = frame.to_enu(*places[sound].T)
    # After the conversion, since distances in degrees depend on the latitude. A median
    # is not moved by a few wrong positions, which are to be found.
    away = np.linalg.norm(position - np.nanmedian(position, axis=0), axis=1)
    rows.refuse(
        away > MAX_DISTANCE,
        "lat_deg",
        lambda row: (
            f"a place within {MAX_DISTANCE / 1e3:g} km of the other sensors, got one "
            f"{away[row] / 1e3:.4g} km away; is a sign missing, or are lat_deg and "
            "lon_deg swapped?"
        ),
    )
    return position, frame


def _given(rows: Columns, column: str) -> Bool[np.ndarray, " row"]:
    """Return where a column is not empty."""
    texts = rows.texts.get(column)
    if texts is None:
        return np.zeros(len(next(iter(rows.texts.values()))), bool)
    return np.array([bool(text) for text in texts], bool)


def _refuse_mixed(rows: Columns, given: Mapping[str, np.ndarray]) -> None:
    """Refuse metres beside degrees, and two kinds of height."""
    metres = given["east_m"] | given["north_m"]
    degrees = given["lat_deg"] | given["lon_deg"]
    rows.refuse(
        metres,
        "east_m" if given["east_m"].any() else "north_m",
        lambda row: (
            "all places as lat_deg, lon_deg or all as east_m, north_m; got metres "
            + (
                "beside degrees in one row"
                if degrees[row]
                else "here, degrees in others"
            )
        ),
    )
    rows.refuse(
        given["alt_m"] & given["up_m"],
        "up_m",
        lambda _: (
            "alt_m, the height above the ellipsoid, or up_m, that above the ground; "
            "got both"
        ),
    )
    # the first row decides the kind of height; errors then name the rows that differ
    for name, other in (HEIGHTS, HEIGHTS[::-1]):
        if given[name][np.argmax(degrees)]:
            rows.refuse(
                degrees & ~given[name] & given[other],
                other,
                lambda _, name=name: (
                    f"{name} as in the rows before, got another height"
                ),
            )
            rows.refuse(
                degrees & ~given[name] & ~given[other],
                name,
                lambda _: "a height as in the rows before, got nothing",
            )
            return
    rows.refuse(
        degrees & (given["alt_m"] | given["up_m"]),
        "alt_m" if given["alt_m"].any() else "up_m",
        lambda _: "no height, as in the rows before, or one in each row of degrees",
    )


def _within(rows: Columns, column: str) -> Float[np.ndarray, " row"]:
    """Return a column, NaN outside the bounds of a position on the Earth."""
    least, most = PLACE_LIMITS[column].at_least, PLACE_LIMITS[column].at_most
    numbers = rows.number(column)
    swapped = "; are lat_deg and lon_deg swapped?" if column == "lat_deg" else ""
    bad = (numbers < least) | (numbers > most)
    rows.refuse(
        bad,
        column,
        lambda row: (
            f"a number between {least:g} and {most:g}, got "
            f"{rows.texts[column][row]}{swapped}"
        ),
    )
    return np.where(bad, np.nan, numbers)


def mean_frame(
    lat_deg: Float[ArrayLike, " place"],
    lon_deg: Float[ArrayLike, " place"],
    alt_m: Float[ArrayLike, " place"],
) -> Frame:
    """Return the frame at the mean of positions and of their heights.

    The mean is taken of the points in space, so that neither the poles nor the date
    line is special.

    Args:
        lat_deg: Geodetic latitudes [degree].
        lon_deg: Longitudes [degree].
        alt_m: Heights [m].
    """
    from pymap3d import ecef2geodetic, geodetic2ecef

    # heights are averaged separately, as their datum need not be the ellipsoid
    level = np.zeros(np.shape(lat_deg))
    points = geodetic2ecef(np.asarray(lat_deg, float), np.asarray(lon_deg), level)
    x, y, z = (float(np.mean(axis)) for axis in points)
    lat, lon, _ = ecef2geodetic(x, y, z)
    return Frame(float(lat), float(lon), float(np.mean(alt_m)))
