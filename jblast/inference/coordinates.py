r"""Coordinates of the unknown numbers, in which their prior is proper and weak.

- A free place: $v = \mathrm{asinh}(R/a)\,(\sin b, \cos b)$, with range $R$ and bearing
  $b$ from the middle of the sensors. The prior is flat in area within $a$ and flat in
  $\ln R$ beyond, to `FAR` widths of the array and at least ten times as far as sound
  travels between the first and the last reading of a clock.
- A free height: $\mathrm{asinh}((z - z_0)/(R + a))$ about the height of the sensors.
  Likewise a free east or north alone, over the distance of the other.
- A free mass: flat in ln from a milligram to 50 Mt.
- An origin time that is not linear: ln of the time before the first timed row.
- Other free numbers: flat within six of their typical spreads (`parameters.Spread`).
- A number with a prior: its normal score.

Numbers that all rows depend on linearly have no coordinate; they are integrated out
(`likelihood`).
"""

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import gammaln

from jblast.inference.likelihood import spread_points
from jblast.scene.uncertain import Belief, Free

NEAR = 0.3
"""Radius within which a place is flat in area, in widths of the array."""
FAR = 300.0
"""Largest range in widths of the array: the front of a charge that far is a plane to a
thousandth of its curvature at one width."""
SPREADS = 6.0
"""Half the range of other free numbers, in typical spreads."""
MASS = (math.log(1e-6), math.log(5e10))
"""Range of ln of a free mass [kg]: a milligram, and the largest weapon tested."""
SOFT = 40.0
"""Widths of a range in a standard deviation of its soft end."""
LN_2 = math.log(2.0)
RINGS, BEARINGS = 10, 24
"""Cells of the stratified start in ln R and bearing."""

Kind = Literal["score", "flat", "height", "axis", "time"]


class Other(NamedTuple):
    """A number with a coordinate of its own.

    Attributes:
        at: Its index among the names.
        kind: Its coordinate.
        low: Smallest coordinate; of a score that of the start.
        high: Largest coordinate.
        place: Free place of its charge; -1 without one.
        middle: Value at the coordinate 0.
        away: Distance of a fixed place from the middle of the sensors [m].
    """

    at: int
    kind: Kind
    low: float
    high: float
    place: int = -1
    middle: float = 0.0
    away: float = 0.0


@dataclass(frozen=True)
class Coordinates:
    """Coordinates $u$ of unknown numbers, their prior and their start.

    First are the two of each free place, then one for each other number.

    Attributes:
        names: Names of all unknown numbers.
        beliefs: Prior, or `Free`, of each.
        base: Value of each; those of linear numbers stay.
        places: Indices of east and north of each free place.
        others: Other numbers with a coordinate.
        linear: Indices of the linear numbers.
        middle: East and north of the middle of the sensors [m].
        radius: Radius $a$ [m].
        most: Largest $|v|$.
        first: Time of the first timed row [s].
    """

    names: tuple[str, ...]
    beliefs: tuple[Belief, ...]
    base: Float[np.ndarray, " name"]
    places: tuple[tuple[int, int], ...]
    others: tuple[Other, ...]
    linear: tuple[int, ...]
    middle: Float[np.ndarray, "2"]
    radius: float
    most: float
    first: float

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return 2 * len(self.places) + len(self.others)

    def labels(self, place: int) -> str:
        """Return the label of the charge of a place: "" or ".NAME"."""
        return self.names[self.places[place][0]].removeprefix("charge_east_m")

    def of_charge(self, place: int) -> list[int]:
        """Return the coordinates of the numbers of one charge."""
        first = 2 * len(self.places)
        label = self.labels(place)
        own = [
            first + j
            for j, other in enumerate(self.others)
            if label and self.names[other.at].endswith(label)
        ]
        return [2 * place, 2 * place + 1, *own]

    def at_place(
        self, u: Float[np.ndarray, "draw free"], place: int = 0
    ) -> tuple[
        Float[np.ndarray, " draw"],
        Float[np.ndarray, " draw"],
        Float[np.ndarray, "draw 2"],
    ]:
        """Return range [m], bearing [rad], and east and north [m] of a place."""
        v = u[:, 2 * place : 2 * place + 2]
        length = np.maximum(np.hypot(*v.T), 1e-12)
        reach = self.radius * np.sinh(np.minimum(length, 50.0))
        position = self.middle + (reach / length)[:, None] * v
        return reach, np.arctan2(*v.T), position

    def values(
        self, u: Float[np.ndarray, "draw free"]
    ) -> Float[np.ndarray, "draw name"]:
        """Return all numbers in their units."""
        found = np.tile(self.base, (len(u), 1))
        reaches = []
        for k, pair in enumerate(self.places):
            reach, _, found[:, pair] = self.at_place(u, k)
            reaches.append(reach)
        for z, other in zip(u.T[2 * len(self.places) :], self.others, strict=True):
            i = other.at
            with np.errstate(over="ignore"):  # far draws of a wide mixture
                if other.kind == "time":
                    found[:, i] = self.first - np.exp(z)
                elif other.kind in ("height", "axis"):
                    reach = reaches[other.place] if other.place >= 0 else other.away
                    found[:, i] = other.middle + (reach + self.radius) * np.sinh(z)
                else:
                    found[:, i] = np.asarray(self.beliefs[i].constrain(z))
        return found

    def of_values(
        self, values: Float[np.ndarray, "draw name"]
    ) -> Float[np.ndarray, "draw free"]:
        """Return the coordinates of numbers."""
        u, reaches = np.zeros((len(values), self.size)), []
        for k, pair in enumerate(self.places):
            away = values[:, pair] - self.middle
            reach = np.maximum(np.linalg.norm(away, axis=1), 1e-12 * self.radius)
            length = np.arcsinh(reach / self.radius)
            u[:, 2 * k : 2 * k + 2] = away * (length / reach)[:, None]
            reaches.append(reach)
        for j, other in enumerate(self.others, 2 * len(self.places)):
            x = values[:, other.at]
            if other.kind == "time":
                u[:, j] = np.log(np.maximum(self.first - x, 1e-300))
            elif other.kind in ("height", "axis"):
                reach = reaches[other.place] if other.place >= 0 else other.away
                u[:, j] = np.arcsinh((x - other.middle) / (reach + self.radius))
            else:
                u[:, j] = np.asarray(self.beliefs[other.at].unconstrain(x))
        return u

    def log_prior_of(self, xp: ModuleType, values: Any) -> Any:
        """Return ln of the prior density per unit of each number's fitted coordinate.

        Linear numbers are flat, or have their prior.

        Args:
            xp: NumPy or JAX.
            values: All numbers in their units, one place.
        """
        total, reaches = xp.zeros(()), []
        for east, north in self.places:
            away = values[xp.asarray([east, north])] - self.middle
            squared = (away**2).sum()
            beyond = xp.maximum(
                0.0, 0.5 * xp.log1p(squared / self.radius**2) + LN_2 - self.most
            )
            total = total - xp.log(self.radius**2 + squared) - 0.5 * (beyond / 0.1) ** 2
            reaches.append(xp.sqrt(squared))
        for other in self.others:
            i = other.at
            if other.kind == "score":
                continue
            if other.kind in ("height", "axis"):
                reach = reaches[other.place] if other.place >= 0 else other.away
                scale = reach + self.radius
                u = (values[i] - other.middle) / scale
                total = total - xp.log(scale) - 0.5 * xp.log1p(u**2)
                u = xp.arcsinh(u)
            elif other.kind == "time":
                u = xp.log(self.first - values[i])
            else:
                u = self.beliefs[i].unconstrain(values[i])
            width = other.high - other.low
            beyond = xp.maximum(0.0, xp.maximum(other.low - u, u - other.high))
            total = total - 0.5 * (SOFT * beyond / width) ** 2
        for i, belief in enumerate(self.beliefs):
            if not isinstance(belief, Free):
                total = total - 0.5 * belief.unconstrain(values[i]) ** 2
        return total

    def log_prior(
        self, u: Float[np.ndarray, "draw free"]
    ) -> Float[np.ndarray, " draw"]:
        """Return ln of the prior density per unit of $u$."""
        total = np.zeros(len(u))
        for k in range(len(self.places)):
            length = np.maximum(np.hypot(u[:, 2 * k], u[:, 2 * k + 1]), 1e-9)
            beyond = np.maximum(0.0, length - self.most)
            total += np.log(np.tanh(length) / length) - 0.5 * (beyond / 0.1) ** 2
            total -= math.log(2 * math.pi * self.most)
        for z, other in zip(u.T[2 * len(self.places) :], self.others, strict=True):
            if other.kind == "score":
                total -= 0.5 * (z**2 + math.log(2 * math.pi))
                continue
            width = other.high - other.low
            beyond = np.maximum(0.0, np.maximum(other.low - z, z - other.high))
            total -= 0.5 * (SOFT * beyond / width) ** 2 + math.log(width)
            if other.kind == "time":  # flat in the time itself
                total += z - other.high
        return total

    def start(self, seed: int) -> Float[np.ndarray, "draw free"]:
        """Return stratified draws: one or two in each cell of ln R and bearing.

        Other numbers are spread evenly.
        """
        rng = np.random.default_rng(seed)
        cells = RINGS * BEARINGS
        count = cells * (2 if self.size > 2 else 1)
        if not self.places:
            count = 64 * 2 ** min(self.size, 3)
        more = max(len(self.places) - 1, 0)
        q = spread_points(count, 2 * more + len(self.others), rng.random())
        u = np.empty((count, self.size))
        if self.places:
            cell = np.arange(count) % cells
            length = (cell // BEARINGS + rng.random(count)) / RINGS * self.most
            angle = (cell % BEARINGS + rng.random(count)) / BEARINGS * 2 * math.pi
            u[:, :2] = _polar(length, angle)
        for k in range(more):
            length, angle = q[:, 2 * k] * self.most, q[:, 2 * k + 1] * 2 * math.pi
            u[:, 2 * k + 2 : 2 * k + 4] = _polar(length, angle)
        for j, other in enumerate(self.others):
            share = q[:, 2 * more + j]
            u[:, 2 * len(self.places) + j] = (
                other.low + (other.high - other.low) * share
            )
        return u

    def log_start(
        self, u: Float[np.ndarray, "draw free"]
    ) -> Float[np.ndarray, " draw"]:
        """Return ln of the density of `start`."""
        total = np.zeros(len(u))
        for k in range(len(self.places)):
            length = np.maximum(np.hypot(u[:, 2 * k], u[:, 2 * k + 1]), 1e-12)
            inside = total - np.log(2 * math.pi * self.most * length)
            total = np.where(length < self.most, inside, -np.inf)
        for z, other in zip(u.T[2 * len(self.places) :], self.others, strict=True):
            inside = total - math.log(other.high - other.low)
            total = np.where((z > other.low) & (z < other.high), inside, -np.inf)
        return total

    def ring(self, u: Float[np.ndarray, "draw free"], place: int = 0) -> np.ndarray:
        """Return the ring of each draw; 0 without a free place."""
        if not self.places:
            return np.zeros(len(u), int)
        length = np.hypot(u[:, 2 * place], u[:, 2 * place + 1])
        return np.minimum((length / self.most * RINGS).astype(int), RINGS - 1)

    def prior_sds(self) -> Float[np.ndarray, " name"]:
        """Return the prior's standard deviation of the coordinate of each number.

        NaN for a free place and for linear numbers.
        """
        found = np.full(len(self.names), np.nan)
        for other in self.others:
            width = (other.high - other.low) / math.sqrt(12)
            found[other.at] = 1.0 if other.kind == "score" else width
        return found

    def longest_steps(self) -> Float[np.ndarray, " free"]:
        """Return the longest step of a climb in each coordinate."""
        of_kind = {"height": 0.5, "axis": 1.5, "score": 10.0}
        others = [of_kind.get(other.kind, 3.0) for other in self.others]
        return np.array([1.5] * 2 * len(self.places) + others)

    def information(self) -> Float[np.ndarray, "free free"]:
        """Return an information that keeps the steps of a climb finite."""
        others = [
            1.0 if other.kind == "score" else 4 / (other.high - other.low) ** 2 + 0.02
            for other in self.others
        ]
        return np.diag([0.25] * 2 * len(self.places) + others)


def _polar(length, angle):
    return np.stack([length * np.sin(angle), length * np.cos(angle)], axis=1)


def log_student(
    u: Float[np.ndarray, "draw free"],
    mean: Float[np.ndarray, " free"],
    root: Float[np.ndarray, "free free"],
    freedom: float,
) -> Float[np.ndarray, " draw"]:
    """Return ln of the density of a multivariate Student-t."""
    size = u.shape[1]
    away = np.linalg.solve(root, (u - mean).T)
    tail = 0.5 * (freedom + size)
    return (
        gammaln(tail)
        - gammaln(freedom / 2)
        - 0.5 * size * math.log(freedom * math.pi)
        - np.log(np.abs(np.diag(root))).sum()
        - tail * np.log1p((away**2).sum(0) / freedom)
    )
