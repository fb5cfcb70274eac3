"""The map in degrees: what GeoJSON and KML hold, one feature after another."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.result import Fit
from jblast.inference.fitting.summary import Summary
from jblast.observations.places.frame import Frame
from jblast.report.fit.place.antimeridian import Polygon, without_crossing
from jblast.report.fit.place.ground_map import ChargePlace, GroundMap
from jblast.report.fit.place.residual_colours import residual_colour
from jblast.report.fit.reference_values import estimates_of
from jblast.report.numbers import printed_number
from jblast.report.words import law_words

CORNERS = 120
"""Of a circle: its area is 0.05 % short."""
CHARGE, ELLIPSE, RING, OTHER = "#d55e00", "#0072b2", "#666666", "#cc79a7"


@dataclass(frozen=True)
class Feature:
    """One thing on the map.

    Attributes:
        kind: "sensor", "charge", "ellipse", "region", "shock ring", "other optimum".
        name: What a reader calls it.
        colour: As #rrggbb.
        point: Longitude and latitude [degree] of what is a place.
        polygons: Of what has an area, none of them across the 180th meridian.
        properties: Numbers of it, units in their names.
    """

    kind: str
    name: str
    colour: str
    point: tuple[float, float] | None = None
    polygons: tuple[Polygon, ...] = ()
    properties: dict[str, Any] = field(default_factory=dict)


def features(shown: GroundMap, frame: Frame, fit: Fit) -> tuple[Feature, ...]:
    """Return everything on a map in WGS84, areas first so that points lie above them.

    Args:
        shown: What the map shows.
        frame: Where its east, north, up are counted from.
        fit: The answer, for the numbers of its charges.
    """
    found = [
        feature
        for charge in shown.charges
        for feature in (
            *_rings(charge, frame),
            *_areas(charge, frame),
            *_charge(charge, frame, fit.summary, fit.scene.label),
        )
    ]
    return (*found, *_sensors(shown, frame))


def _sensors(shown: GroundMap, frame: Frame) -> Iterator[Feature]:
    for station in shown.stations:
        each = {f"residual_sd.{quantity}": r for quantity, r in station.residuals}
        yield Feature(
            kind="sensor",
            name=station.name,
            colour=residual_colour(station.worst),
            point=_point(frame, station.position),
            properties={
                "residual_sd": station.worst,
                **each,
                "up_m": float(station.position[2]),
                "suspected_outlier": station.suspected,
            },
        )


def _charge(charge: ChargePlace, frame: Frame, found: Summary, label) -> Iterator:
    numbers = estimates_of(found)
    suffix = f".{charge.name}" if charge.name else ""
    properties: dict[str, Any] = {}
    for name, estimate in numbers.items():
        stem, _, of = name.partition(".")
        if f".{of}" * bool(of) == suffix and (stem.startswith("charge_") or not suffix):
            properties[stem] = estimate.value
            properties |= {f"{stem}.q05": estimate.q05, f"{stem}.q95": estimate.q95}
    yield Feature(
        kind="charge",
        name=charge.name or "charge",
        colour=CHARGE,
        point=_point(frame, charge.position),
        properties={"place": "fitted" if charge.asked else "given", **properties},
    )
    for east, north in charge.elsewhere:
        yield Feature(
            kind="other optimum",
            name=f"{charge.name or 'charge'}, another optimum",
            colour=OTHER,
            point=_point(frame, np.array([east, north, charge.position[2]])),
        )


def _areas(charge: ChargePlace, frame: Frame) -> Iterator[Feature]:
    of = f" of {charge.name}" if charge.name else ""
    for region in reversed(charge.regions):
        rings = [(outer, *holes) for outer, holes in region.parts]
        yield Feature(
            kind="region",
            name=f"{100 * region.share:.0f} % region{of}",
            colour=ELLIPSE,
            polygons=_polygons(frame, rings),
            properties={"share": region.share},
        )
    for ellipse in reversed(charge.ellipses):
        if not ellipse.minor > 0.0:
            continue  # one coordinate was asked for: no area
        yield Feature(
            kind="ellipse",
            name=f"{100 * ellipse.share:.0f} % ellipse{of}",
            colour=ELLIPSE,
            polygons=_polygons(frame, [(ellipse.outline(CORNERS),)]),
            properties={
                "share": ellipse.share,
                "semi_major_m": ellipse.major,
                "semi_minor_m": ellipse.minor,
                "azimuth_deg": ellipse.azimuth_deg,
                "misleads": bool(charge.regions),
            },
        )


def _rings(charge: ChargePlace, frame: Frame) -> Iterator[Feature]:
    of = f" of {charge.name}" if charge.name else ""
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    unit = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    for ring in charge.rings:
        peak = printed_number("_pa", ring.peak_overpressure_pa)
        yield Feature(
            kind="shock ring",
            name=f"{peak}{of}",
            colour=RING,
            polygons=_polygons(frame, [(charge.position[:2] + ring.range_m * unit,)]),
            properties={
                "peak_overpressure_pa": ring.peak_overpressure_pa,
                "range_m": ring.range_m,
                "range_m.q05": ring.range_q05_m,
                "range_m.q95": ring.range_q95_m,
                "law": law_words(ring.law),
                "law_holds": ring.valid,
            },
        )


def _point(frame: Frame, enu: Float[np.ndarray, "3"]) -> tuple[float, float]:
    lat, lon, _ = frame.to_geodetic(enu)
    return float(lon), float(lat)


def _polygons(
    frame: Frame, parts: Iterable[tuple[Float[np.ndarray, "_ 2"], ...]]
) -> tuple[Polygon, ...]:
    """Return areas (east, north) [m] as polygons in degrees."""
    found: list[Polygon] = []
    for rings in parts:
        in_degrees = []
        for ring in rings:
            enu = np.concatenate([ring, np.zeros((len(ring), 1))], axis=1)
            in_degrees.append(frame.to_geodetic(enu)[:, 1::-1])
        found += without_crossing(in_degrees)
    return tuple(found)
