r"""Likelihood of readings whose errors are partly shared, for batches of places.

A reading departs from its law by $r = A t + e + \epsilon$: linear numbers $t$ (origin
time, offsets of clocks), errors $e$ that rows share, and an error $\epsilon$ of its
own. All but the laws is algebra of rows, so that one program for the laws is all that
is compiled. The functions here take `xp`, NumPy or `jax.numpy`.

Shared errors have the covariance

$$G = F + \sum_s s s^T + \sum_p p p^T \circ C
  + \sum_a a a^T \circ (C - \psi\,\mathrm{same})$$

with $F$ the errors that readings of a record share, $s$ the loadings of whole shots,
$p$ those of paths and $a$ those of arrivals; $C$ is the correlation of paths by a
kernel (`sensors.path_scatter`), and $\psi$ the part of a path alone, which stays with
the row's own error.

Linear numbers with prior precision $T$ (0: flat) are integrated out: with
$\Sigma = G + D$ the precision of the readings is
$P = \Sigma^{-1} - \Sigma^{-1} A (A^T \Sigma^{-1} A + T)^{-1} A^T \Sigma^{-1}$.

An own error is Student-t with 4 degrees of freedom: a normal of variance
$s^2/\lambda$ with $\lambda \sim \Gamma(\nu/2, \nu/2)$. The scales are integrated out in
mean field, $\lambda_i \sim \Gamma((\nu+1)/2, b_i)$, whose bound on the likelihood is
exact to some tenths in ln; `exact_gain` makes it exact for draws.

A lower bound is a condition on its reading's error. Given the readings, the shared
errors of the bounds are normal; the probability that their own errors do the rest is
the mean over `POINTS` quasi-random points of this normal.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.scipy.special
import numpy as np
import scipy.special
from jaxtyping import Bool, Float, Int
from scipy.stats import norm, qmc

from jblast.sensors.path_scatter import ROOT_GUARD, solve_system
from jblast.sensors.simulated_readings import STUDENT_FREEDOM, Noise

POINTS = 32
"""Points of the normal of the bounds given the readings: with 20 bounds their mean is
within a tenth in ln of that of 4,096."""
ROUNDS = 3
"""Rounds of the mean field; 1 to 6 lead to equally many effective draws."""
SHAPE_BEFORE, SHAPE = STUDENT_FREEDOM / 2, (STUDENT_FREEDOM + 1) / 2
"""Shapes of the Gamma distribution of a scale, before and after its reading."""
SAME_PATH = 1.5e-8
"""Variance added to that of each path, so that coinciding paths can be inverted."""

Array = Any
"""Of NumPy or JAX."""


@dataclass(frozen=True)
class Rows:
    """What the likelihood of a log needs beside the laws.

    Attributes:
        measured: The readings on their error scale.
        sigma: Their instrument error, same unit.
        circular: True for angles.
        is_bound: True for lower bounds.
        same_path: True for pairs of rows of one path.
        shared: Covariance of errors that readings of one record share.
        columns: Change of each row by one unit of each linear number.
        precision: Prior precision of each linear number; 0 is flat.
        kernels: Rows of `path_scatter.KERNELS`, equally probable.
        paths: By name of an arrival's scatter, the first row of each of its paths, and
            the path of each row.
        noise: Distribution of the own errors.
    """

    measured: Float[np.ndarray, " row"]
    sigma: Float[np.ndarray, " row"]
    circular: Bool[np.ndarray, " row"]
    is_bound: Bool[np.ndarray, " row"]
    same_path: Bool[np.ndarray, "row row"]
    shared: Float[np.ndarray, "row row"]
    columns: Float[np.ndarray, "row linear"]
    precision: Float[np.ndarray, " linear"]
    kernels: Float[np.ndarray, "kernel 4"]
    paths: Mapping[str, tuple[Int[np.ndarray, " path"], Int[np.ndarray, " row"]]]
    noise: Noise

    @cached_property
    def read(self) -> Int[np.ndarray, " reading"]:
        """Rows that are readings."""
        return np.flatnonzero(~self.is_bound)

    @cached_property
    def bound(self) -> Int[np.ndarray, " bound"]:
        """Rows that are lower bounds."""
        return np.flatnonzero(self.is_bound)

    @cached_property
    def middle(self) -> Float[np.ndarray, "row linear"]:
        """Matrix to the least-squares value of each flat linear number.

        Residuals are taken about it: those of clocks of days would lose their digits.
        """
        return np.linalg.pinv(self.columns * (self.precision == 0)).T

    @cached_property
    def points(self) -> Float[np.ndarray, "bound point"]:
        """Quasi-random standard normals."""
        count = len(self.bound)
        drawn = qmc.Sobol(max(count, 1), seed=0).random(POINTS)
        return norm.ppf(drawn).T[:count]

    @cached_property
    def constant(self) -> float:
        """Factors of the likelihood that no place changes, in ln."""
        proper = self.precision[self.precision > 0]
        flat = len(self.precision) - len(proper)
        normals = len(self.read) - flat
        return 0.5 * float(np.log(proper).sum() - normals * math.log(2 * math.pi))


class Seen(NamedTuple):
    """What the laws say of the rows at a batch of places.

    Attributes:
        predicted: Readings without error, on their error scale.
        record_sd: Law scatter of each row alone.
        shot: Loadings of the effects of whole shots, by name.
        path: Loadings of the effects of paths, by name.
        arrival: Scatter of the arrival of each path, by name.
        place: Log-polar coordinates of each path.
        placed: True if its direction is known.
        valid: True within the range of the row's laws.
    """

    predicted: Float[Array, "place row"]
    record_sd: Float[Array, "place row"]
    shot: Mapping[str, Float[Array, "place row"]]
    path: Mapping[str, Float[Array, "place row"]]
    arrival: Mapping[str, Float[Array, "place row"]]
    place: Float[Array, "place row 4"]
    placed: Bool[Array, "place row"]
    valid: Bool[Array, "place row"]


class Field(NamedTuple):
    """The mean field of a batch, by kernel; rows as in `Rows`.

    Attributes:
        shared: Covariance of shared errors.
        own: Squared scale of each own error.
        residual: Measured minus predicted, about `middle`.
        middle: Least-squares values of the flat linear numbers.
        rate: Rate $b$ of the scale of each reading.
        precision: Precision of the readings, the linear numbers integrated out.
        weighted: Precision times residual.
    """

    shared: Float[Array, "place kernel row row"]
    own: Float[Array, "place kernel row"]
    residual: Float[Array, "place 1 row"]
    middle: Float[Array, "place linear"]
    rate: Float[Array, "place kernel reading"]
    precision: Float[Array, "place kernel reading reading"]
    weighted: Float[Array, "place kernel reading"]


class Normal(NamedTuple):
    """Readings with normal errors, the linear numbers integrated out.

    Attributes:
        log_likelihood: ln of their density, and of the probability of the bounds.
        precision: Precision of the readings.
        weighted: Precision times residual.
        linear: Mean of the linear numbers.
        linear_covariance: Their covariance.
    """

    log_likelihood: Float[Array, "*batch"]
    precision: Float[Array, "*batch reading reading"]
    weighted: Float[Array, "*batch reading"]
    linear: Float[Array, "*batch linear"]
    linear_covariance: Float[Array, "*batch linear linear"]


def log_likelihoods(
    xp: ModuleType, rows: Rows, seen: Seen, rounds: int = ROUNDS
) -> tuple[Float[Array, "place kernel"], Field]:
    """Return ln of the likelihood at each place by each kernel, and its mean field."""
    shared, own = covariances(xp, rows, seen)
    residual = rows.measured - seen.predicted
    wrapped = (residual + math.pi) % (2 * math.pi) - math.pi
    residual = xp.where(rows.circular, wrapped, residual)
    middle = residual @ rows.middle
    residual = (residual - middle @ rows.columns.T)[:, None, :]
    readings = own[..., rows.read]
    rate = xp.zeros_like(readings) + SHAPE
    rounds = 0 if rows.noise == "gaussian" else rounds
    for _ in range(rounds):
        variance = readings * rate / SHAPE
        found = _normal(xp, rows, shared, variance, own, residual, sized=False)
        # second moment of each own error given the others, over its squared scale
        diagonal = xp.diagonal(found.precision, axis1=-2, axis2=-1)
        second = (variance * found.weighted) ** 2 + variance - variance**2 * diagonal
        rate = (STUDENT_FREEDOM + xp.maximum(second, 0.0) / readings) / 2
    found = _normal(xp, rows, shared, readings * rate / SHAPE, own, residual)
    total = found.log_likelihood
    if rows.noise != "gaussian":
        total = total + _of_scales(xp, rate).sum(-1)
    return total, Field(
        shared, own, residual, middle, rate, found.precision, found.weighted
    )


def _of_scales(xp: ModuleType, rate):
    """Return the share of each scale in the bound on ln of the likelihood."""
    divergence = (
        (SHAPE - SHAPE_BEFORE) * scipy.special.digamma(SHAPE)
        - scipy.special.gammaln(SHAPE)
        + scipy.special.gammaln(SHAPE_BEFORE)
        + SHAPE_BEFORE * (xp.log(rate) - math.log(SHAPE_BEFORE))
        + SHAPE * (SHAPE_BEFORE - rate) / rate
    )
    mean_of_log = 0.5 * (scipy.special.digamma(SHAPE) - math.log(SHAPE))
    return mean_of_log - divergence


def covariances(
    xp: ModuleType, rows: Rows, seen: Seen
) -> tuple[Float[Array, "place kernel row row"], Float[Array, "place kernel row"]]:
    """Return the covariance of shared errors, and the squared scale of own errors."""
    apart = ((seen.place[:, :, None] - seen.place[:, None]) ** 2).sum(-1) + ROOT_GUARD
    placed = seen.placed[:, :, None] & seen.placed[:, None]
    kernels = [
        (1 - f) * xp.exp(-apart / smooth**2)
        + f * xp.exp(-((apart / rough**2) ** (power / 2)))
        for f, smooth, rough, power in rows.kernels
    ]
    correlation = xp.where(placed[:, None], xp.stack(kernels, 1), 0.0)
    correlation = xp.where(rows.same_path, 1.0, correlation)
    shared = xp.zeros_like(correlation) + rows.shared
    for loading in seen.shot.values():
        shared = shared + _outer(loading)[:, None]
    for loading in seen.path.values():
        shared = shared + _outer(loading)[:, None] * correlation
    own = (rows.sigma**2 + seen.record_sd**2)[:, None, :]
    own = own + xp.zeros_like(correlation[..., 0])
    for name, loading in seen.arrival.items():
        first, of = rows.paths[name]
        among = correlation[..., first[:, None], first] + SAME_PATH * np.eye(len(first))
        precision = _inverse(xp, among)
        alone = (1 / xp.abs(precision).sum(-1))[..., of]
        part = correlation - alone[..., None] * rows.same_path
        shared = shared + _outer(loading)[:, None] * part
        own = own - (loading**2)[:, None] * (1 - alone)
    return shared, xp.maximum(own, 1e-20)


def _outer(a):
    return a[..., :, None] * a[..., None, :]


def _normal(
    xp: ModuleType, rows: Rows, shared, variance, own, residual, *, sized: bool = True
) -> Normal:
    """Return the readings with own errors of given variance, and bounds given them.

    Without `sized` the determinants are left out.
    """
    read, bound, columns = rows.read, rows.bound, rows.columns[rows.read]
    matrix = shared[..., read[:, None], read] + variance[..., None] * np.eye(len(read))
    inverse = _inverse(xp, matrix)
    by_columns = inverse @ columns
    across = _turned(xp, by_columns)
    inner = across @ columns + np.diag(rows.precision)
    spread = _inverse(xp, inner)
    precision = inverse - by_columns @ spread @ across
    at = residual[..., read, None] + xp.zeros_like(variance)[..., None]
    weighted = (precision @ at)[..., 0]
    total = -0.5 * (at[..., 0] * weighted).sum(-1) + rows.constant
    if sized:
        total = total - 0.5 * (_log_size(xp, matrix) + _log_size(xp, inner))
    if sized and len(bound):
        # shared errors of the bounds given the readings; no time is a bound
        cross = shared[..., bound[:, None], read]
        expected = (cross @ weighted[..., None])[..., 0]
        left = residual[..., bound] - expected
        among = shared[..., bound[:, None], bound]
        among = among - cross @ precision @ _turned(xp, cross)
        error = _root(xp, among) @ rows.points
        needed = (left[..., None] - error) / xp.sqrt(own[..., bound, None])
        share = _survival(xp, needed, rows.noise).prod(-2).mean(-1)
        total = total + xp.log(xp.maximum(share, 1e-300))
    linear = (spread @ (across @ at))[..., 0]
    return Normal(total, precision, weighted, linear, spread)


def exact_gain(
    rows: Rows,
    field: Field,
    kernel: Int[np.ndarray, " place"],
    approximate: Float[np.ndarray, " place"],
    draws: int,
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, " place"], Float[np.ndarray, "place linear"]]:
    """Return ln of the exact over the approximate likelihood, and linear numbers.

    The ratio is estimated without bias by scales drawn from the mean field, so weights
    that contain it stay right. The linear numbers are drawn given one of these scales.

    Args:
        rows: The log.
        field: Mean field at each place.
        kernel: Kernel used at each place.
        approximate: Its approximate likelihood in ln.
        draws: Number of draws of the scales.
        rng: Random numbers.
    """
    place = np.arange(len(kernel))
    shared, own, rate = (
        array[place, kernel][:, None] for array in (field.shared, field.own, field.rate)
    )
    count = len(place)
    scale = np.ones((count, 1, rate.shape[-1]))
    if rows.noise != "gaussian":
        scale = rng.gamma(SHAPE, 1.0, (count, draws, rate.shape[-1])) / rate
    variance = own[..., rows.read] / scale
    found = _normal(np, rows, shared, variance, own, field.residual)
    total = found.log_likelihood
    if rows.noise != "gaussian":
        # prior over proposal of the scales
        total = total + (
            SHAPE_BEFORE * math.log(SHAPE_BEFORE)
            - scipy.special.gammaln(SHAPE_BEFORE)
            - SHAPE * np.log(rate)
            + scipy.special.gammaln(SHAPE)
            + (SHAPE_BEFORE - SHAPE) * np.log(scale)
            + (rate - SHAPE_BEFORE) * scale
        ).sum(-1)
    log_sum = scipy.special.logsumexp(total, axis=1)
    gain = log_sum - math.log(total.shape[1]) - approximate
    of = chosen(np.exp(total - log_sum[:, None]), rng)
    root = _root(np, found.linear_covariance[place, of])
    unit = rng.standard_normal((count, rows.columns.shape[1], 1))
    return gain, field.middle + found.linear[place, of] + (root @ unit)[..., 0]


def chosen(
    shares: Float[np.ndarray, "place option"], rng: np.random.Generator
) -> Int[np.ndarray, " place"]:
    """Draw one option at each place by its share."""
    return (shares.cumsum(1) > rng.random(len(shares))[:, None]).argmax(1)


def _turned(xp: ModuleType, matrix):
    return xp.swapaxes(matrix, -1, -2)


def _inverse(xp: ModuleType, matrix):
    """Invert positive definite matrices."""
    if xp is np:
        return np.linalg.inv(matrix)
    return _eliminated(matrix)[0]


def _log_size(xp: ModuleType, matrix):
    """Return ln of the determinant of positive definite matrices."""
    if xp is np:
        return np.linalg.slogdet(matrix)[1]
    return _eliminated(matrix)[1]


def _eliminated(matrix):
    # without LAPACK: see `path_scatter`
    count = matrix.shape[-1]
    flat = matrix.reshape(-1, count, count)
    found, size = jax.vmap(solve_system, (0, None))(flat, jnp.eye(count))
    return found.reshape(matrix.shape), size.reshape(matrix.shape[:-2])


def _root(xp: ModuleType, matrix):
    """Return the Cholesky factor of small matrices, which may be singular."""
    columns: Sequence[Any] = []
    for i in range(matrix.shape[-1]):
        pivot = xp.sqrt(xp.maximum(matrix[..., i, i], 1e-30))
        column = matrix[..., i] / pivot[..., None] * (np.arange(matrix.shape[-1]) >= i)
        columns = [*columns, column]
        matrix = matrix - _outer(column)
    return xp.stack(columns, -1) if columns else matrix


def _survival(xp: ModuleType, u, noise: Noise):
    """Return the probability of an own error of u standard deviations or more."""
    if noise == "gaussian":
        special = scipy.special if xp is np else jax.scipy.special
        return 0.5 * special.erfc(u / math.sqrt(2))
    # Student-t with 4 degrees of freedom in closed form, without cancellation
    sine = xp.abs(u) / xp.sqrt(4 + u * u)
    tail = (4 / (4 + u * u)) ** 2 * (2 + sine) / (4 * (1 + sine) ** 2)
    return xp.where(u > 0, tail, 1 - tail)
