"""What part of the ground a map shows, and where on it there is room."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.report.fit.place.ground_map import ChargePlace, GroundMap

MARGIN = 0.12
NARROWEST = 0.5
"""Height over width of the flattest map, and width over height of the narrowest."""
SMALL = 0.1
"""An ellipse of less than this share of the map is drawn once more, larger."""


@dataclass(frozen=True)
class View:
    """A rectangle of ground [m]."""

    west: float
    east: float
    south: float
    north: float

    @property
    def width(self) -> float:
        """From west to east [m]."""
        return self.east - self.west

    @property
    def height(self) -> float:
        """From south to north [m]."""
        return self.north - self.south

    def holds(self, east: float, north: float) -> bool:
        """Return whether a place lies in it."""
        inside = self.west <= east <= self.east
        return bool(inside and self.south <= north <= self.north)


def view_of(places: Float[np.ndarray, "place 2"]) -> View:
    """Return the view that shows all places (east, north) [m] with a margin."""
    low, high = places.min(axis=0), places.max(axis=0)
    span = np.maximum(high - low, 1e-12)
    if span.max() < 1e-9:  # one place: ten metres about it
        span[:] = 10.0
    size = np.maximum(
        span * (1 + 2 * MARGIN), NARROWEST * span.max() * (1 + 2 * MARGIN)
    )
    middle = 0.5 * (low + high)
    (west, south), (east, north) = middle - size / 2, middle + size / 2
    return View(float(west), float(east), float(south), float(north))


def whole_view(shown: GroundMap) -> View:
    """Return the view of all sensors and charges, and of where those may have stood."""
    places = [station.position[:2] for station in shown.stations]
    for charge in shown.charges:
        places += _places_of(charge)
        places += [np.array(there) for there in charge.elsewhere]
    return view_of(np.array(places))


def close_view(charge: ChargePlace, whole: View) -> View | None:
    """Return the view of where a charge may have stood; None if the map shows it."""
    if not charge.ellipses:
        return None
    size = 2 * max(ellipse.major for ellipse in charge.ellipses)
    if size > SMALL * max(whole.width, whole.height) or not size > 0.0:
        return None
    places = _places_of(charge)
    if charge.accepted is not None and charge.draws is not None:
        away = np.hypot(*(np.array(charge.accepted) - charge.position[:2]))
        if away < 3 * size:
            places.append(np.array(charge.accepted))
    view = view_of(np.array(places))
    half = max(view.width, view.height) / 2  # a square
    east, north = (view.east + view.west) / 2, (view.north + view.south) / 2
    return View(east - half, east + half, north - half, north + half)


def _places_of(charge: ChargePlace) -> list[Float[np.ndarray, "2"]]:
    places = [charge.position[:2]]
    for ellipse in charge.ellipses:
        places += list(ellipse.outline(24))
    for region in charge.regions:
        places += [place for outer, _ in region.parts for place in outer]
    return places


def round_length(longest: float) -> float:
    """Return 1, 2 or 5 times a power of ten, no longer than a length [m]."""
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)


def free_corners(
    view: View, places: Float[np.ndarray, "place 2"]
) -> list[tuple[float, float]]:
    """Return the corners as shares of width and height, the emptiest first.

    Args:
        view: The view.
        places: What stands in it, (east, north) [m].
    """
    size = np.array([view.width, view.height])
    shares = (places - np.array([view.west, view.south])) / size
    corners = [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)]
    nearest = [np.hypot(*(shares - np.array(c)).T).min() for c in corners]
    return [corners[k] for k in np.argsort(nearest)[::-1]]
