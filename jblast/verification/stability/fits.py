"""Failure modes of fits and of MCMC: starts, null directions, outliers, modes, ridges.

The logs are eight arrivals, to 0.1 ms, each log of a surface charge of its own (5 to
200 kg, within 20 m of the centre of the sensors) with unknown mass and position. All
logs have the same rows, so that one compiled program serves all. Poor starts have the
mass to a factor of 1,000 and the position to a square of 200 m. The end of a fit is off
where its likelihood is lower than a shift of one parameter by 0.1 standard deviations
from the best known end would make it.

Gauss-Newton, BFGS and Levenberg-Marquardt are optimistix's, without further checks: the
success that the solver itself reports is measured.

With two modes emcee's stretch move misses the second one, or gives it a wrong weight.
The first case has a known truth: two round normals in three dimensions, one of which
has twice the weight of the other. The second is a charge next to a line of sensors, and
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
from jblast.inference.posterior.parameters import Estimate
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
"""The size that is reported [sd]."""
SIZES = np.arange(0.0, 2 * REPORTED_SD + 1)
"""Tried by `solve` [sds]."""
FITS = 400
"""Fits in one call, always as many, so that one program serves them all."""
FINE = np.linspace(0.0, 2 * REPORTED_SD, FITS)
"""Tried by least squares [sds]."""
WHICH = 0
"""The nearest sensor, whose reading constrains the fit most."""
LM = "Levenberg-Marquardt"
MIRRORED = (30.0, 10.0, 20.0)
"""Mass, east, north of the charge beside a line of sensors."""
WU_HAO = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
WU_HAO_NULL = (1.0, -0.2, -0.02)
"""Exponents of the mass in 0.91 R^1.03 Q^-0.02 / c_s and 0.34 R^1.4 Q^-0.2 / c_a."""
SPEEDS = {
    "charge_mass_kg": 15.0,
    "air_sound_speed_m_s": 340.0,
    "ground_p_speed_m_s": 5660.0,
}
SOLVED = 5
"""Logs that `solve`, which takes one at a time, is tried on."""
# Loss of log-likelihood of a normal optimum that is missed by this many sds.
OFF = 0.5 * SAME_OPTIMUM_SD**2
SOLVERS = {
    "Gauss-Newton": optx.GaussNewton,
    "BFGS": optx.BFGS,
    "Levenberg-Marquardt": optx.LevenbergMarquardt,
}
MORE = {"Dogleg": optx.Dogleg}
"""Others, which the map of stability leaves out."""
MOST_STEPS = 256
"""The default of optimistix."""
TOLERANCE = {"float64": 1e-8, "float32": 1e-4}
"""About the square root of what each can resolve, relative and absolute."""
SENSORS = 8
SIGMA = 1e-4
"""Error of an arrival [s]."""
LAWS = {"air_arrival_s": "shock_kinematics"}
START = {"charge_mass_kg": 1.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
"""Unknowns, and their priors in the search."""
# Any number: the logs are fixed by it.
SEED = 1
Places = tuple[tuple[float, float], ...]
"""East and north of each sensor [m]."""
# As many as the fits of mass, east and north have.
FREE = 3
STEPS = 1000
MIRROR_STEPS = 2500
LESSER = 1 / 3
"""What the second mode holds."""
SEPARATED_SD = 12.0
"""Modes so many standard deviations apart are told of."""
MODE_SEPARATIONS = (6.0, 8.0, 10.0, SEPARATED_SD)
SHORT, LONG = 500, 4000
"""Steps."""
ENDLESS_STEPS = 1500
CIRCLE_RADIUS = 10.0
"""Radius of the circle of sensors that a ridge without end is told of [m]."""
CLOSE = 6.0
"""Of the one that a bent ridge is told of [m]."""
WALKERS = 64


class Moved(NamedTuple):
    """What a reading ever further off does to ln of the mass.

    Attributes:
        normal: How far normal errors move it, by `FINE` [sds without the outlier].
        student: How far Student-t errors do, as `solve` takes them, by `SIZES`.
        named: Whether the reading is suspected, by `SIZES`.
    """

    normal: Float[np.ndarray, " fine"]
    student: Float[np.ndarray, " size"]
    named: Bool[np.ndarray, " size"]


@functools.cache
def moved() -> Moved:
    """Fit the same log with one reading ever further off."""
    clean = solved_log(ring(), 30.0, 10.0, -5.0, "student")
    posterior, z = clean.solution.posterior, clean.solution.laplace.z
    normal = fit_many(
        clean.uncertain,
        posterior.layout,
        np.array([_off(clean.log, size).value for size in FINE]),
        np.asarray(posterior.sigma),
        LAWS,
        noise="gaussian",
        starts=np.tile(z, (len(FINE), 1)),
    )
    mass = np.asarray(normal.z)[:, 0]
    sd = float(normal.sd()[0, 0])
    found = [_by_student(clean, _off(clean.log, size)) for size in SIZES]
    student = np.array([at for at, _ in found])
    return Moved(
        (mass - mass[0]) / sd,
        (student - student[0]) / sd,
        np.array([named for _, named in found]),
    )


def _off(log: Observations, size: float) -> Observations:
    value = log.value.copy()
    value[WHICH] += size * SIGMA
    return replace(log, value=value)


class SolvedLog(NamedTuple):
    """A log, and what jblast makes of it.

    Attributes:
        log: The arrivals.
        uncertain: What was known before.
        solution: What `solve` found.
    """

    log: Observations
    uncertain: UncertainScene
    solution: Solution


def _by_student(clean: SolvedLog, log: Observations) -> tuple[float, bool]:
    """Return ln of the mass, and whether the reading is suspected."""
    found = solve(log, clean.uncertain)
    posterior, z = found.posterior, found.laplace.z
    named = suspected_outliers(
        log, standardised_residuals(posterior, z).residual, posterior.noise
    )
    return float(z[0]), any(o.sensor == log.sensor[WHICH] for o in named)


def outlier_failure() -> FailureMode:
    """Measure from which size of one outlier on the interval loses the mass."""
    by = moved()
    size = np.abs(by.normal)
    boundary = boundary_at(NORMAL_Q95, size, FINE, "least squares, an outlier")
    never = np.flatnonzero(~by.named)
    first = SIZES[never[-1] + 1] if never[-1] + 1 < len(SIZES) else np.inf
    worst = int(np.argmax(np.abs(by.student)))
    return FailureMode(
        area="fits",
        method="least squares, normal errors",
        failure="one outlier of eight readings moves the mass out of its 90 % interval",
        boundary=boundary,
        unit="sd of the reading",
        beyond=f"an outlier of {REPORTED_SD} sd moves ln mass by "
        f"{np.interp(REPORTED_SD, FINE, size):.1f} of its sd",
        response=verified("marks", bool(first <= REPORTED_SD), "an outlier"),
        message=f"Student-t errors: moved by "
        f"{np.abs(by.student[SIZES == REPORTED_SD])[0]:.2f} sd at {REPORTED_SD}, "
        f"at most by {np.abs(by.student[worst]):.2f} (by an outlier of "
        f"{SIZES[worst]:.0f}); named among the suspected outliers from {first:.0f} sd "
        "on",
    )


class Solutions(NamedTuple):
    """Solutions of one log from many starts.

    Attributes:
        z: Fitted coordinates of those that report success at the least cost.
        good: How many they are.
    """

    z: np.ndarray
    good: int


def stock_solutions(solution: Solution, starts: np.ndarray) -> Solutions:
    """Fit one log from many starts; keep what looks as good as it gets."""
    posterior = solution.posterior
    measured = np.tile(np.asarray(posterior.measured), (len(starts), 1))
    fits: StockFits = stock_fits(LM, posterior, measured, starts)
    cost = np.asarray(costs(posterior, jnp.asarray(measured), jnp.asarray(fits.z)))
    # 1e-3 of a sd: what is left by the solver's own tolerance
    best = fits.successful & (cost - np.nanmin(cost) < 1e-6)
    return Solutions(fits.z[best], int(best.sum()))


def poor_starts(seed: int = 0) -> np.ndarray:
    """Draw starts of mass and place: 1 to 1,000 kg, in a square of 200 m."""
    rng = np.random.default_rng(seed)
    mass = rng.uniform(0, np.log(1000), FITS)
    return np.column_stack([mass, *rng.uniform(-100, 100, (2, FITS))])


def mirror_excess(bent: float) -> float:
    """Return by how much the mirror image fits worse, in -2 ln density.

    Args:
        bent: How far the last sensor stands off the line of the others [m].
    """
    found = solved_log(line(bent), *MIRRORED).solution.optima
    z, density = map(np.asarray, found)
    other = np.sign(z[:, 2]) != np.sign(z[0, 2])
    return float(2 * (density[0] - density[other].max()))


def collinear_failure() -> FailureMode:
    """Measure how far off the line a sensor has to stand."""
    boundary = crossing(lambda bent: mirror_excess(bent) - AMBIGUITY, 0.0, 5.0, to=0.01)
    at = solved_log(line(), *MIRRORED).solution
    fits = stock_solutions(at, poor_starts())
    wrong = int(np.sum(fits.z[:, 2] < 0))
    north = abs(float(at.laplace.z[2]))
    return FailureMode(
        area="fits",
        method=f"{LM}, sensors in a line",
        failure="the mirror image of the charge explains the arrivals as well",
        boundary=boundary,
        unit="m that one sensor stands off the line",
        beyond=f"of {fits.good} fits at the least cost, all reporting success, {wrong} "
        f"say {north:.0f} m south and {fits.good - wrong} {north:.0f} m north",
        response=verified(
            "marks",
            len(other_modes(at, True)) == 1
            and not other_modes(
                solved_log(line(2 * boundary), *MIRRORED).solution, True
            ),
            "sensors in a line",
        ),
        message="the other place is named as an ambiguity, with its cure; exit code 4",
    )


def at_places(count: int) -> SolvedLog:
    """Return a log of eight sensors that stand at so many places of a ring."""
    places = ring()
    return solved_log(
        tuple(places[i % count] for i in range(SENSORS)), 30.0, 10.0, -5.0
    )


def is_told(solution: Solution) -> bool:
    """Whether a log identifies one place and one mass."""
    return not len(solution.identifiability.null) and not other_modes(solution, True)


def one_place_failure() -> FailureMode:
    """Measure at how many places sensors have to stand."""
    needed = next(n for n in range(1, SENSORS + 1) if is_told(at_places(n).solution))
    one = at_places(1).solution
    fits = stock_solutions(one, poor_starts())
    mass = np.exp(fits.z[:, 0])
    null = one.identifiability.null
    places = fits.z[:, 1:]
    apart = places[:, None, :] - places[None, :, :]
    return FailureMode(
        area="fits",
        method=f"{LM}, one sensor",
        failure="mass and place from arrivals at fewer places",
        boundary=float(needed),
        unit="places",
        beyond=f"eight arrivals at one place: {fits.good} of {FITS} fits report "
        f"success at the same cost, with {mass.min():.2g} to {mass.max():.2g} kg up to "
        f"{float(np.sqrt((apart**2).sum(axis=-1)).max()):.0f} m apart",
        response=verified("marks", len(null) == 2, "one sensor"),
        message=f"{len(null)} null directions are named; no value and no interval for "
        "any of the three; exit code 4",
    )


@functools.cache
def wu_hao_told() -> Solution:
    """Solve arrivals by Wu and Hao's laws with the mass and both speeds unknown."""
    places = ((20.0, 0.0), (0.0, 30.0), (-50.0, 0.0))
    known = scene_with(places, SPEEDS, WU_HAO)
    log = simulate(known, SEED, noise="gaussian")
    return solve(log, freed(known, list(SPEEDS)), noise="gaussian")


def null_direction_failure() -> FailureMode:
    """Measure which masses are reported where no arrival constrains them."""
    found = wu_hao_told()
    rng = np.random.default_rng(0)
    low, high = np.log([[0.1, 200.0, 3000.0], [1000.0, 600.0, 8000.0]])
    fits = stock_solutions(found, rng.uniform(low, high, (FITS, 3)))
    values = np.exp(fits.z[np.argsort(fits.z[:, 0])])
    least, most = values[0], values[-1]
    (null,) = found.identifiability.null
    along = ", ".join(f"{weight:.3g}" for weight in null)
    return FailureMode(
        area="fits",
        method=f"{LM}, Wu-Hao, mass and both speeds",
        failure="a null direction: masses apart by this factor are reported",
        boundary=float(most[0] / least[0]),
        unit="",
        beyond=f"{fits.good} of {FITS} fits report success at the same cost, from "
        f"({least[0]:.2g} kg, {least[1]:.0f} m/s) to ({most[0]:.3g} kg, "
        f"{most[1]:.0f} m/s)",
        response=verified(
            "marks",
            bool(np.allclose(null, WU_HAO_NULL, atol=1e-6)),
            "a null direction",
        ),
        message=f"the direction ({along}) in ln is named, and the products that are "
        "told; no value for any of the three; exit code 4",
    )


class Logs(NamedTuple):
    """Logs of one layout.

    Attributes:
        uncertain: What is asked.
        log: One of them, of a charge of its own.
        blank: The posterior of that one.
        truth: Fitted coordinates of each charge.
        readings: Arrivals [s].
        starts: Where fits begin, poor ones.
    """

    uncertain: UncertainScene
    log: Observations
    blank: Posterior
    truth: Float[np.ndarray, "log free"]
    readings: Float[np.ndarray, "log row"]
    starts: Float[np.ndarray, "log free"]


class Off(NamedTuple):
    """Which fits end off the optimum.

    Attributes:
        off: Whether an end is off.
        said: Whether the method calls that end good.
        nearest: Least distance from the charge of a start whose end is off [m].
    """

    off: Bool[np.ndarray, " log"]
    said: Bool[np.ndarray, " log"]
    nearest: float

    def falsely(self) -> int:
        """Count the ends off the optimum that are called good."""
        return int(np.sum(self.off & self.said))


def off(logs: Logs, best: Float[np.ndarray, "log free"], z, said) -> Off:
    """Judge the ends of fits.

    Args:
        logs: What was fitted.
        best: The best end known of each.
        z: Where fits ended.
        said: Whether each is called good by its method.
    """
    wrong = ~(_costs(logs, z) - _costs(logs, best) <= OFF)
    away = np.linalg.norm((logs.starts - logs.truth)[:, 1:], axis=1)
    nearest = float(np.min(away[wrong], initial=np.inf))
    return Off(wrong, np.asarray(said), nearest)


def draw(count: int = FITS, seed: int = 0) -> Logs:
    """Draw logs and poor starts."""
    rng = np.random.default_rng(seed)
    known = solved_log(ring(), 30.0, 10.0, -5.0)
    blank = known.solution.posterior
    far, way = 20 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    mass = rng.uniform(np.log(5), np.log(200), count)
    truth = np.column_stack([mass, far * np.cos(way), far * np.sin(way)])
    exact = np.asarray(
        jax.vmap(lambda z: blank.misfit(z).predicted)(jnp.asarray(truth))
    )
    readings = exact + SIGMA * rng.standard_normal(exact.shape)
    place = rng.uniform(-100, 100, (2, count))
    starts = np.column_stack([rng.uniform(0, np.log(1000), count), *place])
    return Logs(known.uncertain, known.log, blank, truth, readings, starts)


def ours(logs: Logs, starts: Float[np.ndarray, "log free"] | None = None) -> ManyFits:
    """Fit logs by `fit_many`, from starts of its own where none are given."""
    blank = logs.blank
    sigma = np.asarray(blank.sigma)
    asked = logs.uncertain, blank.layout, logs.readings, sigma, LAWS
    return fit_many(*asked, noise="gaussian", starts=starts)


def best_known(logs: Logs) -> Float[np.ndarray, "log free"]:
    """Return the best end known of each log: that of a fit from its truth."""
    return np.asarray(ours(logs, logs.truth).z)


def _costs(logs: Logs, z) -> np.ndarray:
    return np.asarray(costs(logs.blank, jnp.asarray(logs.readings), jnp.asarray(z)))


def by_stock(logs: Logs, best, name: str, precision: str) -> Off:
    """Judge the ends of a stock solver from the poor starts."""
    ends = stock_fits(name, logs.blank, logs.readings, logs.starts, precision)
    return off(logs, best, ends.z, ends.successful)


def solved_off(logs: Logs, best: Float[np.ndarray, "log free"], count=SOLVED) -> int:
    """Return how many of the first logs `solve` leaves off the optimum."""
    wrong = 0
    for row in range(count):
        log = replace(logs.log, value=logs.readings[row])
        found = solve(log, logs.uncertain, noise="gaussian")
        highest = float(found.posterior.log_density(jnp.asarray(best[row])))
        wrong += not highest - float(found.optima.log_density[0]) <= OFF
    return wrong


def poor_start_failures() -> list[FailureMode]:
    """Measure the share of fits that end off the optimum, and what they report."""
    logs = draw()
    best = best_known(logs)
    own, poor = ours(logs), ours(logs, logs.starts)
    of_own = off(logs, best, own.z, own.converged)
    of_poor = off(logs, best, poor.z, ~poor.doubtful)
    said = (
        f"starts of its own, float64: fit_many leaves {of_own.off.sum()} of these logs "
        f"off ({of_own.falsely()} of them called converged), solve "
        f"{solved_off(logs, best)} of {SOLVED}. From these starts fit_many ends "
        f"{of_poor.off.sum()} off, and marks all but {of_poor.falsely()} doubtful"
    )
    held = not (of_own.off.any() or of_poor.falsely())
    modes = []
    for precision in TOLERANCE:
        for name in SOLVERS:
            of = by_stock(logs, best, name, precision)
            modes.append(
                FailureMode(
                    area="fits",
                    method=f"{name}, {precision}",
                    failure="poor start",
                    boundary=float(of.off.sum()),
                    unit=f"of {FITS}",
                    beyond=f"{of.off.sum()} of {FITS} fits end off the optimum, and "
                    f"{of.falsely()} of these report success; the nearest from a start "
                    f"{of.nearest:.0f} m off",
                    response=verified("falls back", held, "poor starts"),
                    message=said,
                )
            )
    return modes


class StockFits(NamedTuple):
    """Where stock solvers ended.

    Attributes:
        z: Fitted coordinates.
        successful: Whether the solver reports success.
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
    """Fit logs of one layout, each from a start of its own, with normal errors.

    Args:
        name: A key of `SOLVERS` or `MORE`.
        posterior: The layout and its laws; no effects shared, no priors.
        measured: Readings of each log, as `Posterior.measured` has them.
        starts: Fitted coordinates.
        precision: "float64" or "float32", of everything.
    """
    with jax.enable_x64(precision == "float64"):

        def cast(tree):
            return jax.tree.map(lambda x: jnp.asarray(x, precision), tree)

        each = _each(name, TOLERANCE[precision])
        z, successful = each(cast(starts), (cast(posterior), cast(measured)))
        return StockFits(np.asarray(z, float), np.asarray(successful))


@functools.cache
def _each(name: str, tolerance: float):
    """Return what fits many logs; compiled once for each layout."""
    solver = {**SOLVERS, **MORE}[name](tolerance, tolerance)

    def fit(start, args):
        asked = {"args": args, "max_steps": MOST_STEPS, "throw": False}
        if isinstance(solver, optx.AbstractLeastSquaresSolver):
            found = optx.least_squares(residuals, solver, start, **asked)
        else:
            found = optx.minimise(_half_square, solver, start, **asked)
        return found.value, found.result == optx.RESULTS.successful

    return jax.jit(jax.vmap(fit, in_axes=(0, (None, 0))))


def residuals(
    z: Float[Array, " free"], args: tuple[Posterior, Float[Array, " row"]]
) -> Float[Array, " row"]:
    """Return how readings miss the laws at a place, in standard deviations."""
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
    """Return minus ln of the likelihood of each log at a place, up to a constant."""
    return jax.vmap(lambda m, z: _half_square(z, (posterior, m)))(measured, z)


def circle(radius: float | Float[np.ndarray, " sensor"]) -> Places:
    """Place sensors about the origin, a radius for all or one for each [m]."""
    angle = np.arange(SENSORS) * 2 * np.pi / SENSORS
    east, north = radius * np.cos(angle), radius * np.sin(angle)
    return tuple(zip(east.tolist(), north.tolist(), strict=True))


def ring() -> Places:
    """Place sensors on all sides, 60 to 140 m from the origin."""
    return circle(np.array([60.0, 140.0, 80.0, 120.0, 70.0, 130.0, 90.0, 110.0]))


def line(bent: float = 0.0) -> Places:
    """Place sensors 30 m apart from west to east, the last so far off the line [m]."""
    east = (-60.0 + 30.0 * np.arange(SENSORS)).tolist()
    return (*((x, 0.0) for x in east[:-1]), (east[-1], bent))


def scene_with(
    places: Places,
    values: Mapping[str, float],
    laws: Mapping[str, str],
    sigma: float = SIGMA,
) -> UncertainScene:
    """Return a scene of sensors on the ground that record what there are laws for."""
    sensors = tuple(
        Sensor(
            f"s{i}",
            jnp.array([*place, 0.0]),
            records=tuple((quantity, sigma) for quantity in laws),
        )
        for i, place in enumerate(places)
    )
    empty = replace(Scene(), scatter=False, sensors=sensors)
    return with_laws(UncertainScene(with_values(empty, values)), laws)


@functools.cache
def solved_log(
    places: Places,
    mass: float,
    east: float,
    north: float,
    noise: Noise = "gaussian",
) -> SolvedLog:
    """Simulate a log with normal errors, and solve it.

    Args:
        places: Of the sensors.
        mass: Of the charge [kg].
        east: Of the charge [m].
        north: Of the charge [m].
        noise: What `solve` takes the errors to be.
    """
    truth = dict(zip(START, (mass, east, north), strict=True))
    log = simulate(scene_with(places, truth, LAWS), SEED, noise="gaussian")
    asked = freed(scene_with(places, START, LAWS), list(START))
    return SolvedLog(log, asked, solve(log, asked, noise=noise))


def two_normals(apart: float) -> Mixture:
    """Return two unit normals so far apart, the second with a third of all."""
    center = np.zeros((2, FREE))
    center[1, 0] = apart
    return mixture_of(center, np.tile(np.eye(FREE), (2, 1, 1)), np.array([2.0, 1.0]))


class BareWalk(NamedTuple):
    """A walk by the stretch move alone.

    Attributes:
        chain: Every step.
        own_tau: emcee's autocorrelation time of the first coordinate [steps]: each
            walker beside its own mean.
        judged: How jblast judges it: all walkers beside one mean.
    """

    chain: Float[np.ndarray, "step walker free"]
    own_tau: float
    judged: Convergence

    def kept(self) -> Float[np.ndarray, "step walker free"]:
        """Return the steps after the first quarter."""
        return self.chain[len(self.chain) // 4 :]


@functools.cache
def from_one(apart: float) -> BareWalk:
    """Walk by the stretch move alone, all walkers in the greater mode."""
    return bare_walk(two_normals(apart), unit_normals(FREE), STEPS)


@functools.cache
def from_both(apart: float) -> BareWalk:
    """Walk by the stretch move alone, half of the walkers in each mode."""
    start = unit_normals(FREE)
    start[::2, 0] += apart
    return bare_walk(two_normals(apart), start, STEPS)


@functools.cache
def by_jblast(apart: float) -> Sampled:
    """Walk as jblast does, half of the walkers in each mode."""
    center = np.asarray(two_normals(apart).center)
    starts = [Start(at, np.eye(FREE), 0.5) for at in center]
    return sample(two_normals(apart), starts, np.eye(FREE), sampler="scan")


def share_beyond(chain: np.ndarray, apart: float) -> float:
    """Return the share of places that belong to the second mode."""
    return float(np.mean(chain[..., 0] > apart / 2))


def found_failure() -> FailureMode:
    """Measure from how far apart the other mode is not found from the first."""
    shares = [share_beyond(from_one(apart).kept(), apart) for apart in MODE_SEPARATIONS]
    missed = 1 - np.array(shares) / LESSER
    # the walks are random: what is missed is taken not to shrink with the distance
    missed = np.maximum.accumulate(missed)
    boundary = boundary_at(
        0.5, missed, np.array(MODE_SEPARATIONS), "stretch move from one mode"
    )
    walk = by_jblast(SEPARATED_SD)
    share = share_beyond(walk.chain[walk.convergence.warm_up :], SEPARATED_SD)
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="from one mode, half of the other is missed",
        boundary=boundary,
        unit="sd between the modes",
        beyond=f"a mode of {LESSER:.0%} of all that is {SEPARATED_SD:g} sd away gets "
        f"{shares[-1]:.1%} in {STEPS} steps",
        response=verified(
            "holds", walk.reached and abs(share - LESSER) < 0.05, "modes"
        ),
        message="walkers start at every optimum the search found and go anew to the "
        f"normals about them: {share:.0%} there, {len(walk.chain)} steps, "
        f"autocorrelation time {walk.convergence.tau.max():.0f}",
    )


class Mirror(NamedTuple):
    """Walks over a charge beside a line of sensors.

    Attributes:
        bare: By the stretch move alone, from the best optimum.
        beyond: How many of its walkers ever stand at the mirror image.
        ours: jblast's.
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
    walk = bare_walk(density, unit_normals(FREE), MIRROR_STEPS)
    north = normal.z[2] + walk.chain @ np.asarray(density.root)[2]
    there = (np.sign(north) != np.sign(normal.z[2])).any(axis=0)
    ours = ensemble(posterior, normal, found.identifiability, found.optima)
    return Mirror(walk, int(there.sum()), ours)


def mirror_failure() -> FailureMode:
    """Measure how many walkers reach the mirror image of a charge."""
    by = mirror()
    shares = [mode.share for mode in by.ours.modes]
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="walkers that never see the mirror image",
        boundary=float(WALKERS - by.beyond),
        unit=f"of {WALKERS}",
        beyond=f"{MIRROR_STEPS} steps from the best optimum: {by.beyond} of {WALKERS} "
        f"walkers ever stand there, and the chain cannot tell: R-hat "
        f"{by.bare.judged.r_hat.max():.3f}, {MIRROR_STEPS / by.bare.own_tau:.0f} "
        "autocorrelation times",
        response=verified(
            "marks", len(shares) == 2 and by.ours.converged, "a mirror image"
        ),
        message=f"both modes are named with their shares, {shares[0]:.0%} and "
        f"{shares[1]:.0%}; autocorrelation time "
        f"{by.ours.convergence.tau.max():.0f}",
    )


def weighed_failure() -> FailureMode:
    """Measure how far off the share of a mode stays where walkers start in both."""
    walk = from_both(SEPARATED_SD)
    share = share_beyond(walk.kept(), SEPARATED_SD)
    tau = walk.judged.tau.max()
    return FailureMode(
        area="walks",
        method="emcee, own autocorrelation time",
        failure="from both modes, the shares stay as started",
        boundary=STEPS / walk.own_tau,
        unit=f"autocorrelation times claimed in {STEPS} steps",
        beyond=f"{SEPARATED_SD:g} sd apart, a mode of {LESSER:.0%} keeps {share:.0%}; "
        f"emcee's autocorrelation time is {walk.own_tau:.0f} steps, its limit of 50 "
        "of them met",
        response=verified(
            "marks", not walk.judged.reached(1.0) and tau > STEPS / 50, "shares"
        ),
        message=f"deviations from the mean of all walkers: {tau:.0f} steps, so the "
        "same walk counts as not converged",
    )


@functools.cache
def along_the_null(steps: int) -> BareWalk:
    """Walk over mass and both speeds by Wu-Hao's laws, from about the optimum."""
    found = wu_hao_told()
    rng = np.random.default_rng(0)
    z = jnp.asarray(found.laplace.z)
    about = Whitened(found.posterior, z, jnp.eye(z.size))
    return bare_walk(about, 0.1 * rng.standard_normal((WALKERS, z.size)), steps)


def null_failure() -> FailureMode:
    """Measure how a walk over a null direction fills it, and looks converged."""
    walk = along_the_null(LONG)
    found = wu_hao_told()
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
        boundary=float(LONG / walk.judged.tau.max()),
        unit=f"autocorrelation times in {LONG} steps",
        beyond=f"ln mass fills {mass.min():.0f} to {mass.max():.0f}, as far as float64 "
        f"goes; autocorrelation time {walk.judged.tau.max():.0f}, R-hat "
        f"{walk.judged.r_hat.max():.3f}: it looks converged",
        response=verified("refuses", refused, "a null direction"),
        message="nothing is walked: improper along charge_mass_kg and the speeds; "
        "expected a prior, or a fixed value",
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
    """Measure how a walk runs down a ridge that does not end."""
    found, ours = endless()
    density = whitened_density(found.posterior, found.laplace, found.identifiability)
    start = np.random.default_rng(0).standard_normal((WALKERS, found.laplace.z.size))
    walks = [bare_walk(density, start, steps) for steps in (SHORT, LONG)]
    low = [np.quantile(_masses(found, walk), 0.05) for walk in walks]
    tau = float(walks[-1].judged.tau.max())
    improper = any(isinstance(f, LongRidge) and f.is_endless for f in ours.findings)
    return FailureMode(
        area="walks",
        method="emcee, arrivals from afar",
        failure="a ridge without end: ever smaller masses arrive with sound",
        boundary=LONG / tau,
        unit=f"autocorrelation times in {LONG} steps",
        beyond=f"the 5 % quantile of the mass is {low[0]:.2g} kg after {SHORT} steps, "
        f"{low[1]:.2g} kg after {LONG}: the walk's length, not the log's word",
        response=verified("marks", improper and not ours.converged, "an endless ridge"),
        message="not converged (exit code 4): the ridge, its ends, and that the "
        "posterior is improper are named",
    )


def _masses(found: Solution, walk: BareWalk) -> np.ndarray:
    z = found.laplace.z[0] + walk.kept() @ root_of(found.laplace)[0]
    return np.exp(z)


def off_at(radius: float) -> float:
    """Return by how many sds an end of a 90 % interval is off for a circle of sensors.

    Args:
        radius: Of the circle [m]; the charge is 60 m from its middle.
    """
    found = _beside(radius)
    return check_intervals(found.posterior, found.laplace).off


def _beside(radius: float) -> Solution:
    return solved_log(circle(radius), 30.0, 60.0, 0.0).solution


def bent_failure() -> FailureMode:
    """Measure from which aperture on the normal approximation does not do."""
    boundary = crossing(lambda r: off_at(r) - MAX_QUANTILE_ERROR, CLOSE, 40.0, to=0.01)
    found = _beside(CLOSE)
    name = found.posterior.parameters.names[0]
    asked, sure = uncertainty(found, "laplace"), uncertainty(found, "auto")
    normal, walked = asked.marginals[name], sure.marginals[name]
    told_of = any(
        isinstance(f, IntervalsOff) and f.parameter == name and not np.isnan(f.off)
        for f in asked.findings
    )
    return FailureMode(
        area="walks",
        method="normal approximation (Laplace)",
        failure="a ridge of mass and range that bends",
        boundary=boundary,
        unit="m radius of eight sensors 60 m away",
        beyond=f"ends of 90 % intervals are off by more than {MAX_QUANTILE_ERROR:g} "
        f"sd; at {CLOSE:g} m by {off_at(CLOSE):.1f}: the mass is "
        f"{_interval(normal)} instead of {_interval(walked)}",
        response=verified(
            "marks",
            told_of and sure.method == "emcee" and sure.converged,
            "a bent ridge",
        ),
        message="a warning names the end that is off by most; --posterior auto walks",
    )


def _interval(marginal: Estimate) -> str:
    return f"{marginal.q05:.3g} to {marginal.q95:.3g} kg"


def bare_walk(
    density: Density,
    start: Float[np.ndarray, "walker free"],
    steps: int,
    seed: int = 0,
) -> BareWalk:
    """Walk from given places.

    Args:
        density: Where to walk.
        start: Where the walkers stand.
        steps: How many steps.
        seed: Of the moves.
    """
    import emcee

    walkers, free = start.shape
    sampler = emcee.EnsembleSampler(
        walkers,
        free,
        lambda w: np.asarray(densities(density, jnp.asarray(w)), float),
        vectorize=True,
    )
    random = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random), steps)
    chain = np.asarray(sampler.get_chain())
    own = emcee.autocorr.integrated_time(chain[..., :1], quiet=True, tol=0)
    return BareWalk(chain, float(own[0]), convergence(chain))


def unit_normals(free: int, seed: int = 0) -> Float[np.ndarray, "walker free"]:
    """Draw walkers from a unit normal."""
    return np.random.default_rng(seed).standard_normal((WALKERS, free))
