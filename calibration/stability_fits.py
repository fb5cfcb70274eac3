"""Logs, fits by other solvers and bare walks, for `stability` and `charts`.

Each log has eight arrival times with a standard error of 0.1 ms. The surface charge (5
to 200 kg, within 20 m of the centre of the sensors) differs between logs; its mass and
position are unknown. All logs have the same rows, so one compiled program serves all.
Poor starts are drawn from 1 to 1,000 kg and from a square of 200 m. A fit has missed
the optimum if its likelihood is lower than a shift of one parameter by 0.1 standard
deviations from the best known optimum would make it.

Gauss-Newton, BFGS and Levenberg-Marquardt are the solvers of optimistix without further
checks. Their success is the one that the solver itself reports.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array

from jblast.inference import (
    ManyFits,
    Posterior,
    Solution,
    fit_many,
    posterior_of,
    solve,
)
from jblast.inference.mcmc import Convergence, convergence
from jblast.observations import Observations
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_laws, with_values
from jblast.sensors import simulate
from jblast.sensors.simulated_readings import Noise

FITS = 400
"""Fits in one call, always as many, so that one program serves them all."""
LM = "Levenberg-Marquardt"
KNOWN = (30.0, 10.0, -5.0)
"""Mass [kg], east and north [m] of the charge of the log that is the template."""
WU_HAO = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
SPEEDS = {
    "charge_mass_kg": 15.0,
    "air_sound_speed_m_s": 340.0,
    "ground_p_speed_m_s": 5660.0,
}
MISFIT_LIMIT = 0.5 * 0.1**2
"""Loss of log-likelihood of a normal posterior at 0.1 sd from its mode."""
SOLVERS = {
    "Gauss-Newton": optx.GaussNewton,
    "BFGS": optx.BFGS,
    LM: optx.LevenbergMarquardt,
    "Dogleg": optx.Dogleg,
}
TOLERANCE = {"float64": 1e-8, "float32": 1e-4}
"""Relative and absolute tolerance: about the square root of each machine epsilon."""
SENSORS = 8
"""Five more than the unknowns: one outlier stands out against the other readings."""
SIGMA = 1e-4
"""Standard error of an arrival, between the best recorder and a plain one [s]."""
LAWS = {"air_arrival_s": "shock_kinematics"}
START = {"charge_mass_kg": 1.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
"""Free parameters, with their values before the fit."""
WALKERS, DIMENSION = 64, 3
Positions = tuple[tuple[float, float], ...]
"""East and north of each sensor [m]."""


class SolvedLog(NamedTuple):
    """A log, the scene with its free parameters before the fit, and its solution."""

    log: Observations
    uncertain: UncertainScene
    solution: Solution


class Logs(NamedTuple):
    """Simulated logs of one layout.

    Attributes:
        uncertain: Scene with the free parameters of every log.
        log: Template with the rows of every log.
        blank: Posterior of the template.
        truth: Fitted coordinates of each charge.
        readings: Arrivals [s].
        starts: Poor starts, fitted coordinates.
    """

    uncertain: UncertainScene
    log: Observations
    blank: Posterior
    truth: np.ndarray
    readings: np.ndarray
    starts: np.ndarray


def circle(radius) -> Positions:
    """Return sensor positions about the origin, with one radius or one each [m]."""
    angle = np.arange(SENSORS) * 2 * np.pi / SENSORS
    east, north = radius * np.cos(angle), radius * np.sin(angle)
    return tuple(zip(east.tolist(), north.tolist(), strict=True))


def ring() -> Positions:
    """Return sensor positions on all sides, 60 to 140 m from the origin."""
    return circle(np.array([60.0, 140.0, 80.0, 120.0, 70.0, 130.0, 90.0, 110.0]))


def line(bent: float = 0.0) -> Positions:
    """Return sensor positions 30 m apart; the last one `bent` m off the line."""
    east = (-60.0 + 30.0 * np.arange(SENSORS)).tolist()
    return (*((x, 0.0) for x in east[:-1]), (east[-1], bent))


def scene_with(
    positions: Positions, values: Mapping[str, float], laws: Mapping[str, str]
) -> UncertainScene:
    """Return a scene of sensors on the ground that record the quantities of `laws`."""
    sensors = tuple(
        Sensor(
            f"s{i}",
            jnp.array([*position, 0.0]),
            records=tuple((quantity, SIGMA) for quantity in laws),
        )
        for i, position in enumerate(positions)
    )
    empty = replace(Scene(), scatter=False, sensors=sensors)
    return with_laws(UncertainScene(with_values(empty, values)), laws)


@functools.cache
def solved_log(
    positions: Positions,
    mass: float,
    east: float,
    north: float,
    noise: Noise = "gaussian",
) -> SolvedLog:
    """Simulate a log with normal errors, and solve it.

    Args:
        positions: Sensor positions.
        mass: Mass of the charge [kg].
        east: East coordinate of the charge [m].
        north: North coordinate of the charge [m].
        noise: Error distribution that `solve` assumes.
    """
    truth = dict(zip(START, (mass, east, north), strict=True))
    log = simulate(scene_with(positions, truth, LAWS), 1, noise="gaussian")
    uncertain = freed(scene_with(positions, START, LAWS), list(START))
    return SolvedLog(log, uncertain, solve(log, uncertain, noise=noise))


def draw(count: int = FITS) -> Logs:
    """Simulate logs of `count` charges, with poor starts."""
    rng = np.random.default_rng(0)
    known = solved_log(ring(), *KNOWN)
    blank = rows_of(known.solution)
    # the root makes the density of charges uniform over the disc
    radius, angle = 20 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    mass = rng.uniform(np.log(5), np.log(200), count)
    truth = np.column_stack([mass, radius * np.cos(angle), radius * np.sin(angle)])
    predicted = jax.vmap(lambda z: blank.misfit(z).predicted)(jnp.asarray(truth))
    readings = np.asarray(predicted) + SIGMA * rng.standard_normal(predicted.shape)
    place = rng.uniform(-100, 100, (2, count))
    starts = np.column_stack([rng.uniform(0, np.log(1000), count), *place])
    return Logs(known.uncertain, known.log, blank, truth, readings, starts)


def rows_of(solution: Solution) -> Posterior:
    """Return the readings of a log as a function that JAX differentiates."""
    density = solution.density
    return posterior_of(
        density.parameters,
        density.layout,
        density.observations,
        density.laws,
        density.noise,
    )


def poor_starts() -> np.ndarray:
    """Draw `FITS` starts: 1 to 1,000 kg, in a square of 200 m, shape (FITS, 3)."""
    rng = np.random.default_rng(0)
    mass = rng.uniform(0, np.log(1000), FITS)
    return np.column_stack([mass, *rng.uniform(-100, 100, (2, FITS))])


def ours(logs: Logs, starts: np.ndarray | None = None) -> ManyFits:
    """Fit logs by `fit_many`; without `starts` it chooses its own."""
    sigma = np.asarray(logs.blank.sigma)
    return fit_many(
        logs.uncertain,
        logs.blank.layout,
        logs.readings,
        sigma,
        LAWS,
        noise="gaussian",
        starts=starts,
    )


def best_known(logs: Logs) -> np.ndarray:
    """Return the best known optimum of each log: that of a fit from its truth."""
    return np.asarray(ours(logs, logs.truth).z)


class StockFits(NamedTuple):
    """Fitted coordinates, and True where the solver reports success."""

    z: np.ndarray
    successful: np.ndarray


def stock_fits(
    name: str,
    posterior: Posterior,
    measured: np.ndarray,
    starts: np.ndarray,
    precision: str = "float64",
) -> StockFits:
    """Fit logs of one layout with normal errors by a solver of optimistix.

    Args:
        name: Name of the solver.
        posterior: Layout and laws, without shared effects and priors.
        measured: Readings of each log, in the form of `Posterior.measured`.
        starts: Fitted coordinates, one start for each log.
        precision: "float64" or "float32", for all arrays.
    """
    with jax.enable_x64(precision == "float64"):

        def cast(tree):
            return jax.tree.map(lambda x: jnp.asarray(x, precision), tree)

        fit_each = _batched_solver(name, TOLERANCE[precision])
        z, successful = fit_each(cast(starts), (cast(posterior), cast(measured)))
        return StockFits(np.asarray(z, float), np.asarray(successful))


@functools.cache
def _batched_solver(name: str, tolerance: float):
    """Return a solver for many logs; compiled once for each layout."""
    solver = SOLVERS[name](tolerance, tolerance)

    def fit(start, args):
        # 256 steps are the default of optimistix
        options = {"args": args, "max_steps": 256, "throw": False}
        if isinstance(solver, optx.AbstractLeastSquaresSolver):
            found = optx.least_squares(residuals, solver, start, **options)
        else:
            found = optx.minimise(_half_square, solver, start, **options)
        return found.value, found.result == optx.RESULTS.successful

    return jax.jit(jax.vmap(fit, in_axes=(0, (None, 0))))


def residuals(z, args):
    """Return the residuals of the readings at a point, in standard deviations."""
    posterior, measured = args
    misfit = eqx.tree_at(lambda p: p.measured, posterior, measured).misfit(z)
    return misfit.residual / misfit.sd


def _half_square(z, args):
    return 0.5 * jnp.sum(jnp.square(residuals(z, args)))


@jax.jit
def _costs(posterior: Posterior, measured, z):
    return jax.vmap(lambda m, z: _half_square(z, (posterior, m)))(measured, z)


def costs(logs: Logs, z) -> np.ndarray:
    """Return minus ln likelihood of the first logs at `z`, up to a constant."""
    measured = jnp.asarray(logs.readings[: len(z)])
    return np.array(_costs(logs.blank, measured, jnp.asarray(z)))


def stock_solutions(solution: Solution, starts: np.ndarray) -> np.ndarray:
    """Fit one log from many starts; return the successful fits of least cost."""
    posterior = rows_of(solution)
    measured = np.tile(np.asarray(posterior.measured), (len(starts), 1))
    fits = stock_fits(LM, posterior, measured, starts)
    cost = np.asarray(_costs(posterior, measured, fits.z))
    # 1e-6 in cost is 1e-3 sd: the rest that the tolerance of the solver leaves
    return fits.z[fits.successful & (cost - np.nanmin(cost) < 1e-6)]


@functools.cache
def wu_hao_solution() -> Solution:
    """Solve arrivals by Wu and Hao's laws with the mass and both speeds unknown."""
    positions = ((20.0, 0.0), (0.0, 30.0), (-50.0, 0.0))
    known = scene_with(positions, SPEEDS, WU_HAO)
    log = simulate(known, 1, noise="gaussian")
    return solve(log, freed(known, list(SPEEDS)), noise="gaussian")


class BareWalk(NamedTuple):
    """A walk by emcee's stretch move alone.

    Attributes:
        kept: Steps after the first quarter.
        own_tau: emcee's autocorrelation time of the first coordinate [steps], from
            deviations of each walker from its own mean.
        judged: Convergence by jblast, from deviations from the mean of all walkers.
        chain: Every step.
    """

    kept: np.ndarray
    own_tau: float
    judged: Convergence
    chain: np.ndarray


def bare_walk(
    log_density: Callable[[Array], Array], start: np.ndarray, steps: int
) -> BareWalk:
    """Run emcee's stretch move from the first position of each walker."""
    import emcee

    density = jax.jit(jax.vmap(log_density))
    # vectorised: one call of the compiled density for half of the walkers
    sampler = emcee.EnsembleSampler(
        start.shape[0],
        start.shape[1],
        lambda w: np.asarray(density(jnp.asarray(w)), float),
        vectorize=True,
    )
    random = np.random.RandomState(0).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random), steps)
    chain = np.asarray(sampler.get_chain())
    # tol=0: return the estimate of a short chain too, instead of raising
    own = emcee.autocorr.integrated_time(chain[..., :1], quiet=True, tol=0)
    return BareWalk(chain[steps // 4 :], float(own[0]), convergence(chain), chain)


def unit_normals() -> np.ndarray:
    """Draw walkers from a unit normal."""
    return np.random.default_rng(0).standard_normal((WALKERS, DIMENSION))


def bare_likelihood(solution: Solution) -> Callable[[Array], Array]:
    """Return ln of the likelihood of a log with normal errors, without any prior."""
    posterior = rows_of(solution)

    def log_density(z):
        found = -_half_square(z, (posterior, posterior.measured))
        return jnp.nan_to_num(found, nan=-jnp.inf, neginf=-jnp.inf)  # of an overflow

    return log_density


def about(solution: Solution) -> tuple[Callable[[Array], Array], np.ndarray]:
    """Return the likelihood in standard deviations about an answer, and their axes."""
    z, root = solution.answer.z, np.linalg.cholesky(solution.answer.inverse.covariance)
    likelihood = bare_likelihood(solution)
    return lambda w: likelihood(jnp.asarray(z) + jnp.asarray(root) @ w), root
