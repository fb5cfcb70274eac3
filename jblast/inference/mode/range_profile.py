r"""Range and bearing of a charge beside an array that is small for the distance.

Arrival times at such an array determine the bearing by their differences. The range
follows from the curvature of the front alone, which vanishes with distance. So the
posterior of the place is a sector, often without an end, and no normal about the mode
describes it. A mode inside the array's surroundings can have a higher density per unit
of the coordinates and still be improbable. Here ln of the likelihood, integrated over
bearing and all other numbers by Laplace's method, is followed along the range:

$$\ell(\ln R) = \ln \sum_k p(\hat y_k(R) \mid R) \det(I_k)^{-1/2},$$

with the information $I_k$ of bearing and other numbers $y$ at each of their optima
$\hat y_k$: a line of sensors has one on either side. The prior is flat in $\ln R$: it
prefers no scale. (One that is flat over the plane puts nearly all of its probability at
the largest ranges.) A free mass has a normal prior in ln, centred on a scaled distance
of 5.5 m/kg^(1/3), with the variance of `SCALED_RANGES`. Without it the range is
determined by masses that arrival times do not constrain: negligible ones, or some of
$e^{90}$ kg. Where $\ell$ does not fall far out, the range has no upper bound: the
bearing is the answer.

An optimum of the search whose place is known better than the steps between ranges is a
peak between them. It counts with its own volume, by Laplace's method over the range as
well.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.mode.laplace import NORMAL_Q95, climbed
from jblast.inference.mode.search import HOPELESS, Optima
from jblast.inference.mode.starts import layout_size, typical_step
from jblast.inference.posterior.fisher_information import by_kernel, information
from jblast.inference.posterior.posterior import Posterior
from jblast.parameters import CHARGE_POSITION
from jblast.scene import Free

STEP = math.log(1.5)
"""Spacing of the ranges in ln: a range known to 20 % spans several of them."""
MIN_STEPS = 3
"""Smallest number of ranges with a likelihood less than `HOPELESS` below the best, for
a profile. With fewer the standard deviation is below a tenth: a normal describes it."""
MAX_WIDTHS = 300.0
"""Largest range, in widths of the array. The sagitta of the front is then 1/2400 of the
width, 0.01 ms for 10 m: farther out arrival times contain no range."""
FALLEN = 0.5 * NORMAL_Q95**2
"""Fall in ln of the likelihood at the end of a one-sided 95 % interval."""
WIDEST_STEP = 10.0
"""Prior standard deviation of numbers that the data hardly constrain, in typical steps.

It bounds a Newton step; an identified number is known far better than this."""
SCALED_RANGES = 0.3, 100.0
"""Prior limits of the scaled distance of the array from a free charge [m/kg^(1/3)].

The lower limit is near the fireball (four charge radii are 0.2). At the upper limit the
front moves at the speed of sound within 0.2 %: arrival times no longer depend on the
mass."""
MASS_SD = 3 * math.log(SCALED_RANGES[1] / SCALED_RANGES[0]) / math.sqrt(12)
"""Standard deviation in ln of a free mass: that of a uniform distribution between the
limits, of the cube of the scaled distance."""
NEAREST_STEP = -5
"""Number of the nearest range: 0.13 widths from the middle of the sensors. Nearer in,
the charge is among the sensors, where the search finds all optima."""
ALL_DIRECTIONS_STEP = 6
"""Number of the range at which all directions are tried: 11 widths. The front is nearly
plane there, so each optimum over the bearing continues to the far ranges."""
RESOLVED = 0.5 * STEP
"""The sum over ranges is accurate to 2 % for a normal with at least this standard
deviation in ln of the range. A narrower optimum is a peak by itself."""
NEGLIGIBLE = 0.05
"""Probability of all other places below which a peak is the answer: half of what a
90 % interval leaves out."""
DETERMINED = 0.5
"""A bearing with a larger standard deviation is not determined [rad], as for the
direction of a front (`signals.arrays`)."""
BEARINGS = 8
"""Number of bearings that are tried, 45 degrees apart. For a ring and for a line of
sensors each optimum has one of them within its basin."""
ROUNDS = 60
"""Largest number of Newton steps at each range, which start from the optimum at the
previous range. A bearing along a line of sensors has no information and takes some 35.
A climb that needs more is not at an optimum (`UNFINISHED`)."""
GAIN = 1e-3
"""A step that gains less than this in ln of the density is the last: the error is far
below `FALLEN`, by which ranges are compared."""
UNFINISHED = 0.5
"""A climb whose next step is expected to gain more than this in ln of the density is
not at an optimum: the gain of a step of one standard deviation."""
SPREADS = 4.0
"""Largest distance of a search result from the most probable place, in standard
deviations of each coordinate. It excludes results with absurd masses."""
SAME_BEARING_SD = 1.0
"""Bearings closer than this many standard deviations are one optimum."""


class RangeProfile(NamedTuple):
    """Optima over bearing and other numbers at each of several ranges.

    Attributes:
        width_m: Largest distance between sensors.
        at: Indices of the charge's east and north among the coordinates.
        middle: Mean position of the sensors, east and north [m].
        level: Number of the range of each place.
        range_m: Ground range from the middle of the sensors [m].
        log_likelihood: ln of the likelihood, integrated over all other numbers.
        bearing: Bearing of the charge from the middle, clockwise from north [rad].
        bearing_sd: Its standard deviation at this range [rad].
        z: Coordinates of each place.
        is_peak: True for places that are optima over the range as well.
        part: Index of the place of each normal approximation. A place has one for each
            correlation function of neighbouring paths.
        share: Share of each approximation in the likelihood of its place.
        offset: Mean of each approximation minus the coordinates of its place.
        spread: Root of its covariance. At a fixed range the last column is zero; for a
            peak the range is free.
    """

    width_m: float
    at: Int[np.ndarray, "2"]
    middle: Float[np.ndarray, "2"]
    level: Int[np.ndarray, " place"]
    range_m: Float[np.ndarray, " place"]
    log_likelihood: Float[np.ndarray, " place"]
    bearing: Float[np.ndarray, " place"]
    bearing_sd: Float[np.ndarray, " place"]
    z: Float[np.ndarray, "place free"]
    is_peak: Bool[np.ndarray, " place"]
    part: Int[np.ndarray, " part"]
    share: Float[np.ndarray, " part"]
    offset: Float[np.ndarray, "part free"]
    spread: Float[np.ndarray, "part free free"]

    def by_range(self) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return the ranges, and ln of the likelihood of each over its optima."""
        levels = np.unique(self.level)
        at = [self.level == level for level in levels]
        return (
            np.array([self.range_m[of].mean() for of in at]),
            np.array([np.logaddexp.reduce(self.log_likelihood[of]) for of in at]),
        )

    @property
    def best(self) -> int:
        """The most probable place."""
        return int(np.argmax(self.log_likelihood))

    @property
    def is_open(self) -> bool:
        """True if the likelihood has not fallen by `FALLEN` at the largest range."""
        height = self.by_range()[1]
        return bool(height[-1] > height.max() - FALLEN)

    @property
    def least_range_m(self) -> float:
        """Lower 95 % bound of a range without an upper bound [m]."""
        ranges, height = self.by_range()
        first = int(np.argmax(height > height.max() - FALLEN))
        if first == 0:
            return float(ranges[0])
        return math.exp(
            np.interp(
                height.max() - FALLEN,
                height[first - 1 : first + 1],
                np.log(ranges[first - 1 : first + 1]),
            )
        )

    @property
    def peaks_suffice(self) -> bool:
        """True if all places that are not peaks are improbable (`NEGLIGIBLE`)."""
        weight = np.exp(self.log_likelihood - self.log_likelihood.max())
        return bool(weight[~self.is_peak].sum() < NEGLIGIBLE * weight.sum())

    def others(self) -> list[int]:
        """Return places of other bearings that are nearly as probable as the best.

        Bearings whose distributions overlap are one.
        """
        best = self.best
        off = np.abs(_turned(self.bearing, self.bearing[best]))
        apart = off > 2 * SAME_BEARING_SD * np.hypot(
            self.bearing_sd, self.bearing_sd[best]
        )
        probable = self.log_likelihood > self.log_likelihood[best] - FALLEN
        there = self.level == self.level[best]
        return np.flatnonzero(there & apart & probable).tolist()

    def draws(
        self, count: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "draw free"]:
        """Draw coordinates: the range by its likelihood, the others given the range."""
        weight = np.exp(self.log_likelihood - self.log_likelihood.max())
        weight = weight[self.part] * self.share
        part = rng.choice(len(weight), count, p=weight / weight.sum())
        place = self.part[part]
        # Each range stands for the interval of one step about it, so a draw is uniform
        # in ln R there. The other coordinates follow by `along`: without it draws of a
        # tilted ridge would lie on steps.
        aside = rng.uniform(-0.5, 0.5, count) * STEP
        noise = rng.standard_normal((count, self.spread.shape[2]))
        about = np.einsum("dfc,dc->df", self.spread[part], noise)
        middle = self.z[place] + self.offset[part]
        return middle + aside[:, None] * self.along()[place] + about

    def sds(self, place: int) -> Float[np.ndarray, " free"]:
        """Return the standard deviations of the coordinates about a place."""
        of = self.part == place
        squared = self.offset[of] ** 2 + np.sum(self.spread[of] ** 2, axis=2)
        return np.sqrt(self.share[of] @ squared)

    def bearings(
        self,
        z: Float[np.ndarray, "draw free"],
        place: int,
    ) -> Float[np.ndarray, " nearer"]:
        """Return the bearings of draws relative to that of a place [rad].

        Draws that are nearer to the bearing of another probable place are left out.

        Args:
            z: Draws.
            place: The best place, or one of `others`.
        """
        away = z[:, self.at] - self.middle
        bearing = np.arctan2(away[:, 0], away[:, 1])
        places = (self.best, *self.others())
        off = np.stack([_turned(bearing, self.bearing[k]) for k in places])
        nearest = np.argmin(np.abs(off), axis=0)
        of = places.index(place)
        return off[of][nearest == of]

    def along(self) -> Float[np.ndarray, "place free"]:
        """Return the differences of the coordinates per unit of ln of the range."""
        along = np.zeros_like(self.z)
        for place in np.flatnonzero(~self.is_peak):
            found = []
            for aside in (-1, 1):
                level = self.level[place] + aside
                adjacent = np.flatnonzero((self.level == level) & ~self.is_peak)
                if not len(adjacent):
                    continue
                off = np.abs(_turned(self.bearing[adjacent], self.bearing[place]))
                nearest = int(adjacent[np.argmin(off)])
                sd = math.hypot(self.bearing_sd[place], self.bearing_sd[nearest])
                if off.min() < 2 * SAME_BEARING_SD * sd:
                    found.append(aside * (self.z[nearest] - self.z[place]) / STEP)
            if found:
                along[place] = np.mean(found, axis=0)
        return along


def with_best_range(
    posterior: Posterior, found: Optima, profile: RangeProfile
) -> Optima:
    """Put the optimum first that lies at the most probable range and bearing.

    If no search ended there (for example because the range is open), the most probable
    place of the profile is put first. Other probable bearings are added.

    Args:
        posterior: The posterior.
        found: Optima of the search, the best first.
        profile: Range profile of the charge.
    """
    z, density = np.asarray(found.z), np.asarray(found.log_density)
    best = profile.best
    away = z[:, profile.at] - profile.middle
    off = _turned(np.arctan2(away[:, 0], away[:, 1]), profile.bearing[best])
    far = np.log(np.linalg.norm(away, axis=1) / profile.range_m[best])
    near = (np.abs(off) < 2 * profile.bearing_sd[best]) & (np.abs(far) < STEP)
    reach = np.hypot(profile.sds(best), STEP * profile.along()[best])
    near &= np.all(np.abs(z - profile.z[best]) < SPREADS * reach, axis=1)
    near &= np.isfinite(density)
    # at the edge of what converges one program ends in NaN where another does not
    near[near] = [_is_regular(posterior, place) for place in z[near]]
    added = [*profile.others()] if near.any() else [best, *profile.others()]
    order = np.argsort(~near, kind="stable")
    heights = [float(posterior.log_density(jnp.asarray(profile.z[k]))) for k in added]
    first = int(near.any())
    return Optima(
        jnp.asarray(np.insert(z[order], first, profile.z[added], axis=0)),
        jnp.asarray(np.insert(density[order], first, heights)),
    )


def range_profile(posterior: Posterior, found: Optima) -> RangeProfile | None:
    """Follow the range of a charge inwards and outwards.

    Args:
        posterior: The posterior.
        found: Its optima.

    Returns:
        The profile. None if the position is not free over the plane, if there are
        several charges, if far places are improbable compared with the best optimum, or
        if the range is known better than the steps resolve: a normal describes it then.
    """
    at = _free_place(posterior)
    if at is None:
        return None
    position = posterior.layout.places()[:, :2]
    if len(position) < 2:
        return None
    middle = position.mean(axis=0)
    width = float(np.linalg.norm(position[:, None] - position[None], axis=-1).max())
    density = np.asarray(found.log_density)
    optima = np.asarray(found.z)[density > density[0] - HOPELESS]
    ranges = np.linalg.norm(optima[:, at] - middle, axis=1)
    walker = _Walker(posterior, at, middle, width)
    first = walker.peak_of(optima[0])
    # An optimum within one width decides most logs by three climbs, at a far range:
    # following all ranges takes most of the time of a fit.
    if not (ranges[0] > width or walker.is_open_from(optima[0], first)):
        return None
    peaks = [first, *map(walker.peak_of, optima[1:])]
    # peaks first: a place at the range of a level is part of a peak beside it
    for peak, distance in zip(peaks, ranges, strict=True):
        if peak is not None:
            walker.add(peak, walker.level_of(distance))
    for z, peak, distance in zip(optima, peaks, ranges, strict=True):
        if peak is None:
            walker.follow(z, walker.level_of(distance))
    there = walker.levels.get(ALL_DIRECTIONS_STEP)
    z = there[0].z if there else optima[0]
    for turned in walker.around(z, ALL_DIRECTIONS_STEP):
        walker.follow(turned, ALL_DIRECTIONS_STEP)
    profile = walker.profile()
    if profile is None:
        return None
    if profile.peaks_suffice:
        # with another peak than the densest first, of which no interval may exist
        is_first = np.array_equal(profile.z[profile.best], optima[0])
        return None if is_first else profile
    if profile.is_open:
        return profile
    height = profile.by_range()[1]
    is_resolved = np.sum(height > height.max() - HOPELESS) >= MIN_STEPS
    return profile if is_resolved else None


def narrowest(away: Float[np.ndarray, "row 2"]) -> Float[np.ndarray, "2"]:
    """Return the direction in which places extend least, as a unit vector.

    Args:
        away: Places relative to their middle, any number of them.
    """
    # an SVD of the places would have a square matrix with a row for each of them
    return np.linalg.eigh(away.T @ away)[1][:, 0]


def _free_place(posterior: Posterior) -> Int[np.ndarray, "2"] | None:
    """Return the indices of a single charge's east and north; None if not both free."""
    parameters = posterior.parameters
    if len(parameters.scene.charges) > 1 or parameters.scene.charge.range_m is not None:
        return None
    at = []
    for name in CHARGE_POSITION[:2]:
        if name not in parameters.names:
            return None
        at.append(parameters.names.index(name))
        if not isinstance(parameters.beliefs[at[-1]], Free):
            return None
    return np.array(at)


class _Place(NamedTuple):
    """An optimum at one range; see `RangeProfile`."""

    log_likelihood: float
    bearing: float
    bearing_sd: float
    z: Float[np.ndarray, " free"]
    is_peak: bool
    share: Float[np.ndarray, " part"]
    offset: Float[np.ndarray, "part free"]
    spread: Float[np.ndarray, "part free free"]


class _Walker:
    """Follows optima over bearing and other numbers from range to range.

    Attributes:
        levels: The optima found so far, by the number of their range.
    """

    def __init__(self, posterior, at, middle, width) -> None:
        self.posterior, self.at, self.middle, self.width = posterior, at, middle, width
        self.steps = np.asarray(typical_step(posterior))
        self.others = np.delete(np.arange(len(self.steps)), at)
        self.size = float(layout_size(posterior))
        names = posterior.parameters.names
        self.time = names.index("origin_time_s") if "origin_time_s" in names else -1
        beliefs = dict(zip(names, posterior.parameters.beliefs, strict=True))
        is_free = isinstance(beliefs.get("charge_mass_kg"), Free)
        self.mass = names.index("charge_mass_kg") if is_free else -1
        self.levels: dict[int, list[_Place]] = {}
        self.last = self.level_of(MAX_WIDTHS * width)

    def level_of(self, distance: float) -> int:
        """Return the number of the range nearest to a distance."""
        nearest = self.range_of(NEAREST_STEP)
        return round(math.log(max(distance, nearest) / self.width) / STEP)

    def range_of(self, level: int) -> float:
        """Return a range by its number [m]."""
        return self.width * math.exp(level * STEP)

    def is_open_from(self, z, peak: _Place | None) -> bool:
        """Return True if a far place is nearly as probable as one among the sensors.

        Tried are the directions of the plane wave that best fits the arrivals. Those at
        a line of sensors determine its slowness along the line only: it comes from
        either side.

        Args:
            z: Coordinates of the place among the sensors.
            peak: The same place if it is a peak, else None.
        """
        layout = self.posterior.layout
        rows = np.array(layout.quantity) == "air_arrival_s"
        rows &= ~(np.asarray(layout.slant_range) > 0)
        if not rows.any():
            return False
        distance = float(np.linalg.norm(z[self.at] - self.middle))
        nearest = self.range_of(NEAREST_STEP)
        here = peak or self._climbed(self._at_range(z, max(distance, nearest)))
        if here is None:
            return False
        away = np.asarray(layout.position)[rows, :2] - self.middle
        design = np.column_stack([np.ones(len(away)), away])
        times = np.asarray(self.posterior.measured)[rows]
        # A plane wave has t = t0 + s . x with the slowness s along its direction of
        # travel, so the charge lies towards -s. It is linear in t0 and s: no search is
        # needed.
        slowness = np.linalg.lstsq(design, times, rcond=None)[0][1:]
        across = narrowest(away)
        lacking = math.sqrt(max(STANDARD_SOUND_SPEED**-2 - slowness @ slowness, 0.0))
        for side in (0, 1, -1):
            far = np.array(z)
            far[self.at] = self.middle - slowness + side * lacking * across
            far = self._at_range(far, self.range_of(ALL_DIRECTIONS_STEP))
            there = self._climbed(far)
            if there and there.log_likelihood > here.log_likelihood - HOPELESS:
                return True
        return False

    def follow(self, z, level: int) -> None:
        """Add the optimum near a place, and follow it inwards and outwards."""
        z = np.array(z)
        for levels in (
            range(level, self.last + 1),
            range(level - 1, NEAREST_STEP - 1, -1),
        ):
            near = z
            for k in levels:
                place = self._climbed(self._at_range(near, self.range_of(k)))
                if place is None:
                    break
                near = place.z
                if k == level:
                    z = near
                if not self.add(place, k):
                    break
                top = max(p.log_likelihood for of in self.levels.values() for p in of)
                if place.log_likelihood < top - HOPELESS:
                    break

    def add(self, place: _Place, level: int) -> bool:
        """Add a place to its level; return False if its bearing is there already."""
        there = self.levels.setdefault(level, [])
        for other in there:
            off = abs(float(_turned(place.bearing, other.bearing)))
            if off < SAME_BEARING_SD * min(
                place.bearing_sd, other.bearing_sd, DETERMINED / 2
            ):
                return False
        there.append(place)
        return True

    def around(self, z, level: int):
        """Return places at a range in `BEARINGS` directions from the array.

        The climb from there to an optimum also changes the charge. The speed of its
        front and the bearing both shift the times along a line of sensors.
        """
        places, step = [], np.zeros(1 + len(self.others))
        for turn in 2 * math.pi * np.arange(BEARINGS) / BEARINGS:
            step[0] = turn
            moved = self._moved(self._at_range(z, self.range_of(level)), step)
            places.append(self._at_range(moved, self.range_of(level)))
        return places

    def profile(self) -> RangeProfile | None:
        """Return the profile of all places found; None without any."""
        rows = [(k, p) for k in sorted(self.levels) for p in self.levels[k]]
        if not rows:
            return None
        level = np.array([k for k, _ in rows])
        range_m = [
            np.linalg.norm(p.z[self.at] - self.middle)
            if p.is_peak
            else self.range_of(k)
            for k, p in rows
        ]
        return RangeProfile(
            self.width,
            self.at,
            self.middle,
            level,
            np.array(range_m),
            np.array([p.log_likelihood for _, p in rows]),
            np.array([p.bearing for _, p in rows]),
            np.array([p.bearing_sd for _, p in rows]),
            np.array([p.z for _, p in rows]),
            np.array([p.is_peak for _, p in rows]),
            np.repeat(np.arange(len(rows)), [len(p.share) for _, p in rows]),
            np.concatenate([p.share for _, p in rows]),
            np.concatenate([p.offset for _, p in rows]),
            np.concatenate([p.spread for _, p in rows]),
        )

    def peak_of(self, z) -> _Place | None:
        """Return an optimum of the search as a peak; None if the ranges resolve it.

        A peak is narrower in ln of the range than `RESOLVED`.
        """
        z = np.array(z)
        away = z[self.at] - self.middle
        distance = max(float(np.linalg.norm(away)), self.range_of(NEAREST_STEP))
        weighed = self.posterior.weighed(jnp.asarray(z))
        known = np.asarray(information(weighed, jnp.asarray(z)))
        # The prior information of `_largest_sds` keeps the inverse finite along null
        # directions.
        known = known + np.diag(
            1 / np.square(self._largest_sds(distance, math.pi * distance))
        )
        if not np.isfinite(known).all():
            return None
        covariance = np.linalg.inv(known)
        of_place = covariance[np.ix_(self.at, self.at)]
        if np.linalg.eigvalsh(of_place)[-1] > (RESOLVED * distance) ** 2:
            return None
        tangent = np.array([away[1], -away[0]]) / distance**2
        value = float(self.posterior.log_density(jnp.asarray(z))) + self._belief(z)[0]
        volume = 0.5 * math.log(2 * math.pi) - 0.5 * np.linalg.slogdet(known)[1]
        # `log_density` is per unit of area; the prior here is flat in ln R and bearing,
        # and dA = R^2 d(ln R) d(bearing). A level stands for one STEP of ln R.
        volume -= 2 * math.log(distance) + math.log(STEP)
        return _Place(
            float(value + volume),
            math.atan2(away[0], away[1]) % (2 * math.pi),
            math.sqrt(tangent @ of_place @ tangent),
            z,
            True,
            np.ones(1),
            np.zeros((1, len(z))),
            np.linalg.cholesky(covariance)[None],
        )

    def _at_range(self, z, distance: float):
        """Move a place to a range; the origin time follows the travel times."""
        away = z[self.at] - self.middle
        moved = np.array(z)
        length = float(np.linalg.norm(away))
        toward = away / length if length > 0 else np.array([0.0, 1.0])
        moved[self.at] = self.middle + distance * toward
        if self.time >= 0:
            left = self.posterior.misfit(jnp.asarray(moved)).residual
            moved[self.time] += float(np.mean(np.asarray(left)))
        return moved

    def _climbed(self, z) -> _Place | None:
        """Return the optimum at a fixed range; None if the climb did not reach it."""
        z, _, promised = climbed(
            self.posterior,
            z,
            lambda z: self._known(self.posterior, z),
            self._moved,
            rounds=ROUNDS,
            gain=GAIN,
            belief=self._belief,
        )
        if promised > UNFINISHED or not _is_regular(self.posterior, z):
            return None
        parts = self._parts(z)
        if parts is None:
            return None
        away = z[self.at] - self.middle
        log_likelihood, offset, covariance, basis = parts
        share = np.exp(log_likelihood - log_likelihood.max())
        share /= share.sum()
        turn = offset[:, 0] - share @ offset[:, 0]
        root = basis @ np.linalg.cholesky(covariance)
        return _Place(
            float(np.logaddexp.reduce(log_likelihood)),
            math.atan2(away[0], away[1]) % (2 * math.pi),
            math.sqrt(share @ (covariance[:, 0, 0] + turn**2)),
            z,
            False,
            share,
            offset @ basis.T,
            np.pad(root, ((0, 0), (0, 0), (0, 1))),
        )

    def _parts(self, z):
        """Return a normal approximation for each correlation function at a range.

        With weights from their densities at one place, rough functions would count too
        little, because their bearings are wide. Each function is followed to its own
        optimum by one Newton step of at most one standard deviation, within which its
        normal is valid.
        """
        basis, least = self._directions(z)
        density, slope, known = (
            np.asarray(of) for of in by_kernel(self.posterior, jnp.asarray(z))
        )
        value, its_slope = self._belief(z)
        known = basis.T @ known @ basis + np.diag(least)
        slope = (slope + its_slope) @ basis
        if not all(np.isfinite(of).all() for of in (density, slope, known)):
            return None
        covariance = np.linalg.inv(known)
        step = np.einsum("kij,kj->ki", covariance, slope)
        length = np.sqrt(np.einsum("ki,ki->k", step, slope))
        part = 1 / np.maximum(1.0, length)
        # gain of a part p of a full Newton step on a quadratic: (p - p^2/2) times the
        # squared length of the step in standard deviations
        gain = (part - 0.5 * part**2) * length**2
        log_likelihood = density + value + gain - 0.5 * np.linalg.slogdet(known)[1]
        return log_likelihood, part[:, None] * step, covariance, basis

    def _belief(self, z):
        """Return ln of the prior density of a free mass at a range, and its gradient.

        The prior is a normal with the mean and variance of the uniform distribution
        over ln of `SCALED_RANGES`.
        """
        slope = np.zeros(len(z))
        if self.mass < 0:
            return 0.0, slope
        distance = float(np.linalg.norm(z[self.at] - self.middle))
        # at the middle of the sensors ln R has no lower bound
        distance = max(distance, self.range_of(NEAREST_STEP))
        middle = 3 * (math.log(distance) - np.mean(np.log(SCALED_RANGES)))
        off = (z[self.mass] - middle) / MASS_SD
        slope[self.mass] = -off / MASS_SD
        return -0.5 * off**2, slope

    def _known(self, posterior, z):
        """Return the information of bearing and other numbers, and their directions.

        The prior information that is added makes it positive definite.
        """
        basis, least = self._directions(z)
        matrix = np.asarray(information(posterior, jnp.asarray(z)))
        return basis.T @ matrix @ basis + np.diag(least), basis

    def _directions(self, z):
        """Return the directions of bearing and other numbers, and prior information."""
        east, north = z[self.at] - self.middle
        basis = np.zeros((len(z), 1 + len(self.others)))
        basis[self.at, 0] = north, -east  # per radian, clockwise
        basis[self.others, 1 + np.arange(len(self.others))] = 1.0
        sds = self._largest_sds(math.hypot(east, north), math.pi)
        return basis, np.append(math.pi, sds[self.others]) ** -2

    def _largest_sds(self, distance: float, of_place: float):
        """Return the standard deviations of coordinates that data do not constrain."""
        sds = WIDEST_STEP * self.steps
        sds[self.at] = of_place
        if self.time >= 0:  # a typical step is that of the layout, not of the range
            sds[self.time] *= max(1.0, distance / self.size)
        if self.mass >= 0:
            sds[self.mass] = MASS_SD
        return sds

    def _moved(self, z, step):
        """Rotate the charge about the sensors, and change the other numbers.

        A rotation keeps the range; a step along the tangent would lengthen it.
        """
        moved = np.array(z)
        (east, north), turn = z[self.at] - self.middle, step[0]
        moved[self.at] = self.middle + np.array(
            [
                east * math.cos(turn) + north * math.sin(turn),
                north * math.cos(turn) - east * math.sin(turn),
            ]
        )
        moved[self.others] += step[1:]
        return moved


def _is_regular(posterior: Posterior, z) -> bool:
    """Return True if the information at a place is finite."""
    z = jnp.asarray(z)
    return bool(np.isfinite(np.asarray(information(posterior.weighed(z), z))).all())


def _turned(bearing, other):
    """Return the difference of two bearings, within half a turn [rad]."""
    return (bearing - other + math.pi) % (2 * math.pi) - math.pi
