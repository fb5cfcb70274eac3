r"""Likelihood of records that share effects, with Student-t errors of their own.

No measurement of its own: the likelihood of `calibration.ford_2021`,
`calibration.ground_motion` and `calibration.far_pressure`; the model of the first two,
records that share effects of a site, a shot and a path, and its maximum over scatters.

A record is $y_i = m_i(x) + s\,\epsilon_i$: $m$ what is predicted from the hidden
$x$ (coefficients with a flat prior, effects scaled to unit normals), $\epsilon$
Student-t. $x$ is integrated out by Laplace's method, which is exact for Gaussian errors
and a prediction linear in $x$. A flat prior on the coefficients makes the
likelihood the restricted one (REML), which does not mistake fitted coefficients for
small scatter.
"""

import itertools
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import gammaln
from jaxtyping import Array, Float
from scipy.optimize import minimize

from calibration import table_rows
from jblast.constants import STANDARD_SOUND_SPEED, STANDARD_TEMPERATURE
from jblast.waves.regression import Regression, log_scaled_place

NEAR = 1e-2
"""Step in a hidden variable below which Newton's method takes over."""

MOST_STEPS = 200
"""Reweighted least-squares steps at most; they gain a factor of about 0.5 each."""


class Marginal(NamedTuple):
    """What is left when the hidden $x$ is integrated out.

    Attributes:
        log_likelihood: ln of the integral over $x$.
        mode: The most likely $x$.
        covariance: Of $x$ about it.
        steepness: Largest gradient left at the mode; large if it was not found.
    """

    log_likelihood: Float[Array, ""]
    mode: Float[Array, " hidden"]
    covariance: Float[Array, "hidden hidden"]
    steepness: Float[Array, ""]


SMALLEST_SD = 1e-3
STEEPEST, STEEPEST_INSIDE = 0.01, 1e-6
"""Slopes of ln L, and of the effects integrated over, that count as a maximum."""


class Maximum(NamedTuple):
    """Where the likelihood is greatest.

    Attributes:
        values: Coefficients, then scatters.
        covariance: Of the coefficients; zero where they were not integrated over.
        log_likelihood: There.
        log_posterior: There, the prior of scatters included.
    """

    values: np.ndarray
    covariance: np.ndarray
    log_likelihood: float
    log_posterior: float


def log_student_t(residual: Array, scale: Array, nu: float) -> Array:
    """Return the log density of a Student-t error; infinite `nu` is Gaussian."""
    squared = (residual / scale) ** 2
    if math.isinf(nu):
        return -0.5 * squared - jnp.log(scale) - 0.5 * math.log(2 * math.pi)
    norm = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * math.log(nu * math.pi)
    return norm - jnp.log(scale) - (nu + 1) / 2 * jnp.log1p(squared / nu)


def marginal(
    predict: Callable[[Array, Array], Array],
    parameters: Float[Array, " parameter"],
    precision: Float[Array, " hidden"],
    start: Float[Array, " hidden"],
    value: Float[Array, " record"],
    weight: Float[Array, " record"],
    nu: float,
) -> Marginal:
    """Integrate the hidden variables out; differentiable in the parameters.

    Args:
        predict: Expected values of the records, from parameters and hidden variables.
        parameters: What stays; the last is the scale of the records' own errors.
        precision: 1 for a unit-normal effect, 0 for a coefficient with a flat prior.
        start: Where the search for the mode begins.
        value: Measured values.
        weight: 1, or 0 for a record left out.
        nu: Degrees of freedom of the records' own errors; `math.inf` is Gaussian.
    """

    def cost(parameters: Array, x: Array) -> Array:
        residual = value - predict(parameters, x)
        terms = weight * log_student_t(residual, parameters[-1], nu)
        return 0.5 * jnp.sum(precision * x**2) - jnp.sum(terms)

    # The search is not differentiated; one Newton step from its end carries the
    # derivative of the mode by the parameters.
    frozen = jax.lax.stop_gradient(parameters)

    def reweighted_step(x: Array) -> Array:
        residual = value - predict(frozen, x)
        slope = jax.jacfwd(predict, argnums=1)(frozen, x)
        if math.isinf(nu):
            pull = weight / frozen[-1] ** 2
        else:
            pull = weight * (nu + 1) / (nu * frozen[-1] ** 2 + residual**2)
        curvature = slope.T @ (pull[:, None] * slope) + jnp.diag(precision)
        return jnp.linalg.solve(curvature, slope.T @ (pull * residual) - precision * x)

    def still_far(state: tuple[Array, Array, Array]) -> Array:
        count, _, step = state
        return (count < MOST_STEPS) & (jnp.max(jnp.abs(step)) > NEAR)

    def walk(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        count, x, step = state
        return count + 1, x + step, reweighted_step(x + step)

    def newton_step(parameters: Array, x: Array) -> Array:
        curvature = jax.hessian(cost, argnums=1)(frozen, jax.lax.stop_gradient(x))
        slope = jax.grad(cost, argnums=1)(parameters, x)
        return x - jnp.linalg.solve(curvature, slope)

    begin = jax.lax.stop_gradient(start)
    state = (jnp.asarray(0), begin, reweighted_step(begin))
    _, x, _ = jax.lax.while_loop(still_far, walk, state)
    x = jax.lax.fori_loop(0, 4, lambda _, x: newton_step(frozen, x), x)
    x = newton_step(parameters, x)
    curvature = jax.hessian(cost, argnums=1)(parameters, x)
    slope = jax.grad(cost, argnums=1)(parameters, x)
    flat = jnp.sum(1.0 - precision)
    return Marginal(
        log_likelihood=-cost(parameters, x)
        - 0.5 * jnp.linalg.slogdet(curvature)[1]
        + 0.5 * flat * math.log(2 * math.pi),
        mode=x,
        covariance=jnp.linalg.inv(curvature),
        steepness=jnp.max(jnp.abs(slope)),
    )


class Records(NamedTuple):
    """One row a record of a table of shots.

    A path is a pair of places, the same in every shot; the first part of its name is
    the site, so HRI and HRII are one site. A campaign is the first part of a shot.
    """

    rows: np.ndarray
    shot: np.ndarray
    campaign: np.ndarray
    site: np.ndarray
    path: np.ndarray
    charge_mass: np.ndarray
    height_of_burst: np.ndarray
    slant_range: np.ndarray

    def where(self, keep: np.ndarray) -> "Records":
        """Pick rows."""
        return Records(*(column[keep] for column in self))

    def column(self, name: str) -> np.ndarray:
        """Return a column of the table as numbers."""
        return np.array([float(row[name]) for row in self.rows])

    def ambient_pressure(self) -> np.ndarray:
        """Return the pressure of the air [Pa]."""
        return 1e3 * self.column("P_ambient_kPa")

    def sound_speed(self) -> np.ndarray:
        """Return the speed of sound in dry air at the temperature [m/s]."""
        warmth = self.column("T_ambient_K") / STANDARD_TEMPERATURE
        return STANDARD_SOUND_SPEED * np.sqrt(warmth)

    def place(self, *ambient: np.ndarray) -> tuple[Array, Array]:
        """Return ln Z and the scaled height [m/kg^(1/3)]."""
        return log_scaled_place(
            self.slant_range, self.charge_mass, self.height_of_burst, *ambient
        )


@cache
def read_records(file: Path) -> Records:
    """Read a table of shots."""
    rows = np.array(table_rows(file))
    shot, path = (np.array([row[name] for row in rows]) for name in ("source", "path"))
    campaign, site = (
        np.array([name.split("-")[0] for name in names]) for names in (shot, path)
    )
    numbers = (
        np.array([float(row[name]) for row in rows])
        for name in ("yield_kg", "hob_m", "range_m")
    )
    return Records(rows, shot, campaign, site, path, *numbers)


class Form(NamedTuple):
    """What is held at a value instead of fitted, and how records err."""

    held: tuple[tuple[str, float], ...] = ()
    nu: float = math.inf


@dataclass(frozen=True, eq=False)
class Model:
    """Records of one quantity about a curve, with effects of site, shot and path.

    Attributes:
        records: The records.
        value: ln of what was measured.
        curve: The same as expected, from the coefficients.
        spreads: Standard deviations of the effects of site, shot and path on each
            record, from the scatters.
        coefficients: Names.
        scatters: Names; the last is that of a record.
        starts: Values of both where searches begin; the best end is taken.
        expected: Mode of the prior on some scatters, Gamma of shape 2 [ln].
    """

    records: Records
    value: np.ndarray
    curve: Callable[[Array], Array]
    spreads: Callable[[Array], tuple[Array, Array, Array]]
    coefficients: tuple[str, ...]
    scatters: tuple[str, ...]
    starts: tuple[tuple[float, ...], ...]
    expected: Mapping[str, float]

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients, then scatters."""
        return self.coefficients + self.scatters

    def inner(self, form: Form) -> list[int]:
        """Return which coefficients are not held."""
        held = dict(form.held)
        return [i for i, name in enumerate(self.coefficients) if name not in held]

    def fit(
        self, form: Form, *, restricted: bool = True, weight: np.ndarray | None = None
    ) -> Maximum:
        """Climb to the maximum from all starts, and return the best.

        Args:
            form: What is fitted.
            restricted: Whether to integrate over the coefficients (for estimates), or
                to maximise over them too (for AIC).
            weight: 1 for a record that is used, 0 for one left out.

        Raises:
            RuntimeError: Every search ended away from a maximum.
        """
        weights = jnp.ones(len(self.value)) if weight is None else jnp.asarray(weight)
        ends, failures = [], []
        for start in self.starts:
            try:
                ends.append(_climb(self, form, restricted, weights, start))
            except RuntimeError as error:
                failures.append(str(error))
        if not ends:
            raise RuntimeError("; ".join(failures))
        return max(ends, key=lambda end: end.log_posterior)

    def show(self, quantity: str, forms: Mapping[str, Form], found: Maximum) -> None:
        """Print how likely each form makes the records, its AIC, and what was found."""
        print(f"{quantity}\n  {'form':30s}     lnL  free     AIC")
        for title, form in forms.items():
            try:
                tried = self.fit(form, restricted=False)
            except RuntimeError as error:
                print(f"  {title:30s} no maximum: {error}")
                continue
            n = len(self.names) - len(form.held)
            aic = 2 * n - 2 * tried.log_likelihood
            print(f"  {title:30s} {tried.log_likelihood:7.2f} {n:5d} {aic:7.1f}")
        n, sds = len(self.coefficients), np.sqrt(np.diag(found.covariance))
        for name, value, sd in zip(self.coefficients, found.values, sds, strict=False):
            print(f"  {name} = {value:9.4f} +- {sd:.4f}")
        for name, value in zip(self.scatters, found.values[n:], strict=True):
            print(f"  {name} scatter {value:.4f}")


@cache
def objective(model: Model, form: Form, restricted: bool):
    """Return minus the log posterior, the marginal and the gradient, compiled.

    It takes the values of the names and the weights of the records. Restricted
    likelihoods integrate the free coefficients too, from those values on.
    """
    records, n = model.records, len(model.coefficients)
    groups = [
        np.unique(names, return_inverse=True)[1]
        for names in (records.site, records.shot, records.path)
    ]
    inner = np.array(model.inner(form) if restricted else [], int)
    sizes = [int(index.max()) + 1 for index in groups]
    ends = np.cumsum([len(inner), *sizes])
    value, held = jnp.asarray(model.value), dict(form.held)

    def cost(theta: Array, weight: Array) -> tuple[Array, Marginal]:
        def predict(theta: Array, x: Array) -> Array:
            effects = zip(
                model.spreads(theta[n:]), groups, itertools.pairwise(ends), strict=True
            )
            site, shot, path = (sd * x[slice(*of)][index] for sd, index, of in effects)
            curve = model.curve(theta[:n].at[inner].set(x[: len(inner)]))
            return curve + (site + shot) + path

        start = jnp.concatenate([theta[inner], jnp.zeros(sum(sizes))])
        precision = jnp.concatenate([jnp.zeros(len(inner)), jnp.ones(sum(sizes))])
        integral = marginal(predict, theta, precision, start, value, weight, form.nu)
        log_prior = 0.0
        for name, mode in model.expected.items():
            if restricted and name not in held:
                sd = theta[model.names.index(name)]
                log_prior += jnp.log(sd) - sd / mode
        return -integral.log_likelihood - log_prior, integral

    return jax.jit(jax.value_and_grad(cost, has_aux=True))


def _climb(
    model: Model, form: Form, restricted: bool, weight: Array, start: tuple[float, ...]
) -> Maximum:
    """Climb from one start; a search that ends away from a maximum is an error."""
    held, n, inner = dict(form.held), len(model.coefficients), model.inner(form)
    fitted = model.scatters if restricted else model.names
    free = np.array([model.names.index(name) for name in fitted if name not in held])
    pairs = zip(model.names, start, strict=True)
    values = np.array([held.get(*pair) for pair in pairs])
    cost = objective(model, form, restricted)

    def at(found: np.ndarray) -> np.ndarray:
        full = values.copy()
        full[free] = found
        return full

    def value_and_slope(found: np.ndarray) -> tuple[float, np.ndarray]:
        (value, _), gradient = cost(at(found), weight)
        return float(value), np.asarray(gradient)[free]

    found = minimize(
        value_and_slope,
        values[free],
        jac=True,
        method="L-BFGS-B",
        bounds=[(SMALLEST_SD, 10.0) if i >= n else (-60.0, 60.0) for i in free],
        options={"ftol": 1e-13, "gtol": 1e-5, "maxiter": 500},
    )
    values = at(found.x)
    (_, end), _ = cost(values, weight)
    # The flag may name a line search that ended in rounding; the slope decides.
    at_bound = (found.x <= SMALLEST_SD) & (found.jac > 0)
    slope = float(np.max(np.abs(np.where(at_bound, 0.0, found.jac))))
    if not (slope <= STEEPEST and float(end.steepness) <= STEEPEST_INSIDE):
        raise RuntimeError(f"the slope of ln L is still {slope:.1g}")
    covariance = np.zeros((n, n))
    if restricted:
        values, covariance = with_mode(values, end, inner, n)
    return Maximum(values, covariance, float(end.log_likelihood), -float(found.fun))


def with_mode(
    values: np.ndarray, end: Marginal, inner: list[int], n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return values with coefficients that were integrated over, and the covariance."""
    values, covariance = values.copy(), np.zeros((n, n))
    values[inner] = end.mode[: len(inner)]
    covariance[np.ix_(inner, inner)] = end.covariance[: len(inner), : len(inner)]
    return values, covariance


def packaged(
    script: str, data: str, records: Records, curves: Mapping[str, Regression]
) -> str:
    """Return a packaged data file: six significant digits, the same each run."""

    def rounded(array: object) -> object:
        return np.vectorize(lambda x: float(f"{x:.6g}"))(np.asarray(array)).tolist()

    size = np.cbrt(records.charge_mass)
    scaled_range, height = records.slant_range / size, records.height_of_burst / size
    content = {
        "source": "LLNL recordings of S.R. Ford et al. 2021, from "
        f"lanl/MultiPEM_Toolbox (BSD-3-Clause); calibration/data/{data}",
        "script": f"calibration/{script}.py",
        "shots": sorted(set(records.shot.tolist())),
        "n_records": len(records.shot),
        "scaled_range": rounded([scaled_range.min(), scaled_range.max()]),
        "scaled_height": rounded([height.min(), height.max()]),
        "curves": {
            quantity: {
                name: rounded(x) for name, x in vars(curve).items() if name != "form"
            }
            for quantity, curve in curves.items()
        },
    }
    return json.dumps(content, indent=1) + "\n"
