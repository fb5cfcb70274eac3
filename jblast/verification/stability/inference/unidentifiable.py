"""What a log cannot tell, and a solver that reports success all the same."""

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jblast.inference import Solution, solve
from jblast.inference.fitting.unidentified import NEAR, other_modes
from jblast.scene import freed
from jblast.sensors import simulate
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.inference.arrival_logs import (
    FITS,
    SEED,
    SENSORS,
    SolvedLog,
    line,
    ring,
    scene_with,
    solved_log,
)
from jblast.verification.stability.inference.stock_solvers import (
    StockFits,
    costs,
    stock_fits,
)
from jblast.verification.stability.threshold import crossing

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


class Solutions(NamedTuple):
    """Solutions of one log from many starts.

    Attributes:
        z: Fitted coordinates of those that report success at the least cost.
        good: How many they are.
    """

    z: np.ndarray
    good: int


def by_stock(solution: Solution, starts: np.ndarray) -> Solutions:
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
    boundary = crossing(lambda bent: mirror_excess(bent) - NEAR, 0.0, 5.0, to=0.01)
    at = solved_log(line(), *MIRRORED).solution
    fits = by_stock(at, poor_starts())
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
    """Whether a log tells one place and one mass."""
    return not len(solution.identifiability.null) and not other_modes(solution, True)


def one_place_failure() -> FailureMode:
    """Measure at how many places sensors have to stand."""
    needed = next(n for n in range(1, SENSORS + 1) if is_told(at_places(n).solution))
    one = at_places(1).solution
    fits = by_stock(one, poor_starts())
    mass = np.exp(fits.z[:, 0])
    null = one.identifiability.null
    return FailureMode(
        area="fits",
        method=f"{LM}, one sensor",
        failure="mass and place from arrivals at fewer places",
        boundary=float(needed),
        unit="places",
        beyond=f"eight arrivals at one place: {fits.good} of {FITS} fits report "
        f"success at the same cost, with {mass.min():.2g} to {mass.max():.2g} kg up to "
        f"{_widest(fits.z[:, 1:]):.0f} m apart",
        response=verified("marks", len(null) == 2, "one sensor"),
        message=f"{len(null)} null directions are named; no value and no interval for "
        "any of the three; exit code 4",
    )


def _widest(places: np.ndarray) -> float:
    apart = places[:, None, :] - places[None, :, :]
    return float(np.sqrt((apart**2).sum(axis=-1)).max())


@functools.cache
def wu_hao_told() -> Solution:
    """Solve arrivals by Wu and Hao's laws with the mass and both speeds unknown."""
    places = ((20.0, 0.0), (0.0, 30.0), (-50.0, 0.0))
    known = scene_with(places, SPEEDS, WU_HAO)
    log = simulate(known, SEED, noise="gaussian")
    return solve(log, freed(known, list(SPEEDS)), noise="gaussian")


def null_direction_failure() -> FailureMode:
    """Measure what masses are reported where no arrival tells them."""
    found = wu_hao_told()
    rng = np.random.default_rng(0)
    low, high = np.log([[0.1, 200.0, 3000.0], [1000.0, 600.0, 8000.0]])
    fits = by_stock(found, rng.uniform(low, high, (FITS, 3)))
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
