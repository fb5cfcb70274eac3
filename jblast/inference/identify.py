"""Estimates from draws, unidentified parameters, and data that would help.

An estimate is read from the draws. A number is identified if its 90 % interval is
narrower than `widest`. A place is identified if the draws of its most probable region
are compact; numbers are then those of that region, and the other regions are reported.
Otherwise bearing and range are.

A null direction is an eigenvector of the information at the answer without information,
some of whose numbers the draws leave open: a derivative that vanishes by symmetry alone
is none. Combinations that vanish along all null directions are estimable although their
numbers are not. They are named like `air_sound_speed_m_s * charge_mass_kg^0.2`.

For each null direction, additional data are compared by the change of their prediction
along it: every quantity at a sensor of the log, and at a position off the sensors'
line. Between two modes the datum whose prediction differs most is named. A prior on any
parameter of the direction resolves it as well.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.answer import (
    Answer,
    constrained,
    layout_size,
    unconstrained,
)
from jblast.inference.density import Density, seen_at
from jblast.inference.posterior.fisher_information import TAKES_PART
from jblast.inference.posterior.parameters import GROWTH, Estimate
from jblast.inference.regions import arcs, quantiles, regions
from jblast.inference.sample import RELIABLE, Draws
from jblast.observations import CLOCK_TIMES, TIMES
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import ADDABLE, ADDITIVE, BY_CAMERA
from jblast.scene import Free, Scene, parameter_named
from jblast.sensors import Layout, resolve_laws
from jblast.sensors.law_choice import law_names

RESOLVED_CHANGE = 0.03
"""A datum resolves a null direction if a typical step along it changes the datum by
more than this in ln: three times the 1 % by which laws scatter from path to path."""
WIDEST_FACTOR = 30.0
"""A positive number whose 90 % interval spans a larger factor is not identified.

A factor of 30 is 1.5 decades, an sd of 1.03 in ln: beyond it not even the order of
magnitude is known. Of a mass it is a factor of 3.1 in every distance (Hopkinson
scaling: distances go as the cube root), so of about 3 to 10 in a peak overpressure.
"""
UNLEARNED = 0.95
"""Ratio of a number's sd to that of its prior above which the log adds nothing: the
data then contain less than a tenth of the information of the prior."""
OPEN_RATIO = 0.25
"""Ratio of a number's sd to that of its weak prior above which the draws leave it open:
the bounds of the prior then limit it, not the log."""
TAILS = (0.001, 0.999)
"""Quantiles beyond which draws do not add to a standard deviation: that of a normal
becomes 0.4 % smaller."""
OPEN_FROM, OPEN_SHARE = 1 / 3, 0.025
"""A range has no upper limit if more than this share of the draws lies beyond this
part of the prior's bound."""
TO_THE_END = 0.1
"""A 90 % interval has no lower limit if it begins within this share of its length from
the end of the prior: draws that are uniform to the end begin at half of it."""
AMBIGUITY = 6.0
"""Another mode within this of the best, in -2 ln density, is an ambiguity: its
probability is 5 % of the best or more."""
WHOLE_TURN = 300.0
"""Size of an arc from which on it is no bearing [degrees]: a charge anywhere about its
only sensor."""
BETWEEN, VALLEY = 9, 0.5
"""Places between two modes, and the fall of ln of the density there by which they are
two: less is a ridge."""
OF_CHARGE = (
    *("charge_mass_kg", "charge_range_m", "charge_east_m", "charge_north_m"),
    "origin_time_s",
)
"""The requested numbers of a fit. Others (height, air, ground, clocks) are conditions:
if the data add nothing to a prior on one of them, the prior is the answer."""
Where = Literal["sensor", "place", "aside", "range", "later"]


@dataclass(frozen=True)
class PlaceFound:
    """Regions, range and bearing of the place of one charge.

    Attributes:
        label: Label of the charge: "" or ".NAME".
        parts: Draws of each region of the place, the most probable first.
        shares: Share of each.
        is_compact: True where the region is a place.
        is_open: True if the range has no upper limit.
        reach: Range of each draw from the middle of the sensors [m].
        bearing: Bearing of each draw [rad].
    """

    label: str
    parts: tuple[Bool[np.ndarray, " draw"], ...]
    shares: tuple[float, ...]
    is_compact: tuple[bool, ...]
    is_open: bool
    reach: Float[np.ndarray, " draw"]
    bearing: Float[np.ndarray, " draw"]

    @property
    def has_place(self) -> bool:
        """True if the most probable region is a place."""
        return bool(self.is_compact) and self.is_compact[0]

    @property
    def is_single(self) -> bool:
        """True if it is the only region."""
        return self.has_place and len(self.parts) == 1


@dataclass(frozen=True)
class Identified:
    """Identified and unidentified parameters of a log.

    Attributes:
        answer: The log at the answer.
        draws: The weighted draws.
    """

    answer: Answer
    draws: Draws

    @property
    def density(self) -> Density:
        """The density of the log."""
        return self.answer.density

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted numbers."""
        return self.answer.names

    @cached_property
    def places(self) -> tuple[PlaceFound, ...]:
        """The free places."""
        axes, draws = self.density.coordinates, self.draws
        found = []
        for k in range(len(axes.places)):
            v = draws.u[:, 2 * k : 2 * k + 2]
            parts = regions(v, draws.weights)
            reach, bearing, _ = axes.at_place(draws.u, k)
            bound = axes.radius * math.sinh(axes.most)
            beyond = draws.weights[reach > OPEN_FROM * bound].sum()
            found.append(
                PlaceFound(
                    label=axes.labels(k),
                    parts=tuple(part.inside for part in parts),
                    shares=tuple(part.share for part in parts),
                    is_compact=tuple(part.is_place for part in parts),
                    is_open=bool(beyond > OPEN_SHARE),
                    reach=reach,
                    bearing=bearing,
                )
            )
        return tuple(found)

    def _of(self, inside: Bool[np.ndarray, " draw"]) -> Float[np.ndarray, " part"]:
        weights = self.draws.weights[inside]
        return weights / weights.sum()

    @cached_property
    def chosen(self) -> Bool[np.ndarray, " draw"]:
        """The draws of the most probable region of every place that has one.

        Without a free place, those about the best mode.
        """
        inside = np.ones(len(self.draws.u), bool)
        for place in self.places:
            if place.has_place:
                inside &= place.parts[0]
        if not self.places and self._separate:
            modes = self.draws.modes
            apart = []
            for i in (self._home, *self._separate):
                away = np.linalg.solve(modes.root[i], (self.draws.u - modes.u[i]).T)
                apart.append((away**2).sum(axis=0))
            inside &= np.argmin(apart, axis=0) == 0
        # regions of several places may exclude one another
        return inside if inside.any() else np.ones(len(inside), bool)

    def resampled(self, count: int, seed: int = 0) -> Int[np.ndarray, " sample"]:
        """Return indices of draws of equal weight in the most probable region."""
        return self.draws.resampled(count, seed, among=self.chosen)

    @cached_property
    def z(self) -> Float[np.ndarray, "draw name"]:
        """Fitted coordinates of the draws."""
        return unconstrained(self.density, self.draws.values)

    @cached_property
    def covariance(self) -> Float[np.ndarray, "name name"]:
        """Covariance of the fitted coordinates in the most probable region."""
        weights, z = self._of(self.chosen), self.z[self.chosen]
        away = z - weights @ z
        return (away * weights[:, None]).T @ away

    @cached_property
    def found(self) -> dict[str, Estimate]:
        """Estimate of each number in the most probable region, identified or not."""
        return self.estimates_in(self.chosen, self.answer.values)

    def estimates_in(
        self,
        inside: Bool[np.ndarray, " draw"],
        best: Float[np.ndarray, " name"] | None = None,
    ) -> dict[str, Estimate]:
        """Return the estimates of some of the draws.

        Args:
            inside: The draws.
            best: Most probable numbers; by default those of the draw of highest
                density.
        """
        weights, values = self._of(inside), self.draws.values[inside]
        top = values[self.draws.log_density[inside].argmax()] if best is None else best
        return {
            name: estimate_of(name, values[:, i], weights, float(top[i]))
            for i, name in enumerate(self.names)
        }

    @cached_property
    def reach(self) -> float:
        """The larger of the layout's extent and the largest slant range [m]."""
        ranges = np.nan_to_num(self.answer.slant_range)
        return max(layout_size(self.density), float(ranges.max(initial=0.0)))

    def widest(self, name: str) -> float:
        """Return the widest 90 % interval with which a number counts as identified.

        For a positive number it is a factor, for others a difference in their unit. A
        coordinate is compared with the reach, a time with the travel time of sound
        over it, any other number with the width of its allowed range.
        """
        parameter = parameter_named(name)
        if parameter.positive:
            return WIDEST_FACTOR
        possible = parameter.bounds.at_most - parameter.bounds.at_least
        # numbers like temperatures have no scale of the layout
        scales = {"layout": self.reach, "travel": self.reach / STANDARD_SOUND_SPEED}
        return scales.get(parameter.spread.of, possible)

    @cached_property
    def unlearned(self) -> tuple[str, ...]:
        """Numbers to whose priors the log adds nothing."""
        sds = np.sqrt(np.diag(self.covariance))
        pairs = zip(self.names, self.answer.has_prior, sds, strict=True)
        return tuple(name for name, prior, sd in pairs if prior and sd > UNLEARNED)

    @cached_property
    def is_wide(self) -> tuple[bool, ...]:
        """True for numbers whose interval is wider than `widest`."""
        return tuple(
            not width(name, self.found[name]) <= self.widest(name)
            for name in self.names
        )

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """Estimate of each number; an unidentified one has no value."""
        lost = self._lost
        return {
            name: Estimate() if name in lost or not known else found
            for name, known, found in zip(
                self.names, self.determined, self._reported(self.chosen), strict=True
            )
        }

    def _reported(self, inside: Bool[np.ndarray, " draw"]) -> list[Estimate]:
        """Return the estimates of some of the draws, wide ones without a value."""
        by_prior = {n for n in self.unlearned if n.partition(".")[0] in OF_CHARGE}
        beliefs, reported = self.density.coordinates.beliefs, []
        best = self.answer.values if inside is self.chosen else None
        for i, (name, found) in enumerate(self.estimates_in(inside, best).items()):
            counts = isinstance(beliefs[i], Free) or name.partition(".")[0] in OF_CHARGE
            too_wide = counts and not width(name, found) <= self.widest(name)
            # an interval of the prior alone is reported, but its middle is no estimate
            unknown = too_wide or name in by_prior
            reported.append(self._bounded(i, inside) if unknown else found)
        return reported

    @cached_property
    def _lost(self) -> set[str]:
        """Numbers of charges without a place: bearing and range replace them."""
        lost = set()
        for place in self.places:
            if not place.has_place:
                bases = ("charge_east_m", "charge_north_m", "origin_time_s")
                lost |= {base + place.label for base in bases}
        return lost

    def _bounded(self, i: int, inside: Bool[np.ndarray, " draw"]) -> Estimate:
        """Return the interval alone, without the ends that the prior alone sets."""
        name, weights = self.names[i], self._of(inside)
        found = self.estimates_in(inside)[name].interval_alone()
        others = {other.at: other for other in self.density.coordinates.others}
        other = others.get(i)
        if other is None or other.kind != "flat":
            return found
        low, high = quantiles(self.z[inside, i], weights, (0.05, 0.95))
        is_low = low - other.low < TO_THE_END * (high - other.low)
        is_high = other.high - high < TO_THE_END * (other.high - low)
        return Estimate(
            q05=math.nan if is_low else found.q05,
            q95=math.nan if is_high else found.q95,
        )

    @cached_property
    def _null(self) -> tuple[np.ndarray, np.ndarray]:
        """Null directions in units of a typical size, and the sizes."""
        null, size = self.answer.inverse.null, self.answer.inverse.size
        # with fewer readings than numbers a curve is left open, however short it is
        restricted = len(self.density.rows.measured) + self.answer.has_prior.sum()
        kept = [
            vector
            for k, vector in enumerate(null.T)
            if vector.any()
            and (k < len(size) - restricted or self.is_left_open(vector))
        ]
        return echelon(np.reshape(kept, (len(kept), len(size)))), size

    def is_left_open(self, vector: Float[np.ndarray, " name"]) -> bool:
        """Return True if the draws leave a number of a direction open."""
        priors = self.density.coordinates.prior_sds()
        u = np.full((len(self.draws.u), len(self.names)), np.nan)
        first = 2 * len(self.density.coordinates.places)
        for j, other in enumerate(self.density.coordinates.others, first):
            u[:, other.at] = self.draws.u[:, j]
        sds = np.array([_sd(x, self.draws.weights) for x in u.T])
        is_open = np.array(self.is_wide) | (sds > OPEN_RATIO * priors)
        taking_part = np.flatnonzero(np.abs(vector) > TAKES_PART)
        if len(taking_part) == 1:  # a number with one end, as by lower bounds
            alone = self._bounded(int(taking_part[0]), self.chosen)
            if math.isnan(alone.q05) != math.isnan(alone.q95):
                return False
        return bool(is_open[taking_part].any())

    @cached_property
    def null(self) -> Float[np.ndarray, "null name"]:
        """Null directions in the fitted coordinates, one row each."""
        rows, size = self._null
        return _led_by_one(rows / size)

    @cached_property
    def determined(self) -> tuple[bool, ...]:
        """True for numbers without a component in any null direction."""
        return tuple(bool((column == 0).all()) for column in self.null.T)

    @cached_property
    def null_directions(self) -> "tuple[NullDirection, ...]":
        """Every null direction with its remedies."""
        space = self.density.parameters.space()
        found = []
        for direction in self.null:
            triples = zip(self.names, space, direction, strict=True)
            used = [(name, of, float(w)) for name, of, w in triples if w != 0]
            spaces = {of for _, of, _ in used}
            found.append(
                NullDirection(
                    parameters={name: weight for name, _, weight in used},
                    space=spaces.pop() if len(spaces) == 1 else "mixed",
                    cure=cure_of_null(self.answer, direction),
                )
            )
        return tuple(found)

    @cached_property
    def combinations(self) -> "tuple[EstimableCombination, ...]":
        """The estimable combinations of unidentified numbers."""
        space, answer = self.density.parameters.space(), []
        inside, weights = self.chosen, self._of(self.chosen)
        linear = self.answer.inverse.covariance
        for form in estimable_forms(self.null, self.determined):
            text, is_product = combination(self.names, space, form)
            value = float(form @ self.answer.z)
            drawn = self.z[inside] @ form
            spread = float(np.sqrt(weights @ (drawn - weights @ drawn) ** 2))
            sd = float(np.sqrt(form @ linear @ form))
            # along a curved invariance the combination changes at a distance
            is_local = spread > 2 * sd
            if is_product:
                # a form of many powers may overflow: it is then omitted
                with np.errstate(over="ignore"):
                    value = float(np.exp(value))
                sd = value * sd
            if np.isfinite([value, sd]).all():
                answer.append(EstimableCombination(text, value, sd, is_local))
        return tuple(answer)

    @cached_property
    def other_modes(self) -> "tuple[OtherMode, ...]":
        """Every other mode that the data cannot rule out.

        If all laws are valid at the best mode, those where a law is not are left out.
        """
        modes, best = self.draws.modes, self.answer
        valid, sds = bool(best.valid.all()), np.sqrt(np.diag(self.covariance))
        answer, top = [], modes.log_density[self._home]
        for i in self._separate:
            values = self.density.best(modes.u[i])
            z = unconstrained(self.density, values[None])[0]
            away = np.abs(z - best.z) > sds
            differ = [n for n, far in zip(self.names, away, strict=True) if far]
            if not set(differ) - self._unknown:
                continue
            if valid and not self.density.seen_with(values[None]).valid.all():
                continue
            answer.append(
                OtherMode(
                    parameters=dict(zip(self.names, map(float, values), strict=True)),
                    differ=tuple(differ),
                    delta_chi2=2 * float(top - modes.log_density[i]),
                    cure=cure_of_ambiguity(best, values),
                )
            )
        return tuple(answer)

    @property
    def _unknown(self) -> set[str]:
        """Numbers in which modes that differ are no other answers."""
        pairs = zip(self.names, self.determined, strict=True)
        return {name for name, known in pairs if not known} | self._lost

    @cached_property
    def _home(self) -> int:
        """The mode of the answer."""
        modes = self.draws.modes
        here = self.density.coordinates.of_values(self.answer.values[None])[0]
        away = np.linalg.solve(modes.root, (here - modes.u)[..., None])
        return int(np.argmin((away**2).sum((1, 2))))

    @cached_property
    def _separate(self) -> tuple[int, ...]:
        """Modes nearly as probable as that of the answer, with a valley between."""
        modes = self.draws.modes
        fall = 2 * (modes.log_density[self._home] - modes.log_density)
        near = [int(i) for i in np.flatnonzero(fall <= AMBIGUITY) if i != self._home]
        return tuple(i for i in near if self._is_apart(modes.u[i]))

    def _is_apart(self, u: Float[np.ndarray, " free"]) -> bool:
        """Return True if the density is lower between a mode and the best one."""
        best = self.draws.modes.u[self._home]
        between = best + np.linspace(0, 1, BETWEEN + 2)[:, None] * (u - best)
        height = self.density(between)
        return bool(height[1:-1].min() < min(height[0], height[-1]) - VALLEY)

    @cached_property
    def bearings(self) -> "tuple[BearingArc, ...]":
        """Arcs of the bearing of the first charge without a place."""
        place = self._without_place
        if place is None:
            return ()
        every, found = arcs(place.bearing, self.draws.weights), []
        if max(arc.size for arc in every) >= WHOLE_TURN:
            return ()
        degrees = np.degrees(place.bearing)
        middles = [arc.first + 0.5 * arc.size for arc in every]
        away = np.array([(degrees - m + 180) % 360 - 180 for m in middles])
        # each draw belongs to the arc whose end is nearest: arcs hold 90 % of them
        sizes = np.array([0.5 * arc.size for arc in every])
        nearest = (np.abs(away) - sizes[:, None]).argmin(axis=0)
        for k, (arc, middle) in enumerate(zip(every, middles, strict=True)):
            off, inside = away[k], nearest == k
            if not inside.any():
                continue
            weights = self._of(inside)
            low, median, high = middle + quantiles(off[inside], weights)
            mean = weights @ off[inside]
            turn = 360 * (median // 360)
            found.append(
                BearingArc(
                    share=arc.share,
                    bearing_deg=Estimate(
                        value=float(median - turn),
                        sd=float(np.sqrt(weights @ (off[inside] - mean) ** 2)),
                        q05=float(low - turn),
                        q50=float(median - turn),
                        q95=float(high - turn),
                    ),
                )
            )
        return tuple(found)

    @cached_property
    def range_m(self) -> Estimate | None:
        """Range of the first charge without a place, from the middle of the sensors."""
        place = self._without_place
        if place is None:
            return None
        low, high = quantiles(place.reach, self.draws.weights, (0.05, 0.95))
        return Estimate(q05=float(low), q95=math.nan if place.is_open else float(high))

    @property
    def _without_place(self) -> PlaceFound | None:
        return next((place for place in self.places if not place.has_place), None)

    @cached_property
    def regions(self) -> "tuple[PlaceRegion, ...]":
        """Regions of the place of the first charge that has several."""
        several = [place for place in self.places if len(place.parts) > 1]
        if not several or not several[0].has_place:
            return ()
        first = several[0]
        found = []
        for inside, share, is_compact in zip(
            first.parts, first.shares, first.is_compact, strict=True
        ):
            reported = self._reported(inside)
            estimates = dict(zip(self.names, reported, strict=True))
            low, high = quantiles(first.reach[inside], self._of(inside), (0.05, 0.95))
            found.append(
                PlaceRegion(
                    share=share,
                    is_place=is_compact,
                    estimates=estimates,
                    range_m=Estimate(q05=float(low), q95=float(high)),
                )
            )
        return tuple(found)

    @cached_property
    def is_reliable(self) -> bool:
        """True if the weights of the draws can be believed."""
        return self.draws.k_hat <= RELIABLE and self.draws.enough

    @cached_property
    def is_identifiable(self) -> bool:
        """True if the log determines a single answer."""
        single = all(place.is_single for place in self.places)
        return single and not self.null_directions and not self.other_modes


def identified(
    density: Density, draws: Draws, values: Float[np.ndarray, " name"]
) -> Identified:
    """Return what draws identify, with given numbers as the answer."""
    z = unconstrained(density, draws.values)
    sds = np.sqrt(draws.weights @ (z - draws.weights @ z) ** 2)
    return Identified(Answer(density, values, sds), draws)


def requested(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the requested numbers among the fitted ones.

    These are mass, position and time of the charges; all numbers if none of these was
    fitted.
    """
    of_charge = tuple(n for n in names if n.partition(".")[0] in OF_CHARGE)
    return of_charge or names


def width(name: str, estimate: Estimate) -> float:
    """Return the width of a 90 % interval, as `Identified.widest` counts it."""
    if not parameter_named(name).positive:
        return estimate.q95 - estimate.q05
    return estimate.q95 / estimate.q05 if estimate.q05 > 0 else np.inf


def estimate_of(
    name: str,
    x: Float[np.ndarray, " draw"],
    weights: Float[np.ndarray, " draw"],
    value: float,
) -> Estimate:
    """Return the estimate of a number by weighted draws."""
    low, median, high = quantiles(x, weights)
    log_sd = math.nan
    if parameter_named(name).positive:
        # a normal prior reaches below zero
        some = x > 0
        log_sd = _sd(np.log(x[some]), weights[some] / weights[some].sum())
    return Estimate(
        value=value,
        sd=_sd(x, weights),
        log_sd=log_sd,
        q05=float(low),
        q50=float(median),
        q95=float(high),
    )


def _sd(x, weights) -> float:
    # a far mode of a share of 1e-6 would decide the second moment
    x = np.clip(x, *quantiles(x, weights, TAILS))
    return float(np.sqrt(weights @ (x - weights @ x) ** 2))


def echelon(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Return the reduced row echelon form: it gives combinations of fewest parameters.

    Rows have a length of about 1; entries that are rounding are set to zero.
    """
    rows = np.array(rows, float)
    lead = 0
    for column in range(rows.shape[1]):
        if lead == len(rows):
            break
        # partial pivoting: rounding is not divided by a small entry
        best = lead + int(np.argmax(np.abs(rows[lead:, column])))
        if np.abs(rows[best, column]) <= TAKES_PART:
            continue
        rows[[lead, best]] = rows[[best, lead]]
        rows[lead] /= rows[lead, column]
        for other in range(len(rows)):
            if other != lead:
                rows[other] -= rows[other, column] * rows[lead]
        lead += 1
    sizes = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    rows[np.abs(rows) < TAKES_PART * sizes] = 0.0
    return rows


def _led_by_one(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Scale each row so that its first entry is 1."""
    return np.array([row / row[np.flatnonzero(row)[0]] for row in rows]).reshape(
        rows.shape
    )


def estimable_forms(
    null: Float[np.ndarray, "null free"], determined: Sequence[bool]
) -> Float[np.ndarray, "form free"]:
    """Return the estimable combinations of parameters not identified singly.

    Each row is a linear form in the coordinates that vanishes along every null
    direction. Identified parameters have no component in it.
    """
    open_ones = [i for i, known in enumerate(determined) if not known]
    if not open_ones:
        return np.zeros((0, len(determined)))
    # Forms of the unidentified parameters that vanish along the null directions. The
    # last parameter leads, so that speeds and times are in terms of the mass. They are
    # scaled, so that metres and seconds have equal weight.
    size = np.abs(null).max(axis=0)[open_ones]
    scaled = null[:, open_ones] / size
    forms = np.linalg.svd(scaled)[2][len(scaled) :]  # orthogonal complement of the rows
    estimable = np.zeros((len(forms), len(determined)))
    estimable[:, open_ones] = _led_by_one(echelon(forms[:, ::-1]) / size[::-1])[:, ::-1]
    return estimable


@dataclass(frozen=True)
class ResolvingDatum:
    """A datum that would resolve a null direction or an ambiguity.

    Attributes:
        quantity: Quantity to record.
        where: "sensor" (at one of the log), "place" (a new one), "aside" (a new place
            off the sensors' line), "range" (a new one) or "later" (at a later time).
        on_right_clock: True if it needs a synchronised clock.
        is_bang: True if it gives the range by the delay after a flash in the log.
    """

    quantity: str
    where: Where
    on_right_clock: bool = False
    is_bang: bool = False


def candidates(answer: Answer) -> tuple[Layout, list[ResolvingDatum]]:
    """Return rows that could be added to a log, and their descriptions.

    The rows are each quantity at a sensor of the log, and at a position off the
    sensors' line. That position is no nearer to the sensors than the nearest is to the
    charge.
    """
    layout = answer.density.layout
    position = np.asarray(layout.position)
    given = np.asarray(layout.slant_range)
    places: list[tuple[np.ndarray, float, Where]] = [(position[0], given[0], "sensor")]
    if np.isnan(given).all():
        reach = float(np.min(answer.slant_range))
        apart = float(np.max(np.ptp(position, axis=0))) > 0
        new = aside(answer.density, reach)
        places.append((new, np.nan, "aside" if apart else "place"))
    else:
        # with ranges instead of positions a second distance is the only new place
        places.append((position[0], 2 * np.nanmax(given), "range"))
    rows = [(q, *place) for q in ADDABLE for place in places]
    data = [ResolvingDatum(q, where) for q, _, _, where in rows]
    return Layout(
        quantity=tuple(q for q, *_ in rows),
        position=jnp.asarray(np.array([p for _, p, _, _ in rows])),
        slant_range=jnp.asarray([r for _, _, r, _ in rows]),
        time=jnp.full(len(rows), jnp.nan),
        group=tuple(range(len(rows))),
        shot=(0,) * len(rows),
        clock=("",) * len(rows),
    ), data


def aside(density: Density, reach: float = 0.0) -> Float[np.ndarray, "3"]:
    """Return a position off the sensors' line, one layout size from their middle.

    Args:
        density: Density with the layout.
        reach: Smallest distance from the middle [m].
    """
    position = np.asarray(density.layout.position)
    middle, size = position.mean(axis=0), max(layout_size(density), reach)
    # the last axis is across the line, or any direction for a single sensor
    _, _, axes = np.linalg.svd((position - middle)[:, :2], full_matrices=True)
    return middle + size * np.array([*axes[-1], 0.0])


@dataclass(frozen=True)
class Cure:
    """Remedies of a null direction, each sufficient alone.

    Attributes:
        parameters: Parameters of which one needs a prior or a measurement.
        data: Rows that could be added.
    """

    parameters: tuple[str, ...]
    data: tuple[ResolvingDatum, ...]


def cure_of_null(answer: Answer, direction: Float[np.ndarray, " name"]) -> Cure:
    """Return the data and priors that would resolve a null direction."""
    layout, possible = candidates(answer)
    step = 1e-3 * direction / np.max(np.abs(direction) / answer.steps)
    z = answer.z + np.stack([step, -step])
    ends = readings_beside(answer, layout, constrained(answer.density, z))
    with np.errstate(invalid="ignore"):
        moved = (ends[0] - ends[1]) / 2e-3
    data = [
        datum
        for datum, seen in zip(possible, np.abs(moved) > RESOLVED_CHANGE, strict=True)
        if seen
    ]
    names, quantities = answer.names, answer.density.layout.quantity
    taking_part = tuple(n for n, w in zip(names, direction, strict=True) if w != 0)
    clocks = any(name.startswith(f"{CLOCK_OFFSET}.") for name in taking_part)
    is_filmed = bool(set(BY_CAMERA) & set(quantities))
    at_sensor = {datum.quantity for datum in data if datum.where == "sensor"}
    data = [
        replace(
            datum,
            on_right_clock=clocks and datum.quantity in CLOCK_TIMES,
            is_bang=is_filmed and datum.quantity == "air_arrival_s",
        )
        for datum in data
        # a new position is omitted if the quantity at a sensor of the log resolves it
        if datum.where == "sensor" or datum.quantity not in at_sensor
    ]
    if GROWTH in taking_part:
        data.append(ResolvingDatum("fireball_radius_m", "later"))
    return Cure(taking_part, tuple(data))


def laws_beside(
    laws: Mapping[str, str], scene: Scene, layout: Layout
) -> dict[str, str]:
    """Return the laws of the log, and the automatic choice for other quantities."""
    return law_names(resolve_laws(scene, layout)) | {
        q: n for q, n in laws.items() if q in layout.quantities()
    }


def readings_beside(
    answer: Answer, layout: Layout, values: Float[np.ndarray, "place name"]
) -> Float[np.ndarray, "place row"]:
    """Return readings of other rows in ln, times in units of a typical travel time."""
    density = answer.density
    laws = laws_beside(density.laws, answer.scene, layout)
    scene = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, float) else x, answer.scene
    )
    at = jnp.asarray(values)
    names = density.coordinates.names
    seen = seen_at(at, scene, layout, names, tuple(sorted(laws.items())))
    found = np.asarray(seen.predicted)
    # times relative to a travel time: a change of 3 % then means the same for all
    timed = np.isin(layout.quantity, TIMES)
    plain = np.isin(layout.quantity, ADDITIVE)
    typical = layout_size(density) / STANDARD_SOUND_SPEED
    scaled = np.where(timed & plain, found / typical, found)
    return np.where(timed & ~plain, found - math.log(typical), scaled)


def cure_of_ambiguity(
    answer: Answer, there: Float[np.ndarray, " name"]
) -> ResolvingDatum:
    """Return the datum that differs most between two answers."""
    layout, possible = candidates(answer)
    ends = readings_beside(answer, layout, np.stack([answer.values, there]))
    with np.errstate(invalid="ignore"):  # of a law without a prediction
        apart = np.nan_to_num(np.abs(ends[0] - ends[1]))
    return possible[int(np.argmax(apart))]


def combination(
    names: Sequence[str], space: Sequence[str], weights: Float[np.ndarray, " free"]
) -> tuple[str, bool]:
    """Name a linear form in the coordinates.

    Returns:
        The name, and True for a product of powers (every part is in ln).
    """
    parts = [(n, s, w) for n, s, w in zip(names, space, weights, strict=True) if w != 0]
    if all(s == "ln" for _, s, _ in parts):
        return " * ".join(
            name if _short(w) == "1" else f"{name}^{_short(w)}" for name, _, w in parts
        ), True
    terms = [(f"ln({n})" if s == "ln" else n, w) for n, s, w in parts]
    first, *rest = [
        (w < 0, name if _short(abs(w)) == "1" else f"{_short(abs(w))} * {name}")
        for name, w in terms
    ]
    text = ("-" if first[0] else "") + first[1]
    return text + "".join(f" {'-' if neg else '+'} {t}" for neg, t in rest), False


def _short(weight: float) -> str:
    return f"{weight:.4g}"


@dataclass(frozen=True)
class NullDirection:
    """A direction in which parameters change together and no datum changes.

    Attributes:
        parameters: Component of each parameter; in ln for positive ones.
        space: Space of the coordinates: "ln", "linear" or "mixed".
        cure: Remedies.
    """

    parameters: Mapping[str, float]
    space: str
    cure: Cure


@dataclass(frozen=True)
class OtherMode:
    """Another mode that the data cannot rule out.

    Attributes:
        parameters: Value of every parameter.
        differ: Names of the parameters that differ from the best mode.
        delta_chi2: Increase of chi squared over the best mode.
        cure: Datum that would distinguish it from the best.
    """

    parameters: Mapping[str, float]
    differ: tuple[str, ...]
    delta_chi2: float
    cure: ResolvingDatum


@dataclass(frozen=True)
class EstimableCombination:
    """A combination of unidentified numbers that the data do identify.

    Attributes:
        combination: Formula.
        value: Estimate.
        sd: Standard deviation.
        is_local: True if it is estimable near the answer only (a curved invariance).
    """

    combination: str
    value: float
    sd: float
    is_local: bool = False


@dataclass(frozen=True)
class BearingArc:
    """An arc of bearings from the middle of the sensors.

    Attributes:
        share: Share of the posterior in it.
        bearing_deg: Bearing within it, clockwise from north.
    """

    share: float
    bearing_deg: Estimate


@dataclass(frozen=True)
class PlaceRegion:
    """A region of the place of a charge.

    Attributes:
        share: Share of the posterior in it.
        is_place: True if it is compact; otherwise only its range is limited.
        estimates: Estimate of every number within it.
        range_m: Range from the middle of the sensors.
    """

    share: float
    is_place: bool
    estimates: Mapping[str, Estimate]
    range_m: Estimate
