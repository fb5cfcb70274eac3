"""Lanes of a batch, and the results of fits of many logs.

A lane is one log of a batch. Lanes are gathered and scattered, so that a part of a
batch can be fitted again. A result is doubtful where the fit did not converge or its
cost is more than `COST_Z_MAX` standard deviations above the mean that the errors imply.
"""

from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.many.residuals import LaneRows
from jblast.parameters import CHARGE_POSITION
from jblast.sensors import Layout
from jblast.sensors.simulated_readings import Noise

MIN_LANES = 16
"""Batches with fewer lanes are padded to this number: fewer sizes are compiled."""
Tree = TypeVar("Tree")
COST = {"gaussian": (0.5, 0.70711), "student": (0.70093, 0.98290)}
"""Mean and standard deviation of the cost of one reading: for Student-t of nu degrees
of freedom, with a = (nu + 1)/2, a (psi(a) - psi(nu/2)) and a sqrt(psi'(nu/2) -
psi'(a)), since 1/(1 + t^2/nu) is a beta variable."""
COST_Z_MAX = 6.0
"""Excess of the cost over its mean, in standard deviations, above which a result is
doubtful: a correct log hardly ever exceeds it."""


def lanes_where(wanted: Bool[Array, " lane"]) -> Int[np.ndarray, " some"]:
    """Return indices of lanes, padded by the last to a power of two.

    Few sizes are then compiled.
    """
    lanes = np.flatnonzero(np.asarray(wanted))
    if lanes.size == 0:
        return lanes
    size = max(MIN_LANES, 1 << (lanes.size - 1).bit_length())
    return np.pad(lanes, (0, size - lanes.size), mode="edge")


@jax.jit
def gather_lanes(tree: Tree, lanes) -> Tree:
    """Return some lanes of arrays whose last axis is the lane."""
    return jax.tree.map(lambda x: x[..., lanes], tree)


@jax.jit
def scatter_lanes(onto: Tree, new: Tree, lanes) -> Tree:
    """Replace some lanes of arrays."""
    return jax.tree.map(lambda a, b: a.at[..., lanes].set(b), onto, new)


class LaneResults(NamedTuple):
    """The result of each lane; see `ManyFits`. The lane is the last axis.

    Attributes:
        done: True for lanes that have ended; False for stragglers.
    """

    y: Float[Array, "unknown lane"]
    cost: Float[Array, " lane"]
    misfit: Float[Array, " lane"]
    covariance: Float[Array, "free free lane"]
    converged: Bool[Array, " lane"]
    tolerance: Float[Array, " lane"]
    steps: Int[Array, " lane"]
    done: Bool[Array, " lane"]


def doubtful(
    noise: Noise,
    rows: int,
    results: LaneResults,
    bad: Bool[Array, " lane"],
    most_z: float | Float[Array, ""] = COST_Z_MAX,
) -> Bool[Array, " lane"]:
    """Return True for results that may not be the best optimum.

    Args:
        noise: Distribution of the errors.
        rows: Number of readings of a log.
        results: Results of the logs.
        bad: True for logs that could not be read.
        most_z: Largest excess of a cost over its mean, in standard deviations.
    """
    mean, sd = COST[noise]
    # the sum of independent costs is nearly normal for logs of several rows
    likely = results.misfit <= rows * mean + most_z * sd * np.sqrt(rows)
    return ~(bad | (results.converged & likely))


@jax.jit
def better(a: LaneResults, b: LaneResults) -> LaneResults:
    """Return the lower cost of each lane; of equal costs, the one that converged."""
    lower = ~(a.cost <= b.cost) & jnp.isfinite(b.cost)
    # the tolerance is four times the rounding error of the residuals' length
    # (`solver.square_tolerance`)
    rounding = 0.25 * jnp.maximum(a.tolerance, b.tolerance)
    slack = rounding * (jnp.sqrt(2 * jnp.abs(a.cost)) + rounding)
    level = (jnp.abs(a.cost - b.cost) <= slack) & (a.converged != b.converged)
    taken = jnp.where(level, b.converged, lower)
    return jax.tree.map(lambda x, y: jnp.where(taken, y, x), a, b)


def fitted_values(rows: LaneRows, results: LaneResults, bad: Bool[Array, " lane"]):
    """Return z, covariance, numbers by name, cost and misfit, NaN for bad logs."""
    parameters = rows.parameters
    z = results.y[: len(parameters.names)]
    z = jnp.where(bad[None, :], jnp.nan, z)
    beliefs = zip(parameters.names, parameters.beliefs, strict=True)
    numbers = {name: b.constrain(z[k]) for k, (name, b) in enumerate(beliefs)}
    covariance = jnp.where(bad[None, None, :], jnp.nan, results.covariance)
    costs = (jnp.where(bad, jnp.nan, c) for c in (results.cost, results.misfit))
    return z.T, jnp.moveaxis(covariance, 2, 0), numbers, *costs


def beyond_array(
    layout: Layout, numbers: dict[str, Float[Array, " log"]], bad: Bool[Array, " log"]
) -> Bool[Array, " log"]:
    """Return True for positions farther from the sensors than their extent.

    Args:
        layout: Layout of the sensors.
        numbers: Fitted numbers by name; without a position the result is False.
        bad: True for logs that could not be read.
    """
    position = layout.places()[:, :2]
    if not {*CHARGE_POSITION[:2]} <= {*numbers} or len(position) < 2:
        return jnp.zeros_like(bad)
    middle = position.mean(axis=0)
    width = np.linalg.norm(position[:, None] - position[None], axis=-1).max()
    east, north = (numbers[name] for name in CHARGE_POSITION[:2])
    return jnp.hypot(east - middle[0], north - middle[1]) > width


class ManyFits(eqx.Module):
    """Fits of many logs, each of its own blast.

    Attributes:
        names: Names of the free numbers.
        z: Optimum in fitted coordinates: ln of a free positive number; a number with a
            prior relative to its median, in its standard deviations (of ln, for a
            log-normal). NaN for a bad log.
        values: The numbers by name.
        cost: Minus ln of the joint density at the optimum, up to a constant.
        misfit: Contribution of readings and priors to the cost, 0 for a perfect log.
        covariance: Covariance of the coordinates by Fisher information; NaN where that
            is singular.
        converged: True if $z$ is an optimum: the gradient, in standard deviations, is
            at most `tolerance`, and the cost curves upwards in every direction. There
            may be a better optimum.
        doubtful: True if $z$ may not be the best optimum after all tries: it did not
            converge, or its misfit is improbable.
        beyond_array: True if the position is farther from the middle of the sensors
            than their extent. The scatter of neighbouring paths is taken as independent
            here: such a position is too near and its covariance too small. Use `fit`.
        tolerance: Largest gradient of an optimum; larger where rounding is larger.
        steps: Number of places tried.
        bad: True for a log that could not be read.
        faults: Fault of each of the first bad logs, by number.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    z: Float[Array, "log free"]
    values: dict[str, Float[Array, " log"]]
    cost: Float[Array, " log"]
    misfit: Float[Array, " log"]
    covariance: Float[Array, "log free free"]
    converged: Bool[Array, " log"]
    doubtful: Bool[Array, " log"]
    beyond_array: Bool[Array, " log"]
    tolerance: Float[Array, " log"]
    steps: Int[Array, " log"]
    bad: Bool[Array, " log"]
    faults: tuple[tuple[int, str], ...] = eqx.field(static=True)

    def sd(self) -> Float[Array, "log free"]:
        """Return the standard deviation of each coordinate."""
        return jnp.sqrt(jnp.diagonal(self.covariance, axis1=1, axis2=2))
