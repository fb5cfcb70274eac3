"""Gauss-Newton, BFGS and Levenberg-Marquardt from poor starts, and what they report.

Logs of eight arrivals, each of a charge of its own (5 to 200 kg, within 20 m of the
middle of the sensors), from starts that know the mass to a factor of 1,000 and the
place to a square of 200 m. An end is off where its likelihood is less than 0.1 standard
deviations of one number would make it, beside the best end known.
"""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.inference import ManyFits, Posterior, fit_many, solve
from jblast.inference.mode.search import SAME
from jblast.observations import Observations
from jblast.scene import UncertainScene
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.inference.arrival_logs import (
    FITS,
    LAWS,
    SIGMA,
    ring,
    solved_log,
)
from jblast.verification.stability.inference.stock_solvers import (
    SOLVERS,
    TOLERANCE,
    costs,
    stock_fits,
)

SOLVED = 5
"""Logs that `solve`, which takes one at a time, is tried on."""
OFF = 0.5 * SAME**2


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
