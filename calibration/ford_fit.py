"""Fit the curve of `jblast/waves/ford_curve.py` and its scatter to the recordings.

The model stands in `ford_2021.py`, its likelihood in `random_effects.py`.
"""

import itertools
from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from calibration.ford_records import read_records
from calibration.random_effects import Marginal, marginal
from jblast.waves.ford_curve import FordCurve, log_curve, log_scaled_place
from jblast.waves.scaling import sachs_impulse_factor, sachs_time_factor

COEFFICIENTS = ("b1", "b2", "b3", "b4")
SCATTERS = ("site", "shot", "burial", "path", "record")
NAMES = COEFFICIENTS + SCATTERS
GUARDED = ("site", "shot")
EXPECTED_SD = 0.1
"""Mode of the prior on the guarded scatter [ln]: weather, wind and terrain."""

SMALLEST_SD = 1e-3
STARTS = {
    "positive_impulse_pa_s": (
        (6.5, -1.15, 12.0, 0.4, 0.1, 0.06, 1.0, 0.15, 0.1),
        (6.8, -1.15, 5.0, 1.0, 0.1, 0.15, 0.6, 0.15, 0.1),
    ),
    "positive_duration_s": ((-5.3, 0.22, 0.7, 1.0, 0.05, 0.12, 0.6, 0.11, 0.1),),
}
"""Values of `NAMES` where searches begin; the best end is taken."""


class Form(NamedTuple):
    """What is held at a value instead of fitted, and how records err."""

    fixed: tuple[tuple[str, float], ...] = ()
    nu: float = 4.0


class Fit(NamedTuple):
    """A fitted curve, and what it reached; the prior tells the two apart."""

    curve: FordCurve
    log_likelihood: float
    log_posterior: float
    n_free: int


@cache
def objective(quantity: str, form: Form, restricted: bool):
    """Return minus the log-likelihood, the marginal and the gradient, compiled.

    It takes the values of `NAMES` and the weights of the records. Restricted
    likelihoods integrate the free coefficients too, from those values on.
    """
    records = read_records()
    place = log_scaled_place(
        records.slant_range,
        records.charge_mass,
        records.height_of_burst,
        records.ambient_pressure,
    )
    factor = (sachs_impulse_factor if "impulse" in quantity else sachs_time_factor)(
        records.charge_mass, records.ambient_pressure, records.sound_speed
    )
    value = jnp.log(records.value[quantity]) - jnp.log(factor)
    depth = jnp.maximum(-place[1], 0.0)
    site, shot, path = (
        np.unique(names, return_inverse=True)[1]
        for names in (records.site, records.shot, records.path)
    )
    held = dict(form.fixed)
    guarded = np.array([NAMES.index(name) for name in GUARDED if name not in held], int)
    sizes = [int(index.max()) + 1 for index in (site, shot, path)]
    inner = np.array(
        [i for i, name in enumerate(COEFFICIENTS) if restricted and name not in held],
        int,
    )

    def integrate(theta: jax.Array, weight: jax.Array) -> Marginal:
        def predict(theta: jax.Array, x: jax.Array) -> jax.Array:
            site_sd, shot_sd, burial_sd, path_sd, _ = theta[4:]
            spread = jnp.sqrt(shot_sd**2 + (burial_sd * depth) ** 2)
            coefficients = theta[:4].at[inner].set(x[: len(inner)])
            ends = np.cumsum([len(inner), *sizes])
            of_site, of_shot, of_path = (x[a:b] for a, b in itertools.pairwise(ends))
            shared = site_sd * of_site[site] + spread * of_shot[shot]
            return log_curve(coefficients, *place) + shared + path_sd * of_path[path]

        start = jnp.concatenate([theta[inner], jnp.zeros(sum(sizes))])
        precision = jnp.concatenate([jnp.zeros(len(inner)), jnp.ones(sum(sizes))])
        return marginal(predict, theta, precision, start, value, weight, form.nu)

    def cost(theta: jax.Array, weight: jax.Array) -> tuple[jax.Array, Marginal]:
        integral = integrate(theta, weight)
        sds = theta[guarded]
        log_prior = jnp.sum(jnp.log(sds) - sds / EXPECTED_SD) if restricted else 0.0
        return -integral.log_likelihood - log_prior, integral

    return jax.jit(jax.value_and_grad(cost, has_aux=True))


def fit(
    quantity: str,
    form: Form,
    *,
    restricted: bool = True,
    weight: np.ndarray | None = None,
) -> Fit:
    """Fit one quantity from all starts, and return the best.

    Args:
        quantity: Its name in observation files.
        form: What is fitted.
        restricted: Whether to integrate over the coefficients (for estimates), or to
            maximise over them too (for AIC).
        weight: 1 for a record that is used, 0 for one left out.

    Raises:
        RuntimeError: Every search ended away from a maximum.
    """
    weights = np.ones(len(read_records().shot)) if weight is None else weight
    ends, failures = [], []
    for start in STARTS[quantity]:
        try:
            ends.append(search(quantity, form, restricted, weights, start))
        except RuntimeError as error:
            failures.append(str(error))
    if not ends:
        raise RuntimeError("; ".join(failures))
    return max(ends, key=lambda end: end.log_posterior)


def search(
    quantity: str,
    form: Form,
    restricted: bool,
    weight: np.ndarray,
    start: tuple[float, ...],
) -> Fit:
    """Fit one quantity from one start; arguments as for `fit`."""
    cost = objective(quantity, form, restricted)
    weights = jnp.asarray(weight)
    held = dict(form.fixed)
    theta = np.array([held.get(*pair) for pair in zip(NAMES, start, strict=True)])
    fitted = SCATTERS if restricted else NAMES
    free = np.array([NAMES.index(name) for name in fitted if name not in held])

    def at(values: np.ndarray) -> np.ndarray:
        full = theta.copy()
        full[free] = values
        return full

    def value_and_slope(values: np.ndarray) -> tuple[float, np.ndarray]:
        (value, _), gradient = cost(at(values), weights)
        return float(value), np.asarray(gradient)[free]

    found = minimize(
        value_and_slope,
        theta[free],
        jac=True,
        method="L-BFGS-B",
        bounds=[(SMALLEST_SD, 10.0) if i >= 4 else (-60.0, 60.0) for i in free],
        options={"ftol": 1e-13, "gtol": 1e-5, "maxiter": 500},
    )
    theta = at(found.x)
    (_, end), _ = cost(theta, weights)
    # The flag may name a line search that ended in rounding; the slope decides.
    at_bound = (found.x <= SMALLEST_SD) & (found.jac > 0)
    slope = float(np.max(np.abs(np.where(at_bound, 0.0, found.jac))))
    if slope > 0.01 or float(end.steepness) > 1e-6:
        raise RuntimeError(f"the slope of ln L is still {slope:.1g}")
    inner = [i for i, name in enumerate(COEFFICIENTS) if name not in held]
    covariance = np.zeros((4, 4))
    if restricted:
        theta[inner] = end.mode[: len(inner)]
        covariance[np.ix_(inner, inner)] = end.covariance[: len(inner), : len(inner)]
    return Fit(
        curve=FordCurve(theta[:4], covariance, *theta[4:]),
        log_likelihood=float(end.log_likelihood),
        log_posterior=-float(found.fun),
        n_free=len(NAMES) - len(held),
    )
