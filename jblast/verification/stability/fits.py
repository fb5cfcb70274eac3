"""Failure modes of fits and of MCMC: starts, null directions, outliers, modes, ridges.

Each log has eight arrival times with a standard error of 0.1 ms. The surface charge (5
to 200 kg, within 20 m of the centre of the sensors) differs between logs; its mass and
position are unknown. All logs have the same rows, so one compiled program serves all.
Poor starts are drawn from 1 to 1,000 kg and from a square of 200 m. A fit has missed
the optimum if its likelihood is lower than a shift of one parameter by 0.1 standard
deviations from the best known optimum would make it.

Gauss-Newton, BFGS and Levenberg-Marquardt are the solvers of optimistix without further
checks. Their success is the one that the solver itself reports.

With two modes emcee's stretch move misses the second one, or gives it a wrong weight.
The first case has a known truth: two round normals in three dimensions, one of which
has twice the weight of the other. The second is a charge next to a line of sensors and
its mirror image, with half the weight each. Ridges are flat, endless or curved.
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
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference import (
    Ensemble,
    ManyFits,
    Posterior,
    Solution,
    ensemble,
    fit_many,
    solve,
)
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
from jblast.inference.mcmc.convergence import Convergence, convergence
from jblast.inference.mcmc.engines import Mixture, mixture_of
from jblast.inference.mcmc.ensemble import LongRidge
from jblast.inference.mcmc.run import Sampled, Start, sample
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
from jblast.verification.stability.failure import (
    FailureMode,
    boundary_at,
    crossing,
    verified,
)

REPORTED_SD = 20
"""Outlier size in the table [sd]: 2 ms, a clear straggler but no gross error."""
# Up to twice the reported size, so that the growth of the error with it is visible.
SIZES = np.arange(0.0, 2 * REPORTED_SD + 1)
"""Outlier sizes for `solve`, which fits one log at a time [sd]."""
# With 400 logs the standard error of a share is 0.025 at most.
FITS = 400
"""Fits in one call: always the same number, so that one program serves them all."""
FINE_SIZES = np.linspace(0.0, 2 * REPORTED_SD, FITS)
"""Outlier sizes for least squares [sd]."""
OUTLIER_ROW = 0
"""Row of the outlier: the nearest sensor, whose reading constrains the fit most."""
LM = "Levenberg-Marquardt"
# 20 m off the line: the mirror image, 40 m away, is a separate optimum, not a ridge.
MIRRORED = (30.0, 10.0, 20.0)
"""Mass [kg], east and north [m] of the charge next to a line of sensors."""
WU_HAO = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
WU_HAO_NULL = (1.0, -0.2, -0.02)
"""Exponents of the mass in 0.91 R^1.03 Q^-0.02 / c_s and 0.34 R^1.4 Q^-0.2 / c_a."""
# The null direction does not depend on these values.
SPEEDS = {
    "charge_mass_kg": 15.0,
    "air_sound_speed_m_s": 340.0,
    "ground_p_speed_m_s": 5660.0,
}
SOLVE_LOGS = 5
"""Logs for `solve`, which fits one at a time and is far slower than `fit_many`."""
# Loss of log-likelihood of a normal posterior at `SAME_OPTIMUM_SD` from its mode.
MISFIT_LIMIT = 0.5 * SAME_OPTIMUM_SD**2
SOLVERS = {
    "Gauss-Newton": optx.GaussNewton,
    "BFGS": optx.BFGS,
    "Levenberg-Marquardt": optx.LevenbergMarquardt,
}
OTHER_SOLVERS = {"Dogleg": optx.Dogleg}
"""Solvers of the cost chart only; `jblast stability` leaves them out."""
MAX_SOLVER_STEPS = 256
"""Iteration limit of a stock solver: the default of optimistix."""
TOLERANCE = {"float64": 1e-8, "float32": 1e-4}
"""Relative and absolute tolerance: about the square root of each machine epsilon."""
# Five more than the three unknowns: one outlier stands out against the other readings.
SENSORS = 8
# Between the best recorder (1 us) and a plain one (1 ms) of `stability.laws`.
SIGMA = 1e-4
"""Standard error of an arrival [s]."""
LAWS = {"air_arrival_s": "shock_kinematics"}
START = {"charge_mass_kg": 1.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
"""Free parameters, with their values before the fit."""
# Any number: it only fixes the simulated logs.
SEED = 1
Positions = tuple[tuple[float, float], ...]
"""East and north of each sensor [m]."""
# As many as the fits of mass, east and north have.
DIMENSION = 3
# Satisfies emcee's own condition of 50 autocorrelation times, which misses the failure.
TWO_MODE_STEPS = 1000
# The chain passes every convergence check of its own, so only the mode is missing.
MIRROR_STEPS = 2500
# Unequal weights: walkers that stay where they started have a visibly wrong share.
MINOR_SHARE = 1 / 3
"""Weight of the second mode."""
# Hardly any walker crosses this gap; at 4 sd the stretch move finds both shares.
SEPARATED_SD = 12.0
"""Separation of the modes in the table [sd]."""
MODE_SEPARATIONS = (6.0, 8.0, 10.0, SEPARATED_SD)
# A factor of 8, so that a quantile that drifts with the length shows it.
SHORT_CHAIN, LONG_CHAIN = 500, 4000
"""Steps of two walks along the same ridge."""
# Bounds the time of a walk that cannot converge; longer ones report the same.
ENDLESS_STEPS = 1500
# Seen from 300 m, the sensors subtend 4 degrees: arrivals hardly constrain the range.
CIRCLE_RADIUS = 10.0
"""Radius of the circle of sensors of an endless ridge [m]."""
# A tenth of the range of 60 m, well inside the boundary where the normal fails.
BENT_RADIUS = 6.0
"""Radius of the circle of sensors of a curved ridge [m]."""
# Far above twice the dimension, the least that emcee accepts.
WALKERS = 64


class OutlierShifts(NamedTuple):
    """Shift of ln mass caused by one outlier, for a range of outlier sizes.

    Attributes:
        normal: Shift with normal errors, by `FINE_SIZES` [sd without the outlier].
        student: Shift with the Student-t errors of `solve`, by `SIZES`, same unit.
        suspected: True where the reading is a suspected outlier, by `SIZES`.
    """

    normal: Float[np.ndarray, " fine"]
    student: Float[np.ndarray, " size"]
    suspected: Bool[np.ndarray, " size"]


@functools.cache
def outlier_shifts() -> OutlierShifts:
    """Fit the same log with an outlier of growing size."""
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    posterior, z = clean.solution.posterior, clean.solution.laplace.z
    outlier = SIGMA * (np.arange(SENSORS) == OUTLIER_ROW)
    normal = fit_many(
        clean.uncertain,
        posterior.layout,
        clean.log.value + FINE_SIZES[:, None] * outlier,
        np.asarray(posterior.sigma),
        LAWS,
        noise="gaussian",
        starts=np.tile(z, (len(FINE_SIZES), 1)),
    )
    mass = np.asarray(normal.z)[:, 0]
    sd = float(normal.sd()[0, 0])
    student, suspected = np.empty(len(SIZES)), np.empty(len(SIZES), bool)
    for i, size in enumerate(SIZES):
        log = replace(clean.log, value=clean.log.value + size * outlier)
        found = solve(log, clean.uncertain)
        at = found.laplace.z
        residual = standardised_residuals(found.posterior, at).residual
        suspects = suspected_outliers(log, residual, found.posterior.noise)
        student[i] = at[0]
        suspected[i] = any(o.sensor == log.sensor[OUTLIER_ROW] for o in suspects)
    return OutlierShifts((mass - mass[0]) / sd, (student - student[0]) / sd, suspected)


class SolvedLog(NamedTuple):
    """A log with its solution by jblast.

    Attributes:
        log: The arrivals.
        uncertain: Scene with free parameters before the fit.
        solution: Result of `solve`.
    """

    log: Observations
    uncertain: UncertainScene
    solution: Solution


def outlier_failure() -> FailureMode:
    """Measure the outlier size from which the 90 % interval excludes the mass."""
    shifts = outlier_shifts()
    size = np.abs(shifts.normal)
    boundary = boundary_at(NORMAL_Q95, size, FINE_SIZES, "least squares, an outlier")
    # the size from which every larger one is suspected, not the first suspected one
    missed = np.flatnonzero(~shifts.suspected)
    first = SIZES[missed[-1] + 1] if missed[-1] + 1 < len(SIZES) else np.inf
    worst = int(np.argmax(np.abs(shifts.student)))
    return FailureMode(
        area="fits",
        method="least squares, normal errors",
        failure="one outlier of eight readings moves the mass out of its 90 % interval",
        boundary=boundary,
        unit="sd of the reading",
        beyond=f"an outlier of {REPORTED_SD} sd moves ln mass by "
        f"{np.interp(REPORTED_SD, FINE_SIZES, size):.1f} of its sd",
        response=verified("marks", bool(first <= REPORTED_SD), "an outlier"),
        message=f"Student-t errors: moved by "
        f"{np.abs(shifts.student[SIZES == REPORTED_SD])[0]:.2f} sd at {REPORTED_SD}, "
        f"at most by {np.abs(shifts.student[worst]):.2f} (by an outlier of "
        f"{SIZES[worst]:.0f}); reported as a suspected outlier from {first:.0f} sd on",
    )


def stock_solutions(
    solution: Solution, starts: np.ndarray
) -> Float[np.ndarray, "good free"]:
    """Fit one log from many starts; return the successful fits of least cost."""
    posterior = solution.posterior
    measured = np.tile(np.asarray(posterior.measured), (len(starts), 1))
    fits = stock_fits(LM, posterior, measured, starts)
    cost = np.asarray(costs(posterior, jnp.asarray(measured), jnp.asarray(fits.z)))
    # 1e-6 in cost is 1e-3 sd: the rest that the tolerance of the solver leaves
    return fits.z[fits.successful & (cost - np.nanmin(cost) < 1e-6)]


def poor_starts(seed: int = 0) -> np.ndarray:
    """Draw `FITS` starts: 1 to 1,000 kg, in a square of 200 m, shape (FITS, 3)."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(0, np.log(1000), FITS)
    return np.column_stack([mass, *rng.uniform(-100, 100, (2, FITS))])


def mirror_excess(bent: float) -> float:
    """Return the excess of -2 ln density at the mirror image of the charge.

    Args:
        bent: Distance of the last sensor from the line of the others [m].
    """
    found = solved_log(line(bent), *MIRRORED).solution.optima
    z, density = map(np.asarray, found)
    other = np.sign(z[:, 2]) != np.sign(z[0, 2])
    return float(2 * (density[0] - density[other].max()))


def collinear_failure() -> FailureMode:
    """Measure the offset of one sensor that resolves the mirror image."""
    # at the limit of jblast's own search for ambiguities; 1 % is enough for the table
    boundary = crossing(lambda bent: mirror_excess(bent) - AMBIGUITY, 0.0, 5.0, to=0.01)
    at = solved_log(line(), *MIRRORED).solution
    fits = stock_solutions(at, poor_starts())
    wrong = int(np.sum(fits[:, 2] < 0))
    north = abs(float(at.laplace.z[2]))
    return FailureMode(
        area="fits",
        method=f"{LM}, sensors in a line",
        failure="the mirror image of the charge explains the arrivals as well",
        boundary=boundary,
        unit="m that one sensor stands off the line",
        beyond=f"of {len(fits)} fits at the least cost, all reporting success, {wrong} "
        f"end {north:.0f} m south and {len(fits) - wrong} {north:.0f} m north",
        response=verified(
            "marks",
            len(other_modes(at, True)) == 1
            and not other_modes(
                solved_log(line(2 * boundary), *MIRRORED).solution, True
            ),
            "sensors in a line",
        ),
        message="the mirror image is reported as an ambiguity, with data to add; exit "
        "code 4",
    )


def log_at_positions(count: int) -> SolvedLog:
    """Return a log of eight sensors at the first `count` positions of a ring."""
    ring_positions = ring()
    return solved_log(
        tuple(ring_positions[i % count] for i in range(SENSORS)), 30.0, 10.0, -5.0
    )


def is_identified(solution: Solution) -> bool:
    """Return True if a log identifies one position and one mass."""
    return not len(solution.identifiability.null) and not other_modes(solution, True)


def one_place_failure() -> FailureMode:
    """Measure the number of sensor positions that identify mass and position."""
    needed = next(
        count
        for count in range(1, SENSORS + 1)
        if is_identified(log_at_positions(count).solution)
    )
    one = log_at_positions(1).solution
    fits = stock_solutions(one, poor_starts())
    mass = np.exp(fits[:, 0])
    null = one.identifiability.null
    positions = fits[:, 1:]
    separation = positions[:, None, :] - positions[None, :, :]
    return FailureMode(
        area="fits",
        method=f"{LM}, one sensor",
        failure="mass and position from arrivals at fewer positions",
        boundary=float(needed),
        unit="positions",
        beyond=f"eight arrivals at one position: {len(fits)} of {FITS} fits report "
        f"success at the same cost, with {mass.min():.2g} to {mass.max():.2g} kg up to "
        f"{float(np.sqrt((separation**2).sum(axis=-1)).max()):.0f} m apart",
        response=verified("marks", len(null) == 2, "one sensor"),
        message=f"{len(null)} null directions are reported; no value and no interval "
        "for any of the three; exit code 4",
    )


@functools.cache
def wu_hao_solution() -> Solution:
    """Solve arrivals by Wu and Hao's laws with the mass and both speeds unknown."""
    positions = ((20.0, 0.0), (0.0, 30.0), (-50.0, 0.0))
    known = scene_with(positions, SPEEDS, WU_HAO)
    log = simulate(known, SEED, noise="gaussian")
    return solve(log, freed(known, list(SPEEDS)), noise="gaussian")


def null_direction_failure() -> FailureMode:
    """Measure the range of masses that a solver reports along a null direction."""
    found = wu_hao_solution()
    rng = np.random.default_rng(0)
    # starts from 0.1 to 1,000 kg, and speeds of air and rock far beyond plausible ones
    low, high = np.log([[0.1, 200.0, 3000.0], [1000.0, 600.0, 8000.0]])
    fits = stock_solutions(found, rng.uniform(low, high, (FITS, 3)))
    values = np.exp(fits[np.argsort(fits[:, 0])])
    least, most = values[0], values[-1]
    (null,) = found.identifiability.null
    along = ", ".join(f"{weight:.3g}" for weight in null)
    return FailureMode(
        area="fits",
        method=f"{LM}, Wu-Hao, mass and both speeds",
        failure="a null direction: reported masses differ by this factor",
        boundary=float(most[0] / least[0]),
        unit="",
        beyond=f"{len(fits)} of {FITS} fits report success at the same cost, from "
        f"({least[0]:.2g} kg, {least[1]:.0f} m/s) to ({most[0]:.3g} kg, "
        f"{most[1]:.0f} m/s)",
        response=verified(
            "marks",
            bool(np.allclose(null, WU_HAO_NULL, atol=1e-6)),
            "a null direction",
        ),
        message=f"the null direction ({along}) in ln is reported, and the identified "
        "products; no value for any of the three; exit code 4",
    )


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
    truth: Float[np.ndarray, "log free"]
    readings: Float[np.ndarray, "log row"]
    starts: Float[np.ndarray, "log free"]


class MissedFits(NamedTuple):
    """Fits that missed the optimum.

    Attributes:
        missed: True where a fit missed the optimum.
        reported: True where the method reports success.
        nearest: Least distance from the charge of a start that led to a miss [m].
    """

    missed: Bool[np.ndarray, " log"]
    reported: Bool[np.ndarray, " log"]
    nearest: float

    def false_successes(self) -> int:
        """Count the misses that are reported as successes."""
        return int(np.sum(self.missed & self.reported))


def missed_fits(
    logs: Logs, best: Float[np.ndarray, "log free"], z, reported
) -> MissedFits:
    """Compare fits with the best known optima.

    Args:
        logs: The logs that were fitted.
        best: Best known optimum of each log.
        z: Fitted coordinates.
        reported: True where the method reports success.
    """

    def cost(at) -> np.ndarray:
        readings = jnp.asarray(logs.readings)
        return np.asarray(costs(logs.blank, readings, jnp.asarray(at)))

    # negated, so that a cost of NaN is a miss
    missed = ~(cost(z) - cost(best) <= MISFIT_LIMIT)
    distance = np.linalg.norm((logs.starts - logs.truth)[:, 1:], axis=1)
    nearest = float(np.min(distance[missed], initial=np.inf))
    return MissedFits(missed, np.asarray(reported), nearest)


def draw(count: int = FITS, seed: int = 0) -> Logs:
    """Simulate logs of `count` charges, with poor starts."""
    rng = np.random.default_rng(seed)
    known = solved_log(ring(), 30.0, 10.0, -5.0)
    blank = known.solution.posterior
    # the root makes the density of charges uniform over the disc
    radius, angle = 20 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    mass = rng.uniform(np.log(5), np.log(200), count)
    truth = np.column_stack([mass, radius * np.cos(angle), radius * np.sin(angle)])
    exact = np.asarray(
        jax.vmap(lambda z: blank.misfit(z).predicted)(jnp.asarray(truth))
    )
    readings = exact + SIGMA * rng.standard_normal(exact.shape)
    place = rng.uniform(-100, 100, (2, count))
    starts = np.column_stack([rng.uniform(0, np.log(1000), count), *place])
    return Logs(known.uncertain, known.log, blank, truth, readings, starts)


def ours(logs: Logs, starts: Float[np.ndarray, "log free"] | None = None) -> ManyFits:
    """Fit logs by `fit_many`; without `starts` it chooses its own."""
    blank = logs.blank
    return fit_many(
        logs.uncertain,
        blank.layout,
        logs.readings,
        np.asarray(blank.sigma),
        LAWS,
        noise="gaussian",
        starts=starts,
    )


def best_known(logs: Logs) -> Float[np.ndarray, "log free"]:
    """Return the best known optimum of each log: that of a fit from its truth."""
    return np.asarray(ours(logs, logs.truth).z)


def stock_misses(logs: Logs, best, name: str, precision: str) -> MissedFits:
    """Compare the fits of a stock solver from poor starts with the best known."""
    fits = stock_fits(name, logs.blank, logs.readings, logs.starts, precision)
    return missed_fits(logs, best, fits.z, fits.successful)


def solve_misses(
    logs: Logs, best: Float[np.ndarray, "log free"], count=SOLVE_LOGS
) -> int:
    """Return the number of optima that `solve` misses in the first `count` logs."""
    missed = 0
    for row in range(count):
        log = replace(logs.log, value=logs.readings[row])
        found = solve(log, logs.uncertain, noise="gaussian")
        highest = float(found.posterior.log_density(jnp.asarray(best[row])))
        missed += not highest - float(found.optima.log_density[0]) <= MISFIT_LIMIT
    return missed


def poor_start_failures() -> list[FailureMode]:
    """Measure the share of missed optima, and the share reported as success."""
    logs = draw()
    best = best_known(logs)
    own, poor = ours(logs), ours(logs, logs.starts)
    from_own = missed_fits(logs, best, own.z, own.converged)
    from_poor = missed_fits(logs, best, poor.z, ~poor.doubtful)
    message = (
        f"own starts, float64: fit_many misses {from_own.missed.sum()} of these optima "
        f"({from_own.false_successes()} reported as converged), solve "
        f"{solve_misses(logs, best)} of {SOLVE_LOGS}. From the poor starts fit_many "
        f"misses {from_poor.missed.sum()}, and marks all but "
        f"{from_poor.false_successes()} doubtful"
    )
    reliable = not (from_own.missed.any() or from_poor.false_successes())
    modes = []
    for precision in TOLERANCE:
        for name in SOLVERS:
            found = stock_misses(logs, best, name, precision)
            modes.append(
                FailureMode(
                    area="fits",
                    method=f"{name}, {precision}",
                    failure="poor start",
                    boundary=float(found.missed.sum()),
                    unit=f"of {FITS}",
                    beyond=f"{found.missed.sum()} of {FITS} fits miss the optimum, and "
                    f"{found.false_successes()} of these report success; the nearest "
                    f"from a start {found.nearest:.0f} m off",
                    response=verified("falls back", reliable, "poor starts"),
                    message=message,
                )
            )
    return modes


class StockFits(NamedTuple):
    """Fits of a stock solver.

    Attributes:
        z: Fitted coordinates.
        successful: True where the solver reports success.
    """

    z: Float[np.ndarray, "fit free"]
    successful: Bool[np.ndarray, " fit"]


def stock_fits(
    name: str,
    posterior: Posterior,
    measured: Float[np.ndarray, "fit row"],
    starts: Float[np.ndarray, "fit free"],
    precision: str = "float64",
) -> StockFits:
    """Fit logs of one layout with normal errors, one start for each log.

    Args:
        name: A key of `SOLVERS` or `OTHER_SOLVERS`.
        posterior: Layout and laws, without shared effects and priors.
        measured: Readings of each log, in the form of `Posterior.measured`.
        starts: Fitted coordinates.
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
    solver = {**SOLVERS, **OTHER_SOLVERS}[name](tolerance, tolerance)

    def fit(start, args):
        options = {"args": args, "max_steps": MAX_SOLVER_STEPS, "throw": False}
        if isinstance(solver, optx.AbstractLeastSquaresSolver):
            found = optx.least_squares(residuals, solver, start, **options)
        else:
            found = optx.minimise(_half_square, solver, start, **options)
        return found.value, found.result == optx.RESULTS.successful

    return jax.jit(jax.vmap(fit, in_axes=(0, (None, 0))))


def residuals(
    z: Float[Array, " free"], args: tuple[Posterior, Float[Array, " row"]]
) -> Float[Array, " row"]:
    """Return the residuals of the readings at a point, in standard deviations."""
    posterior, measured = args
    misfit = eqx.tree_at(lambda p: p.measured, posterior, measured).misfit(z)
    return misfit.residual / misfit.sd


def _half_square(z, args):
    return 0.5 * jnp.sum(jnp.square(residuals(z, args)))


@jax.jit
def costs(
    posterior: Posterior,
    measured: Float[Array, "fit row"],
    z: Float[Array, "fit free"],
) -> Float[Array, " fit"]:
    """Return minus ln likelihood of each log at its point, up to a constant."""
    return jax.vmap(lambda m, z: _half_square(z, (posterior, m)))(measured, z)


def circle(radius: float | Float[np.ndarray, " sensor"]) -> Positions:
    """Return sensor positions about the origin, with one radius or one each [m]."""
    angle = np.arange(SENSORS) * 2 * np.pi / SENSORS
    east, north = radius * np.cos(angle), radius * np.sin(angle)
    return tuple(zip(east.tolist(), north.tolist(), strict=True))


def ring() -> Positions:
    """Return sensor positions on all sides, 60 to 140 m from the origin."""
    return circle(np.array([60.0, 140.0, 80.0, 120.0, 70.0, 130.0, 90.0, 110.0]))


def line(bent: float = 0.0) -> Positions:
    """Return sensor positions 30 m apart from west to east.

    Args:
        bent: Distance of the last sensor from the line [m].
    """
    east = (-60.0 + 30.0 * np.arange(SENSORS)).tolist()
    return (*((x, 0.0) for x in east[:-1]), (east[-1], bent))


def scene_with(
    positions: Positions,
    values: Mapping[str, float],
    laws: Mapping[str, str],
    sigma: float = SIGMA,
) -> UncertainScene:
    """Return a scene of sensors on the ground that record the quantities of `laws`."""
    sensors = tuple(
        Sensor(
            f"s{i}",
            jnp.array([*position, 0.0]),
            records=tuple((quantity, sigma) for quantity in laws),
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
    log = simulate(scene_with(positions, truth, LAWS), SEED, noise="gaussian")
    uncertain = freed(scene_with(positions, START, LAWS), list(START))
    return SolvedLog(log, uncertain, solve(log, uncertain, noise=noise))


def two_normals(separation: float) -> Mixture:
    """Return two unit normals at a separation [sd], the second with weight 1/3."""
    center = np.zeros((2, DIMENSION))
    center[1, 0] = separation
    covariance = np.tile(np.eye(DIMENSION), (2, 1, 1))
    return mixture_of(center, covariance, np.array([2.0, 1.0]))


class BareWalk(NamedTuple):
    """A walk by the stretch move alone.

    Attributes:
        chain: Every step.
        own_tau: emcee's autocorrelation time of the first coordinate [steps], from
            deviations of each walker from its own mean.
        judged: Convergence by jblast, from deviations from the mean of all walkers.
    """

    chain: Float[np.ndarray, "step walker free"]
    own_tau: float
    judged: Convergence

    def kept(self) -> Float[np.ndarray, "step walker free"]:
        """Return the steps after the first quarter."""
        return self.chain[len(self.chain) // 4 :]


@functools.cache
def from_one_mode(separation: float) -> BareWalk:
    """Walk by the stretch move alone, all walkers in the greater mode."""
    start = unit_normals(DIMENSION)
    return bare_walk(two_normals(separation), start, TWO_MODE_STEPS)


@functools.cache
def from_both_modes(separation: float) -> BareWalk:
    """Walk by the stretch move alone, half of the walkers in each mode."""
    start = unit_normals(DIMENSION)
    start[::2, 0] += separation
    return bare_walk(two_normals(separation), start, TWO_MODE_STEPS)


@functools.cache
def jblast_walk(separation: float) -> Sampled:
    """Walk by jblast's sampler, half of the walkers in each mode."""
    density, scale = two_normals(separation), np.eye(DIMENSION)
    starts = [Start(center, scale, 0.5) for center in np.asarray(density.center)]
    return sample(density, starts, scale, sampler="scan")


def second_mode_share(chain: np.ndarray, separation: float) -> float:
    """Return the share of samples that belong to the second mode."""
    return float(np.mean(chain[..., 0] > separation / 2))


def found_failure() -> FailureMode:
    """Measure the separation at which a walk from one mode misses the other."""
    shares = [
        second_mode_share(from_one_mode(separation).kept(), separation)
        for separation in MODE_SEPARATIONS
    ]
    # the walks are random: the missed share is taken not to fall with the separation
    missed = np.maximum.accumulate(1 - np.array(shares) / MINOR_SHARE)
    boundary = boundary_at(
        0.5, missed, np.array(MODE_SEPARATIONS), "stretch move from one mode"
    )
    walk = jblast_walk(SEPARATED_SD)
    share = second_mode_share(walk.chain[walk.convergence.warm_up :], SEPARATED_SD)
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="from one mode, half of the other is missed",
        boundary=boundary,
        unit="sd between the modes",
        beyond=f"a mode of weight {MINOR_SHARE:.0%} at {SEPARATED_SD:g} sd has "
        f"{shares[-1]:.1%} of the samples after {TWO_MODE_STEPS} steps",
        # 0.05 rejects a walk that keeps the 50 % of walkers that started there
        response=verified(
            "holds", walk.reached and abs(share - MINOR_SHARE) < 0.05, "modes"
        ),
        message="walkers start at every optimum of the search, and later jumps propose "
        f"samples of the normals about them: {share:.0%} there, {len(walk.chain)} "
        f"steps, autocorrelation time {walk.convergence.tau.max():.0f}",
    )


class Mirror(NamedTuple):
    """Walks over a charge next to a line of sensors.

    Attributes:
        bare: Walk by the stretch move alone, from the best optimum.
        beyond: Number of its walkers that ever reach the mirror image.
        ours: Walk by jblast.
    """

    bare: BareWalk
    beyond: int
    ours: Ensemble


@functools.cache
def mirror() -> Mirror:
    """Walk about a charge that has a mirror image."""
    found = solved_log(line(), *MIRRORED).solution
    posterior, normal = found.posterior, found.laplace
    density = whitened_density(posterior, normal, found.identifiability)
    walk = bare_walk(density, unit_normals(DIMENSION), MIRROR_STEPS)
    north = normal.z[2] + walk.chain @ np.asarray(density.root)[2]
    there = (np.sign(north) != np.sign(normal.z[2])).any(axis=0)
    ours = ensemble(posterior, normal, found.identifiability, found.optima)
    return Mirror(walk, int(there.sum()), ours)


def mirror_failure() -> FailureMode:
    """Measure the number of walkers that never reach the mirror image of a charge."""
    walks = mirror()
    shares = [mode.share for mode in walks.ours.modes]
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="walkers that never reach the mirror image",
        boundary=float(WALKERS - walks.beyond),
        unit=f"of {WALKERS}",
        beyond=f"{MIRROR_STEPS} steps from the best optimum: {walks.beyond} of "
        f"{WALKERS} walkers reach it, and the chain looks converged: R-hat "
        f"{walks.bare.judged.r_hat.max():.3f}, "
        f"{MIRROR_STEPS / walks.bare.own_tau:.0f} autocorrelation times",
        response=verified(
            "marks", len(shares) == 2 and walks.ours.converged, "a mirror image"
        ),
        message=f"both modes are reported with their shares, {shares[0]:.0%} and "
        f"{shares[1]:.0%}; autocorrelation time "
        f"{walks.ours.convergence.tau.max():.0f}",
    )


def weighed_failure() -> FailureMode:
    """Measure the error of the share of a mode where walkers start in both."""
    walk = from_both_modes(SEPARATED_SD)
    share = second_mode_share(walk.kept(), SEPARATED_SD)
    tau = walk.judged.tau.max()
    return FailureMode(
        area="walks",
        method="emcee, own autocorrelation time",
        failure="from both modes, the shares stay as started",
        boundary=TWO_MODE_STEPS / walk.own_tau,
        unit=f"autocorrelation times claimed in {TWO_MODE_STEPS} steps",
        beyond=f"{SEPARATED_SD:g} sd apart, a mode of weight {MINOR_SHARE:.0%} keeps "
        f"{share:.0%}; emcee's autocorrelation time is {walk.own_tau:.0f} steps, and "
        "its condition of 50 of them is satisfied",
        response=verified(
            "marks",
            not walk.judged.reached(1.0) and tau > TWO_MODE_STEPS / 50,
            "shares",
        ),
        message=f"deviations from the mean of all walkers: {tau:.0f} steps, so the "
        "same walk counts as not converged",
    )


@functools.cache
def null_walk(steps: int) -> BareWalk:
    """Walk over mass and both speeds by Wu-Hao's laws, from about the optimum."""
    found = wu_hao_solution()
    rng = np.random.default_rng(0)
    z = jnp.asarray(found.laplace.z)
    about = Whitened(found.posterior, z, jnp.eye(z.size))
    return bare_walk(about, 0.1 * rng.standard_normal((WALKERS, z.size)), steps)


def null_failure() -> FailureMode:
    """Measure the range of a walk along a null direction, and its convergence."""
    walk = null_walk(LONG_CHAIN)
    found = wu_hao_solution()
    mass = found.laplace.z[0] + walk.kept()[..., 0]
    try:
        ensemble(found.posterior, found.laplace, found.identifiability)
        refused = False
    except InputError as error:
        refused = "improper along charge_mass_kg" in str(error)
    return FailureMode(
        area="walks",
        method="emcee, Wu-Hao, mass and both speeds",
        failure="a null direction without a prior has no width",
        boundary=float(LONG_CHAIN / walk.judged.tau.max()),
        unit=f"autocorrelation times in {LONG_CHAIN} steps",
        beyond=f"ln mass covers {mass.min():.0f} to {mass.max():.0f}, the range of "
        f"float64; autocorrelation time {walk.judged.tau.max():.0f}, R-hat "
        f"{walk.judged.r_hat.max():.3f}: it looks converged",
        response=verified("refuses", refused, "a null direction"),
        message="no walk: improper along charge_mass_kg and the speeds; expected a "
        "prior, or a fixed value",
    )


@functools.cache
def endless() -> tuple[Solution, Ensemble]:
    """Walk over the mass of a charge 300 m from a circle of sensors of 10 m."""
    found = solved_log(circle(CIRCLE_RADIUS), 30.0, 300.0, 0.0).solution
    walk = ensemble(
        found.posterior,
        found.laplace,
        found.identifiability,
        found.optima,
        most_steps=ENDLESS_STEPS,
    )
    return found, walk


def endless_failure() -> FailureMode:
    """Measure the drift of a walk along an endless ridge."""
    found, ours = endless()
    density = whitened_density(found.posterior, found.laplace, found.identifiability)
    start = np.random.default_rng(0).standard_normal((WALKERS, found.laplace.z.size))
    walks = [bare_walk(density, start, steps) for steps in (SHORT_CHAIN, LONG_CHAIN)]
    mass_row = root_of(found.laplace)[0]
    low = [
        np.quantile(np.exp(found.laplace.z[0] + walk.kept() @ mass_row), 0.05)
        for walk in walks
    ]
    tau = float(walks[-1].judged.tau.max())
    improper = any(isinstance(f, LongRidge) and f.is_endless for f in ours.findings)
    return FailureMode(
        area="walks",
        method="emcee, arrivals from afar",
        failure="an endless ridge: all smaller masses arrive at the speed of sound",
        boundary=LONG_CHAIN / tau,
        unit=f"autocorrelation times in {LONG_CHAIN} steps",
        beyond=f"the 5 % quantile of the mass is {low[0]:.2g} kg after {SHORT_CHAIN} "
        f"steps, {low[1]:.2g} kg after {LONG_CHAIN}: it depends on the length of the "
        "walk, not on the log",
        response=verified("marks", improper and not ours.converged, "an endless ridge"),
        message="not converged (exit code 4): the ridge, its bounds and the improper "
        "posterior are reported",
    )


def interval_error(radius: float) -> float:
    """Return the error of a bound of the 90 % interval of Laplace's method [sd].

    Args:
        radius: Radius of the circle of sensors [m]; the charge is 60 m from its centre.
    """
    found = _near_circle(radius)
    return check_intervals(found.posterior, found.laplace).off


def _near_circle(radius: float) -> Solution:
    return solved_log(circle(radius), 30.0, 60.0, 0.0).solution


def bent_failure() -> FailureMode:
    """Measure the aperture below which the normal approximation fails its check."""
    boundary = crossing(
        lambda r: interval_error(r) - MAX_QUANTILE_ERROR, BENT_RADIUS, 40.0, to=0.01
    )
    found = _near_circle(BENT_RADIUS)
    name = found.posterior.parameters.names[0]
    laplace, auto = uncertainty(found, "laplace"), uncertainty(found, "auto")
    intervals = [
        f"{marginal.q05:.3g} to {marginal.q95:.3g} kg"
        for marginal in (laplace.marginals[name], auto.marginals[name])
    ]
    warned = any(
        isinstance(f, IntervalsOff) and f.parameter == name and not np.isnan(f.off)
        for f in laplace.findings
    )
    return FailureMode(
        area="walks",
        method="normal approximation (Laplace)",
        failure="a curved ridge of mass and range",
        boundary=boundary,
        unit="m radius of eight sensors 60 m away",
        beyond=f"bounds of 90 % intervals are off by more than {MAX_QUANTILE_ERROR:g} "
        f"sd; at {BENT_RADIUS:g} m by {interval_error(BENT_RADIUS):.1f}: the mass is "
        f"{intervals[0]} instead of {intervals[1]}",
        response=verified(
            "marks",
            warned and auto.method == "emcee" and auto.converged,
            "a curved ridge",
        ),
        message="a warning names the bound with the largest error; --posterior auto "
        "runs MCMC",
    )


def bare_walk(
    density: Density,
    start: Float[np.ndarray, "walker free"],
    steps: int,
    seed: int = 0,
) -> BareWalk:
    """Run emcee's stretch move.

    Args:
        density: Log density.
        start: First position of each walker.
        steps: Number of steps.
        seed: Seed of the moves.
    """
    import emcee

    walkers, free = start.shape
    # vectorised: one call of the compiled density for half of the walkers
    sampler = emcee.EnsembleSampler(
        walkers,
        free,
        lambda w: np.asarray(densities(density, jnp.asarray(w)), float),
        vectorize=True,
    )
    random = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random), steps)
    chain = np.asarray(sampler.get_chain())
    # tol=0: return the estimate of a short chain too, instead of raising
    own = emcee.autocorr.integrated_time(chain[..., :1], quiet=True, tol=0)
    return BareWalk(chain, float(own[0]), convergence(chain))


def unit_normals(free: int, seed: int = 0) -> Float[np.ndarray, "walker free"]:
    """Draw walkers from a unit normal."""
    return np.random.default_rng(seed).standard_normal((WALKERS, free))
