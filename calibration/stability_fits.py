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
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from calibration.stability import Mode, boundary_at, crossing, verified
from jblast.errors import InputError
from jblast.inference import ManyFits, Posterior, Solution, ensemble, fit_many, solve
from jblast.inference.fitting.goodness_of_fit import (
    standardised_residuals,
    suspected_outliers,
)
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.fitting.unidentified import AMBIGUITY, other_modes
from jblast.inference.importance import (
    MAX_QUANTILE_ERROR,
    IntervalsOff,
    check_intervals,
)
from jblast.inference.mcmc import Convergence, convergence
from jblast.inference.mode.laplace import NORMAL_Q95
from jblast.inference.mode.search import SAME_OPTIMUM_SD
from jblast.inference.whitening import (
    Density,
    Whitened,
    densities,
    root_of,
    whitened_density,
)
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
MISFIT_LIMIT = 0.5 * SAME_OPTIMUM_SD**2
"""Loss of log-likelihood of a normal posterior at `SAME_OPTIMUM_SD` from its mode."""
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
TWO_MODE_STEPS, MIRROR_STEPS, SHORT_CHAIN, LONG_CHAIN, ENDLESS_STEPS = (
    1000,
    2500,
    500,
    4000,
    1500,
)
"""Steps of the walks. The first satisfies emcee's condition of 50 autocorrelation
times, the second every check of convergence; the last bounds one that cannot."""
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
    blank = known.solution.posterior
    # the root makes the density of charges uniform over the disc
    radius, angle = 20 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    mass = rng.uniform(np.log(5), np.log(200), count)
    truth = np.column_stack([mass, radius * np.cos(angle), radius * np.sin(angle)])
    predicted = jax.vmap(lambda z: blank.misfit(z).predicted)(jnp.asarray(truth))
    readings = np.asarray(predicted) + SIGMA * rng.standard_normal(predicted.shape)
    place = rng.uniform(-100, 100, (2, count))
    starts = np.column_stack([rng.uniform(0, np.log(1000), count), *place])
    return Logs(known.uncertain, known.log, blank, truth, readings, starts)


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
    posterior = solution.posterior
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
            np.asarray(costs(logs.blank, readings, jnp.asarray(at))) for at in (z, best)
        )
        return ~(cost - least <= MISFIT_LIMIT)  # negated: a cost of NaN is a miss

    def solve_misses(row: int) -> bool:
        log = replace(logs.log, value=logs.readings[row])
        found = solve(log, logs.uncertain, noise="gaussian")
        highest = float(found.posterior.log_density(jnp.asarray(best[row])))
        return not highest - float(found.optima.log_density[0]) <= MISFIT_LIMIT

    own, poor = ours(logs), ours(logs, logs.starts)
    own_missed, poor_missed = missed(own.z), missed(poor.z)
    silent = int((poor_missed & ~np.asarray(poor.doubtful)).sum())
    message = (
        f"own starts, float64: fit_many misses {own_missed.sum()} of these optima, "
        f"solve {sum(map(solve_misses, range(SOLVE_LOGS)))} of {SOLVE_LOGS}. From the "
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
        z, density = map(np.asarray, solved_log(line(bent), *MIRRORED).solution.optima)
        other = np.sign(z[:, 2]) != np.sign(z[0, 2])
        return float(2 * (density[0] - density[other].max()))

    # at the limit of jblast's own search for ambiguities; 1 % is enough for the table
    boundary = crossing(lambda bent: excess(bent) - AMBIGUITY, 0.0, 5.0, to=0.01)
    at, resolved = (
        solved_log(line(bent), *MIRRORED).solution for bent in (0.0, 2 * boundary)
    )
    fits = stock_solutions(at, poor_starts())
    wrong, north = int(np.sum(fits[:, 2] < 0)), abs(float(at.laplace.z[2]))
    named = len(other_modes(at, True)) == 1 and not other_modes(resolved, True)
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
        if not len(at_positions(count).identifiability.null)
        and not other_modes(at_positions(count), True)
    )
    one = at_positions(1)
    fits = stock_solutions(one, poor_starts())
    mass, null = np.exp(fits[:, 0]), one.identifiability.null
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
        verified("marks", len(null) == 2, "one sensor"),
        f"{len(null)} null directions are reported; no value and no interval for any "
        "of the three; exit code 4",
    )


def _outlier() -> Mode:
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    posterior, z = clean.solution.posterior, clean.solution.laplace.z
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
        found = solve(log, clean.uncertain)
        student[i] = found.laplace.z[0]
        residual = standardised_residuals(found.posterior, found.laplace.z).residual
        suspects = suspected_outliers(log, residual, found.posterior.noise)
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
    (null,) = found.identifiability.null
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
    return [_shares(), _mirror(), _null_walk(), _endless(), _bent()]


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


def bare_walk(density: Density, start: np.ndarray, steps: int) -> BareWalk:
    """Run emcee's stretch move from the first position of each walker."""
    import emcee

    # vectorised: one call of the compiled density for half of the walkers
    sampler = emcee.EnsembleSampler(
        start.shape[0],
        start.shape[1],
        lambda w: np.asarray(densities(density, jnp.asarray(w)), float),
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


class TwoNormals(eqx.Module):
    """Unit normals apart along the first axis, the second with half the weight."""

    apart: Array

    def log_density(self, w: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the density at a place, up to a constant."""
        other = jnp.log(0.5) - 0.5 * (w[0] - self.apart) ** 2
        return jnp.logaddexp(-0.5 * w[0] ** 2, other) - 0.5 * jnp.sum(w[1:] ** 2)


def _shares() -> Mode:
    start = unit_normals()
    start[::2, 0] += SEPARATED_SD
    walk = bare_walk(TwoNormals(jnp.asarray(SEPARATED_SD)), start, TWO_MODE_STEPS)
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
    normal = found.laplace
    density = whitened_density(found.posterior, normal, found.identifiability)
    walk = bare_walk(density, unit_normals(), MIRROR_STEPS)
    north = normal.z[2] + walk.chain @ np.asarray(density.root)[2]
    beyond = int((np.sign(north) != np.sign(normal.z[2])).any(axis=0).sum())
    both = ensemble(found.posterior, normal, found.identifiability, found.optima)
    share = float(np.mean(np.sign(both.draws()[:, 2]) == np.sign(normal.z[2])))
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
        verified("marks", 0.3 < share < 0.7 and both.converged, "a mirror image"),
        f"walkers start at both optima and keep their shares, {share:.0%} and "
        f"{1 - share:.0%}; autocorrelation time {both.convergence.tau.max():.0f}",
    )


def _null_walk() -> Mode:
    found = wu_hao_solution()
    z = jnp.asarray(found.laplace.z)
    about = Whitened(found.posterior, z, jnp.eye(z.size))
    walk = bare_walk(about, 0.1 * unit_normals(), LONG_CHAIN)
    mass = found.laplace.z[0] + walk.kept[..., 0]
    refused = False
    try:
        ensemble(found.posterior, found.laplace, found.identifiability)
    except InputError as error:
        refused = "improper along charge_mass_kg" in str(error)
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
        verified("refuses", refused, "a null direction"),
        "no walk: improper along charge_mass_kg and the speeds; expected a prior, or a "
        "fixed value",
    )


def _endless() -> Mode:
    # seen from 300 m, the sensors subtend 4 degrees
    found = solved_log(circle(10.0), 30.0, 300.0, 0.0).solution
    density = whitened_density(found.posterior, found.laplace, found.identifiability)
    walks = [bare_walk(density, unit_normals(), n) for n in (SHORT_CHAIN, LONG_CHAIN)]
    row = root_of(found.laplace)[0]
    low = [
        np.quantile(np.exp(found.laplace.z[0] + walk.kept @ row), 0.05)
        for walk in walks
    ]
    both = ensemble(
        found.posterior,
        found.laplace,
        found.identifiability,
        found.optima,
        most_steps=ENDLESS_STEPS,
    )
    return Mode(
        "walks",
        "emcee, arrivals from afar",
        "an endless ridge: all smaller masses arrive at the speed of sound",
        LONG_CHAIN / float(walks[-1].judged.tau.max()),
        f"autocorrelation times in {LONG_CHAIN} steps",
        f"the 5 % quantile of the mass is {low[0]:.2g} kg after {SHORT_CHAIN} steps, "
        f"{low[1]:.2g} kg after {LONG_CHAIN}: it depends on the length of the walk, "
        "not on the log",
        verified("marks", not both.converged, "an endless ridge"),
        "not converged (exit code 4)",
    )


def _bent() -> Mode:
    def near(radius: float) -> Solution:
        return solved_log(circle(radius), 30.0, 60.0, 0.0).solution

    def off(radius: float) -> float:
        return check_intervals(near(radius).posterior, near(radius).laplace).off

    bent = 6.0  # a tenth of the range, well inside the boundary
    boundary = crossing(lambda r: off(r) - MAX_QUANTILE_ERROR, bent, 40.0, to=0.01)
    found = near(bent)
    name = found.posterior.parameters.names[0]
    normal, auto = uncertainty(found, "laplace"), uncertainty(found, "auto")
    intervals = [
        f"{marginal.q05:.3g} to {marginal.q95:.3g} kg"
        for marginal in (normal.marginals[name], auto.marginals[name])
    ]
    warned = any(
        isinstance(f, IntervalsOff) and f.parameter == name and not np.isnan(f.off)
        for f in normal.findings
    )
    walked = auto.method == "emcee" and auto.converged
    return Mode(
        "walks",
        "normal approximation (Laplace)",
        "a curved ridge of mass and range",
        boundary,
        "m radius of eight sensors 60 m away",
        f"bounds of 90 % intervals are off by more than {MAX_QUANTILE_ERROR:g} sd; at "
        f"{bent:g} m by {off(bent):.1f}: the mass is {intervals[0]} instead of "
        f"{intervals[1]}",
        verified("marks", warned and walked, "a curved ridge"),
        "a warning names the bound with the largest error; --posterior auto runs MCMC",
    )
