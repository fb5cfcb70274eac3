r"""Contributions of inputs to an outcome's scatter: Sobol' indices and elasticities.

The first-order index of an input is the share of the variance that it explains alone,
the total index that of all terms in which it takes part (Sobol' 1993; Homma and
Saltelli 1996); they differ where inputs interact. Both are bootstrapped. For a function
that can be called again they follow from the pairs of matrices of Saltelli et al.
(2010), by SciPy.

For existing samples they follow from an expansion of the outcome in orthonormal
polynomials. Each input is replaced by its rank, as a uniform or a normal score,
whichever fits better, so that no prior is needed. From the coefficients $c_\alpha$ of
the products $\prod_i P_{\alpha_i}$ the variance due to input $i$ follows directly
(Sudret 2008): alone it is $\sum c_\alpha^2$ over the terms of $i$ only, in total over
all terms with $i$. The degree is chosen by leave-one-out cross-validation (Blatman and
Sudret 2010), in closed form.

An elasticity is the change of an outcome in per cent for 1 % of an input.
"""

import itertools
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from numpy.polynomial import hermite_e, legendre
from scipy.linalg import solve_triangular
from scipy.special import factorial, ndtri

from jblast.quantities import QUANTITIES
from jblast.study.columns import Lane, StudyColumns
from jblast.study.statistics import LEVEL

RESAMPLES = 200
"""Resamples of a bootstrap: some 10 lie beyond each bound of a 90 % interval."""
GROUPS = 100
"""Groups of samples that a bootstrap resamples.

Sums of products are computed once a group, so that a resample costs as much as 100
samples, whatever their number.
"""
MAX_ROWS = 4000
"""Largest number of samples in a fit; more are thinned evenly.

4,000 samples give each of `MAX_TERMS` coefficients 20; the cost of a fit grows with
their number, its precision with the square root only.
"""
MIN_ROWS = 30
"""Fewer samples have no expansion, by declaration: their intervals would be useless."""
DISAGREEMENT = 0.1
"""Smallest reported difference of first and total index, or of shares by slope and by
variance. By declaration: a tenth of the variance matters to a decision.
"""
DEGREES = range(1, 11)
"""Degrees of the polynomials that are compared."""
ROWS_A_TERM = 5
"""Samples for each coefficient at least: with fewer, a fit follows single samples."""
MAX_TERMS = 200
"""Coefficients of an expansion beyond its first degree: the cost of a bootstrap grows
with the cube."""
PATIENCE = 3
"""Degrees without improvement after which the search ends; an even outcome skips
one."""
FAMILIES = ("hermite", "legendre")
MAX_LANES = 12
"""Largest number of analysed lanes: each takes seconds."""
REASONS = {
    "interaction": "acts together with others",
    "range": "has a larger effect over its whole range than its slope at the middle",
    "nonlinearity": "is steep at the middle, and levels off",
}
NO_EFFECT = 0.02
"""Total index below which an input has no effect, by declaration. Chance alone gives
terms over samples, at most 200/4000 of the unexplained variance for all inputs."""


def elasticities(
    outcome: Callable[[Mapping[str, Float[Array, ""]]], Float[Array, ""]],
    numbers: Mapping[str, float],
) -> dict[str, float]:
    r"""Return $\partial\ln|y|/\partial\ln|x|$ of each number, by `jax.grad`.

    Args:
        outcome: Function of numbers by name, with one value.
        numbers: Point at which the slopes are computed.

    Returns:
        Elasticity by name; NaN where the outcome or the number is zero.
    """
    point = {name: jnp.asarray(value, float) for name, value in numbers.items()}
    value, slopes = jax.jit(jax.value_and_grad(outcome))(point)
    y = float(value)
    return {
        name: float(slopes[name]) * numbers[name] / y
        if y and numbers[name]
        else float("nan")
        for name in numbers
    }


def fitted_slopes(
    inputs: Mapping[str, Float[np.ndarray, " sample"]],
    values: Float[np.ndarray, " sample"],
) -> tuple[dict[str, float], dict[str, float]]:
    """Return elasticities and shares of variance of a plane fitted to samples.

    This is an estimate of slopes from stored samples alone. The plane is fitted by
    least squares to the tenth of the samples nearest to the median, in units of
    standard deviations.

    Returns:
        Elasticity at the medians by name, NaN for a median or outcome of zero; and the
        share of the variance by name if the outcome were linear.
    """
    names = [name for name, of in inputs.items() if np.ptp(of) > 0]
    good = np.isfinite(values)
    matrix = np.column_stack([np.asarray(inputs[name])[good] for name in names])
    y = np.asarray(values, float)[good]
    middle, sd = np.median(matrix, axis=0), matrix.std(axis=0)
    scores = (matrix - middle) / sd
    away = np.sum(scores**2, axis=1)
    # at least ten samples per coefficient, or all of them
    count = min(len(y), max(len(y) // 10, 10 * (len(names) + 1)))
    near = np.argpartition(away, count - 1)[:count]
    plane = np.column_stack([np.ones(count), scores[near]])
    found = np.linalg.lstsq(plane, y[near], rcond=None)[0]
    # inputs have unit deviation here: squared slopes are variances
    squares = found[1:] ** 2
    shares = squares / squares.sum() if squares.sum() > 0 else squares
    with np.errstate(divide="ignore", invalid="ignore"):
        elastic = np.where(
            (found[0] != 0) & (middle != 0), found[1:] / sd * middle / found[0], np.nan
        )
    return (
        dict(zip(names, map(float, elastic), strict=True)),
        dict(zip(names, map(float, shares), strict=True)),
    )


class SobolIndices(NamedTuple):
    """Sobol' indices of one outcome, with 90 % intervals.

    Attributes:
        names: Names of the inputs.
        first: Share of the variance that each input explains alone.
        first_interval: Lower and upper bound of `first`.
        total: Share of the variance due to all terms with the input.
        total_interval: Lower and upper bound of `total`.
        explained: Share of the variance of new samples that the expansion predicts.
            The remainder is noise, or steps that polynomials cannot represent.
        method: Name of the method.
        rows: Number of samples used.
    """

    names: tuple[str, ...]
    first: Float[np.ndarray, " input"]
    first_interval: Float[np.ndarray, "2 input"]
    total: Float[np.ndarray, " input"]
    total_interval: Float[np.ndarray, "2 input"]
    explained: float
    method: str
    rows: int


def indices_from_samples(
    inputs: Mapping[str, Float[np.ndarray, " sample"]],
    values: Float[np.ndarray, " sample"],
    *,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> SobolIndices | None:
    """Return the indices of existing samples; None if there are too few.

    Args:
        inputs: Independent inputs by name; constant ones are ignored.
        values: Outcome; samples without a finite one are ignored.
        resamples: Number of resamples of the bootstrap.
        seed: Seed of the bootstrap.
    """
    names = [name for name, of in inputs.items() if np.ptp(of) > 0]
    good = np.isfinite(values)
    values = np.asarray(values, float)[good]
    if len(values) < max(MIN_ROWS, 3 * len(names)) or not names or not np.ptp(values):
        return None
    matrix = np.column_stack([np.asarray(inputs[name])[good] for name in names])
    if len(values) > MAX_ROWS:
        # evenly instead of at random, so that the result does not depend on a seed
        chosen = np.linspace(0, len(values) - 1, MAX_ROWS).astype(int)
        matrix, values = matrix[chosen], values[chosen]
    # unit variance: squared coefficients are shares
    scaled = (values - values.mean()) / values.std()
    fitted = expansion_of(matrix, scaled)
    first, total = shares_of(fitted.powers, fitted.coefficients, 1.0)
    firsts, totals = resampled(fitted, scaled, resamples, seed)
    ends = [0.5 - LEVEL / 2, 0.5 + LEVEL / 2]
    return SobolIndices(
        tuple(names),
        first,
        np.quantile(firsts, ends, axis=0),
        total,
        np.quantile(totals, ends, axis=0),
        fitted.explained,
        f"an expansion in {len(fitted.powers)} polynomials",
        len(values),
    )


class Expansion(NamedTuple):
    """Expansion of an outcome in products of orthonormal polynomials.

    Attributes:
        design: Products of polynomials at each sample, the constant first.
        powers: Degree of each input in each product.
        coefficients: Coefficients of the products.
        explained: Share of variance predicted by leave-one-out cross-validation.
        family: "hermite" (normal scores) or "legendre" (uniform ranks).
    """

    design: Float[np.ndarray, "sample term"]
    powers: Int[np.ndarray, "term input"]
    coefficients: Float[np.ndarray, " term"]
    explained: float
    family: str


def resampled(
    fitted: Expansion, values: Float[np.ndarray, " sample"], resamples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return first and total indices of a bootstrap, one row for each resample.

    The resampled units are `GROUPS` groups of samples, whose sums of products are
    computed once.
    """
    rng, count = np.random.default_rng(seed), len(values)
    groups = min(GROUPS, count)
    parts = [np.arange(n, count, groups) for n in range(groups)]
    grams = np.array([fitted.design[of].T @ fitted.design[of] for of in parts])
    sides = np.array([fitted.design[of].T @ values[of] for of in parts])
    squares = np.array([values[of] @ values[of] for of in parts])
    # groups differ by one sample if their number does not divide the samples
    sizes = np.array([len(of) for of in parts])
    # keeps the matrix regular if a term has no samples; 1e-9 of the diagonal otherwise
    floor = 1e-9 * count * np.eye(fitted.design.shape[1])
    found = []
    for _ in range(resamples):
        times = rng.multinomial(groups, np.full(groups, 1 / groups))
        gram = np.tensordot(times, grams, 1)
        gram += floor
        solved = np.linalg.solve(gram, times @ sides)
        number = times @ sizes
        mean = (times @ sides)[0] / number
        variance = float(times @ squares / number - mean**2)
        found.append(shares_of(fitted.powers, solved, variance))
    firsts, totals = zip(*found, strict=True)
    return np.array(firsts), np.array(totals)


def indices_of_function(
    function: Callable[[Float[np.ndarray, "sample input"]], Float[np.ndarray, " s"]],
    names: tuple[str, ...],
    points: int = 1024,
    *,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> SobolIndices:
    """Return the indices of a function, from calls of it.

    Args:
        function: Outcome, from standard normal coordinates of all inputs.
        names: Names of the inputs.
        points: Rows of each matrix, a power of two; the function is evaluated
            `points` times the number of inputs plus two.
        resamples: Number of resamples of the bootstrap.
        seed: Seed of the points and of the bootstrap.

    Raises:
        ValueError: `points` is no power of two, or an outcome is not finite.
    """
    from scipy.stats import norm, sobol_indices

    # Sobol' points are balanced for powers of two only
    if points < 2 or points & (points - 1):
        raise ValueError(f"points: expected a power of two, got {points}")

    def called(columns):
        values = np.asarray(function(columns.T), float)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise ValueError(
                f"expected a finite outcome of each sample, got {values[bad[0]]} of "
                f"sample {bad[0]}"
            )
        # SciPy expects outcomes on the first axis
        return values[None]

    rng = np.random.default_rng(seed)
    found = sobol_indices(func=called, n=points, dists=[norm()] * len(names), rng=rng)
    interval = found.bootstrap(confidence_level=LEVEL, n_resamples=resamples)
    first, total = interval.first_order, interval.total_order
    return SobolIndices(
        names,
        np.ravel(found.first_order),
        np.array(
            [first.confidence_interval.low, first.confidence_interval.high]
        ).reshape(2, -1),
        np.ravel(found.total_order),
        np.array(
            [total.confidence_interval.low, total.confidence_interval.high]
        ).reshape(2, -1),
        1.0,
        "pairs of matrices",
        points * (len(names) + 2),
    )


def disagreement(
    indices: SobolIndices, slope_shares: Mapping[str, float]
) -> dict[str, str]:
    """Return the reason of a disagreement of slope and indices, by input.

    Args:
        indices: Indices of the outcome.
        slope_shares: Share of the variance by input if the outcome were linear:
            squared product of slope and standard deviation, over the sum.
    """
    reasons = {}
    for n, name in enumerate(indices.names):
        if name not in slope_shares:
            continue
        first, total, by_slope = indices.first[n], indices.total[n], slope_shares[name]
        if (
            abs(by_slope - first) <= DISAGREEMENT
            and abs(by_slope - total) <= DISAGREEMENT
        ):
            continue
        if total - first > DISAGREEMENT:
            reasons[name] = "interaction"
        elif by_slope < first:
            reasons[name] = "range"
        else:
            reasons[name] = "nonlinearity"
    return reasons


def expansion_of(
    inputs: Float[np.ndarray, "sample input"], values: Float[np.ndarray, " sample"]
) -> Expansion:
    """Return the expansion with the best predictions, over families and degrees."""
    from scipy.stats import rankdata

    # the half keeps ranks inside (0, 1), where normal scores are finite
    ranks = (rankdata(inputs, axis=0) - 0.5) / len(inputs)
    best: list[Expansion] = []
    for family in FAMILIES:
        own: list[Expansion] = []
        for degree in DEGREES:
            powers = powers_of(inputs.shape[1], degree)
            many = len(powers) * ROWS_A_TERM > len(values) or len(powers) > MAX_TERMS
            # the first degree is always fitted, however few samples there are
            if own and many:
                break
            design = design_of(ranks, powers, family)
            own.append(Expansion(design, powers, *fit(design, values), family))
            at = int(np.argmax([one.explained for one in own]))
            if len(own) > at + PATIENCE:
                break
        best.append(max(own, key=lambda one: one.explained))
    return max(best, key=lambda one: one.explained)


def fit(
    design: Float[np.ndarray, "sample term"], values: Float[np.ndarray, " sample"]
) -> tuple[Float[np.ndarray, " term"], float]:
    """Return coefficients and the share of variance predicted by leave-one-out."""
    # normal equations are accurate enough: the columns are nearly orthonormal
    gram = design.T @ design + 1e-9 * len(values) * np.eye(design.shape[1])
    root = np.linalg.cholesky(gram)
    rotated = solve_triangular(root, design.T, lower=True, check_finite=False)
    found = solve_triangular(root.T, rotated @ values, check_finite=False)
    # leave-one-out residuals from the leverages: one fit in place of one per sample
    left = np.maximum(1 - np.sum(rotated**2, axis=0), 1e-12)
    off = (values - design @ found) / left
    variance = np.var(values)
    return found, float(1 - np.mean(off**2) / variance) if variance > 0 else 0.0


def powers_of(inputs: int, degree: int) -> Int[np.ndarray, "term input"]:
    """Return the degrees of all products of at most a total degree."""
    found = [
        np.bincount(chosen, minlength=inputs)
        for total in range(degree + 1)
        for chosen in itertools.combinations_with_replacement(range(inputs), total)
    ]
    return np.array([np.zeros(inputs, int) if not len(f) else f for f in found])


def design_of(
    ranks: Float[np.ndarray, "sample input"],
    powers: Int[np.ndarray, "term input"],
    family: str,
) -> Float[np.ndarray, "sample term"]:
    """Return the products of orthonormal polynomials at each sample."""
    most = int(powers.max())
    order = np.arange(most + 1)
    # unit variance under the density of the inputs: squared coefficients are
    # variances
    if family == "hermite":
        each = hermite_e.hermevander(ndtri(ranks), most) / np.sqrt(factorial(order))
    else:
        each = legendre.legvander(2 * ranks - 1, most) * np.sqrt(2 * order + 1)
    found = np.ones((len(ranks), len(powers)))
    for n in range(ranks.shape[1]):
        columns = each[:, n]
        if len(np.unique(ranks[:, n])) < len(ranks):
            columns = orthonormal(columns)
        found *= columns[:, powers[:, n]]
    return found


def orthonormal(
    columns: Float[np.ndarray, "sample degree"],
) -> Float[np.ndarray, "sample degree"]:
    """Return polynomials that are orthonormal over samples with repeated values.

    An input with few levels, as an axis of a study, has other ranks than a density:
    squared coefficients of its polynomials would not be shares. With n levels, a
    polynomial of degree n or more is a combination of lower ones; it is zero here.
    """
    rotated, root = np.linalg.qr(columns)
    size = np.diag(root)
    # rounding leaves 1e-16 of a dependent column; independent ones are far above 1e-9
    kept = np.abs(size) > 1e-9 * np.abs(size[0])
    return rotated * np.where(kept, np.sign(size), 0.0) * np.sqrt(len(columns))


def shares_of(
    powers: Int[np.ndarray, "term input"],
    coefficients: Float[np.ndarray, " term"],
    variance: float,
) -> tuple[Float[np.ndarray, " input"], Float[np.ndarray, " input"]]:
    """Return the first-order and total shares of a variance."""
    squares, entered = coefficients**2, powers > 0
    alone = entered & (entered.sum(axis=1) == 1)[:, None]
    # a constant resample has no shares: zeros instead of a division by zero
    scale = variance if variance > 0 else 1.0
    return squares @ alone / scale, squares @ entered / scale


@dataclass(frozen=True)
class InputShare:
    """Contribution of a parameter to the scatter of an outcome.

    Attributes:
        name: Name of the parameter.
        first: First-order Sobol' index: share of the variance that it explains alone.
        first_interval: 90 % interval of it.
        total: Total Sobol' index: share of the variance with its interactions.
        total_interval: 90 % interval of it.
        elasticity: Change of the outcome in per cent for one per cent of the parameter,
            at the middle of the samples.
        differs: Reason for a disagreement of slope and index; null if they agree.
    """

    name: str
    first: float
    first_interval: tuple[float, float]
    total: float
    total_interval: tuple[float, float]
    elasticity: float
    differs: str | None


@dataclass(frozen=True)
class Shares:
    """Sources of the scatter of an outcome.

    Attributes:
        outcome: Name of the outcome.
        sensor: Name of the sensor; null for none.
        explained: Share of the variance that the method explains.
        method: Description of the method.
        rows: Number of samples of the analysis.
        numbers: Contribution of each sampled parameter.
    """

    outcome: str
    sensor: str | None
    explained: float
    method: str
    rows: int
    numbers: tuple[InputShare, ...]

    @property
    def title(self) -> str:
        """Name of outcome and sensor."""
        return ", ".join(filter(None, (self.outcome, self.sensor)))

    @property
    def rest(self) -> float:
        """Share of the variance that no parameter explains."""
        return min(1.0, max(0.0, 1.0 - self.explained))

    @property
    def without_effect(self) -> list[str]:
        """Parameters without an effect on the outcome."""
        return [n.name for n in self.numbers if n.total_interval[1] < NO_EFFECT]


def lane_shares(columns: StudyColumns) -> tuple[Shares, ...]:
    """Return the sources of scatter of the first lanes, if their samples identify them.

    Axes over numbers count as sampled evenly from their values.
    """
    columns = columns.rows or columns
    inputs = dict(columns.inputs)
    inputs |= {axis.name: axis.values[axis.at] for axis in columns.numeric_axes}
    lanes = columns.lanes[:MAX_LANES]
    found = [(lane, indices_from_samples(inputs, lane.values)) for lane in lanes]
    return tuple(_shares(inputs, lane, of) for lane, of in found if of is not None)


def _shares(
    inputs: Mapping[str, np.ndarray], lane: Lane, indices: SobolIndices
) -> Shares:
    elastic, by_slope = fitted_slopes(inputs, lane.values)
    reasons = disagreement(indices, by_slope)
    first, last = indices.first_interval.T, indices.total_interval.T
    numbers = tuple(
        InputShare(
            name,
            float(indices.first[n]),
            (float(first[n, 0]), float(first[n, 1])),
            float(indices.total[n]),
            (float(last[n, 0]), float(last[n, 1])),
            elastic[name],
            REASONS[reasons[name]] if name in reasons else None,
        )
        for n, name in enumerate(indices.names)
    )
    whole = indices.explained, indices.method, indices.rows
    return Shares(lane.name, lane.sensor or None, *whole, numbers)


def rest_name(columns: StudyColumns, shares: Shares) -> str:
    """Return the source of the share of variance that no parameter explains."""
    kinds = {lane.name: lane.kind for lane in columns.lanes}
    if kinds[shares.outcome] == "yes_no":
        return "scatter and steps"
    scenes = columns.attributes.get("scene", "")
    texts = [scenes] if isinstance(scenes, str) else scenes.values()
    laws = [tomllib.loads(text).get("law", {}) for text in texts]
    scattered = any(law.get("scatter", True) for law in laws)
    at_sensor = shares.outcome in QUANTITIES
    return "scatter of the law" if at_sensor and scattered else "noise"
