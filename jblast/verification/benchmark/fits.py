r"""Fits, samplers and Monte Carlo: cost against error.

Fit: methods to find the optimum of a log, their cost against the share of failures. The
logs are those of `verification.stability.fits`: eight arrivals of one charge each, with
poor starts from 1 to 1,000 kg and from a square of 200 m. `fit_many` and `solve` also
run from starts of their own choice.

Sampler: methods to compute 90 % intervals of a posterior. The case is that of five
microphones (`calibration.cases`), whose optimum is known. The reference is a
long run of the compiled sampler; its error is half the difference between its first and
second half.

Monte Carlo: random draws and Sobol' points, for a pressure of three uncertain
parameters whose mean and probability are known: peak pressure falls with the scaled
distance $Z = R\,W^{-1/3}$ alone, and $\ln Z$ is normal where $\ln R$ and $\ln W$
are. So the probability of a pressure above a threshold is that of $Z$ below a root,
averaged over the scatter of the law by Gauss-Hermite quadrature. An error is the rms
over repetitions of the difference from the exact value.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import least_squares, root_scalar
from scipy.special import ndtr

from calibration.cases import MICROPHONE_LAWS, TRUTH, scene_with
from jblast.fidelity.timing import best_of
from jblast.inference import Posterior, solve
from jblast.inference.identifiability import Identifiability, identifiability
from jblast.inference.importance import Importance, importance, weighted_quantiles
from jblast.inference.mcmc.engines import (
    BLOCK,
    Emcee,
    Engine,
    Scan,
    WalkState,
    mixture_of,
)
from jblast.inference.mode.laplace import NORMAL_Q95, Laplace, laplace
from jblast.inference.mode.search import optima
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.whitening import Density, Whitened, densities, whitened_density
from jblast.progress import in_words
from jblast.scene import UncertainScene, freed
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale
from jblast.sensors.simulated_readings import written
from jblast.study.sampling.draws import points_of
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.stability.fits import (
    MISFIT_LIMIT,
    Logs,
    best_known,
    costs,
    draw,
    ours,
    residuals,
    stock_fits,
)
from jblast.waves import kingery_bulmash_pressure

DIMENSIONS = 3
"""Uncertain parameters of the pressure: mass, range and scatter."""
# Powers of two: a Sobol sequence is balanced only there.
SAMPLES = (1 << 10, 1 << 14, 1 << 18)
"""Samples of an estimate."""
# Estimates with other seeds; the standard error of their rms is 18 %, 1/sqrt(2 x 16).
REPETITIONS = 16
COMMON_PA = 12e3
"""Pressure that about one sample in twenty exceeds [Pa]."""
Estimate = Callable[[int], float]
"""Function from a seed to an estimate."""
# Factors of five or more: the slope of error against cost is visible on the chart.
STEPS = (200, 1000, 5000)
"""Steps of the walks."""
DRAWS = (500, 4000, 30_000)
"""Draws of importance sampling."""
# Four times the longest compared walk, so that the error of the reference is half.
REFERENCE = 20_000
"""Steps of the reference walk."""
RUNS = 3
"""Runs of the longest walk, which differ by the seed."""
MAX_RUNS = 5
"""Largest number of runs of shorter walks, whose errors vary more."""
REFERENCE_SEED = 100
"""Seed of the reference walk, different from those of all other runs."""
Interval = Float[np.ndarray, "2 free"]
# The standard error of a failure rate of 1 % is then 0.2 %.
LOGS = 2000
SOLVED = 100
"""Logs for `solve`, which fits one at a time."""
LOOPED = 500
"""Logs for scipy, which also fits one at a time."""
# The least of three: other load can only lengthen a call.
REPEATS = 3
STOCK = (
    ("Gauss-Newton", "float64"),
    ("Dogleg", "float64"),
    ("Levenberg-Marquardt", "float64"),
    ("BFGS", "float64"),
    ("Levenberg-Marquardt", "float32"),
    ("BFGS", "float32"),
)
ABBREVIATIONS = {"Levenberg-Marquardt": "LM"}
OWN_STARTS, POOR_STARTS = "own starts", "poor starts"
MASS_KG, MASS_FACTOR = 15.0, 1.5
"""Median of the charge mass [kg], and its standard deviation as a factor."""
RANGE_M, RANGE_FACTOR = 40.0, 1.05
"""The same of the range [m]."""
SCATTER = 0.1
"""Standard deviation of ln pressure about the law."""
# Half as many agree to 1e-9.
NODES = 120
"""Nodes of the quadrature."""
# Any number: the log is fixed by it.
LOG_SEED = 11
# Many walkers cost little in one compiled scan.
WALKERS = 256
SHARES = (0.05, 0.95)
"""Quantiles at the bounds of the 90 % interval."""
# Walks start from the normal approximation, so that a tenth is ample.
WARM_UP = 10
"""Divisor of the length of a walk that gives its warm-up."""


def pressure(u: Float[Array, "3"]) -> Float[Array, ""]:
    """Return the peak pressure of a sample in standard normal coordinates [Pa]."""
    law = kingery_bulmash_pressure(
        RANGE_M * RANGE_FACTOR ** u[1],
        MASS_KG * MASS_FACTOR ** u[0],
    )
    return law * jnp.exp(SCATTER * u[2])


def probability_above(threshold_pa: float) -> float:
    """Return the probability of a pressure above a threshold, by quadrature."""
    log_pressure = jax.jit(
        lambda log_z: jnp.log(kingery_bulmash_pressure(jnp.exp(log_z), 1.0))
    )
    middle, sd = _log_z()
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    total = 0.0
    for node, weight in zip(nodes, weights / weights.sum(), strict=True):
        # At a given scatter the pressure falls with Z, and ln Z is normal.
        target = np.log(threshold_pa) - SCATTER * node
        root = root_scalar(
            lambda z, target=target: float(log_pressure(jnp.asarray(z))) - target,
            bracket=(np.log(0.2), np.log(1e4)),
            xtol=1e-12,
        ).root
        total += weight * ndtr((root - middle) / sd)
    return float(total)


def mean_pressure() -> float:
    """Return the mean pressure, by quadrature [Pa]."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    middle, sd = _log_z()
    values = kingery_bulmash_pressure(jnp.exp(middle + sd * nodes), jnp.ones(NODES))
    mean = float(np.asarray(values) @ weights / weights.sum())
    # The mean of the log-normal scatter.
    return mean * float(np.exp(0.5 * SCATTER**2))


def _log_z() -> tuple[float, float]:
    """Return mean and standard deviation of ln of the scaled distance."""
    middle = np.log(RANGE_M) - np.log(MASS_KG) / 3
    spread = np.hypot(np.log(RANGE_FACTOR), np.log(MASS_FACTOR) / 3)
    return float(middle), float(spread)


def one_posterior() -> Posterior:
    """Return the posterior of one simulated log, with exact laws."""
    scene = scene_with(scatter=False)
    layout, sigma, _ = planned_layout(scene)
    read = observe(jax.random.key(LOG_SEED), scene, layout, MICROPHONE_LAWS, sigma)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    measured = to_error_scale(read, layout.quantity)
    return Posterior(
        parameters, layout, measured, sigma, tuple(MICROPHONE_LAWS.items())
    )


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


def montecarlo_points(
    samples: tuple[int, ...] = SAMPLES,
    repetitions: int = REPETITIONS,
) -> list[BenchmarkPoint]:
    """Return cost and error of each estimate of a mean and of a probability.

    Args:
        samples: Numbers of samples of an estimate.
        repetitions: Repetitions of each estimate, which differ by the seed.
    """
    progress = in_words()
    found: list[BenchmarkPoint] = []

    def add(panel: str, method: str, number: int, true: float, estimate: Estimate):
        progress(f"{panel}: {method}, {number:,}")
        seconds, _ = best_of(lambda: estimate(0), 3)
        deviations = [estimate(seed) / true - 1 for seed in range(repetitions)]
        error = float(np.sqrt(np.mean(np.square(deviations))))
        span = f"{number:,} samples, {repetitions} repetitions"
        short = f"{number / 2**20:g}M" if number >= 2**20 else f"{number / 2**10:g}k"
        found.append(BenchmarkPoint(f"{method} {short}", seconds, error, span, panel))

    generators = {"plain": random_scores, "Sobol": sobol_scores}
    for name, scores in generators.items():
        for number in samples:
            add(
                "mean pressure",
                name,
                number,
                mean_pressure(),
                lambda seed, n=number, of=scores: float(
                    np.mean(pressures(of(n, DIMENSIONS, seed)))
                ),
            )
    true = probability_above(COMMON_PA)
    for name, scores in generators.items():
        for number in samples:
            add(
                f"probability of {true:.2g}",
                name,
                number,
                true,
                lambda seed, n=number, of=scores: float(
                    np.mean(pressures(of(n, DIMENSIONS, seed)) > COMMON_PA)
                ),
            )
    return found


def random_scores(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Return standard normal scores."""
    return np.random.default_rng(seed).standard_normal((count, dimensions))


def sobol_scores(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Return standard normal scores of scrambled Sobol' points."""
    points = points_of("sobol", dimensions, count, seed, "")
    assert points is not None
    return points(0, count)


# Compiled once for all calls: a `jit` inside the function would trace at each call.
_PRESSURES = jax.jit(jax.vmap(pressure))


def pressures(scores: np.ndarray) -> np.ndarray:
    """Return the pressures of draws [Pa]."""
    return np.asarray(_PRESSURES(jnp.asarray(scores)))


register_benchmark(
    Benchmark(
        name="montecarlo",
        title="Monte Carlo: cost against standard error, by number of samples",
        cost="time of an estimate",
        error="rms over repetitions, relative to the exact value",
        measure=montecarlo_points,
    )
)


class Solved(NamedTuple):
    """Common input of all samplers.

    Attributes:
        posterior: The posterior.
        identified: Directions that the log identifies.
        normal: Normal approximation.
        seconds: Time of the normal approximation, with the optimum known.
        density: The posterior in whitened coordinates.
    """

    posterior: Posterior
    identified: Identifiability
    normal: Laplace
    seconds: float
    density: Whitened


def solved() -> Solved:
    """Find the optimum and the normal approximation."""
    posterior = one_posterior()
    z = np.asarray(optima(jax.random.key(0), posterior).z[0])
    identified = identifiability(posterior, z)
    seconds, normal = best_of(
        lambda: laplace(posterior, z, identified.identified_basis)
    )
    density = whitened_density(posterior, normal, identified)
    return Solved(posterior, identified, normal, seconds, density)


def weighted_ends(found: Importance, normal: Laplace) -> Interval:
    """Return the interval bounds of weighted draws, relative to the optimum."""
    deviation = (found.z - normal.z).T
    return np.array([weighted_quantiles(x, found.weights, SHARES) for x in deviation]).T


def sampler_points(
    steps: tuple[int, ...] = STEPS,
    draws: tuple[int, ...] = DRAWS,
    reference: int = REFERENCE,
    runs: int = RUNS,
) -> list[BenchmarkPoint]:
    """Return the cost of every sampler at several lengths, and the interval error.

    The error is that of the worst bound of any parameter, rms over the runs. Errors
    below the uncertainty of the reference are set to that uncertainty.

    Args:
        steps: Steps of walks, 100 or more.
        draws: Draws of importance sampling.
        reference: Steps of the reference walk.
        runs: Runs of the longest of each method; shorter ones have up to `MAX_RUNS`.
    """
    progress = in_words()
    progress("the optimum")
    case = solved()
    free, axes = case.normal.z.size, np.asarray(case.density.root)
    progress("the reference")
    long, took = timed_walk(Scan(), case.density, free, reference, REFERENCE_SEED)
    long = long @ axes.T
    true, sd = interval_ends(long), long.reshape(-1, free).std(axis=0)
    # Two halves differ by twice the error of the whole, if they are independent.
    half = len(long) // 2
    halves = interval_ends(long[:half]) - interval_ends(long[half:])
    uncertainty = 0.5 * float(np.max(np.abs(halves) / sd))
    over = f"{free} parameters, 90 % intervals"
    points = []

    def add(method: str, seconds: float, ends: list[Interval], words: str = "") -> None:
        # in posterior sds, so that parameters of all units compare
        worst = [np.max(np.abs(one - true) / sd) for one in ends]
        error = max(uncertainty, float(np.sqrt(np.mean(np.square(worst)))))
        points.append(
            BenchmarkPoint(method, case.seconds + seconds, error, over + words)
        )

    for name, sampler in (("emcee", Emcee()), ("one scan", Scan())):
        for number in steps:
            progress(f"{name}, {number} steps")
            times = min(runs * max(steps) // number, MAX_RUNS)
            walked = [
                timed_walk(sampler, case.density, free, number, seed)
                for seed in range(times)
            ]
            add(
                f"{name}, {number:,} steps",
                min(seconds for _, seconds in walked),
                [interval_ends(chain @ axes.T) for chain, _ in walked],
                f", {WALKERS} walkers, {times} runs",
            )
    for number in draws:
        progress(f"importance sampling, {number} draws")
        times = min(runs * max(draws) // number, MAX_RUNS)
        drawn = [
            best_of(
                lambda number=number, seed=seed: importance(
                    case.posterior, case.normal, seed=seed, draws=number
                ),
                1,
            )
            for seed in range(times)
        ]
        add(
            f"importance, {number:,} draws",
            min(seconds for seconds, _ in drawn),
            [weighted_ends(found, case.normal) for _, found in drawn],
            f", {times} runs",
        )
    sds = np.sqrt(np.diag(case.normal.covariance))
    add("Laplace", 0.0, [np.outer([-NORMAL_Q95, NORMAL_Q95], sds)])
    points.append(
        BenchmarkPoint(
            f"one scan, {reference:,} steps",
            case.seconds + took,
            uncertainty,
            f"{over}, {WALKERS} walkers",
            is_reference=True,
        )
    )
    return points


register_benchmark(
    Benchmark(
        name="sampler",
        title="Sampling a posterior: cost against error",
        cost="time of a run, with the optimum known",
        error="worst bound of a 90 % interval [posterior sd], or that of the reference",
        measure=sampler_points,
        relative=False,
    )
)


class FitOutcome(NamedTuple):
    """Fits of the first logs by one method.

    Attributes:
        method: Name of the method.
        start: Description of the starts.
        seconds: Time of all fits.
        z: Fitted coordinates, one row for each fitted log.
    """

    method: str
    start: str
    seconds: float
    z: Float[np.ndarray, "log free"]


def fit_outcomes(logs: Logs, solved: int, looped: int) -> list[FitOutcome]:
    """Fit the logs by every method.

    Args:
        logs: The logs.
        solved: Number of logs for `solve`.
        looped: Number of logs for scipy.
    """
    progress = in_words()
    outcomes = []
    for name, start, given in (
        ("fit_many", OWN_STARTS, None),
        ("fit_many, poor starts", POOR_STARTS, logs.starts),
    ):
        progress(name)
        took, fits = best_of(lambda given=given: ours(logs, given), REPEATS)
        outcomes.append(FitOutcome(name, start, took, np.asarray(fits.z)))
    for name, precision in STOCK:
        words = ABBREVIATIONS.get(name, name)
        words += "" if precision == "float64" else f", {precision}"
        progress(words)
        took, stock = best_of(
            lambda name=name, precision=precision: stock_fits(
                name, logs.blank, logs.readings, logs.starts, precision
            ),
            REPEATS,
        )
        outcomes.append(FitOutcome(words, POOR_STARTS, took, stock.z))
    for name, start, fit, number in (
        ("scipy, lm", POOR_STARTS, by_scipy, looped),
        ("solve", OWN_STARTS, by_solve, solved),
    ):
        progress(name)
        took, z = best_of(
            lambda fit=fit, number=number: fit(logs, number),
            1,
            lambda fit=fit: fit(logs, 1),
        )
        outcomes.append(FitOutcome(name, start, took, z))
    return outcomes


def by_scipy(logs: Logs, count: int) -> Float[np.ndarray, "log free"]:
    """Fit the first logs from their poor starts by MINPACK, one after another."""
    # Readings as an argument, not a constant: one program serves all logs.
    function = jax.jit(lambda z, measured: residuals(z, (logs.blank, measured)))
    slopes = jax.jit(jax.jacfwd(lambda z, m: residuals(z, (logs.blank, m))))

    def jacobian(measured) -> Any:  # the stubs of scipy accept no function here
        return lambda z: np.asarray(slopes(z, measured))

    return np.array(
        [
            least_squares(
                lambda z, m=measured: np.asarray(function(z, m)),
                start,
                jac=jacobian(measured),
                method="lm",
                x_scale="jac",
            ).x
            for measured, start in zip(
                logs.readings[:count], logs.starts[:count], strict=True
            )
        ]
    )


def by_solve(logs: Logs, count: int) -> Float[np.ndarray, "log free"]:
    """Fit the first logs by `solve`, one after another."""
    scene = logs.uncertain.scene
    layout, sigma, names = planned_layout(scene)
    found = (
        solve(
            written(scene, layout, readings, np.asarray(sigma), names),
            logs.uncertain,
            noise="gaussian",
        )
        for readings in logs.readings[:count]
    )
    return np.array([np.asarray(one.optima.z[0]) for one in found])


def missed(logs: Logs, outcomes: list[FitOutcome]) -> list[int]:
    """Return the number of fits of each method that miss the optimum.

    The optimum is the best fit of any method or from the truth. A fit misses it if its
    likelihood is lower than a shift of one parameter by 0.1 standard deviations would
    make it. In float64 the count is the same for any limit down to 1e-9 in cost. In
    float32 rounding alone exceeds that.
    """

    def cost(z: Float[np.ndarray, "log free"]) -> Float[np.ndarray, " log"]:
        measured = jnp.asarray(logs.readings[: len(z)])
        return np.array(costs(logs.blank, measured, jnp.asarray(z)))

    # fmin ignores NaN: a method that diverged does not define the optimum
    least = cost(best_known(logs))
    each = [cost(outcome.z) for outcome in outcomes]
    for found in each:
        least[: len(found)] = np.fmin(least[: len(found)], found)
    return [
        int(np.sum(~(found - least[: len(found)] <= MISFIT_LIMIT))) for found in each
    ]


def fit_points(
    count: int = LOGS,
    solved: int = SOLVED,
    looped: int = LOOPED,
) -> list[BenchmarkPoint]:
    """Return the cost of a fit by every method, and the share that misses the optimum.

    No miss in N logs counts as half a log, since the chart is logarithmic.

    Args:
        count: Number of logs.
        solved: Number of logs for `solve`.
        looped: Number of logs for scipy.
    """
    logs = draw(count)
    outcomes = fit_outcomes(logs, solved, looped)
    return [
        BenchmarkPoint(
            outcome.method,
            outcome.seconds / len(outcome.z),
            max(misses, 0.5) / len(outcome.z),
            f"{misses} of {len(outcome.z):,} missed, {outcome.start}",
        )
        for outcome, misses in zip(outcomes, missed(logs, outcomes), strict=True)
    ]


register_benchmark(
    Benchmark(
        name="fit",
        title="Finding the optimum of a log: cost against misses",
        cost=f"time of a fit, {LOGS:,} at once; scipy and solve one by one",
        error="share that misses the optimum; half a log if none does",
        measure=fit_points,
    )
)
