"""Fit the curve of `waves/laws/ground_motion.py` and its scatter to recordings.

How effects are integrated out stands in `random_effects.py`.
"""

import csv
import itertools
import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from calibration.likelihood_maximum import likelihood_maximum
from calibration.random_effects import Marginal, marginal
from jblast.waves.laws.ground_motion import (
    GroundMotionCurve,
    log_curve,
    log_gradient,
    log_scaled_place,
)

DATA = Path(__file__).parent / "data" / "seismic_ford2021.csv"
QUANTITIES = ("ground_displacement_m", "ground_peak_velocity_m_s")
COEFFICIENTS = ("b1", "b2", "b3", "b4", "b5")
SCATTERS = ("site", "shot", "path", "record")
NAMES = COEFFICIENTS + SCATTERS
EXPECTED_SD = {"site": 1.0, "shot": 1.0}
"""Mode of the prior on two scatters [ln], Gamma of shape 2: wide (90 % from 0.36 to
4.7), it excludes that a few sites have no scatter at all. It lowers the most probable
site scatter by 6 % and raises that of shots by 2 %."""
SD_GRID = np.geomspace(0.05, 12.0, 18)
"""Site and shot scatters that the posterior is summed over [ln]: steps of 38 %, about
one and a half of its standard deviations, enough for sums over an even grid."""

STARTS = {
    "ground_displacement_m": (-11.0, -1.4, 1.2, 15.0, -0.2, 1.4, 0.1, 0.4, 0.26),
    "ground_peak_velocity_m_s": (-0.6, -1.8, 1.2, 15.0, -0.2, 0.5, 0.1, 0.4, 0.39),
}


class Records(NamedTuple):
    """One row a record; the first part of a path's name is its site."""

    shot: np.ndarray
    site: np.ndarray
    path: np.ndarray
    charge_mass: np.ndarray
    height_of_burst: np.ndarray
    slant_range: np.ndarray
    log_value: dict[str, np.ndarray]

    def place(self) -> tuple[jax.Array, jax.Array]:
        """Return ln Z and the scaled height [m/kg^(1/3)]."""
        return log_scaled_place(
            self.slant_range, self.charge_mass, self.height_of_burst
        )


class Form(NamedTuple):
    """What is held at a value instead of fitted, and how records err."""

    held: tuple[tuple[str, float], ...] = ()
    nu: float = math.inf


class Fit(NamedTuple):
    """A curve, and what it reached; the prior tells the last two apart."""

    curve: GroundMotionCurve
    log_likelihood: float
    log_posterior: float
    n_free: int


@cache
def read_records() -> Records:
    """Read all 200 records; values are ln of y/S."""
    with DATA.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))

    def text(name: str) -> np.ndarray:
        return np.array([row[name] for row in rows])

    def number(name: str) -> np.ndarray:
        return text(name).astype(float)

    mass = number("yield_kg")
    return Records(
        shot=text("source"),
        site=np.array([row["path"].split("-")[0] for row in rows]),
        path=text("path"),
        charge_mass=mass,
        height_of_burst=number("hob_m"),
        slant_range=number("range_m"),
        log_value={
            "ground_displacement_m": np.log(
                number("p_wave_displacement") / np.cbrt(mass)
            ),
            "ground_peak_velocity_m_s": np.log(number("p_wave_max_velocity")),
        },
    )


@cache
def objective(quantity: str, form: Form, restricted: bool):
    """Return minus the log posterior, the marginal and the gradient, compiled.

    It takes the values of `NAMES` and the weights of the records. Restricted
    likelihoods integrate the free coefficients too, from those values on.
    """
    records = read_records()
    place, value = records.place(), jnp.asarray(records.log_value[quantity])
    groups = [
        np.unique(names, return_inverse=True)[1]
        for names in (records.site, records.shot, records.path)
    ]
    held, n = dict(form.held), len(COEFFICIENTS)
    sizes = [int(index.max()) + 1 for index in groups]
    inner = np.array(
        [i for i, name in enumerate(COEFFICIENTS) if restricted and name not in held],
        int,
    )
    ends = np.cumsum([len(inner), *sizes])

    def cost(theta: jax.Array, weight: jax.Array) -> tuple[jax.Array, Marginal]:
        def predict(theta: jax.Array, x: jax.Array) -> jax.Array:
            curve = log_curve(theta[:n].at[inner].set(x[: len(inner)]), *place)
            for sd, index, (start, stop) in zip(
                theta[n:-1], groups, itertools.pairwise(ends), strict=True
            ):
                curve += sd * x[start:stop][index]
            return curve

        start = jnp.concatenate([theta[inner], jnp.zeros(sum(sizes))])
        precision = jnp.concatenate([jnp.zeros(len(inner)), jnp.ones(sum(sizes))])
        integral = marginal(predict, theta, precision, start, value, weight, form.nu)
        log_prior = 0.0
        for name, mode in EXPECTED_SD.items():
            if restricted and name not in held:
                sd = theta[NAMES.index(name)]
                log_prior += jnp.log(sd) - sd / mode
        return -integral.log_likelihood - log_prior, integral

    return jax.jit(jax.value_and_grad(cost, has_aux=True))


def predictive(
    quantity: str, form: Form, weight: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Return values with the scatter of a new shot, and the covariance with it.

    The variance of a new site's effect is the posterior mean of $\sigma^2$, not the
    square of the most probable $\sigma$: of three or four sites the scatter is known
    to a factor of two, and the mode is too small. The curve is linear about its most
    probable coefficients for the sum over both scatters; path and record scatter, which
    many records determine, stay. Coefficients are then those of generalised least
    squares with these scatters.

    Args:
        quantity: Of `QUANTITIES`.
        form: What is fitted.
        weight: 1 for a record that is used, 0 for one left out.
        values: The most probable coefficients and scatters.
    """
    records, used, n = read_records(), weight > 0, len(COEFFICIENTS)
    held = dict(form.held)
    inner = [i for i, name in enumerate(COEFFICIENTS) if name not in held]
    place, b = records.place(), jnp.asarray(values[:n])
    left = np.asarray(records.log_value[quantity] - log_curve(b, *place))[used]
    slopes = np.asarray(log_gradient(b, *place))[used][:, inner]
    alike = [
        np.equal.outer(names[used], names[used])
        for names in (records.site, records.shot, records.path)
    ]
    path_sd, record_sd = values[n + 2 :]
    known = path_sd**2 * alike[2] + record_sd**2 * np.eye(used.sum())
    grids = [
        np.array([held[name]]) if name in held else SD_GRID for name in SCATTERS[:2]
    ]
    density = np.zeros([grid.size for grid in grids])
    for (i, site), (j, shot) in itertools.product(*map(enumerate, grids)):
        covariance = known + site**2 * alike[0] + shot**2 * alike[1]
        solved = np.linalg.solve(covariance, np.column_stack([slopes, left]))
        information = slopes.T @ solved[:, :-1]
        pull = slopes.T @ solved[:, -1]
        density[i, j] = -0.5 * (
            np.linalg.slogdet(covariance)[1]
            + np.linalg.slogdet(information)[1]
            + left @ solved[:, -1]
            - pull @ np.linalg.solve(information, pull)
        )
        for name, sd in (("site", site), ("shot", shot)):
            if name not in held:  # prior, and the step of a geometric grid
                density[i, j] += np.log(sd) - sd / EXPECTED_SD[name] + np.log(sd)
    share = np.exp(density - density.max())
    share /= share.sum()
    values = values.copy()
    for place_of, axis, grid in zip((n, n + 1), (1, 0), grids, strict=True):
        values[place_of] = np.sqrt(share.sum(axis=axis) @ grid**2)
    (_, end), _ = objective(quantity, form, True)(values, jnp.asarray(weight))
    values[inner] = end.mode[: len(inner)]
    covariance = np.zeros((n, n))
    covariance[np.ix_(inner, inner)] = end.covariance[: len(inner), : len(inner)]
    return values, covariance


def fit(
    quantity: str,
    form: Form,
    *,
    restricted: bool = True,
    weight: np.ndarray | None = None,
) -> Fit:
    """Fit one quantity.

    Args:
        quantity: Of `QUANTITIES`.
        form: What is fitted.
        restricted: Whether to integrate over the coefficients (for estimates), or to
            maximise over them too (for AIC).
        weight: 1 for a record that is used, 0 for one left out.

    Raises:
        RuntimeError: The search ended away from a maximum.
    """
    held = dict(form.held)
    start = zip(NAMES, STARTS[quantity], strict=True)
    fitted = SCATTERS if restricted else NAMES
    n = len(COEFFICIENTS)
    weights = np.ones(len(read_records().shot)) if weight is None else weight
    found = likelihood_maximum(
        objective(quantity, form, restricted),
        weights,
        np.array([held.get(name, value) for name, value in start]),
        np.array([NAMES.index(name) for name in fitted if name not in held]),
        [i for i, name in enumerate(COEFFICIENTS) if name not in held],
        n,
        restricted=restricted,
    )
    values, covariance = found.values, found.covariance
    if restricted:
        values, covariance = predictive(quantity, form, weights, values)
    return Fit(
        curve=GroundMotionCurve(values[:n], covariance, *values[n:]),
        log_likelihood=found.log_likelihood,
        log_posterior=found.log_posterior,
        n_free=len(NAMES) - len(held),
    )
