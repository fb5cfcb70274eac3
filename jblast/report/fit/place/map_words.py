"""What is said below a map and beside it."""

import textwrap

import numpy as np

from jblast.inference.fitting.place.confidence_ellipse import charge_ellipse
from jblast.inference.fitting.result import Fit
from jblast.report.fit.place.ground_map import ChargePlace, GroundMap
from jblast.report.fit.place.view import View
from jblast.report.numbers import printed_number
from jblast.report.words import law_words


def map_notes(shown: GroundMap, view: View, width: int) -> list[str]:
    """Return the lines below a map: its key, rings, corners in degrees.

    Args:
        shown: What the map shows.
        view: Which part of the ground that is.
        width: Of a line [letters].
    """
    key = ["circles: sensors"]
    if any(charge.rests_on_clocks for charge in shown.charges):
        key += ["star: charge, if the clocks agree; no ellipse without that"]
    elif any(charge.asked for charge in shown.charges):
        regions = any(charge.regions for charge in shown.charges)
        key += ["star: charge"]
        key += ["blue: 50 and 90 % of the posterior" + ", dashed as ellipses" * regions]
    elif shown.charges:
        key += ["star: charge, its place given"]
    else:
        key += ["the log cannot tell where the charge stood"]
    if any(charge.accepted for charge in shown.charges):
        key += ["cross: accepted place, if in view"]
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
    """Say how far a charge's shock went, in one line; none without rings."""
    if not charge.rings:
        return []
    of = f" of {charge.name}" if charge.name else ""
    reaches = [
        f"{printed_number('_pa', ring.peak_overpressure_pa)} to "
        f"{printed_number('_m', ring.range_m, 3)}" + "*" * (not ring.valid)
        for ring in charge.rings
    ]
    # a number is not parted from its unit where a line is broken
    reach = ", ".join(reaches).replace(" kPa", "\u00a0kPa").replace(" m", "\u00a0m")
    outside = "; * outside the law, dashed" * any(not r.valid for r in charge.rings)
    law = law_words(charge.rings[0].law)
    wide = any(ring.range_q05_m < ring.range_q95_m for ring in charge.rings)
    band = ", with its 90 % band" if wide else ""
    return [f"grey: peak overpressure{of} by {law}{band}: {reach}{outside}"]


def degrees(lat: float, lon: float) -> str:
    """Return a place as 47.12345° N, 8.54321° E."""
    ns, ew = "N" if lat >= 0 else "S", "E" if lon >= 0 else "W"
    return f"{abs(lat):.5f}° {ns}, {abs(lon):.5f}° {ew}"


def absent_map_note(fit: Fit) -> str:
    """Say why there is no map."""
    if np.isfinite(fit.observations.slant_range).any():
        return "No map: the log gives ranges, and no place of a sensor."
    return "No map: the log names no place of a sensor."


def map_alt(fit: Fit) -> str:
    """Say in words what a map shows, for who cannot see it."""
    parts = []
    for shot, charge in enumerate(fit.scene.charges):
        if (ellipse := charge_ellipse(fit, shot=shot)) is not None:
            of = f" of {charge.name}" if charge.name else ""
            long, wide = (
                printed_number("_m", 2 * half, 3)
                for half in (ellipse.major, ellipse.minor)
            )
            parts.append(
                f"{100 * ellipse.share:.0f} % ellipse{of} {long} by {wide}, its longer "
                f"axis at {ellipse.azimuth_deg:.0f}° from north"
            )
    return "; ".join(["Map of sensors, coloured by residual, and charge", *parts]) + "."


def map_caption(fit: Fit) -> str:
    """Say how a map is to be read."""
    words = (
        "Each sensor has the colour of its residual that is furthest from 0. The blue "
        "areas hold half and nine tenths of the draws of the charge's place; the grey "
        "bands are what the posterior of the mass leaves open, the law taken as exact, "
        "the air still and the ground level."
    )
    if fit.observations.frame is not None:
        words += " place.geojson and place.kml hold the same in degrees."
    return words
