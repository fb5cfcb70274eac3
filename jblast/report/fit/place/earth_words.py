"""Where and when it was, in degrees and by the calendar, in words."""

import math

from jblast.inference.fitting.place.confidence_ellipse import rests_on_clocks
from jblast.inference.fitting.place.on_earth import PlaceOnEarth, on_earth, utc
from jblast.inference.fitting.result import Fit
from jblast.inference.posterior.estimate import Estimate
from jblast.report.fit.place.map_words import degrees
from jblast.report.numbers import printed_number


def earth_lines(fit: Fit) -> list[str]:
    """Return a sentence for each charge of a log in degrees or with dates."""
    lines = []
    earth = on_earth(fit)
    for shot, charge in enumerate(fit.scene.charges):
        found = earth.charges_on_earth[shot]
        named = f"{charge.name}: it" if charge.name else "It"
        why = "if the clocks agree" if rests_on_clocks(fit, shot) else "as given"
        said = [f"{named} stood at {_place(found.place, why)}"] if found.place else []
        if found.origin_time_utc:
            when = _time(fit, f"origin_time_s{fit.scene.label(charge)}")
            by = f" by the clock {earth.origin_clock}" if earth.origin_clock else ""
            who = "it" if said else named
            said.append(f"{who} exploded at {when}{by}")
        if said:
            lines.append("; ".join(said) + ".")
    return lines


def _place(place: PlaceOnEarth, without_ellipse: str) -> str:
    """Return a place and the ellipse about it, or why there is none."""
    at = degrees(place.lat_deg, place.lon_deg)
    if place.ellipse_90_m is None:
        return f"{at}, {without_ellipse}"
    major, minor, azimuth = place.ellipse_90_m
    long, wide = (printed_number("_m", 2.0 * half, 2) for half in (major, minor))
    return (
        f"{at}, 90 % within an ellipse of {long} by {wide}, its longer axis towards "
        f"{math.degrees(azimuth):.0f} degrees"
    )


def _time(fit: Fit, name: str) -> str:
    """Return an origin time as far as it is known: 2020-08-04 15:08:18.31 UTC."""
    epoch, estimate = (
        fit.observations.epoch,
        fit.summary.estimates.get(name, Estimate()),
    )
    if epoch is None:
        return ""
    half = 0.5 * (estimate.q95 - estimate.q05)
    if not half > 0.0:
        value = float(fit.origin_time[0])
        return f"{utc(epoch, value)[:-1].replace('T', ' ')} UTC"
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 6)
    text = utc(epoch, round(estimate.value, decimals))[:-1].replace("T", " ")
    text = text[: len(text) - 6 + decimals] if decimals else text[:-7]
    return f"{text} UTC ± {half:.{decimals}f} s (90 %)"
