r"""The position of a charge on a map: ellipse, region, coordinates, shock rings.

The confidence ellipse contains a share of the posterior draws. Its shape is that of
their covariance $\Sigma$, its size the share's quantile of
$d^2 = (x - \bar x)^T \Sigma^{-1} (x - \bar x)$ among the draws. For normal draws that
is $\chi^2_2$, 4.605 for 90 %, or $-2 \ln(1 - \mathrm{share})$. For others the ellipse
is wider or narrower, and still contains the share.

An ellipse suits a nearly normal posterior. Two clocks that disagree leave a curve, few
sensors in a row two regions: there the ellipse is mostly empty, and the region of
highest density is drawn instead. The density at a point is inversely proportional to
the square of the distance to its k-th nearest draw (Loftsgaarden and Quesenberry,
1965), which resolves thin curves as well as broad regions.

Longitude, latitude and UTC are given where the log has a frame on the Earth and a
dated clock. Shock rings are the distances at which the peak overpressure of the law,
on level ground, has fallen to given values.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.inference.fitting.fit import Fit
from jblast.inference.posterior.parameters import Estimate
from jblast.observations.instants import written
from jblast.parameters import CLOCK_OFFSET
from jblast.registry import Law
from jblast.scene import Scene
from jblast.sensors.calculator import (
    SCALED_DISTANCES,
    Rows,
    by_law,
    calculated_laws,
)
from jblast.waves.propagation import ambient

MIN_VARIANCE_RATIO = 1e-12
"""Ratio of two variances below which the smaller is rounding: the position is fixed
along that axis."""
NEIGHBOURS = 60
"""Rank of the neighbour whose distance measures the density of draws. For normal draws
the area of a region is 5 % too large; fewer neighbours give ragged outlines."""
FILLED = 0.8
"""Share of a 90 % ellipse filled by the 90 % region below which the ellipse
misleads."""
MIN_PART = 0.01
"""Smallest area of a part or a hole, relative to the largest part. Smaller ones are
chance: of 8000 draws they contain about `NEIGHBOURS` or fewer."""
# random points in the ellipse: the share that is filled is precise to 1 %
TRIES = 2000
# points along each side of the grid of outlines: steps of 1 to 2 % of the ellipse
GRID = 160
LEVELS = (1e3, 5e3, 20e3, 100e3)
"""Default peak overpressures of shock rings [Pa]: from broken windows to destroyed
buildings."""


@dataclass(frozen=True)
class ConfidenceEllipse:
    """An ellipse about the most probable positions of a charge.

    Attributes:
        share: Share of the draws inside, 0 to 1.
        east: East of the centre, the mean of the draws [m].
        north: North of the centre [m].
        major: Longer half axis [m].
        minor: Shorter half axis [m]; 0 if only one coordinate was fitted.
        azimuth_deg: Direction of the longer axis, clockwise from north, 0 to 180.
    """

    share: float
    east: float
    north: float
    major: float
    minor: float
    azimuth_deg: float

    def axes(self) -> Float[np.ndarray, "2 2"]:
        """Return the half axes as vectors (east, north) [m], one row each."""
        along = np.deg2rad(self.azimuth_deg)
        unit = np.array([np.sin(along), np.cos(along)])
        return np.stack([self.major * unit, self.minor * np.array([-unit[1], unit[0]])])

    def outline(self, points: int = 72) -> Float[np.ndarray, "point 2"]:
        """Return points (east, north) of the outline, anticlockwise, not closed [m]."""
        turn = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
        major, minor = self.axes()
        ring = np.cos(turn)[:, None] * major + np.sin(turn)[:, None] * minor
        return np.array([self.east, self.north]) + ring

    def holds(
        self, east: Float[np.ndarray, "..."], north: Float[np.ndarray, "..."]
    ) -> Bool[np.ndarray, "..."]:
        """Return True for points inside; without width, for points on the axis."""
        away = np.stack([east - self.east, north - self.north], axis=-1)
        length = np.array([self.major, self.minor])
        unit = self.axes() / np.where(length > 0.0, length, 1.0)[:, None]
        scaled = (away @ unit.T) / np.where(length > 0.0, length, 1.0)
        # points on the outline may be outside by rounding
        return np.sum(scaled**2, axis=-1) <= 1.0 + 1e-9


def confidence_ellipse(
    east: Float[np.ndarray, " draw"],
    north: Float[np.ndarray, " draw"],
    share: float = 0.9,
) -> ConfidenceEllipse:
    """Return the ellipse of the draws' covariance that contains a share of them.

    Args:
        east: Draws of the position [m]; all equal if it is fixed.
        north: Draws of the position [m].
        share: Share of the draws to be contained, between 0 and 1.
    """
    draws = np.stack([east, north], axis=-1)
    centre = draws.mean(axis=0)
    away = draws - centre
    variances, vectors = np.linalg.eigh(away.T @ away / len(draws))
    wide = (
        variances > MIN_VARIANCE_RATIO * variances[1]
    )  # ascending: of two, the second
    # a fixed coordinate has no width: the ellipse is then a segment
    scale = np.sqrt(np.where(wide, variances, 1.0))
    distance = np.sqrt(np.sum(np.where(wide, away @ vectors / scale, 0.0) ** 2, -1))
    # the next higher draw, not interpolated: the stated share is contained exactly
    size = float(np.quantile(distance, share, method="higher"))
    minor, major = np.where(wide, size * scale, 0.0)
    azimuth = float(np.rad2deg(np.arctan2(vectors[0, 1], vectors[1, 1])))
    return ConfidenceEllipse(
        share=share,
        east=float(centre[0]),
        north=float(centre[1]),
        major=float(major),
        minor=float(minor),
        azimuth_deg=azimuth % 180.0,
    )


def place_draws(
    fit: Fit, shot: int = 0
) -> tuple[Float[np.ndarray, " draw"], Float[np.ndarray, " draw"]] | None:
    """Return draws of the position of a charge, east and north [m].

    None if its position was not fitted, or a coordinate is not identified.

    Args:
        fit: The fit.
        shot: Index of the charge in the scene.
    """
    charge = fit.scene.charges[shot]
    label = fit.scene.label(charge)
    names = [f"charge_{axis}_m{label}" for axis in ("east", "north")]
    free = [name for name in names if name in fit.summary.free]
    unknown = fit.summary.unidentified
    drawn = [name for name in free if name in fit.draws and name not in unknown]
    if not drawn or len(drawn) < len(free):
        return None
    count = len(fit.draws[drawn[0]])
    if not count or not all(np.isfinite(fit.draws[name]).all() for name in drawn):
        return None
    east, north = (
        fit.draws[name] if name in drawn else np.full(count, float(known))
        for name, known in zip(names, np.asarray(charge.position_m)[:2], strict=True)
    )
    return east, north


def charge_ellipse(
    fit: Fit, share: float = 0.9, shot: int = 0
) -> ConfidenceEllipse | None:
    """Return the ellipse that contains a share of the positions of a charge.

    None if `place_draws` returns None, or if the position depends on the assumption
    that clocks agree: the ellipse is far too small if they do not.
    """
    draws = place_draws(fit, shot)
    if draws is None or rests_on_clocks(fit, shot):
        return None
    return confidence_ellipse(*draws, share)


def rests_on_clocks(fit: Fit, shot: int = 0) -> bool:
    """Return True if a position is identified only by assuming that clocks agree.

    Args:
        fit: The fit.
        shot: Index of the charge in the scene.
    """
    label = fit.scene.label(fit.scene.charges[shot])
    place = {f"charge_east_m{label}", f"charge_north_m{label}"}
    return any(
        not place.isdisjoint(note["parameters"])
        for note in fit.summary.warnings
        if note.kind == "rests_on_clocks"
    )


@dataclass(frozen=True)
class CredibleRegion:
    """The densest part of a posterior that contains a share of it.

    Attributes:
        share: Share of the draws inside.
        parts: Outline of each part, a ring (east, north) [m], anticlockwise and not
            closed, with the rings of its holes, clockwise.
    """

    share: float
    parts: tuple[
        tuple[Float[np.ndarray, "_ 2"], tuple[Float[np.ndarray, "_ 2"], ...]], ...
    ]


def credible_regions(
    east: Float[np.ndarray, " draw"],
    north: Float[np.ndarray, " draw"],
    shares: Sequence[float] = (0.5, 0.9),
) -> tuple[CredibleRegion, ...]:
    """Return regions of highest density if an ellipse would mislead, else ().

    Args:
        east: Draws of the position [m].
        north: Draws of the position [m].
        shares: Share of the draws in each region.
    """
    ellipse = confidence_ellipse(east, north)
    if not ellipse.minor > 0.0:
        return ()
    turned = np.linalg.inv(ellipse.axes())
    centre = np.array([ellipse.east, ellipse.north])
    # in units of the ellipse: distances in all directions count alike
    x = (np.stack([east, north], axis=-1) - centre) @ turned  # the ellipse: |x| = 1
    # imported here, as is contourpy below: a fit without a map needs neither
    from scipy.spatial import KDTree

    # Weighted draws are resampled with repetition. With fewer neighbours than the
    # copies of one draw the distance would be 0, and the density infinite.
    _, times = np.unique(x, axis=0, return_counts=True)
    nearest = min(max(NEIGHBOURS, 3 * int(times.max())), len(x))
    tree = KDTree(x)

    def sparse(at):
        """Distance to the k-th nearest draw."""
        return tree.query(at, nearest)[0][..., -1]

    tries = np.random.default_rng(0).uniform(-1.0, 1.0, (TRIES, 2))
    # uniform in the unit disc
    tries = tries[np.sum(tries**2, axis=1) < 1.0]
    found = sparse(x)
    if np.mean(sparse(tries) <= np.quantile(found, ellipse.share)) >= FILLED:
        return ()
    regions = []
    for share in shares:
        limit = float(np.quantile(found, share))
        inside = x[found <= limit]
        parts = _outlines(inside, sparse, limit, ellipse.axes(), centre)
        regions.append(CredibleRegion(share, parts))
    return tuple(regions)


def _outlines(inside, sparse, limit: float, axes, centre):
    """Return the outlines of the region where draws are denser than a limit."""
    from contourpy import FillType, contour_generator

    # margins, so that contours close within the grid
    low, high = inside.min(axis=0) - 0.3, inside.max(axis=0) + 0.3
    across, along = (np.linspace(low[k], high[k], GRID) for k in (0, 1))
    places = np.stack(np.meshgrid(across, along), axis=-1)
    # ln of the distance: contours interpolate it more evenly
    field = np.log(sparse(places.reshape(-1, 2)).reshape(GRID, GRID))
    contours = contour_generator(across, along, field, fill_type=FillType.OuterOffset)
    found = []
    for points, starts in zip(*contours.filled(-np.inf, np.log(limit)), strict=True):
        # contourpy turns outer rings anticlockwise and holes clockwise, as do the axes,
        # and repeats the first point at the end of a ring
        found.append([points[i : j - 1] @ axes + centre for i, j in pairwise(starts)])
    least = MIN_PART * max(_area(outer) for outer, *_ in found)
    return tuple(
        (outer, tuple(hole for hole in holes if -_area(hole) > least))
        for outer, *holes in found
        if _area(outer) > least
    )


def _area(ring: Float[np.ndarray, "point 2"]) -> float:
    """Return the area of a ring, negative if clockwise."""
    # relative to its first point: coordinates of kilometres would cancel
    x, y = (ring - ring[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


@dataclass(frozen=True)
class PlaceOnEarth:
    """Position of a charge, WGS84.

    Attributes:
        lat_deg: Latitude of the most probable position [degree].
        lon_deg: Longitude, -180 to 180 [degree].
        alt_m: Height above the datum of the sensors' heights [m].
        ellipse_90_m: Half axes of the ellipse that contains 90 % of the posterior, the
            longer one first [m]; null if the position was given, or depends on clocks
            that were assumed to agree.
        ellipse_azimuth_deg: Direction of the longer half axis, clockwise from north
            [degree]; null without an ellipse.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    ellipse_90_m: tuple[float, float] | None
    ellipse_azimuth_deg: float | None


@dataclass(frozen=True)
class ChargeOnEarth:
    """Position and time of a charge, in degrees and by the calendar.

    Attributes:
        charge: Name of the charge; "" for the only one.
        place: Position; null if the log has no latitudes, its scene no [place], or it
            is not identified.
        origin_time_utc: Origin time, ISO 8601, on the clock of `origin_clock`; null if
            the log has no dates, or it is not identified.
    """

    charge: str
    place: PlaceOnEarth | None
    origin_time_utc: str | None


@dataclass(frozen=True)
class OnEarth:
    """Positions and times of a fit, in degrees and by the calendar.

    Attributes:
        place: Position of the first charge, as in `charges_on_earth`.
        origin_time_utc: Origin time of the first charge, as in `charges_on_earth`.
        origin_clock: Recorder with the clock of the origin times if other clocks are
            free; "" for the common clock.
        charges_on_earth: Position and time of every charge of the scene.
    """

    place: PlaceOnEarth | None
    origin_time_utc: str | None
    origin_clock: str
    charges_on_earth: tuple[ChargeOnEarth, ...]


def on_earth(fit: Fit) -> OnEarth:
    """Return positions in degrees and times in UTC, as far as the log has them."""
    charges = tuple(
        ChargeOnEarth(charge.name, _place(fit, shot), _time(fit, shot))
        for shot, charge in enumerate(fit.scene.charges)
    )
    first = charges[0]
    dated = any(charge.origin_time_utc for charge in charges)
    # the clock relative to which others are free; "" for the common clock
    clock = ""
    if dated and any(n.startswith(f"{CLOCK_OFFSET}.") for n in fit.summary.free):
        clocks = dict.fromkeys(fit.observations.clocks())
        fixed = [c for c in clocks if f"{CLOCK_OFFSET}.{c}" not in fit.summary.free]
        clock = fixed[0] if len(fixed) == 1 else ""
    return OnEarth(first.place, first.origin_time_utc, clock, charges)


def _place(fit: Fit, shot: int) -> PlaceOnEarth | None:
    frame, charge = fit.observations.frame, fit.scene.charges[shot]
    label = fit.scene.label(charge)
    names = [f"charge_{axis}_m{label}" for axis in ("east", "north", "up")]
    estimates = [fit.summary.estimates.get(name, Estimate(0.0)) for name in names]
    if frame is None or charge.range_m is not None:
        return None
    if not all(estimate.identified for estimate in estimates):
        return None
    lat, lon, alt = frame.to_geodetic(np.array([float(x) for x in charge.position_m]))
    found = charge_ellipse(fit, shot=shot)
    axes = None if found is None else (found.major, found.minor)
    azimuth = None if found is None else float(found.azimuth_deg)
    return PlaceOnEarth(float(lat), float(lon), float(alt), axes, azimuth)


def _time(fit: Fit, shot: int) -> str | None:
    """Return the origin time of a charge as ISO 8601."""
    epoch, charge = fit.observations.epoch, fit.scene.charges[shot]
    name = f"origin_time_s{fit.scene.label(charge)}"
    estimate = fit.summary.estimates.get(name, Estimate(float(charge.time_s)))
    if epoch is None or not estimate.identified:
        return None
    return written(epoch, estimate.value)


@dataclass(frozen=True)
class ShockRing:
    """Range at which a peak overpressure is reached, on level ground at the height 0.

    Attributes:
        peak_overpressure_pa: Peak overpressure [Pa].
        range_m: Ground range from the charge at the answer [m].
        range_q05_m: Range by the 5 % quantile of the mass, without the scatter of the
            law [m].
        range_q95_m: Range by the 95 % quantile of the mass [m].
        law: Name of the law.
        valid: True if the law is within its range.
    """

    peak_overpressure_pa: float
    range_m: float
    range_q05_m: float
    range_q95_m: float
    law: str
    valid: bool


def shock_rings(
    fit: Fit, shot: int = 0, levels: Sequence[float] = LEVELS
) -> tuple[ShockRing, ...]:
    """Return the ranges at which the shock of a charge falls to given peaks.

    Law and mass are those of the fit (`peak_law`). There is no ring without a law, with
    an unidentified mass, or if the charge is higher above the ground than the range.

    Args:
        fit: The fit.
        shot: Index of the charge in the scene.
        levels: Peak overpressures [Pa].
    """
    law = peak_law(fit)
    charge = fit.scene.charges[shot]
    mass = f"charge_mass_kg{fit.scene.label(charge)}"
    # a fixed mass gives equal ranges
    masses = [float(charge.mass_kg)] * 3
    if mass in fit.summary.free:
        estimate = fit.summary.estimates[mass]
        if not estimate.identified:
            return ()
        masses = [estimate.q05, float(charge.mass_kg), estimate.q95]
    if law is None or not np.isfinite(masses).all() or not min(masses) > 0.0:
        return ()
    # rings are those of one charge; the calculator has one
    alone = replace(fit.scene, charges=(charge,))
    ranges, valid = ranges_at(alone, law, masses, levels)
    height = float(np.asarray(charge.position_m)[2])
    # slant range to ground range; a level reached only above the ground has no ring
    along = np.sqrt(np.maximum(ranges**2 - height**2, 0.0))
    return tuple(
        ShockRing(
            peak_overpressure_pa=level,
            range_m=float(along[1, i]),
            range_q05_m=float(along[0, i]),
            range_q95_m=float(along[2, i]),
            law=law.name,
            valid=bool(ok),
        )
        for i, (level, ok) in enumerate(zip(levels, valid[1], strict=True))
        if np.isfinite(along[:, i]).all() and along[1, i] > 0.0
    )


def peak_law(fit: Fit) -> Law | None:
    """Return the law of peak overpressure that matches a fit; None without one.

    It is the law of the peaks in the log, else that of the same source as another law
    of the fit.
    """
    by_name = {law.name: law for law in calculated_laws("peak_overpressure_pa")}
    used = fit.summary.law
    for name in (used.get("peak_overpressure_pa"), *used.values()):
        if name in by_name:
            return by_name[name]
    return None


def ranges_at(
    scene: Scene, law: Law, masses: Sequence[float], levels: Sequence[float]
) -> tuple[Float[np.ndarray, "mass level"], Bool[np.ndarray, "mass level"]]:
    r"""Return the largest ranges at which the peak of a law falls below each level.

    The law is evaluated at the points of the calculator's `roots`, for all masses in
    one call. Between two points, 0.4 % apart, $\ln p$ is interpolated linearly in $\ln
    R$: the relative error of the range is 1e-5 where the slope is smooth.

    Args:
        scene: Charge, air and ground; the mass of its charge is not used.
        law: Law of the peak overpressure.
        masses: Masses of the explosive [kg], positive.
        levels: Peak overpressures [Pa].

    Returns:
        Slant ranges [m], NaN where a level is not reached, and True where the law is
        within its range on both sides.
    """
    _, pressure = ambient(scene.air)
    factor = float(scene.charge.tnt_factor_for(law.quantity))
    scale = factor * STANDARD_PRESSURE / float(pressure)
    log_range = (
        np.log(SCALED_DISTANCES) + np.log(scale * np.asarray(masses))[:, None] / 3
    )
    count = log_range.shape[1]
    mass = np.repeat(np.asarray(masses, float), count)
    found = by_law(Rows(scene, np.exp(log_range.ravel()), mass), law.quantity)[law.name]
    with np.errstate(divide="ignore", invalid="ignore"):
        log_peak = np.log(found.value.reshape(log_range.shape))
    holds = found.valid.reshape(log_range.shape)
    ranges = np.full((len(masses), len(levels)), np.nan)
    valid = np.zeros(ranges.shape, bool)
    for i, j in np.ndindex(ranges.shape):
        above = log_peak[i] - np.log(levels[j])
        # the outermost crossing: a law may rise again near the charge
        last = np.flatnonzero((above[:-1] >= 0.0) & (above[1:] < 0.0))
        if last.size:
            k = last[-1]
            part = above[k] / (above[k] - above[k + 1])
            ranges[i, j] = np.exp(
                log_range[i, k] + part * (log_range[i, k + 1] - log_range[i, k])
            )
            valid[i, j] = holds[i, k] and holds[i, k + 1]
    return ranges, valid
