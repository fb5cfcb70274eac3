r"""Cases for samplers: five microphones, and rare events of known probability.

Five microphones about a charge have few readings more than free parameters: mass,
position in the plane and time, without a prior, with exact or scattering laws. A normal
approximation is least accurate there.

The pressure of known probability has uncertain mass, range and scatter. Peak pressure
falls with the scaled distance $Z = R\,W^{-1/3}$ alone, and $\ln Z$ is normal where
$\ln R$ and $\ln W$ are. So the probability of a pressure above a threshold is that of
$Z$ below a root, averaged over the scatter of the law by Gauss-Hermite quadrature,
without random draws.

The rare regions are in standard normal coordinates. Half-spaces along different
coordinates are independent, a shell is a tail of the chi-squared distribution, and an
edge $u_1 = e(q)$, with $q$ the sum of squares of the other coordinates, is one integral
over that distribution.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import quad
from scipy.optimize import root_scalar
from scipy.special import ndtr
from scipy.stats import chi2, ncx2, norm

from jblast.fidelity.timing import best_of
from jblast.inference import Posterior
from jblast.inference.mcmc.engines import BLOCK, Engine, WalkState, mixture_of
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.whitening import Density, densities
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale
from jblast.study.rare import Margin
from jblast.waves import kingery_bulmash_pressure

UNEQUAL = (4.0, 4.3, 4.7, 5.0)
"""Distances of the unequal half-spaces [sd]: the last is a hundred times rarer."""
# Half as many agree to 1e-9.
NODES = 120
"""Nodes of the quadrature."""
POSITIONS = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100))
"""East and north of each microphone [m]."""
RECORDS = (("air_arrival_s", 1e-4), ("peak_overpressure_pa", 0.02))
"""Quantities of each microphone, with their standard errors [s], [-]."""
TRUTH = {
    "charge_mass_kg": 30.0,
    "charge_east_m": 10.0,
    "charge_north_m": -5.0,
    "origin_time_s": 1.5,
}
LAWS = {quantity: "shock_kinematics" for quantity, _ in RECORDS}
# Any number: the log is fixed by it.
SEED = 11
# Many walkers cost little in one compiled scan.
WALKERS = 256
SHARES = (0.05, 0.95)
"""Quantiles at the bounds of the 90 % interval."""
# Walks start from the normal approximation, so that a tenth is ample.
WARM_UP = 10
"""Divisor of the length of a walk that gives its warm-up."""


@dataclass(frozen=True)
class RareRegion:
    """An event and its probability.

    Attributes:
        name: Kind of the event.
        margin: Function that is positive in the event.
        dimensions: Number of random variables.
        probability: Exact probability.
    """

    name: str
    margin: Margin
    dimensions: int
    probability: float


def tail(distance: float) -> float:
    """Return the probability of a half-space at a distance from the origin."""
    return float(ndtr(-distance))


def any_of(*probabilities: float) -> float:
    """Return the probability that one of several independent events happens."""
    return float(1.0 - np.prod(1.0 - np.asarray(probabilities)))


def shell(dimensions: int, probability: float) -> RareRegion:
    """Return the event that the distance from the origin exceeds a radius.

    Args:
        dimensions: Number of random variables.
        probability: Probability of the event, which determines the radius.
    """
    radius = float(np.sqrt(chi2.isf(probability, dimensions)))
    return RareRegion(
        "shell",
        lambda u: jnp.linalg.norm(u) - radius,
        dimensions,
        probability,
    )


def curved(name: str, dimensions: int, distance: float, bend: float) -> RareRegion:
    """Return the event $u_1 > d + b q$, wrapped about the origin if b is negative."""

    def density(length: float) -> float:
        # of the length of the other coordinates, so that it is finite at 0
        q = length**2
        beyond = ndtr(-(distance + bend * q))
        return float(beyond * 2.0 * length * chi2.pdf(q, dimensions - 1))

    return RareRegion(
        name,
        lambda u: u[0] - distance - bend * jnp.sum(u[1:] ** 2),
        dimensions,
        # beyond a length of 12 the probability is below 1e-26 in 3 to 8 dimensions
        float(quad(density, 1e-12, 12.0, epsabs=0.0, epsrel=1e-9, limit=200)[0]),
    )


def island() -> RareRegion:
    """Return a half-space and a ball whose slope is negligible at the origin."""
    centre, radius = jnp.array([0.0, -4.3, 0.0, 0.0, 0.0]), np.sqrt(2.0 * np.log(5 / 3))

    def margin(u: Float[Array, "5"]) -> Float[Array, ""]:
        hill = 5.0 * jnp.exp(-0.5 * jnp.sum((u - centre) ** 2)) - 3.0
        return jnp.maximum(u[0] - 4.0, hill)

    # the ball, of radius 1, does not touch the half-space: the probabilities add up
    ball = float(ncx2.cdf(radius**2, 5, 4.3**2))
    return RareRegion("half-space, island", margin, 5, tail(4.0) + ball)


def rare_regions() -> list[RareRegion]:
    """Return all rare events."""
    # the third coordinate is free, so the probability is an integral over the second
    rough = quad(
        lambda x: ndtr(-4.2 + 0.02 * np.sin(20.0 * x)) * norm.pdf(x),
        -9.0,
        9.0,
        epsabs=0.0,
        epsrel=1e-9,
        limit=2000,
    )[0]
    return [
        RareRegion("half-space", lambda u: u[0] - 4.5, 3, tail(4.5)),
        RareRegion("half-space", lambda u: u[0] - 4.5, 20, tail(4.5)),
        RareRegion(
            "2 equal half-spaces", lambda u: jnp.abs(u[0]) - 4.5, 2, 2 * tail(4.5)
        ),
        RareRegion(
            "8 equal half-spaces",
            lambda u: jnp.max(jnp.abs(u)) - 4.5,
            4,
            any_of(*[2 * tail(4.5)] * 4),
        ),
        RareRegion(
            "8 equal half-spaces",
            lambda u: jnp.max(u) - 4.5,
            8,
            any_of(*[tail(4.5)] * 8),
        ),
        RareRegion(
            "16 equal half-spaces",
            lambda u: jnp.max(jnp.abs(u)) - 4.5,
            8,
            any_of(*[2 * tail(4.5)] * 8),
        ),
        RareRegion(
            "4 unequal half-spaces",
            lambda u: jnp.max(u - jnp.array(UNEQUAL)),
            4,
            any_of(*map(tail, UNEQUAL)),
        ),
        RareRegion(
            "2 scales of margin",
            lambda u: jnp.maximum(u[0] - 4.2, 0.01 * (u[1] - 4.0)),
            2,
            any_of(tail(4.2), tail(4.0)),
        ),
        island(),
        shell(2, 1e-5),
        shell(8, 1e-6),
        RareRegion(
            "cylinder",
            lambda u: jnp.linalg.norm(u[:2]) - 5.0,
            3,
            float(chi2.sf(25.0, 2)),
        ),
        curved("curved away", 3, 4.0, 0.2),
        curved("curved towards", 3, 4.5, -0.08),
        curved("wrapped", 3, 4.0, -0.2),
        curved("wrapped", 8, 4.0, -0.2),
        RareRegion(
            "corner", lambda u: jnp.minimum(u[0], u[1]) - 2.0, 2, tail(2.0) ** 2
        ),
        RareRegion(
            "rough",
            lambda u: u[0] - 4.2 + 0.02 * jnp.sin(20.0 * u[1]),
            3,
            float(rough),
        ),
        RareRegion(
            "flat, common", lambda u: jnp.where(u[0] > 2.0, 1.0, -1.0), 2, tail(2.0)
        ),
        RareRegion(
            "flat, rare", lambda u: jnp.where(u[0] > 4.0, 1.0, -1.0), 2, tail(4.0)
        ),
    ]


class RarePressure(NamedTuple):
    """Distribution of mass and range, and a pressure threshold.

    Attributes:
        mass_kg: Median of the charge mass [kg].
        mass_factor: Standard deviation of the mass, as a factor.
        range_m: Median of the range [m].
        range_factor: Standard deviation of the range, as a factor.
        scatter: Standard deviation of ln pressure about the law.
        threshold_pa: Pressure that is rarely exceeded [Pa].
    """

    mass_kg: float = 15.0
    mass_factor: float = 1.5
    range_m: float = 40.0
    range_factor: float = 1.05
    scatter: float = 0.1
    threshold_pa: float = 22e3


CASE = RarePressure()


def pressure(u: Float[Array, "3"], case: RarePressure = CASE) -> Float[Array, ""]:
    """Return the peak pressure of a sample in standard normal coordinates [Pa]."""
    law = kingery_bulmash_pressure(
        case.range_m * case.range_factor ** u[1],
        case.mass_kg * case.mass_factor ** u[0],
    )
    return law * jnp.exp(case.scatter * u[2])


def margin(u: Float[Array, "3"]) -> Float[Array, ""]:
    """Return ln of the pressure over its threshold."""
    return jnp.log(pressure(u) / CASE.threshold_pa)


def probability_above(threshold_pa: float, case: RarePressure = CASE) -> float:
    """Return the probability of a pressure above a threshold, by quadrature."""
    log_pressure = jax.jit(
        lambda log_z: jnp.log(kingery_bulmash_pressure(jnp.exp(log_z), 1.0))
    )
    middle, sd = _log_z(case)
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    total = 0.0
    for node, weight in zip(nodes, weights / weights.sum(), strict=True):
        # At a given scatter the pressure falls with Z, and ln Z is normal.
        target = np.log(threshold_pa) - case.scatter * node
        root = root_scalar(
            lambda z, target=target: float(log_pressure(jnp.asarray(z))) - target,
            bracket=(np.log(0.2), np.log(1e4)),
            xtol=1e-12,
        ).root
        total += weight * ndtr((root - middle) / sd)
    return float(total)


def mean_pressure(case: RarePressure = CASE) -> float:
    """Return the mean pressure, by quadrature [Pa]."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    middle, sd = _log_z(case)
    values = kingery_bulmash_pressure(jnp.exp(middle + sd * nodes), jnp.ones(NODES))
    mean = float(np.asarray(values) @ weights / weights.sum())
    # The mean of the log-normal scatter.
    return mean * float(np.exp(0.5 * case.scatter**2))


def _log_z(case: RarePressure) -> tuple[float, float]:
    """Return mean and standard deviation of ln of the scaled distance."""
    middle = np.log(case.range_m) - np.log(case.mass_kg) / 3
    spread = np.hypot(np.log(case.range_factor), np.log(case.mass_factor) / 3)
    return float(middle), float(spread)


def scene_with(
    *, scatter: bool, positions: Sequence[tuple[float, float]] = POSITIONS
) -> Scene:
    """Return a scene of microphones about a charge.

    Args:
        scatter: True for scattering laws, False for exact ones.
        positions: East and north of each microphone [m].
    """
    sensors = tuple(
        Sensor(f"m{i}", jnp.array([*position, 1.5]), records=RECORDS)
        for i, position in enumerate(positions)
    )
    empty = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors)
    return with_values(empty, TRUTH)


def one_posterior() -> Posterior:
    """Return the posterior of one simulated log, with exact laws."""
    scene = scene_with(scatter=False)
    layout, sigma, _ = planned_layout(scene)
    read = observe(jax.random.key(SEED), scene, layout, LAWS, sigma)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    measured = to_error_scale(read, layout.quantity)
    return Posterior(parameters, layout, measured, sigma, tuple(LAWS.items()))


def timed_walk(
    sampler: Engine,
    density: Density,
    free: int,
    steps: int,
    seed: int = 0,
    repeats: int = 1,
) -> tuple[Float[np.ndarray, "step walker free"], float]:
    """Walk from samples of a unit normal.

    Args:
        sampler: The sampler.
        density: Log density in whitened coordinates.
        free: Number of free parameters.
        steps: Number of steps.
        seed: Seed of the start and of the moves.
        repeats: Number of timed repetitions.

    Returns:
        The chain without its warm-up, and the least time of the compiled walk [s].
    """
    w = np.random.default_rng(seed).standard_normal((WALKERS, free))
    value = np.array(densities(density, jnp.asarray(w)))
    start = WalkState(w, value, sampler.first_random(seed))
    about = mixture_of(np.zeros((1, free)), np.eye(free)[None], np.ones(1))

    def walk(steps: int) -> Float[np.ndarray, "step walker free"]:
        return sampler.walk(density, about, start, steps, lambda: None).chain

    # one block compiles the sampler, at a fraction of the time of the whole walk
    seconds, chain = best_of(lambda: walk(steps), repeats, lambda: walk(BLOCK))
    return chain[steps // WARM_UP :], seconds


def interval_ends(
    draws: Float[np.ndarray, "... free"],
) -> Float[np.ndarray, "2 free"]:
    """Return the bounds of the 90 % interval of each parameter, shape (2, free)."""
    return np.quantile(draws.reshape(-1, draws.shape[-1]), SHARES, axis=0)
