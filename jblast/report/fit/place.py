"""Positions of the charge and the sensors, for the map and as text."""

import math
import textwrap
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.place import (
    ConfidenceEllipse,
    CredibleRegion,
    PlaceOnEarth,
    ShockRing,
    charge_ellipse,
    confidence_ellipse,
    credible_regions,
    on_earth,
    place_draws,
    rests_on_clocks,
    shock_rings,
)
from jblast.inference.posterior.parameters import Estimate
from jblast.observations.instants import written
from jblast.observations.places import Frame
from jblast.report.estimates import Accepted, outlier_rows
from jblast.report.words import law_words, printed_number

EDGES = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
"""Residuals at which the colour changes [sd]: 2 and 3 sd are what readers look for."""
COLOURS = (
    *("#2166ac", "#67a9cf", "#d1e5f0"),
    "#f7f7f7",
    *("#fddbc7", "#ef8a62", "#b2182b"),
)
"""ColorBrewer's RdBu with seven classes, which is safe for colour-blind readers."""
NO_RESIDUAL = "#b0b0b0"
"""Colour of a sensor without a residual."""
MARGIN = 0.12
"""Margin of a map as a share of its positions' extent: room for names."""
MIN_ASPECT = 0.5
"""Least height over width, and width over height, of a map: sensors in a line would
otherwise make a strip without room for names."""
INSET_BELOW = 0.1
"""An ellipse below this share of the map's side gets an enlarged map: on a map of 5
inches it is half an inch, about two star markers."""
MARK_SHARE = 0.01
"""Share of the map's extent within which positions of one sensor are one mark: the
width of its symbol on a map of 5 inches."""
SHARES = (0.5, 0.9)
"""Shares of the posterior, one ellipse each."""


def residual_colour(residual_sd: float) -> str:
    """Return the colour of a residual [sd] as #rrggbb."""
    if math.isnan(residual_sd):
        return NO_RESIDUAL
    steps = sum(abs(residual_sd) > edge for edge in EDGES if edge > 0.0)
    return COLOURS[len(COLOURS) // 2 + (steps if residual_sd > 0.0 else -steps)]


def earth_lines(fit: Fit) -> list[str]:
    """Return a sentence for each charge of a log in degrees or with dates."""
    lines = []
    earth = on_earth(fit)
    for shot, charge in enumerate(fit.scene.charges):
        found = earth.charges_on_earth[shot]
        named = f"{charge.name}: it" if charge.name else "The charge"
        why = "if the clocks agree" if rests_on_clocks(fit, shot) else "as given"
        parts = [f"{named} was at {_place(found.place, why)}"] if found.place else []
        if found.origin_time_utc:
            when = _time(fit, f"origin_time_s{fit.scene.label(charge)}")
            by = f" by the clock {earth.origin_clock}" if earth.origin_clock else ""
            subject = "it" if parts else named
            parts.append(f"{subject} exploded at {when}{by}")
        if parts:
            lines.append("; ".join(parts) + ".")
    return lines


def _place(place: PlaceOnEarth, without_ellipse: str) -> str:
    """Return a position with its 90 % ellipse, or the reason for having none."""
    at = degrees(place.lat_deg, place.lon_deg)
    if place.ellipse_90_m is None:
        return f"{at}, {without_ellipse}"
    major, minor, azimuth = place.ellipse_90_m
    long, wide = (printed_number("_m", 2.0 * half, 2) for half in (major, minor))
    return (
        f"{at}, 90 % ellipse with axes {long} by {wide}, longer one towards "
        f"{math.degrees(azimuth):.0f} degrees"
    )


def _time(fit: Fit, name: str) -> str:
    """Return an origin time to its significant digits: 2020-08-04 15:08:18.31 UTC."""
    epoch, estimate = (
        fit.observations.epoch,
        fit.summary.estimates.get(name, Estimate()),
    )
    if epoch is None:
        return ""
    half = 0.5 * (estimate.q95 - estimate.q05)
    if not half > 0.0:
        value = float(fit.origin_time[0])
        return f"{written(epoch, value)[:-1].replace('T', ' ')} UTC"
    # datetime has six decimals of a second
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 6)
    text = written(epoch, round(estimate.value, decimals))[:-1].replace("T", " ")
    text = text[: len(text) - 6 + decimals] if decimals else text[:-7]
    return f"{text} UTC ± {half:.{decimals}f} s (90 %)"


@dataclass(frozen=True)
class ChargePlace:
    """A charge on the map.

    Attributes:
        name: Name of the charge; "" if there is only one.
        shot: Index of the charge in the scene.
        position: East, north, up at the answer [m].
        is_fitted: Whether its position was fitted, not fixed.
        draws: Draws of its position (east, north) [m]; None if it was fixed.
        ellipses: One ellipse for each of `SHARES`; none if it was fixed.
        regions: One credible region for each of `SHARES`, if an ellipse would mislead.
        rings: Ranges at which its peak overpressure falls to some values.
        elsewhere: Other optima, (east, north) [m].
        accepted: Published position (east, north) [m], if known.
        rests_on_clocks: Whether the position is identified only if clocks agree that
            were assumed to; then it has neither ellipses nor regions.
    """

    name: str
    shot: int
    position: Float[np.ndarray, "3"]
    is_fitted: bool
    draws: Float[np.ndarray, "draw 2"] | None
    ellipses: tuple[ConfidenceEllipse, ...]
    regions: tuple[CredibleRegion, ...]
    rings: tuple[ShockRing, ...]
    elsewhere: tuple[tuple[float, float], ...] = ()
    accepted: tuple[float, float] | None = None
    rests_on_clocks: bool = False


@dataclass(frozen=True)
class Station:
    """A sensor on the map.

    Attributes:
        name: Name in the log.
        position: East, north, up [m].
        residuals: Pairs of quantity and residual [sd], one per row of the log.
        suspected: Whether one of them is a suspected outlier.
    """

    name: str
    position: Float[np.ndarray, "3"]
    residuals: tuple[tuple[str, float], ...]
    suspected: bool = False

    @property
    def worst(self) -> float:
        """The residual that is furthest from 0 [sd]; NaN if there is none."""
        finite = [r for _, r in self.residuals if np.isfinite(r)]
        return max(finite, key=abs, default=float("nan"))


@dataclass(frozen=True)
class GroundMap:
    """Contents of a map.

    Attributes:
        stations: Sensors with known positions.
        charges: Charges with known or fitted positions.
        wind: Wind towards east and north [m/s].
        frame: Origin of east, north, up on the Earth; None if unknown.
    """

    stations: tuple[Station, ...]
    charges: tuple[ChargePlace, ...]
    wind: tuple[float, float]
    frame: Frame | None


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
        """Return whether a position lies in the view."""
        inside = self.west <= east <= self.east
        return bool(inside and self.south <= north <= self.north)


def map_notes(shown: GroundMap, view: View, width: int) -> list[str]:
    """Return the lines below a map: its key, rings, corners in degrees.

    Args:
        shown: Contents of the map.
        view: Rectangle of ground that is shown.
        width: Width of a line [characters].
    """
    key = ["circles: sensors"]
    if any(charge.rests_on_clocks for charge in shown.charges):
        key += ["star: charge, if the clocks agree; no ellipse without that"]
    elif any(charge.is_fitted for charge in shown.charges):
        regions = any(charge.regions for charge in shown.charges)
        key += ["star: charge"]
        key += ["blue: 50 and 90 % of the posterior" + ", dashed as ellipses" * regions]
    elif shown.charges:
        key += ["star: charge, position fixed"]
    else:
        key += ["the position of the charge is not identified"]
    if any(charge.accepted for charge in shown.charges):
        key += ["cross: accepted position, if in view"]
    if any(charge.elsewhere for charge in shown.charges):
        key += ["orange crosses: other optima"]
    if any(station.suspected for station in shown.stations):
        key += ["ringed: suspected outlier"]
    lines = _broken(key, "   ·   ", width)
    for charge in shown.charges:
        for line in ring_lines(charge):
            lines += textwrap.wrap(line, width)
    if shown.frame is not None:
        corners = np.array([[view.west, view.south, 0.0], [view.east, view.north, 0.0]])
        (south, west, _), (north, east, _) = shown.frame.to_geodetic(corners)
        ends = [
            f"lower left {degrees(south, west)}",
            f"upper right {degrees(north, east)} (WGS84)",
        ]
        lines += _broken(ends, "   ·   ", width)
    return lines


def _broken(parts: list[str], between: str, width: int) -> list[str]:
    """Join parts into lines of at most a width."""
    lines = [parts[0]]
    for part in parts[1:]:
        longer = lines[-1] + between + part
        lines[-1:] = [longer] if len(longer) <= width else [lines[-1], part]
    return lines


def ring_lines(charge: ChargePlace) -> list[str]:
    """Return a line with the ranges of some peak overpressures; none without rings."""
    if not charge.rings:
        return []
    of = f" of {charge.name}" if charge.name else ""
    reaches = [
        f"{printed_number('_pa', ring.peak_overpressure_pa)} to "
        f"{printed_number('_m', ring.range_m, 3)}" + "*" * (not ring.valid)
        for ring in charge.rings
    ]
    # no-break spaces keep a number and its unit on one line, and the footnote
    reach = ", ".join(reaches).replace(" kPa", "\u00a0kPa").replace(" m", "\u00a0m")
    starred = "* outside the law's range".replace(" ", "\u00a0")
    outside = f"; {starred}" * any(not r.valid for r in charge.rings)
    law = law_words(charge.rings[0].law)
    wide = any(ring.range_q05_m < ring.range_q95_m for ring in charge.rings)
    band = ", with its 90 % band" if wide else ""
    return [f"grey: peak overpressure{of} by {law}{band}: {reach}{outside}"]


def degrees(lat: float, lon: float) -> str:
    """Return a position as 47.12345° N, 8.54321° E."""
    ns, ew = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"{abs(lat):.5f}° {ns}, {abs(lon):.5f}° {ew}"


def absent_map_note(fit: Fit) -> str:
    """Return the reason for having no map."""
    if np.isfinite(fit.observations.slant_range).any():
        return "No map: the log has ranges, but no positions of sensors."
    return "No map: the log has no positions of sensors."


def map_alt(fit: Fit) -> str:
    """Return the alternative text of a map, for screen readers."""
    parts = []
    for shot, charge in enumerate(fit.scene.charges):
        if (ellipse := charge_ellipse(fit, shot=shot)) is not None:
            of = f" of {charge.name}" if charge.name else ""
            long, wide = (
                printed_number("_m", 2 * half, 3)
                for half in (ellipse.major, ellipse.minor)
            )
            parts.append(
                f"{100 * ellipse.share:.0f} % ellipse{of} with axes {long} by {wide}, "
                f"longer one at {ellipse.azimuth_deg:.0f}° from north"
            )
    return "; ".join(["Map of sensors, coloured by residual, and charge", *parts]) + "."


def map_caption(fit: Fit) -> str:
    """Return the caption of a map."""
    words = (
        "The colour of a sensor is its largest residual. The blue areas contain 50 and "
        "90 % of the draws of the charge's position. The grey bands show the posterior "
        "of the mass, for still air and level ground and without model error."
    )
    if fit.observations.frame is not None:
        words += " place.geojson and place.kml contain the same map in degrees."
    return words


def view_of(places: Float[np.ndarray, "place 2"]) -> View:
    """Return the view that shows all positions (east, north) [m] with a margin."""
    low, high = places.min(axis=0), places.max(axis=0)
    span = np.maximum(high - low, 1e-12)
    # a single position has no extent, and an axis needs one: ten metres
    if span.max() < 1e-9:
        span[:] = 10.0
    size = np.maximum(
        span * (1 + 2 * MARGIN), MIN_ASPECT * span.max() * (1 + 2 * MARGIN)
    )
    middle = 0.5 * (low + high)
    (west, south), (east, north) = middle - size / 2, middle + size / 2
    return View(float(west), float(east), float(south), float(north))


def whole_view(shown: GroundMap) -> View:
    """Return the view of all sensors, charges, ellipses and other optima."""
    # without published positions: a wrong one far off would shrink the rest of the map
    # to a spot
    places = [station.position[:2] for station in shown.stations]
    for charge in shown.charges:
        places += _places_of(charge)
        places += [np.array(there) for there in charge.elsewhere]
    return view_of(np.array(places))


def close_view(charge: ChargePlace, whole: View) -> View | None:
    """Return the view of a charge's ellipses; None if the map is large enough."""
    if not charge.ellipses:
        return None
    size = 2 * max(ellipse.major for ellipse in charge.ellipses)
    if size > INSET_BELOW * max(whole.width, whole.height) or not size > 0.0:
        return None
    places = _places_of(charge)
    # a published position near the ellipse is worth its place on the map
    if charge.accepted is not None and charge.draws is not None:
        away = np.hypot(*(np.array(charge.accepted) - charge.position[:2]))
        # further away it would shrink the ellipses to a dot again
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
        places: Positions in it, (east, north) [m].
    """
    size = np.array([view.width, view.height])
    shares = (places - np.array([view.west, view.south])) / size
    corners = [(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)]
    # the corner whose nearest name is furthest away has most space
    nearest = [np.hypot(*(shares - np.array(c)).T).min() for c in corners]
    return [corners[k] for k in np.argsort(nearest)[::-1]]


def ground_map(fit: Fit, accepted: Accepted | None = None) -> GroundMap | None:
    """Return the contents of a map; None if no sensor's position is known.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source.
    """
    stations = _stations(fit)
    if not stations:
        return None
    found = (_charge(fit, shot, accepted) for shot in range(len(fit.scene.charges)))
    air = fit.scene.air
    return GroundMap(
        stations=stations,
        charges=tuple(charge for charge in found if charge is not None),
        wind=(float(air.wind_east), float(air.wind_north)),
        frame=fit.observations.frame,
    )


def _stations(fit: Fit) -> tuple[Station, ...]:
    table, suspected = fit.observations, set(outlier_rows(fit))
    # a row with a range has a placeholder position, on a line from the charge
    ranged = np.isfinite(table.slant_range)
    placed = np.flatnonzero(np.isfinite(table.position).all(axis=1) & ~ranged)
    if not len(placed):
        return ()
    # positions of a sensor that differ by rounding are one mark with one label
    mark = MARK_SHARE * float(np.max(np.ptp(table.position[placed, :2], axis=0)))
    marks: list[list[int]] = []
    by_sensor: dict[str, list[list[int]]] = {}
    for row in placed.tolist():
        own = by_sensor.setdefault(table.sensor[row], [])
        at = table.position[row, :2]
        for rows in own:
            if math.dist(table.position[rows[0], :2], at) <= mark:
                rows.append(row)
                break
        else:
            own.append([row])
            marks.append(own[-1])
    return tuple(
        Station(
            name=table.sensor[of[0]],
            position=table.position[of[0]],
            residuals=tuple((table.quantity[i], float(fit.residual[i])) for i in of),
            suspected=not suspected.isdisjoint(of),
        )
        for of in marks
    )


def _charge(fit: Fit, shot: int, accepted: Accepted | None) -> ChargePlace | None:
    """Return one charge; None if its position is not identified or it did not fire."""
    charge = fit.scene.charges[shot]
    position = np.asarray(charge.position_m, float)
    names = [f"charge_{axis}_m{fit.scene.label(charge)}" for axis in ("east", "north")]
    is_fitted = not set(names).isdisjoint(fit.summary.free)
    pair = place_draws(fit, shot)
    unknown = is_fitted and pair is None
    if unknown or charge.range_m is not None or bool(np.isinf(charge.time_s)):
        return None
    # without agreeing clocks the draws would claim a position
    rests = rests_on_clocks(fit, shot)
    pair = None if rests else pair
    draws = None if pair is None else np.stack(pair, axis=-1)
    ellipses, regions = (), ()
    if pair is not None:
        ellipses = tuple(confidence_ellipse(*pair, share) for share in SHARES)
        regions = credible_regions(*pair, SHARES)
    known = [accepted[name][0] for name in names if accepted and name in accepted]
    return ChargePlace(
        name=charge.name,
        shot=shot,
        position=position,
        is_fitted=is_fitted,
        rests_on_clocks=rests,
        draws=draws,
        ellipses=ellipses,
        regions=regions,
        rings=shock_rings(fit, shot),
        elsewhere=_elsewhere(fit, names, position),
        accepted=(float(known[0]), float(known[1])) if len(known) == 2 else None,
    )


def _elsewhere(
    fit: Fit, names: list[str], position: Float[np.ndarray, "3"]
) -> tuple[tuple[float, float], ...]:
    """Return the positions of a charge at other optima, if they differ."""
    east, north = names
    places = [
        (float(of.parameters.get(east, here)), float(of.parameters.get(north, there)))
        for of in fit.summary.ambiguities
        for here, there in [position[:2]]
    ]
    return tuple(place for place in places if place != tuple(position[:2]))
