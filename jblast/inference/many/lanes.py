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
"""Batches with fewer elements are padded to this number."""
Tree = TypeVar("Tree")
COST = {"gaussian": (0.5, 0.70711), "student": (0.70093, 0.98290)}
"""Mean and standard deviation of the cost of one reading: for Student-t of nu degrees
of freedom, with a = (nu + 1)/2, a (psi(a) - psi(nu/2)) and a sqrt(psi'(nu/2) -
psi'(a)), since 1/(1 + t^2/nu) is a beta variable."""
COST_Z_MAX = 6.0
"""A cost above its mean by more standard deviations makes a result doubtful."""


def lanes_where(wanted: Bool[Array, " lane"]) -> Int[np.ndarray, " some"]:
    """Return which lanes; the last again, so that few sizes are ever compiled."""
    lanes = np.flatnonzero(np.asarray(wanted))
    if lanes.size == 0:
        return lanes
    size = max(MIN_LANES, 1 << (lanes.size - 1).bit_length())
    return np.pad(lanes, (0, size - lanes.size), mode="edge")


@jax.jit
def gather_lanes(tree: Tree, lanes) -> Tree:
    """Pick lanes of arrays whose last axis is the lane."""
    return jax.tree.map(lambda x: x[..., lanes], tree)


@jax.jit
def scatter_lanes(onto: Tree, new: Tree, lanes) -> Tree:
    """Put lanes in their places."""
    return jax.tree.map(lambda a, b: a.at[..., lanes].set(b), onto, new)


class LaneResults(NamedTuple):
    """The result of each lane; see `ManyFits`. The lane is the last axis.

    Attributes:
        done: Whether a lane has ended at all, and was not left on its way.
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
    """Return which results may not be the best there are.

    Args:
        noise: Of the readings.
        rows: How many readings a log has.
        results: Of the logs.
        bad: Which could not be read.
        most_z: By how many standard deviations a cost may be above its mean.
    """
    mean, sd = COST[noise]
    likely = results.misfit <= rows * mean + most_z * sd * np.sqrt(rows)
    return ~(bad | (results.converged & likely))


@jax.jit
def better(a: LaneResults, b: LaneResults) -> LaneResults:
    """Take the lower cost of each lane; of two as low, the one that converged."""
    lower = ~(a.cost <= b.cost) & jnp.isfinite(b.cost)
    # a quarter of a tolerance is the most that rounding adds to the residuals' length
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
    """Return which places lie farther from the sensors than these are apart.

    Args:
        layout: Where the sensors stand.
        numbers: What was fitted, by name; False for all logs without a fitted place.
        bad: Logs that could not be read.
    """
    position = layout.places()[:, :2]
    if not {*CHARGE_POSITION[:2]} <= {*numbers} or len(position) < 2:
        return jnp.zeros_like(bad)
    middle = position.mean(axis=0)
    width = np.linalg.norm(position[:, None] - position[None], axis=-1).max()
    east, north = (numbers[name] for name in CHARGE_POSITION[:2])
    return jnp.hypot(east - middle[0], north - middle[1]) > width


class ManyFits(eqx.Module):
    """What many logs say, each of its own blast.

    Attributes:
        names: The free numbers.
        z: Where the optimum is, in fitted coordinates: ln of a free positive number;
            what has a prior counts from its median, in its standard deviations (of ln,
            for a log-normal). NaN for a bad log.
        values: The numbers by name.
        cost: Minus ln of the joint density at the optimum, up to a constant.
        misfit: What of it the readings and priors add, 0 for a perfect log.
        covariance: Of the coordinates, by Fisher information; NaN where that is
            singular.
        converged: Whether $z$ is an optimum: the gradient, in standard deviations, is
            down to `tolerance`, and the cost curves upwards on every side. It does not
            say that it is the best one.
        doubtful: Whether $z$ may not be the best there is, all tries used up: it did
            not converge, or has a misfit that readings would hardly have.
        beyond_array: Whether the place lies farther from the middle of the sensors than
            they are apart. The scatter of neighbouring paths is taken as independent
            here: such a place is too near and its covariance too small. Take `fit`.
        tolerance: How long a gradient counts as none; larger where rounding hides more.
        steps: Places tried.
        bad: Whether a log could not be read.
        faults: What is wrong with each of the first bad logs, by number.
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
