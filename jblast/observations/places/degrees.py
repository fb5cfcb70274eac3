"""The places of a table that gives latitudes and longitudes."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from jblast.observations.places.frame import FARTHEST, Frame, mean_frame
from jblast.parameter_table import PLACE_LIMITS

METRES = ("east_m", "north_m")
DEGREES = ("lat_deg", "lon_deg")
HEIGHTS = ("alt_m", "up_m")
"""Above the one datum of all heights, and above the ground there."""


@runtime_checkable
class Columns(Protocol):
    """The columns of a table: `observations.rows.Rows` is one."""

    @property
    def texts(self) -> Mapping[str, Sequence[str]]:
        """Each column as it was written."""
        ...

    def number(self, column: str) -> Float[np.ndarray, " row"]:
        """Return a column of numbers, NaN where it has none."""
        ...

    def refuse(
        self,
        bad: Bool[np.ndarray, " row"],
        column: str,
        expected: Callable[[int], str],
    ) -> None:
        """Tell bad rows, with what the column should hold."""
        ...


def places_of(rows: Columns) -> tuple[Float[np.ndarray, "row 3"], Frame | None]:
    """Return east, north, up of rows [m], and what frame of, if they are in degrees.

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
    ground, which is then taken as level; or there are none, and all stood on it.

    Args:
        rows: The table.

    Returns:
        Positions [m], NaN where a row has no place; None if no row is in degrees.

    Raises:
        InputError: A row has half a place, or one that is none, or the rows mix
            latitudes with metres, or heights above the sea with those above the ground;
            unless faults are gathered.
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
    distinct = np.unique(places[sound], axis=0)
    frame = mean_frame(*distinct.T)
    if given["up_m"].any():  # ground of one level, of which nobody said how high
        frame = Frame(frame.lat_deg, frame.lon_deg)
    position = np.full(places.shape, np.nan)
    position[sound] = frame.to_enu(*places[sound].T)
    _refuse_far(rows, position)
    return position, frame


def _given(rows: Columns, column: str) -> Bool[np.ndarray, " row"]:
    """Return where a column holds something."""
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
    """Return a column, NaN where it is out of what a place on Earth may have."""
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


def _refuse_far(rows: Columns, position: Float[np.ndarray, "row 3"]) -> None:
    """Refuse a place on another continent than most."""
    middle = np.nanmedian(position, axis=0)
    away = np.linalg.norm(position - middle, axis=1)
    rows.refuse(
        away > FARTHEST,
        "lat_deg",
        lambda row: (
            f"a place within {FARTHEST / 1e3:g} km of the other sensors, got one "
            f"{away[row] / 1e3:.4g} km away; is a sign missing, or are lat_deg and "
            "lon_deg swapped?"
        ),
    )
