"""Where on the Earth a charge stood, and when by the calendar."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from jblast.inference.fitting.place.confidence_ellipse import charge_ellipse
from jblast.inference.fitting.result import Fit
from jblast.inference.posterior.estimate import Estimate
from jblast.observations.clocks import written
from jblast.parameters import CLOCK_OFFSET


@dataclass(frozen=True)
class PlaceOnEarth:
    """Where a charge stood, WGS84.

    Attributes:
        lat_deg: Latitude of the most probable place [degree].
        lon_deg: Longitude, -180 to 180 [degree].
        alt_m: Height, by the datum of the sensors' [m].
        ellipse_90_m: Half axes of the ellipse that holds 90 % of the posterior, the
            longer one first [m], and the direction of that, clockwise from north
            [rad]; null where the place was given, or rests on clocks that were taken
            to agree.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    ellipse_90_m: tuple[float, float, float] | None


@dataclass(frozen=True)
class ChargeOnEarth:
    """What a fit says of a charge in degrees and by the calendar.

    Attributes:
        charge: Its name; "" of the only one.
        place: Where it stood; null where the log has no latitudes, its scene no
            [place], or it cannot tell.
        origin_time_utc: When it exploded, ISO 8601, on the clock of `origin_clock`;
            null where the log has no dates, or cannot tell.
    """

    charge: str
    place: PlaceOnEarth | None
    origin_time_utc: str | None


@dataclass(frozen=True)
class OnEarth:
    """What a fit says in degrees and by the calendar.

    Attributes:
        place: Where the first charge stood, as `charges_on_earth` has it.
        origin_time_utc: When the first charge exploded, likewise.
        origin_clock: The recorder whose clock that is, where those of others are free;
            "" for the common clock.
        charges_on_earth: The same of every charge of the scene.
    """

    place: PlaceOnEarth | None
    origin_time_utc: str | None
    origin_clock: str
    charges_on_earth: tuple[ChargeOnEarth, ...]


def on_earth(fit: Fit) -> OnEarth:
    """Return an answer in degrees and by the calendar, as far as its log allows."""
    charges = tuple(
        ChargeOnEarth(charge.name, _place(fit, shot), _time(fit, shot))
        for shot, charge in enumerate(fit.scene.charges)
    )
    first = charges[0]
    dated = any(charge.origin_time_utc for charge in charges)
    clock = _common_clock(fit) if dated else ""
    return OnEarth(first.place, first.origin_time_utc, clock, charges)


def _place(fit: Fit, shot: int) -> PlaceOnEarth | None:
    frame, charge = fit.observations.frame, fit.scene.charges[shot]
    label = fit.scene.label(charge)
    asked = [f"charge_{axis}_m{label}" for axis in ("east", "north", "up")]
    estimates = [fit.summary.estimates.get(name, Estimate(0.0)) for name in asked]
    if frame is None or charge.range_m is not None:
        return None
    if not all(estimate.identified for estimate in estimates):
        return None
    lat, lon, alt = frame.to_geodetic(np.array([float(x) for x in charge.position_m]))
    found = charge_ellipse(fit, shot=shot)
    ellipse = None
    if found is not None:
        ellipse = (found.major, found.minor, math.radians(found.azimuth_deg))
    return PlaceOnEarth(float(lat), float(lon), float(alt), ellipse)


def _time(fit: Fit, shot: int) -> str | None:
    """Return when a charge exploded."""
    epoch, charge = fit.observations.epoch, fit.scene.charges[shot]
    name = f"origin_time_s{fit.scene.label(charge)}"
    estimate = fit.summary.estimates.get(name, Estimate(float(charge.time_s)))
    if epoch is None or not estimate.identified:
        return None
    return utc(epoch, estimate.value)


def utc(epoch: datetime, seconds: float) -> str:
    """Return an instant as ISO 8601 to the microsecond, UTC.

    Args:
        epoch: Of time zero.
        seconds: Since then.
    """
    text = written(epoch.astimezone(UTC), round(seconds, 6))
    return f"{text[:-4]}Z"


def _common_clock(fit: Fit) -> str:
    """Return the clock that others are set by, "" where that is everybody's."""
    free = [n for n in fit.summary.free if n.startswith(f"{CLOCK_OFFSET}.")]
    if not free:
        return ""
    clocks = dict.fromkeys(fit.observations.clocks())
    others = [clock for clock in clocks if f"{CLOCK_OFFSET}.{clock}" not in free]
    return others[0] if len(others) == 1 else ""
