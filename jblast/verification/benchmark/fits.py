"""Fit: ways to the optimum of a log, their cost against how often they miss it.

The logs are those of the map of stability: eight arrivals, each of a charge of its own,
and poor starts, which know the mass to a factor of 1,000 and the place to a square of
200 m. All ways start there but `fit_many` and `solve` where they choose for themselves.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from jblast.fidelity.timing import best_of
from jblast.inference import solve
from jblast.progress import in_words
from jblast.sensors import planned_layout
from jblast.sensors.simulate import written
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.stability.inference.poor_starts import (
    OFF,
    Logs,
    best_known,
    draw,
    ours,
)
from jblast.verification.stability.inference.stock_solvers import (
    costs,
    residuals,
    stock_fits,
)

LOGS = 2000
SOLVED = 100
"""Logs for `solve`, which takes one at a time."""
LOOPED = 500
"""Logs for scipy, which does so too."""
REPEATS = 3
STOCK = (
    ("Gauss-Newton", "float64"),
    ("Dogleg", "float64"),
    ("Levenberg-Marquardt", "float64"),
    ("BFGS", "float64"),
    ("Levenberg-Marquardt", "float32"),
    ("BFGS", "float32"),
)
SHORT = {"Levenberg-Marquardt": "LM"}
OWN, POOR = "starts of its own", "poor starts"


class FitOutcome(NamedTuple):
    """Where the fits of a method ended.

    Attributes:
        method: Its name.
        start: Where from, in words.
        seconds: For all fits.
        z: Fitted coordinates of the first so many logs.
    """

    method: str
    start: str
    seconds: float
    z: Float[np.ndarray, "log free"]


def fit_outcomes(logs: Logs, solved: int, looped: int) -> list[FitOutcome]:
    """Fit the logs by every way.

    Args:
        logs: What to fit.
        solved: Logs for `solve`.
        looped: Logs for scipy.
    """
    tell = in_words()
    outcomes = []
    for name, start, given in (
        ("fit_many", OWN, None),
        ("fit_many, poor starts", POOR, logs.starts),
    ):
        tell(name)
        took, fits = best_of(lambda given=given: ours(logs, given), REPEATS)
        outcomes.append(FitOutcome(name, start, took, np.asarray(fits.z)))
    for name, precision in STOCK:
        words = SHORT.get(name, name)
        words += "" if precision == "float64" else f", {precision}"
        tell(words)
        took, stock = best_of(
            lambda name=name, precision=precision: stock_fits(
                name, logs.blank, logs.readings, logs.starts, precision
            ),
            REPEATS,
        )
        outcomes.append(FitOutcome(words, POOR, took, stock.z))
    for name, start, fit, number in (
        ("scipy, lm", POOR, by_scipy, looped),
        ("solve", OWN, by_solve, solved),
    ):
        tell(name)
        took, z = best_of(
            lambda fit=fit, number=number: fit(logs, number),
            1,
            lambda fit=fit: fit(logs, 1),
        )
        outcomes.append(FitOutcome(name, start, took, z))
    return outcomes


def by_scipy(logs: Logs, count: int) -> Float[np.ndarray, "log free"]:
    """Fit the first logs from their poor starts by MINPACK, one after another."""
    function = jax.jit(lambda z, measured: residuals(z, (logs.blank, measured)))
    slopes = jax.jit(jax.jacfwd(lambda z, m: residuals(z, (logs.blank, m))))

    def jacobian(measured) -> Any:  # scipy's types know of no function here
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
    """Count the fits off the optimum of each method.

    Off is an end less probable, beside the best that any method found or that a fit
    from the truth ends at, than 0.1 standard deviations of one number would make it. In
    float64 the count is the same for any limit down to 1e-9 in cost; rounding alone
    takes float32 over that.
    """

    def cost(z: Float[np.ndarray, "log free"]) -> Float[np.ndarray, " log"]:
        measured = jnp.asarray(logs.readings[: len(z)])
        return np.array(costs(logs.blank, measured, jnp.asarray(z)))

    least = cost(best_known(logs))
    each = [cost(outcome.z) for outcome in outcomes]
    for found in each:
        least[: len(found)] = np.fmin(least[: len(found)], found)
    return [int(np.sum(~(found - least[: len(found)] <= OFF))) for found in each]


def fit_points(
    count: int = LOGS,
    solved: int = SOLVED,
    looped: int = LOOPED,
) -> list[BenchmarkPoint]:
    """Return the cost of a fit by every method, and the share that misses the optimum.

    None of N counts as half a log of N.

    Args:
        count: How many logs.
        solved: Logs for `solve`.
        looped: Logs for scipy.
    """
    logs = draw(count)
    outcomes = fit_outcomes(logs, solved, looped)
    return [
        BenchmarkPoint(
            of.method,
            of.seconds / len(of.z),
            max(off, 0.5) / len(of.z),
            f"{off} of {len(of.z):,} off, {of.start}",
        )
        for of, off in zip(outcomes, missed(logs, outcomes), strict=True)
    ]


register_benchmark(
    Benchmark(
        name="fit",
        title="Finding the optimum of a log: cost against misses",
        cost=f"time of a fit, {LOGS:,} at once; scipy's and solve's one by one",
        error="share that ends off the optimum; half a log if none does",
        measure=fit_points,
    )
)
