r"""The likelihood of a log, written once for NumPy and for JAX.

The readings $y$ about the predictions $f$ of the laws are

$$y = f + A x + g + e$$

with linear numbers $x$ (origin time, clocks, effects of whole shots), effects $g$ that
the rows of a path or of neighbouring paths share, and own errors $e$. Effects are
normal; own errors are Student-t with 4 degrees of freedom, a normal whose precision has
a Gamma distribution. Rows that share effects other than linear ones are a block: all
rows where neighbouring paths are correlated, else those of one path. With the
covariance $G$ of a block, own scales $s$ and precisions $\lambda$, and the prior
precision $T$ of the linear numbers (0: flat),

$$B = G + \mathrm{diag}(s^2/\lambda), \quad
  P = B^{-1} - B^{-1} A (A^T B^{-1} A + T)^{-1} A^T B^{-1},$$

$$\ln L = -\tfrac12 (y^T P y + \ln|B| + \ln|A^T B^{-1} A + T| - \ln|T|).$$

The precisions follow from a mean field: $\lambda_i$ is Gamma distributed with shape
$5/2$ and the rate $b_i = 2 + \langle e_i^2 \rangle / 2 s_i^2$, where
$\langle e_i^2 \rangle = (d_i (P y)_i)^2 + d_i - d_i^2 P_{ii}$ with
$d = s^2/\langle\lambda\rangle$. The divergence from the prior completes the bound on
the likelihood. `exact_gain` estimates without bias what the bound leaves out.

A lower bound multiplies the likelihood by the probability that its reading is larger,
given the other readings.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import jax.scipy.special
import numpy as np
import scipy.special
from jaxtyping import Bool, Float, Int

from jblast.sensors.path_scatter import (
    ANCHORS,
    FEW_NEIGHBOURS,
    ROOT_GUARD,
    solve_system,
)
from jblast.sensors.simulated_readings import STUDENT_FREEDOM, Noise

POINTS = 128
"""Points of the normal of the bounds given the readings: with 20 bounds their mean is
within a tenth in ln of that of 4,096."""
ROUNDS = 3
"""Rounds of the mean field; 1 to 6 lead to equally many effective draws."""
SHAPE_BEFORE, SHAPE = STUDENT_FREEDOM / 2, (STUDENT_FREEDOM + 1) / 2
"""Shapes of the Gamma distribution of a scale, before and after its reading."""
SAME_PATH = 1.5e-8
"""Variance added to that of each path: the paths of a far charge coincide, and rounding
of their differences must not make a covariance negative."""

Array = Any
"""Of NumPy or JAX."""


@dataclass(frozen=True)
class Paths:
    """The paths on which one quantity of one charge was recorded.

    Attributes:
        first: First row of each path.
        path: Path of each row of the log; those of other quantities have path 0.
        recorded: True for rows of the quantity.
    """

    first: Int[np.ndarray, " path"]
    path: Int[np.ndarray, " row"]
    recorded: Bool[np.ndarray, " row"]

    @property
    def anchors(self) -> Int[np.ndarray, " anchor"]:
        """Some of the paths, evenly spread over the rows."""
        return np.linspace(0, len(self.first) - 1, ANCHORS).astype(int)


@dataclass(frozen=True)
class Rows:
    """Readings of a log, their errors and their paths.

    Attributes:
        measured: The readings on their error scale.
        sigma: Their instrument error, same unit.
        circular: True for angles.
        is_bound: True for lower bounds.
        group: Path of each row.
        block: Rows of each block; -1 fills up.
        shared: Covariance of errors that readings of one record share.
        columns: Change of each row by one unit of each linear number.
        precision: Prior precision of each linear number; 0 is flat.
        kernels: Rows of `path_scatter.KERNELS`, equally probable.
        paths: By name of the scatter of a path.
        correlated: True if neighbouring paths are one block.
        anchored: True if they share effects through some of them as anchors.
        noise: Distribution of the own errors.
    """

    measured: Float[np.ndarray, " row"]
    sigma: Float[np.ndarray, " row"]
    circular: Bool[np.ndarray, " row"]
    is_bound: Bool[np.ndarray, " row"]
    group: Int[np.ndarray, " row"]
    block: Int[np.ndarray, "block member"]
    shared: Float[np.ndarray, "block member member"]
    columns: Float[np.ndarray, "row linear"]
    precision: Float[np.ndarray, " linear"]
    kernels: Float[np.ndarray, "kernel 4"]
    paths: Mapping[str, Paths]
    correlated: bool
    anchored: bool
    noise: Noise

    @property
    def of_all_numbers(self) -> "Rows":
        """The rows if linear numbers are given like the others."""
        none = np.zeros((len(self.measured), 0))
        return replace(self, columns=none, precision=np.zeros(0))

    @property
    def work(self) -> int:
        """Numbers in the matrices of one place."""
        return self.block.size * self.block.shape[1] * len(self.kernels)

    @cached_property
    def member(self) -> Int[np.ndarray, "block member"]:
        """Rows of each block; those that fill up are row 0."""
        return np.maximum(self.block, 0)

    @cached_property
    def is_read(self) -> Bool[np.ndarray, "block member"]:
        """True for members that are readings."""
        return (self.block >= 0) & ~self.is_bound[self.member]

    @cached_property
    def same_path(self) -> Bool[np.ndarray, "block member member"]:
        """True for pairs of members of one path."""
        group = np.where(self.block >= 0, self.group[self.member], -1)
        return group[:, :, None] == group[:, None]

    @cached_property
    def place(self) -> tuple[Int[np.ndarray, " row"], Int[np.ndarray, " row"]]:
        """Block and member of each row."""
        block, member = np.nonzero(self.block >= 0)
        order = np.argsort(self.block[block, member])
        return block[order], member[order]

    @cached_property
    def bound(self) -> Int[np.ndarray, " bound"]:
        """Rows that are lower bounds."""
        return np.flatnonzero(self.is_bound)

    @cached_property
    def middle(self) -> Float[np.ndarray, "row linear"]:
        """Matrix to the least-squares value of each flat linear number.

        Residuals are taken about it: those of clocks of days would lose their digits.
        """
        flat = self.columns * (self.precision == 0) * ~self.is_bound[:, None]
        return np.linalg.pinv(flat).T

    @cached_property
    def points(self) -> Float[np.ndarray, "bound point"]:
        """Quasi-random standard normals."""
        if not len(self.bound):
            return np.zeros((0, POINTS))
        # imported here: the import takes longer than that of JAX
        from scipy.stats import qmc

        drawn = qmc.Sobol(len(self.bound), rng=0).random(POINTS)
        return scipy.special.ndtri(drawn).T

    @cached_property
    def constant(self) -> float:
        """Factors of the likelihood that no place changes, in ln."""
        proper = self.precision[self.precision > 0]
        flat = len(self.precision) - len(proper)
        normals = int(self.is_read.sum()) - flat
        return 0.5 * float(np.log(proper).sum() - normals * math.log(2 * math.pi))


class Seen(NamedTuple):
    """Predictions of the rows at a batch of places, and scatter of the laws.

    Attributes:
        predicted: Readings without error, on their error scale.
        record_sd: Law scatter of each row alone.
        shot: Loadings of the effects of whole shots, by name.
        path: Loadings of the effects of paths, by name.
        arrival: Scatter of the arrival of each path, by name.
        place: Log-polar coordinates of each path.
        placed: True if its direction is known.
        valid: True within the range of the row's laws.
        slant_range: Distance from the charge [m].
    """

    predicted: Float[Array, "place row"]
    record_sd: Float[Array, "place row"]
    shot: Mapping[str, Float[Array, "place row"]]
    path: Mapping[str, Float[Array, "place row"]]
    arrival: Mapping[str, Float[Array, "place row"]]
    place: Float[Array, "place row 4"]
    placed: Bool[Array, "place row"]
    valid: Bool[Array, "place row"]
    slant_range: Float[Array, "place row"]


class Errors(NamedTuple):
    """Errors of the rows at a batch of places, by kernel.

    Attributes:
        shared: Covariance of the effects within each block.
        effect: Change of each row by one standard deviation of each effect that blocks
            share.
        own: Squared scale of each own error.
    """

    shared: Float[Array, "place kernel block member member"]
    effect: Float[Array, "place kernel row effect"]
    own: Float[Array, "place kernel row"]


class Field(NamedTuple):
    """Errors of the rows, and the mean field of their scales.

    Attributes:
        errors: The errors.
        residual: Measured minus predicted, about `middle`.
        middle: Least-squares values of the flat linear numbers.
        rate: Rate $b$ of the scale of each own error.
        normal: The readings by the mean scales.
    """

    errors: Errors
    residual: Float[Array, "place 1 row"]
    middle: Float[Array, "place linear"]
    rate: Float[Array, "place kernel row"]
    normal: "Normal"


class Normal(NamedTuple):
    """Readings with normal errors, effects and linear numbers integrated out.

    Attributes:
        log_likelihood: ln of their density, and of the probability of the bounds.
        inverse: Inverse of the covariance of each block.
        by_columns: It times the columns of linear numbers and effects.
        spread: Covariance of linear numbers and effects.
        weighted: Precision times residual, by block.
        linear: Mean of the linear numbers and effects.
    """

    log_likelihood: Float[Array, "*batch"]
    inverse: Float[Array, "*batch block member member"]
    by_columns: Float[Array, "*batch block member column"]
    spread: Float[Array, "*batch column column"]
    weighted: Float[Array, "*batch block member"]
    linear: Float[Array, "*batch column"]

    def at(self, which: Any) -> "Normal":
        """Return some of a batch."""
        return Normal(*(part[which] for part in self))

    def solved(
        self, rows: Rows, right: Float[np.ndarray, "*batch row right"]
    ) -> Float[np.ndarray, "*batch row right"]:
        """Return the precision of the readings times columns; bounds have none."""
        members = right[..., rows.member, :] * rows.is_read[..., None]
        across = _across(np, self.by_columns, members)
        found = _times(self.inverse, members)
        found = found - _onto(self.by_columns, self.spread @ across)
        return (found * rows.is_read[..., None])[..., *rows.place, :]

    def weights(self, rows: Rows) -> Float[np.ndarray, "*batch row"]:
        """Return precision times residual of each row; 0 for bounds."""
        return (self.weighted * rows.is_read)[..., *rows.place]


def log_likelihoods(
    xp: ModuleType, rows: Rows, seen: Seen, rounds: int = ROUNDS
) -> tuple[Float[Array, "place kernel"], Field]:
    """Return ln of the likelihood at each place by each kernel, and its mean field."""
    with (
        # the algebra is written by NumPy's rules of broadcasting and of types
        jax.numpy_rank_promotion("allow"),
        jax.numpy_dtype_promotion("standard"),
        # places without a density have NaN
        np.errstate(invalid="ignore", over="ignore", divide="ignore"),
    ):
        return _log_likelihoods(xp, rows, seen, rounds)


def _log_likelihoods(xp: ModuleType, rows: Rows, seen: Seen, rounds: int):
    errors = errors_of(xp, rows, seen)
    residual = rows.measured - seen.predicted
    if rows.circular.any():
        wrapped = (residual + math.pi) % (2 * math.pi) - math.pi
        residual = xp.where(rows.circular, wrapped, residual)
    middle = residual @ rows.middle
    residual = (residual - middle @ rows.columns.T)[:, None, :]
    rate = xp.zeros_like(errors.own) + SHAPE
    rounds = 0 if rows.noise == "gaussian" else rounds
    for _ in range(rounds):
        variance = errors.own * rate / SHAPE
        found = _normal(xp, rows, errors, variance, residual, sized=False)
        # second moment of each own error given the others, over its squared scale
        diagonal = xp.diagonal(found.inverse, axis1=-2, axis2=-1) - xp.sum(
            _onto(found.by_columns, found.spread) * found.by_columns, -1
        )
        diagonal, weighted = (
            part[..., *rows.place] for part in (diagonal, found.weighted)
        )
        second = (variance * weighted) ** 2 + variance - variance**2 * diagonal
        rate = (STUDENT_FREEDOM + xp.maximum(second, 0.0) / errors.own) / 2
    found = _normal(xp, rows, errors, errors.own * rate / SHAPE, residual)
    total = found.log_likelihood
    if rows.noise != "gaussian":
        total = total + xp.where(rows.is_bound, 0.0, _of_scales(xp, rate)).sum(-1)
    return total, Field(errors, residual, middle, rate, found)


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


def errors_of(xp: ModuleType, rows: Rows, seen: Seen) -> Errors:
    """Return the errors of the rows at a batch of places."""
    correlation = _correlations(xp, rows, seen)
    shared = xp.zeros_like(correlation) + rows.shared
    own = (rows.sigma**2 + seen.record_sd**2)[:, None, :]
    own = own + xp.zeros_like(correlation[..., 0, 0, :1])
    effects = list(seen.shot.values())
    for name, loading in seen.path.items():
        within, columns, _ = _split(xp, rows, seen, name, correlation)
        effects += [loading[..., None] * column for column in columns]
        shared = shared + _outer(loading[:, rows.member])[:, None] * within
    for name, sd in seen.arrival.items():
        within, columns, alone = _split(xp, rows, seen, name, correlation)
        effects += [sd[..., None] * column for column in columns]
        part = within - _members(alone, rows)[..., None] * rows.same_path
        shared = shared + _outer(sd[:, rows.member])[:, None] * part
        own = own - (sd**2)[:, None] * (1 - alone)
    stacked = [part if part.ndim == 3 else part[..., None] for part in effects]
    none = xp.zeros((*seen.predicted.shape, 0))
    effect = xp.concatenate([none, *stacked], -1)[:, None]
    return Errors(shared, effect, xp.maximum(own, 1e-20))


def _correlations(xp: ModuleType, rows: Rows, seen: Seen):
    """Return the correlation of the paths of each block, by kernel."""
    if not rows.correlated:
        same = xp.zeros((len(seen.predicted), 1, 1, 1, 1)) + rows.same_path
        return same + xp.zeros((1, len(rows.kernels), 1, 1, 1))
    place, placed = seen.place[:, rows.member], seen.placed[:, rows.member]
    apart = ((place[..., :, None, :] - place[..., None, :, :]) ** 2).sum(-1)
    apart = (apart + ROOT_GUARD)[:, None]
    known = (placed[..., :, None] & placed[..., None, :])[:, None]
    found = xp.concatenate([_kernel(xp, apart, one) for one in rows.kernels], 1)
    return xp.where(rows.same_path, 1.0 + SAME_PATH, xp.where(known, found, 0.0))


def _kernel(xp: ModuleType, apart, kernel):
    f, smooth, rough, power = kernel
    turbulent = f * xp.exp(-((apart / rough**2) ** (power / 2)))
    return turbulent if f == 1 else turbulent + (1 - f) * xp.exp(-apart / smooth**2)


def _split(xp: ModuleType, rows: Rows, seen: Seen, name: str, correlation):
    """Return the parts of a scatter of paths of unit variance.

    Returns:
        Its covariance within blocks, columns of effects that all blocks share, and the
        variance that each path has alone.
    """
    one = xp.zeros((*correlation.shape[:2], len(rows.measured))) + 1.0
    paths = rows.paths[name]
    if rows.correlated:
        first = paths.first
        block, member = rows.place
        among = correlation[:, :, block[first][0]]
        at = member[first]
        # at most the smallest eigenvalue: the covariance without it stays positive
        alone = 1 / xp.abs(_inverse(xp, among[..., at[:, None], at])).sum(-1)
        return correlation, [], xp.where(paths.recorded, alone[..., paths.path], one)
    if not rows.anchored or len(paths.first) <= ANCHORS:
        return correlation, [], one
    first, anchors = paths.first, paths.anchors
    place, placed = seen.place[:, first], seen.placed[:, first]
    apart = ((place[:, :, None] - place[:, None, anchors]) ** 2).sum(-1) + ROOT_GUARD
    known = placed[:, :, None] & placed[:, None, anchors]
    across = xp.where(known, _kernel(xp, apart, rows.kernels[0]), 0.0)
    itself = np.arange(len(first))[:, None] == anchors
    across = xp.where(itself, 1.0, across)
    among = across[:, anchors] + SAME_PATH * np.eye(len(anchors))
    # columns whose products are the covariance that the anchors explain
    columns = across @ _turned(xp, _inverse(xp, _root(xp, among)))
    neighbours = xp.maximum(across.sum(1) - 1, 0.0)
    share = neighbours / (neighbours + FEW_NEIGHBOURS)
    columns = columns * xp.sqrt(share + SAME_PATH)[:, None]
    alone = xp.maximum(1 - (columns**2).sum(-1), SAME_PATH)
    alone = xp.where(paths.recorded, alone[:, paths.path], 1.0)
    columns = xp.where(paths.recorded[:, None], columns[:, paths.path], 0.0)
    within = rows.same_path * alone[:, rows.member][:, None, :, :, None]
    return within, [columns], one * alone[:, None]


def _members(x, rows: Rows):
    return x[..., rows.member]


def _outer(a):
    return a[..., :, None] * a[..., None, :]


def _normal(
    xp: ModuleType, rows: Rows, errors: Errors, variance, residual, *, sized=True
) -> Normal:
    """Return the readings with own errors of given variance, and bounds given them.

    Without `sized` the determinants are left out.
    """
    read = rows.is_read
    pairs = read[:, :, None] & read[:, None]
    diagonal = xp.where(read, _members(variance, rows), 1.0)
    unit = np.eye(read.shape[1])
    matrix = errors.shared * pairs + diagonal[..., None] * unit
    inverse = _inverse(xp, matrix)
    given = xp.zeros((*errors.effect.shape[:-1], 1)) + rows.columns
    columns = xp.concatenate([given, errors.effect], -1)
    members = columns[..., rows.member, :] * read[..., None]
    by_columns = _times(inverse, members)
    size = columns.shape[-1]
    precision = np.concatenate([rows.precision, np.ones(size - len(rows.precision))])
    inner = _across(xp, by_columns, members) + np.diag(precision)
    spread = _inverse(xp, inner)
    at = _members(residual, rows) * read
    weighted = _times(inverse, at[..., None])
    linear = spread @ _across(xp, members, weighted)
    weighted = (weighted - _onto(by_columns, linear))[..., 0]
    linear = linear[..., 0]
    total = rows.constant - 0.5 * (at * weighted).sum((-1, -2))
    if sized:
        total = total - 0.5 * (_log_size(xp, matrix).sum(-1) + _log_size(xp, inner))
    found = Normal(total, inverse, by_columns, spread, weighted, linear)
    if sized and len(rows.bound):
        share = _of_bounds(xp, rows, errors, columns, residual, found)
        found = found._replace(log_likelihood=total + xp.log(share))
    return found


def _of_bounds(xp: ModuleType, rows: Rows, errors: Errors, columns, residual, found):
    """Return the probability of the bounds given the readings."""
    bound, (block, member) = rows.bound, rows.place
    of, at = block[bound], member[bound]
    # effects of the bounds given the readings; no time is a bound
    cross = errors.shared[..., of, at, :] * rows.is_read[of]
    mean = (cross * found.weighted[..., of, :]).sum(-1)
    mean = mean + (columns[..., bound, :] * found.linear[..., None, :]).sum(-1)
    left = (
        columns[..., bound, :]
        - (cross[..., None, :] @ found.by_columns[..., of, :, :])[..., 0, :]
    )
    solved = (found.inverse[..., of, :, :] @ cross[..., None])[..., 0]
    same = of[:, None] == of
    among = errors.shared[..., of[:, None], at[:, None], at] - (
        cross[..., :, None, :] * solved[..., None, :, :]
    ).sum(-1)
    among = among * same + left @ found.spread @ _turned(xp, left)
    error = _root(xp, among) @ rows.points
    needed = (residual[..., bound] - mean)[..., None] - error
    needed = needed / xp.sqrt(errors.own[..., bound, None])
    share = _survival(xp, needed, rows.noise).prod(-2).mean(-1)
    return xp.maximum(share, 1e-300)


def by_information(
    rows: Rows,
    errors: Errors,
    variance: Float[np.ndarray, " row"],
    columns: Float[np.ndarray, "row column"],
) -> Float[np.ndarray, "row column"]:
    """Return the precision of the readings times columns, at the first place.

    Args:
        rows: The log.
        errors: Errors, by one kernel.
        variance: Variance of each own error.
        columns: Columns.
    """
    first = Errors(*(part[:1, :1] for part in errors))
    silent = np.zeros((1, 1, len(variance)))
    found = _normal(np, rows, first, variance[None, None], silent, sized=False)
    return found.at((0, 0)).solved(rows, columns)


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
    place, count = np.arange(len(kernel)), len(kernel)
    errors = field.errors
    errors = Errors(
        errors.shared[place, kernel][:, None],
        errors.effect[place, kernel if errors.effect.shape[1] > 1 else 0][:, None],
        errors.own[place, kernel][:, None],
    )
    rate = field.rate[place, kernel][:, None]
    scale = np.ones_like(rate)
    if rows.noise != "gaussian":
        scale = rng.gamma(SHAPE, 1.0, (count, draws, rate.shape[-1])) / rate
    found = _normal(np, rows, errors, errors.own / scale, field.residual)
    total = found.log_likelihood
    if rows.noise != "gaussian":
        # prior over proposal of the scales
        ratio = (
            SHAPE_BEFORE * math.log(SHAPE_BEFORE)
            - scipy.special.gammaln(SHAPE_BEFORE)
            - SHAPE * np.log(rate)
            + scipy.special.gammaln(SHAPE)
            + (SHAPE_BEFORE - SHAPE) * np.log(scale)
            + (rate - SHAPE_BEFORE) * scale
        )
        total = total + np.where(rows.is_bound, 0.0, ratio).sum(-1)
    whole = log_sum(total, axis=1)
    gain = whole - math.log(total.shape[1]) - approximate
    of = chosen(np.exp(total - whole[:, None]), rng)
    size = rows.columns.shape[1]
    # the corner of a covariance is that of the linear numbers alone
    root = _root(np, found.spread[place, of, :size, :size])
    unit = rng.standard_normal((count, size, 1))
    drawn = found.linear[place, of, :size] + (root @ unit)[..., 0]
    return gain, field.middle + drawn


def spread_points(
    count: int, size: int, shift: float = 0.5
) -> Float[np.ndarray, "point axis"]:
    """Return points that are evenly spread over the unit cube.

    Multiples of the powers of 1/g, with g^(size + 1) = g + 1: the generalised golden
    ratio (Roberts 2018, The unreasonable effectiveness of quasirandom sequences).

    Args:
        count: Number of points.
        size: Dimensions of the cube.
        shift: Coordinate of the point before the first in every dimension.
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (size + 1))
    steps = ratio ** -np.arange(1.0, size + 1)
    found = (shift + np.arange(1, count + 1)[:, None] * steps) % 1.0
    return np.clip(found, 1e-9, 1 - 1e-9)


def log_sum(x: np.ndarray, axis: int | None = None) -> Any:
    """Return ln of the sum of exp."""
    with np.errstate(invalid="ignore"):  # of a place without a density
        return np.logaddexp.reduce(x, axis=axis)


def chosen(
    shares: Float[np.ndarray, "place option"], rng: np.random.Generator
) -> Int[np.ndarray, " place"]:
    """Draw one option at each place by its share."""
    return (shares.cumsum(1) > rng.random(len(shares))[:, None]).argmax(1)


def _times(inverse, members):
    """Return the product of a matrix of each block with its members."""
    return inverse * members if inverse.shape[-1] == 1 else inverse @ members


def _across(xp: ModuleType, one, other):
    """Return the products of columns, summed over all members of all blocks."""
    return _turned(xp, _in_rows(one)) @ _in_rows(other)


def _onto(columns, matrix):
    """Return columns of all members of all blocks times a matrix."""
    found = _in_rows(columns) @ matrix
    return found.reshape(*found.shape[:-2], *columns.shape[-3:-1], found.shape[-1])


def _in_rows(columns):
    blocks, members, count = columns.shape[-3:]
    return columns.reshape(*columns.shape[:-3], blocks * members, count)


def _turned(xp: ModuleType, matrix):
    return xp.swapaxes(matrix, -1, -2)


def _inverse(xp: ModuleType, matrix):
    """Invert positive definite matrices, or triangular ones."""
    if matrix.shape[-1] == 1:
        return 1 / matrix
    return np.linalg.inv(matrix) if xp is np else _eliminated(matrix)[0]


def _log_size(xp: ModuleType, matrix):
    """Return ln of the determinant of positive definite matrices."""
    if matrix.shape[-1] == 1:
        return xp.log(matrix[..., 0, 0])
    return np.linalg.slogdet(matrix)[1] if xp is np else _eliminated(matrix)[1]


def _eliminated(matrix):
    # without LAPACK: see `path_scatter`
    count = matrix.shape[-1]
    if not count:
        return matrix, jnp.zeros(matrix.shape[:-2])
    flat = matrix.reshape(-1, count, count)
    found, size = jax.vmap(solve_system, (0, None))(flat, jnp.eye(count))
    return found.reshape(matrix.shape), size.reshape(matrix.shape[:-2])


def _root(xp: ModuleType, matrix):
    """Return the Cholesky factor of small matrices, which may be singular."""
    columns = []
    # what rounding leaves of a singular matrix is no pivot
    least = 1e-12 * xp.diagonal(matrix, axis1=-2, axis2=-1) + 1e-30
    for i in range(matrix.shape[-1]):
        pivot = xp.sqrt(xp.maximum(matrix[..., i, i], least[..., i]))
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
