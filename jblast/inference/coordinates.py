r"""Coordinates of the unknown numbers, in which their prior is proper and weak.

- A free place: $v = \mathrm{asinh}(R/a)\,(\sin b, \cos b)$, with range $R$ and bearing
  $b$ from the middle of the sensors. The prior is flat in area within $a$ and flat in
  $\ln R$ beyond, to `FAR` widths of the array and at least ten times as far as sound
  travels between the first and the last reading of a clock.
- A free height: $\mathrm{asinh}((z - z_0)/(R + a))$ about the height of the sensors.
- A free mass: flat in ln from a milligram to 50 Mt.
- An origin time that is not linear: ln of the time before the first timed row.
- Other free numbers: flat within six of their typical spreads (`parameters.Spread`).
- A number with a prior: its normal score.

Numbers that all rows depend on linearly have no coordinate; they are integrated out
(`likelihood`).
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import gammaln
from scipy.stats import norm, qmc

from jblast.scene.uncertain import Belief

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
RINGS, BEARINGS = 10, 24
"""Cells of the stratified start in ln R and bearing."""

Kind = Literal["score", "flat", "height", "time"]


class Other(NamedTuple):
    """A number with a coordinate of its own.

    Attributes:
        index: Its place among the names.
        kind: Its coordinate.
        low: Smallest coordinate; of a score that of the start.
        high: Largest coordinate.
    """

    index: int
    kind: Kind
    low: float
    high: float


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
        up: Their mean height [m].
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
    up: float
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
            if label and self.names[other.index].endswith(label)
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
        reach: float | np.ndarray = self.radius
        for k, pair in enumerate(self.places):
            reach, _, found[:, pair] = self.at_place(u, k)
        for z, other in zip(u.T[2 * len(self.places) :], self.others, strict=True):
            i = other.index
            if other.kind == "time":
                found[:, i] = self.first - np.exp(z)
            elif other.kind == "height":
                found[:, i] = self.up + (reach + self.radius) * np.sinh(z)
            else:
                found[:, i] = np.asarray(self.beliefs[i].constrain(z))
        return found

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
                total += norm.logpdf(z)
                continue
            width = other.high - other.low
            beyond = np.maximum(0.0, np.maximum(other.low - z, z - other.high))
            total -= 0.5 * (SOFT * beyond / width) ** 2 + math.log(width)
            if other.kind == "time":  # flat in the time itself
                total += z - other.high
        return total

    def start(self, seed: int) -> Float[np.ndarray, "draw free"]:
        """Return stratified draws: one or two in each cell of ln R and bearing.

        Other numbers follow a Sobol' sequence.
        """
        rng = np.random.default_rng(seed)
        cells = RINGS * BEARINGS
        count = cells * (2 if self.size > 2 else 1)
        if not self.places:
            count = 64 * 2 ** min(self.size, 3)
        more = max(len(self.places) - 1, 0)
        wide = max(2 * more + len(self.others), 1)
        q = qmc.Sobol(wide, seed=seed).random_base2((count - 1).bit_length())[:count]
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

    def longest_steps(self) -> Float[np.ndarray, " free"]:
        """Return the longest step of a climb in each coordinate."""
        of_kind = {"height": 0.5}
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
