r"""Range and bearing of a charge beside an array, the range followed outwards.

Arrival times at an array that is small beside the distance determine the bearing by
their differences, and the range by the curvature of the front alone, which vanishes
with distance. So the posterior of the place is a sector, often without an end, and no
normal about the mode describes it. Here ln of the density, integrated over bearing and
all other numbers by Laplace's method at each range, is followed along the range:

$$L(\ln R) = \ln p(\hat y(R) \mid R) - \tfrac12 \ln\det I_y + 2 \ln R,$$

with the information $I_y$ of bearing and other numbers $y$, and $R^2$ for a prior that
is flat over the plane. Where $L$ does not fall far out, the range is not identified:
the bearing is the answer.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.mode.laplace import density_and_slope
from jblast.inference.mode.starts import layout_size, typical_step
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.posterior import Posterior
from jblast.parameter_table import CHARGE_POSITION
from jblast.quantities import ARRIVALS
from jblast.scene import Free

STEP = math.log(1.5)
"""Between ranges, in ln: the density of a range known to 20 % has several of them."""
FARTHEST = 300.0
"""Ranges are followed to this many times that of the mode or the width of the array,
whichever is more: of a front from there the curvature is 1/300 of that observed."""
FALLEN = 3.0
"""A density that has fallen by this much in ln, to 5 %, has come to an end."""
BEYOND = 6.0
"""It is followed no further once it has fallen by this much."""
WIDEST_STEP = 10.0
"""Numbers of which the data determine little move by so many typical steps at most."""
TOLD = 0.5
"""A bearing with a larger standard deviation is not determined [rad], as for the
direction of a front (`detect.array.direction`)."""
ROUNDS = 12
"""Newton steps at each range, from the place found at the last one."""
GAIN = 1e-3
"""A step that gains less than this in ln of the density is the last."""


class RangeProfile(NamedTuple):
    """Places along the range, the nearest first.

    Attributes:
        range_m: Distance from the middle of the sensors, over the ground [m].
        log_density: Per unit of ln range, flat over the plane; see the module.
        bearing: Of the charge from the middle of the sensors, clockwise [rad].
        bearing_sd: Its standard deviation at each range [rad].
        z: The most probable place of each range.
        spread: Root of the covariance of the coordinates at each range, one column for
            the bearing and for each other number.
    """

    range_m: Float[np.ndarray, " range"]
    log_density: Float[np.ndarray, " range"]
    bearing: Float[np.ndarray, " range"]
    bearing_sd: Float[np.ndarray, " range"]
    z: Float[np.ndarray, "range free"]
    spread: Float[np.ndarray, "range free column"]

    @property
    def has_bearing(self) -> bool:
        """Whether the bearing is determined at the most probable range."""
        return bool(self.bearing_sd[self.likeliest()] < TOLD)

    @property
    def is_open(self) -> bool:
        """Whether the density has not come to an end at the largest range."""
        return bool(self.log_density[-1] > self.log_density.max() - FALLEN)

    def least_range(self, share: float = 0.05) -> float:
        """Return the quantile of the range for a curvature that is flat a priori [m].

        The times are linear in the curvature $1/R$, so a density without an end in $R$
        has a proper one in $1/R$.
        """
        ln = np.log(self.range_m)
        weight = np.exp(self.log_density - 3 * ln - (self.log_density - 3 * ln).max())
        below = np.concatenate([[0], np.cumsum((weight[1:] + weight[:-1]) / 2)])
        return float(np.exp(np.interp(share * below[-1], below, ln)))

    def likeliest(self) -> int:
        """Return the most probable range for a curvature that is flat a priori."""
        return int(np.argmax(self.log_density - 3 * np.log(self.range_m)))

    def draws(
        self, count: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "draw free"]:
        """Draw coordinates, the range by its density and the others about it."""
        ln = np.log(self.range_m)
        fine = np.linspace(ln[0], ln[-1], 1 + 50 * (len(ln) - 1))
        density = np.interp(fine, ln, self.log_density)
        weight = np.exp(density - density.max())
        drawn = rng.choice(fine, count, p=weight / weight.sum())
        drawn += (rng.random(count) - 0.5) * (fine[1] - fine[0])
        middle = np.stack([np.interp(drawn, ln, x) for x in self.z.T], axis=1)
        near = np.argmin(np.abs(drawn[:, None] - ln[None, :]), axis=1)
        noise = rng.standard_normal((count, self.spread.shape[2]))
        # the bearing's part of a place grows with the range
        moved = np.einsum("dfc,dc->df", self.spread[near], noise)
        return middle + moved


def range_profile(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> RangeProfile | None:
    """Follow the range of a charge outwards and inwards from a place.

    Returns:
        The profile; None where there are several charges or quantities other than
        arrivals, the place is not free over the plane, or the charge is nearer than the
        width of the layout.

    Args:
        posterior: The posterior.
        z: Its mode.
    """
    parameters, layout = posterior.parameters, posterior.layout
    scene = parameters.scene
    if len(scene.charges) > 1 or scene.charge.range_m is not None:
        return None
    if not set(layout.quantity) <= {*ARRIVALS}:
        return None
    at = [
        parameters.names.index(name) if name in parameters.names else -1
        for name in CHARGE_POSITION[:2]
    ]
    if min(at) < 0 or not all(isinstance(parameters.beliefs[i], Free) for i in at):
        return None
    placed = ~(np.asarray(layout.slant_range) > 0)
    position = np.unique(np.asarray(layout.position)[placed][:, :2], axis=0)
    if len(position) < 2:
        return None
    middle = position.mean(axis=0)
    width = float(np.linalg.norm(position[:, None] - position[None], axis=-1).max())
    here = float(np.linalg.norm(z[at] - middle))
    if here < width:
        return None
    walker = _Walker(posterior, np.array(at), middle)
    outward = walker.walked(z, here, STEP, FARTHEST * max(here, width))
    inward = walker.walked(z, here, -STEP, width)
    rows = [*inward[:0:-1], *outward]
    return RangeProfile(*map(np.array, zip(*rows, strict=True)))


class _Walker:
    """Finds the most probable place of each range."""

    def __init__(self, posterior, at, middle) -> None:
        self.posterior, self.at, self.middle = posterior, at, middle
        self.least = 1 / (WIDEST_STEP * np.asarray(typical_step(posterior))) ** 2
        self.others = np.delete(np.arange(len(self.least)), at)
        self.size = float(layout_size(posterior))
        names = list(posterior.parameters.names)
        self.time = names.index("origin_time_s") if "origin_time_s" in names else -1

    def walked(self, z, here: float, step: float, last: float) -> list[tuple]:
        """Return range, density, bearing, its sd and the place, range by range."""
        rows, top = [], -np.inf
        for k in range(1 + math.ceil(abs(math.log(last / here) / step))):
            z, *row, spread = self._climbed(
                self._at_range(z, here * math.exp(k * step))
            )
            rows.append((here * math.exp(k * step), *row, z, spread))
            top = max(top, row[0])
            if not row[0] > top - BEYOND:
                break
        return rows

    def _at_range(self, z, distance: float):
        """Move a place to a range; the origin time follows the travel times."""
        away = z[self.at] - self.middle
        moved = np.array(z)
        moved[self.at] = self.middle + away * distance / np.linalg.norm(away)
        if self.time >= 0:
            left = self.posterior.misfit(jnp.asarray(moved)).residual
            moved[self.time] += float(np.mean(np.asarray(left)))
        return moved

    def _climbed(self, z):
        """Climb at a fixed range by Newton steps with the expected information."""
        value, slope = self._density(z)
        for _ in range(ROUNDS):
            known, basis = self._known(z)
            step = np.linalg.solve(known, basis.T @ slope)
            if not 0.5 * step @ known @ step > GAIN:
                break
            for part in 0.5 ** np.arange(8):
                tried = self._moved(z, part * step)
                found, tried_slope = self._density(tried)
                if found > value:
                    z, value, slope = tried, found, tried_slope
                    break
            else:
                break
        known, basis = self._known(z)
        away = z[self.at] - self.middle
        distance = float(np.linalg.norm(away))
        density = value - 0.5 * np.linalg.slogdet(known)[1] + 2 * math.log(distance)
        bearing = math.atan2(away[0], away[1]) % (2 * math.pi)
        covariance = np.linalg.inv(known)
        spread = basis @ np.linalg.cholesky(covariance)
        return z, float(density), bearing, math.sqrt(covariance[0, 0]), spread

    def _density(self, z):
        value, slope = density_and_slope(self.posterior, jnp.asarray(z))
        return float(value), np.asarray(slope)

    def _known(self, z):
        """Return the information of bearing and other numbers, and their directions."""
        east, north = z[self.at] - self.middle
        basis = np.zeros((len(z), 1 + len(self.others)))
        basis[self.at, 0] = north, -east  # per radian, clockwise
        basis[self.others, 1 + np.arange(len(self.others))] = 1.0
        least = np.append(math.pi**-2, self.least[self.others])
        if self.time >= 0:  # a typical step is that of the layout, not of the range
            far = max(1.0, math.hypot(east, north) / self.size)
            least[1 + np.flatnonzero(self.others == self.time)] /= far**2
        matrix = np.asarray(information(self.posterior, jnp.asarray(z)))
        return basis.T @ matrix @ basis + np.diag(least), basis

    def _moved(self, z, step):
        """Turn the place about the sensors, and move the other numbers."""
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
