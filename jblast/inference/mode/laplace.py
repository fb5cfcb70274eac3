"""The posterior as a normal about its optimum, in the fitted coordinates.

Its covariance is the inverse of the expected (Fisher) information, not of the curvature
at the optimum: where readings lie close to the law by luck, Student-t errors curve more
there than they do on average, and intervals come out too narrow. Five microphones, four
unknowns, 400 simulated logs (`calibration/coverage.py`): 90 % intervals of the place
held the truth in 82 and 83 % by curvature, in 87 and 88 % by expected information.
Where the density does not fall along an axis as that information predicts, its width
is measured on the density. An axis that only leaves a curved ridge keeps its width if
the density falls as predicted along the crest.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.posterior.fisher_information import (
    NULL,
    information,
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.parameters import Estimate, Parameters
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.scene import parameter_named

NORMAL_Q95 = 1.6448536269514722
"""95 % quantile of the standard normal."""
FALLS = (0.1, 2.5)
"""Limits of the fall in ln-density one standard deviation away. A normal falls by 0.5;
between the limits its width is right within a factor of 2.2."""
CLIMBS = 10
"""Gauss-Newton steps back onto the crest of a curved ridge."""
DECREMENT = 1e-4
"""Converged: one more Newton step would gain less than this in ln-density."""


@dataclass(frozen=True)
class Laplace:
    """Normal approximation of a posterior.

    Attributes:
        z: Mean: the optimum.
        covariance: Covariance; zero along null directions, which it does not describe.
        decrement: Expected gain in ln-density of one more Newton step.
        peak: True if the density falls in every direction.
    """

    z: Float[np.ndarray, " free"]
    covariance: Float[np.ndarray, "free free"]
    decrement: float
    peak: bool

    @property
    def converged(self) -> bool:
        """True if the mean is an optimum."""
        return self.peak and self.decrement < DECREMENT

    def draws(
        self, count: int, rng: np.random.Generator
    ) -> Float[np.ndarray, "draw free"]:
        """Draw coordinates."""
        values, vectors = np.linalg.eigh(self.covariance)
        # rounding of a zero eigenvalue (a null direction) may be negative
        root = vectors * np.sqrt(np.clip(values, 0, None))
        return self.z + rng.standard_normal((count, self.z.size)) @ root.T


class Climbed(NamedTuple):
    """End of a climb.

    Attributes:
        z: Coordinates.
        log_density: ln of the density at z.
        promised: Expected gain in ln of the density of one more step.
    """

    z: Float[np.ndarray, " free"]
    log_density: float
    promised: float


def laplace(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    basis: Float[np.ndarray, "free identified"],
) -> Laplace:
    """Approximate a posterior about its optimum.

    Args:
        posterior: The posterior.
        z: Its optimum.
        basis: Basis of the identified directions, one column each.
    """
    curvature = basis.T @ np.asarray(information(posterior, jnp.asarray(z))) @ basis
    # along the axes of the information, which are independent: each width can be
    # checked by itself
    values, vectors = np.linalg.eigh(curvature)
    top, slope = _top(posterior, z)
    axes = basis @ vectors / np.sqrt(np.maximum(values, NULL))
    low, high = FALLS
    peak = True
    for k, axis in enumerate(axes.T):  # in place: each becomes one sd long
        fall = _fall(posterior, z, axis, top)
        # the density falls too fast along a straight step off a curved crest
        if not fall < high and len(axes.T) > 1:
            others = np.delete(axes, k, axis=1)
            fall = _fall_of_crest(posterior, z, axis, others, top)
        if not low < fall < high:
            axis *= half_width(posterior, z, axis, top)
            fall = _fall(posterior, z, axis, top)
        # where the density does not fall at all, the place is a saddle
        peak &= bool(fall > low)
    return Laplace(z, axes @ axes.T, float(0.5 * np.sum((slope @ axes) ** 2)), peak)


def _top(posterior, z):
    value, slope = density_and_slope(posterior, jax.device_put(z))
    return float(value), np.asarray(slope)


def _fall(posterior, z, axis, top) -> float:
    """Fall of ln-density one step away, on the side where it falls less."""
    # the slopes are not used, but their program is loaded: another would be compiled
    ends = (_top(posterior, z + sign * axis)[0] for sign in (-1, 1))
    return min(top - end for end in ends)


def _fall_of_crest(posterior, z, axis, others, top) -> float:
    """Fall of ln-density one step away along a curved ridge.

    The other coordinates are adjusted until the readings have changed as they would on
    a straight ridge.
    """
    ends = []
    for step in (-axis, axis):
        there = z + step
        # Gauss-Newton: the other axes are one standard deviation long, so their matrix
        # is nearly a unit matrix
        for _ in range(CLIMBS):
            slope = np.asarray(_bend(posterior, jnp.asarray(z), there, step))
            there = there - others @ (others.T @ slope)
        ends.append(float(posterior.log_density(jnp.asarray(there))))
    return min(top - end for end in ends)


@kept
def _bend(posterior: Posterior, z, there, step):
    """Return the gradient of half the squared nonlinear change of the readings."""
    here, moved = posterior.misfit(z), posterior.misfit(there)
    data = whitened_rows(posterior, here, (here.residual - moved.residual)[:, None])[
        :, 0
    ]
    data = jnp.concatenate([data, posterior.parameters.has_prior() * (there - z)])
    jacobian = whitened_jacobian(posterior, z)
    return jacobian.T @ (data - jacobian @ step)


def half_width(posterior, z, axis, top) -> float:
    """Number of steps at which ln-density has fallen by 0.5: one sd of a normal.

    The expected information is misleading along an axis where slopes vanish by symmetry
    alone: the height of a charge among sensors at its own height, or its position
    across a line of sensors.
    """
    # ten steps a decade: the width is right within 26 %
    steps = np.geomspace(1e-6, 1e6, 121)

    def has_fallen(at: int) -> bool:
        return not _fall(posterior, z, steps[at] * axis, top) < 0.5

    at = len(steps) // 2  # a factor of 1; searched from there in either direction
    if has_fallen(at):
        while at > 0 and has_fallen(at - 1):
            at -= 1
    else:
        while at < len(steps) - 1 and not has_fallen(at):
            at += 1
    return steps[at]


def climbed(
    posterior: Posterior,
    z: Float[np.ndarray, " free"],
    known_at: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    moved: Callable[[np.ndarray, np.ndarray], np.ndarray],
    *,
    rounds: int,
    gain: float,
    belief: Callable[[np.ndarray], tuple[float, np.ndarray]] | None = None,
) -> Climbed:
    """Climb by Newton steps with the expected information, halved until they gain.

    Args:
        posterior: The posterior.
        z: Starting point.
        known_at: Function that returns the information along some directions (positive
            definite), and the directions, one column each.
        moved: Function that moves a place by a step along these directions.
        rounds: Largest number of steps.
        gain: A step that gains less than this in ln of the density is the last.
        belief: Function that returns a term of ln of the density, and its gradient.
    """

    def top(z):
        value, slope = _top(posterior, z)
        if belief is None:
            return value, slope
        more, its_slope = belief(z)
        return value + more, slope + its_slope

    value, slope = top(z)
    promised = math.inf
    for _ in range(rounds):
        known, directions = known_at(z)
        if not (np.isfinite(known).all() and np.isfinite(slope).all()):
            break
        step = np.linalg.solve(known, directions.T @ slope)
        # expected gain of a full step on a quadratic
        promised = float(0.5 * step @ known @ step)
        if not promised > gain:
            break
        # 1/128 of a step that does not gain is rounding, or the end of the density
        for part in 0.5 ** np.arange(8):
            there = moved(z, part * step)
            found, its_slope = top(there)
            if found > value:
                break
        else:
            promised = 0.0  # no step gains: it is rounding
            break
        gained, z, value, slope = found - value, there, found, its_slope
        if gained < gain:
            promised = gained
            break
    return Climbed(z, value, promised)


@kept
def density_and_slope(posterior: Posterior, z):
    """Return ln of the density per unit of z, and its gradient."""
    return jax.value_and_grad(posterior.log_density)(z)


def marginals(parameters: Parameters, normal: Laplace) -> dict[str, Estimate]:
    """Return the marginal estimate of each number.

    Value and median are those at the mean of its coordinate.
    """
    # 40 Gauss-Hermite nodes reach 11 sd: the standard deviation of a lognormal number
    # is exact to rounding up to an sd of 3 in ln
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    weights = weights / weights.sum()
    sds = np.sqrt(np.diag(normal.covariance))
    steps = np.concatenate([[-NORMAL_Q95, 0.0, NORMAL_Q95], nodes])
    at = parameters.values_of_each(jax.device_put(normal.z + steps[:, None] * sds))
    values = {name: np.asarray(at[name]) for name in parameters.names}
    return {
        name: Estimate(
            value=float(value[1]),
            sd=_sd(value[3:], weights),
            log_sd=_log_sd(value[3:], weights)
            if parameter_named(name).positive
            else math.nan,
            q05=float(value[0]),
            q50=float(value[1]),
            q95=float(value[2]),
        )
        for name, value in values.items()
    }


def _sd(values, weights) -> float:
    with np.errstate(over="ignore", invalid="ignore"):  # e.g. a mass nothing bounds
        return float(np.sqrt(weights @ np.square(values - weights @ values)))


def _log_sd(values, weights) -> float:
    """Standard deviation of ln over the nodes at which the number is positive.

    A normal prior reaches below zero at the outer nodes.
    """
    positive = values > 0
    return _sd(np.log(values[positive]), weights[positive] / weights[positive].sum())
