"""Failure modes of fits and of MCMC, for `calibration.stability` and `.charts`.

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
from jaxtyping import Array, Float

from calibration.stability import Mode, boundary_at, crossing, verified
from jblast.inference import (
    ManyFits,
    Posterior,
    Solution,
    fit_many,
    posterior_of,
    solve,
)
from jblast.inference.fitting.goodness_of_fit import suspected_outliers
from jblast.inference.identify import AMBIGUITY
from jblast.inference.mcmc import Convergence, convergence
from jblast.inference.posterior.parameters import NORMAL_Q95
from jblast.inference.sample import NEAR
from jblast.observations import Observations
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_laws, with_values
from jblast.sensors import simulate
from jblast.sensors.simulated_readings import Noise

OUTLIER_SD = 20
"""Outlier size in the table [sd]: 2 ms, a clear straggler but no gross error."""
SIZES = np.arange(0.0, 2 * OUTLIER_SD + 1)
"""Outlier sizes [sd]: up to twice the size in the table, to see the error grow."""
FITS = 400
"""Fits in one call, always as many, so that one program serves them all."""
LM = "Levenberg-Marquardt"
MIRRORED = (30.0, 10.0, 20.0)
"""Mass [kg], east and north [m] of the charge next to a line of sensors: its mirror
image, 40 m away, is a separate optimum, not a ridge."""
WU_HAO = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
WU_HAO_NULL = (1.0, -0.2, -0.02)
"""Exponents of the mass in 0.91 R^1.03 Q^-0.02 / c_s and 0.34 R^1.4 Q^-0.2 / c_a."""
SPEEDS = {
    "charge_mass_kg": 15.0,
    "air_sound_speed_m_s": 340.0,
    "ground_p_speed_m_s": 5660.0,
}
SOLVE_LOGS = 5
"""Logs for `solve`, which fits one at a time and is far slower than `fit_many`."""
MISFIT_LIMIT = 0.5 * 0.1**2
"""Loss of log-likelihood of a normal posterior at 0.1 sd from its mode."""
SOLVERS = {
    "Gauss-Newton": optx.GaussNewton,
    "BFGS": optx.BFGS,
    LM: optx.LevenbergMarquardt,
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
SEPARATED_SD, MINOR_SHARE = 12.0, 1 / 3
"""Separation of two normals [sd], which hardly any walker crosses; the second's weight,
unequal so that walkers that stay where they started have a visibly wrong share."""
TWO_MODE_STEPS, MIRROR_STEPS, SHORT_CHAIN, LONG_CHAIN = 1000, 2500, 500, 4000
"""Steps of the walks. The first satisfies emcee's condition of 50 autocorrelation
times, the second every check of convergence."""
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
    known = solved_log(ring(), 30.0, 10.0, -5.0)
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
    solver = {**SOLVERS, "Dogleg": optx.Dogleg}[name](tolerance, tolerance)

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
def costs(posterior: Posterior, measured, z):
    """Return minus ln likelihood of each log at its point, up to a constant."""
    return jax.vmap(lambda m, z: _half_square(z, (posterior, m)))(measured, z)


def stock_solutions(solution: Solution, starts: np.ndarray) -> np.ndarray:
    """Fit one log from many starts; return the successful fits of least cost."""
    posterior = rows_of(solution)
    measured = np.tile(np.asarray(posterior.measured), (len(starts), 1))
    fits = stock_fits(LM, posterior, measured, starts)
    cost = np.asarray(costs(posterior, jnp.asarray(measured), jnp.asarray(fits.z)))
    # 1e-6 in cost is 1e-3 sd: the rest that the tolerance of the solver leaves
    return fits.z[fits.successful & (cost - np.nanmin(cost) < 1e-6)]


def fit_failures() -> list[Mode]:
    """Measure every failure mode of a fit."""
    return [*_poor_starts(), _collinear(), _one_place(), _outlier(), _null_direction()]


def _poor_starts() -> list[Mode]:
    logs = draw()
    best = best_known(logs)
    readings = jnp.asarray(logs.readings)

    def missed(z) -> np.ndarray:
        cost, least = (
            np.asarray(costs(logs.blank, readings[: len(z)], jnp.asarray(at)))
            for at in (z, best[: len(z)])
        )
        return ~(cost - least <= MISFIT_LIMIT)  # negated: a cost of NaN is a miss

    def solved(row: int) -> np.ndarray:
        log = replace(logs.log, value=logs.readings[row])
        return solve(log, logs.uncertain, noise="gaussian").answer.z

    own, poor = ours(logs), ours(logs, logs.starts)
    own_missed, poor_missed = missed(own.z), missed(poor.z)
    alone = np.array([solved(row) for row in range(SOLVE_LOGS)])
    silent = int((poor_missed & ~np.asarray(poor.doubtful)).sum())
    message = (
        f"own starts, float64: fit_many misses {own_missed.sum()} of these optima, "
        f"solve {missed(alone).sum()} of {SOLVE_LOGS}. From the "
        f"poor starts fit_many misses {poor_missed.sum()}, and marks all but {silent} "
        "doubtful"
    )
    distance = np.linalg.norm((logs.starts - logs.truth)[:, 1:], axis=1)
    modes = []
    for precision in TOLERANCE:
        for name in SOLVERS:
            fits = stock_fits(name, logs.blank, logs.readings, logs.starts, precision)
            wrong = missed(fits.z)
            modes.append(
                Mode(
                    "fits",
                    f"{name}, {precision}",
                    "poor start",
                    float(wrong.sum()),
                    f"of {FITS}",
                    f"{wrong.sum()} of {FITS} fits miss the optimum, and "
                    f"{(wrong & fits.successful).sum()} of these report success; the "
                    f"nearest from a start {distance[wrong].min():.0f} m off",
                    verified("falls back", not (own_missed.any() or silent), name),
                    message,
                )
            )
    return modes


def _collinear() -> Mode:
    def excess(bent: float) -> float:
        """Return the excess of -2 ln density at the mirror image of the charge."""
        found = solved_log(line(bent), *MIRRORED).solution
        modes = found.draws.modes
        north = np.array([found.density.best(u)[2] for u in modes.u])
        other = modes.log_density[np.sign(north) != np.sign(north[0])]
        # a mode farther below the best is not kept
        fall = modes.log_density[0] - other.max(initial=-np.inf)
        return 2 * min(float(fall), NEAR)

    # at the limit of jblast's own search for ambiguities; 1 % is enough for the table
    boundary = crossing(lambda bent: excess(bent) - AMBIGUITY, 0.0, 5.0, to=0.01)
    at, resolved = (
        solved_log(line(bent), *MIRRORED).solution for bent in (0.0, 2 * boundary)
    )
    fits = stock_solutions(at, poor_starts())
    wrong, north = int(np.sum(fits[:, 2] < 0)), abs(float(at.answer.z[2]))
    named = len(at.identified.other_modes) == 1 and resolved.identified.is_identifiable
    return Mode(
        "fits",
        f"{LM}, sensors in a line",
        "the mirror image of the charge explains the arrivals as well",
        boundary,
        "m that one sensor stands off the line",
        f"of {len(fits)} fits at the least cost, all reporting success, {wrong} end "
        f"{north:.0f} m south and {len(fits) - wrong} {north:.0f} m north",
        verified("marks", named, "sensors in a line"),
        "the mirror image is reported as an ambiguity, with data to add; exit code 4",
    )


def _one_place() -> Mode:
    def at_positions(count: int) -> Solution:
        places = tuple(ring()[i % count] for i in range(SENSORS))
        return solved_log(places, 30.0, 10.0, -5.0).solution

    needed = next(
        count
        for count in range(1, SENSORS + 1)
        if at_positions(count).identified.is_identifiable
    )
    one = at_positions(1)
    fits = stock_solutions(one, poor_starts())
    mass, null = np.exp(fits[:, 0]), one.identified.null
    valued = [x.identified for x in one.identified.estimates.values()]
    apart = np.linalg.norm(fits[:, None, 1:] - fits[None, :, 1:], axis=-1).max()
    return Mode(
        "fits",
        f"{LM}, one sensor",
        "mass and position from arrivals at fewer positions",
        float(needed),
        "positions",
        f"eight arrivals at one position: {len(fits)} of {FITS} fits report success at "
        f"the same cost, with {mass.min():.2g} to {mass.max():.2g} kg up to "
        f"{apart:.0f} m apart",
        verified("marks", len(null) == 2 and not any(valued), "one sensor"),
        f"{len(null)} null directions are reported; no value and no interval for any "
        "of the three; exit code 4",
    )


def _outlier() -> Mode:
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    posterior, z = rows_of(clean.solution), clean.solution.answer.z
    # the nearest sensor, whose reading constrains the fit most
    outlier = SIGMA * (np.arange(SENSORS) == 0)
    fine = np.linspace(0.0, 2 * OUTLIER_SD, FITS)
    normal = fit_many(
        clean.uncertain,
        posterior.layout,
        clean.log.value + fine[:, None] * outlier,
        np.asarray(posterior.sigma),
        LAWS,
        noise="gaussian",
        starts=np.tile(z, (FITS, 1)),
    )
    mass, sd = np.asarray(normal.z)[:, 0], float(normal.sd()[0, 0])
    moved = np.abs(mass - mass[0]) / sd
    boundary = boundary_at(NORMAL_Q95, moved, fine, "least squares, an outlier")
    student, suspected = np.empty(SIZES.size), np.empty(SIZES.size, bool)
    for i, size in enumerate(SIZES):
        log = replace(clean.log, value=clean.log.value + size * outlier)
        answer = solve(log, clean.uncertain).answer
        student[i] = answer.z[0]
        suspects = suspected_outliers(log, answer.residual, answer.density.noise)
        suspected[i] = any(o.sensor == log.sensor[0] for o in suspects)
    shift = np.abs(student - student[0]) / sd
    # the size from which every larger one is suspected
    first = SIZES[min(np.flatnonzero(~suspected)[-1] + 1, SIZES.size - 1)]
    worst = int(np.argmax(shift))
    return Mode(
        "fits",
        "least squares, normal errors",
        "one outlier of eight readings moves the mass out of its 90 % interval",
        boundary,
        "sd of the reading",
        f"an outlier of {OUTLIER_SD} sd moves ln mass by "
        f"{np.interp(OUTLIER_SD, fine, moved):.1f} of its sd",
        verified("marks", bool(first <= OUTLIER_SD), "an outlier"),
        f"Student-t errors: moved by {shift[SIZES == OUTLIER_SD][0]:.2f} sd at "
        f"{OUTLIER_SD}, at most by {shift[worst]:.2f} (by an outlier of "
        f"{SIZES[worst]:.0f}); reported as a suspected outlier from {first:.0f} sd on",
    )


@functools.cache
def wu_hao_solution() -> Solution:
    """Solve arrivals by Wu and Hao's laws with the mass and both speeds unknown."""
    positions = ((20.0, 0.0), (0.0, 30.0), (-50.0, 0.0))
    known = scene_with(positions, SPEEDS, WU_HAO)
    log = simulate(known, 1, noise="gaussian")
    return solve(log, freed(known, list(SPEEDS)), noise="gaussian")


def _null_direction() -> Mode:
    found = wu_hao_solution()
    rng = np.random.default_rng(0)
    # starts from 0.1 to 1,000 kg, and speeds of air and rock far beyond plausible ones
    low, high = np.log([[0.1, 200.0, 3000.0], [1000.0, 600.0, 8000.0]])
    fits = stock_solutions(found, rng.uniform(low, high, (FITS, 3)))
    values = np.exp(fits[np.argsort(fits[:, 0])])
    least, most = values[0], values[-1]
    (null,) = found.identified.null
    along = ", ".join(f"{weight:.3g}" for weight in null)
    named = bool(np.allclose(null, WU_HAO_NULL, atol=1e-6))
    return Mode(
        "fits",
        f"{LM}, Wu-Hao, mass and both speeds",
        "a null direction: reported masses differ by this factor",
        float(most[0] / least[0]),
        "",
        f"{len(fits)} of {FITS} fits report success at the same cost, from "
        f"({least[0]:.2g} kg, {least[1]:.0f} m/s) to ({most[0]:.3g} kg, {most[1]:.0f} "
        "m/s)",
        verified("marks", named, "a null direction"),
        f"the null direction ({along}) in ln is reported, and the identified products; "
        "no value for any of the three; exit code 4",
    )


def walk_failures() -> list[Mode]:
    """Measure every failure mode of MCMC."""
    return [_shares(), _mirror(), _null_walk(), _endless()]


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


def two_normals(w: Float[Array, " free"]) -> Float[Array, ""]:
    """Return ln of the density of unit normals apart, the second of half the weight."""
    other = jnp.log(0.5) - 0.5 * (w[0] - SEPARATED_SD) ** 2
    return jnp.logaddexp(-0.5 * w[0] ** 2, other) - 0.5 * jnp.sum(w[1:] ** 2)


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


def _shares() -> Mode:
    start = unit_normals()
    start[::2, 0] += SEPARATED_SD
    walk = bare_walk(two_normals, start, TWO_MODE_STEPS)
    share, tau = np.mean(walk.kept[..., 0] > SEPARATED_SD / 2), walk.judged.tau.max()
    seen = not walk.judged.reached(1.0) and tau > TWO_MODE_STEPS / 50
    return Mode(
        "walks",
        "emcee, own autocorrelation time",
        "from both modes, the shares stay as started",
        TWO_MODE_STEPS / walk.own_tau,
        f"autocorrelation times claimed in {TWO_MODE_STEPS} steps",
        f"{SEPARATED_SD:g} sd apart, a mode of weight {MINOR_SHARE:.0%} keeps "
        f"{share:.0%}; emcee's autocorrelation time is {walk.own_tau:.0f} steps, and "
        "its condition of 50 of them is satisfied",
        verified("marks", bool(seen), "shares"),
        f"deviations from the mean of all walkers: {tau:.0f} steps, so the same walk "
        "counts as not converged",
    )


def _mirror() -> Mode:
    found = solved_log(line(), *MIRRORED).solution
    density, root = about(found)
    walk = bare_walk(density, unit_normals(), MIRROR_STEPS)
    best = found.answer.z[2]
    north = best + walk.chain @ root[2]
    beyond = int((np.sign(north) != np.sign(best)).any(axis=0).sum())
    draws = found.draws
    share = float(draws.weights @ (np.sign(draws.values[:, 2]) == np.sign(best)))
    return Mode(
        "walks",
        "emcee, stretch move",
        "walkers that never reach the mirror image",
        float(WALKERS - beyond),
        f"of {WALKERS}",
        f"{MIRROR_STEPS} steps from the best optimum: {beyond} of {WALKERS} walkers "
        f"reach it, and the chain looks converged: R-hat "
        f"{walk.judged.r_hat.max():.3f}, {MIRROR_STEPS / walk.own_tau:.0f} "
        "autocorrelation times",
        verified("marks", 0.3 < share < 0.7, "a mirror image"),
        f"weighted draws contain both optima, with shares of {share:.0%} and "
        f"{1 - share:.0%}",
    )


def _null_walk() -> Mode:
    found = wu_hao_solution()
    z, likelihood = jnp.asarray(found.answer.z), bare_likelihood(found)
    walk = bare_walk(lambda w: likelihood(z + w), 0.1 * unit_normals(), LONG_CHAIN)
    mass = found.answer.z[0] + walk.kept[..., 0]
    estimates = found.identified.estimates.values()
    named = len(found.identified.null) == 1 and not any(x.identified for x in estimates)
    tau = float(walk.judged.tau.max())
    return Mode(
        "walks",
        "emcee, Wu-Hao, mass and both speeds",
        "a null direction without a prior has no width",
        LONG_CHAIN / tau,
        f"autocorrelation times in {LONG_CHAIN} steps",
        f"ln mass covers {mass.min():.0f} to {mass.max():.0f}, the range of float64; "
        f"autocorrelation time {tau:.0f}, R-hat {walk.judged.r_hat.max():.3f}: it "
        "looks converged",
        verified("marks", named, "a null direction"),
        "the null direction is reported, and no value for any of the three; exit code "
        "4",
    )


def _endless() -> Mode:
    # seen from 300 m, the sensors subtend 4 degrees
    found = solved_log(circle(10.0), 30.0, 300.0, 0.0).solution
    density, root = about(found)
    walks = [bare_walk(density, unit_normals(), n) for n in (SHORT_CHAIN, LONG_CHAIN)]
    low = [
        np.quantile(np.exp(found.answer.z[0] + walk.kept @ root[0]), 0.05)
        for walk in walks
    ]
    mass = found.identified.estimates["charge_mass_kg"]
    words = f"no value of the mass; it is below {mass.q95:.3g} kg"
    if mass.identified:
        words = "not converged (exit code 4)"
    marked = not mass.identified or not found.converged
    return Mode(
        "walks",
        "emcee, arrivals from afar",
        "an endless ridge: all smaller masses arrive at the speed of sound",
        LONG_CHAIN / float(walks[-1].judged.tau.max()),
        f"autocorrelation times in {LONG_CHAIN} steps",
        f"the 5 % quantile of the mass is {low[0]:.2g} kg after {SHORT_CHAIN} steps, "
        f"{low[1]:.2g} kg after {LONG_CHAIN}: it depends on the length of the walk, "
        "not on the log",
        verified("marks", marked, "an endless ridge"),
        words,
    )
