"""Positions of the charge and the sensors, for the map and as text."""

import math

import numpy as np
from jaxtyping import Float

from jblast.inference.fitting.fit import Fit
from jblast.inference.fitting.place import (
    PlaceOnEarth,
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
from jblast.registry import law_words
from jblast.report.estimates import Accepted, log_name, outlier_rows
from jblast.report.maps import Feature, Map, degrees, map_files, point
from jblast.report.numbers import printed_number

EDGES = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)
"""Residuals at which the colour changes [sd]: 2 and 3 sd are what readers look for."""
SHADES = ("#2166ac", "#67a9cf", "#d1e5f0", "#f7f7f7", "#fddbc7", "#ef8a62", "#b2182b")
"""ColorBrewer's RdBu with seven classes, which is safe for colour-blind readers."""
NO_RESIDUAL = "#b0b0b0"
"""Colour of a sensor without a residual."""
MARK_SHARE = 0.01
"""Share of the map's extent within which positions of one sensor are one mark: the
width of its symbol on a map of 5 inches."""
SHARES = (0.9, 0.5)
"""Shares of the posterior; the largest first, so that smaller areas lie above."""
CORNERS = 120
"""Corners of a circle: the polygon's area is 0.05 % too small."""
MAX_DRAWS = 600
"""Draws in an enlarged map: more of them merge into one spot."""
CALM_M_S = 0.05
"""Wind below this is not written [m/s]: it would be printed as 0.0."""


def residual_colour(residual_sd: float) -> str:
    """Return the colour of a residual [sd] as #rrggbb."""
    if math.isnan(residual_sd):
        return NO_RESIDUAL
    steps = sum(abs(residual_sd) > edge for edge in EDGES if edge > 0.0)
    return SHADES[len(SHADES) // 2 + (steps if residual_sd > 0.0 else -steps)]


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
    assert place.ellipse_azimuth_deg is not None
    major, minor = place.ellipse_90_m
    long, wide = (printed_number("_m", 2.0 * half, 2) for half in (major, minor))
    return (
        f"{at}, 90 % ellipse with axes {long} by {wide}, longer one towards "
        f"{place.ellipse_azimuth_deg:.0f} degrees"
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


def map_of_fit(fit: Fit, accepted: Accepted | None = None) -> Map | None:
    """Return the map of a fit; None if no sensor's position is known.

    Args:
        fit: The fit.
        accepted: Published values by parameter name, each with its source.
    """
    sensors = _sensors(fit)
    if not sensors:
        return None
    charges = [_charge(fit, shot, accepted) for shot in range(len(fit.scene.charges))]
    near: np.ndarray | None = None
    notes = ["north up"]
    for features in charges:
        areas = [f.places for f in features if f.kind in ("region", "ellipse")]
        if areas and near is None:
            near = np.concatenate(areas)
            # further away a published position would shrink the areas to a dot
            size = np.ptp(near, axis=0).max()
            middle = near.mean(axis=0)
            others = [f.places for f in features if f.kind == "accepted"]
            beside = [x for x in others if np.abs(x - middle).max() < 2 * size]
            near = np.concatenate([near, *beside])
    air = fit.scene.air
    east, north = float(air.wind_east), float(air.wind_north)
    if (speed := math.hypot(east, north)) >= CALM_M_S:
        towards = math.degrees(math.atan2(east, north)) % 360.0
        notes += [f"wind {printed_number('_m_s', speed, 2)} towards {towards:.0f}°"]
    lines = [line for shot in range(len(charges)) for line in ring_lines(fit, shot)]
    if near is not None:
        lines.append("Areas: 50 and 90 % of the posterior of the position.")
    if any(rests_on_clocks(fit, shot) for shot in range(len(charges))):
        lines.append("The charge is there if the clocks agree; no area without that.")
    return Map(
        features=[f for features in (*charges, sensors) for f in features],
        frame=fit.observations.frame,
        note=", ".join(notes),
        lines=lines,
        near=near,
        scale=("largest residual of the sensor (sd)", EDGES, SHADES),
    )


def place_files(fit: Fit, accepted: Accepted | None = None) -> dict[str, str]:
    """Return the map in WGS84 as files, if the log has positions on the Earth."""
    shown, name = map_of_fit(fit, accepted), log_name(fit)
    if shown is None or shown.frame is None:
        return {}
    title = f"Blast fit: {name}" if name else "Blast fit"
    return map_files("place", shown.features, shown.frame, title)


def ring_lines(fit: Fit, shot: int) -> list[str]:
    """Return a line with the ranges of some peak overpressures; none without rings."""
    if not (rings := shock_rings(fit, shot)):
        return []
    reaches = ", ".join(
        f"{printed_number('_pa', ring.peak_overpressure_pa)} to "
        f"{printed_number('_m', ring.range_m, 3)}" + "*" * (not ring.valid)
        for ring in rings
    )
    name, law = fit.scene.charges[shot].name, law_words(rings[0].law)
    outside = " (* outside the law's range)" * any(not ring.valid for ring in rings)
    of = f" of {name}" if name else ""
    return [f"Peak overpressure{of} by {law}, with its 90 % band: {reaches}{outside}."]


def absent_map_note(fit: Fit) -> str:
    """Return the reason for having no map."""
    if np.isfinite(fit.observations.slant_range).any():
        return "No map: the log has ranges, but no positions of sensors."
    return "No map: the log has no positions of sensors."


def map_alt(fit: Fit) -> str:
    """Return the alternative text of a map, for screen readers."""
    parts = ["Map of sensors, coloured by residual, and charge"]
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
    return "; ".join(parts) + "."


def map_caption(fit: Fit) -> str:
    """Return the caption of a map."""
    words = (
        "The colour of a sensor is its largest residual. The blue areas contain 50 and "
        "90 % of the draws of the charge's position. The grey bands show the posterior "
        "of the mass, for still air and level ground and without model error."
    )
    if fit.observations.frame is not None:
        files = place_files(fit)
        words += f" The same map in degrees: {' and '.join(files)}."
        if "place.kml" not in files:
            words += " (place.kml needs simplekml, of the extra geo.)"
    return words


def _sensors(fit: Fit) -> list[Feature]:
    table, suspected = fit.observations, set(outlier_rows(fit))
    # a row with a range has a placeholder position, on a line from the charge
    ranged = np.isfinite(table.slant_range)
    placed = np.flatnonzero(np.isfinite(table.position).all(axis=1) & ~ranged)
    if not len(placed):
        return []
    # positions of a sensor that differ by rounding are one mark with one label
    mark = MARK_SHARE * float(np.max(np.ptp(table.position[placed, :2], axis=0)))
    marks: list[list[int]] = []
    for row in placed.tolist():
        for rows in marks:
            apart = math.dist(table.position[rows[0], :2], table.position[row, :2])
            if table.sensor[rows[0]] == table.sensor[row] and apart <= mark:
                rows.append(row)
                break
        else:
            marks.append([row])
    features = []
    for rows in marks:
        name, place = table.sensor[rows[0]], table.position[rows[0]]
        residuals = {table.quantity[i]: float(fit.residual[i]) for i in rows}
        finite = [r for i in rows if np.isfinite(r := float(fit.residual[i]))]
        worst = max(finite, key=abs, default=math.nan)
        doubtful = not suspected.isdisjoint(rows)
        numbers = {f"residual_sd.{quantity}": r for quantity, r in residuals.items()}
        numbers = {"residual_sd": worst, **numbers, "up_m": float(place[2])}
        sensor = point(
            "sensor", name, place, label="" if doubtful else name,
            properties={**numbers, "suspected_outlier": doubtful},
            colour=residual_colour(worst),
        )  # fmt: skip
        ring = [point("suspected", "", place, label=name)] if doubtful else []
        features += [sensor, *ring]
    return features


def _charge(fit: Fit, shot: int, accepted: Accepted | None) -> list[Feature]:
    """Return a charge; nothing if its position is not identified or it did not fire."""
    charge = fit.scene.charges[shot]
    position = np.asarray(charge.position_m, float)
    label = fit.scene.label(charge)
    names = [f"charge_{axis}_m{label}" for axis in ("east", "north")]
    is_fitted = not set(names).isdisjoint(fit.summary.free)
    pair = place_draws(fit, shot)
    unknown = is_fitted and pair is None
    if unknown or charge.range_m is not None or bool(np.isinf(charge.time_s)):
        return []
    of, name = f" of {charge.name}" if charge.name else "", charge.name or "charge"
    features = _rings(fit, shot, position, of)
    # without agreeing clocks the draws would claim a position
    if pair is not None and not rests_on_clocks(fit, shot):
        draws = np.stack(pair, axis=-1)
        # every n-th draw: in MCMC neighbours are correlated
        features.append(point("draw", "", draws[:: max(len(draws) // MAX_DRAWS, 1)]))
        features += _areas(pair, of)
    estimates = {}
    for key, estimate in {**fit.summary.estimates, **fit.summary.derived}.items():
        stem, _, owner = key.partition(".")
        if owner == charge.name and (stem.startswith("charge_") or not owner):
            estimates |= {
                stem: estimate.value,
                f"{stem}.q05": estimate.q05,
                f"{stem}.q95": estimate.q95,
            }
    place = {"place": "fitted" if is_fitted else "given"}
    features.append(
        point("charge", name, position, label=name, properties=place | estimates)
    )
    for other in fit.summary.ambiguities:
        there = [
            float(other.parameters.get(axis, here))
            for axis, here in zip(names, position, strict=False)
        ]
        if there != position[:2].tolist():
            there = [*there, position[2]]
            features.append(point("other optimum", f"{name}, another optimum", there))
    known = [accepted[axis][0] for axis in names if accepted and axis in accepted]
    if len(known) == 2:
        features.append(point("accepted", "", known))
    return features


def likely_places(fit: Fit) -> list[Feature]:
    """Return the 90 % area of a charge's position, and its other optima.

    The area is a region of highest density where an ellipse would mislead. It is empty
    for a position that is not identified.
    """
    return [
        feature
        for feature in _charge(fit, 0, None)
        if feature.kind == "other optimum"
        or (
            feature.properties.get("share") == 0.9
            and not feature.properties.get("misleads")
        )
    ]


def _areas(pair: tuple[np.ndarray, np.ndarray], of: str) -> list[Feature]:
    """Return ellipses, and where they would mislead regions of the position."""
    regions = credible_regions(*pair, SHARES)
    features = [
        Feature(
            "region", f"{100 * region.share:.0f} % region{of}",
            [(outer, *holes) for outer, holes in region.parts],
            properties={"share": region.share},
        )
        for region in regions
    ]  # fmt: skip
    for share in SHARES:
        ellipse = confidence_ellipse(*pair, share)
        numbers = {
            "share": share,
            "semi_major_m": ellipse.major,
            "semi_minor_m": ellipse.minor,
            "azimuth_deg": ellipse.azimuth_deg,
            "misleads": bool(regions),
        }
        # with one free coordinate the ellipse is a line, and has no area for files
        name = f"{100 * share:.0f} % ellipse{of}" if ellipse.minor > 0.0 else ""
        outline = [[ellipse.outline(CORNERS)]]
        features.append(
            Feature(
                "ellipse", name, outline, properties=numbers, dashed=bool(regions)
            )
        )  # fmt: skip
    return features


def _rings(
    fit: Fit, shot: int, position: Float[np.ndarray, "3"], of: str
) -> list[Feature]:
    """Return circles of some peak overpressures, with their 90 % bands."""
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    unit = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    features = []
    for ring in shock_rings(fit, shot):
        peak = printed_number("_pa", ring.peak_overpressure_pa)
        numbers = {
            "peak_overpressure_pa": ring.peak_overpressure_pa,
            "range_m": ring.range_m,
            "range_m.q05": ring.range_q05_m,
            "range_m.q95": ring.range_q95_m,
            "law": law_words(ring.law),
            "law_holds": ring.valid,
        }
        low, middle, high = (
            position[:2] + reach * unit
            for reach in (ring.range_q05_m, ring.range_m, ring.range_q95_m)
        )
        features += [
            Feature("band", "", [[high, low[::-1]]]),
            Feature(
                "shock ring", peak + of, [[middle]], peak, numbers,
                dashed=not ring.valid,
            ),
        ]  # fmt: skip
    return features
