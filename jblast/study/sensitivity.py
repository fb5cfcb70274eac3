r"""Contributions of inputs to an outcome's scatter: Sobol' indices and elasticities.

The first-order index of an input is the share of the variance that it explains alone,
the total index that of all terms in which it takes part (Sobol' 1993; Homma and
Saltelli 1996); they differ where inputs interact. Both are bootstrapped.

They follow from an expansion of the outcome in orthonormal polynomials. Each input is
replaced by its rank, so that no prior is needed. From the coefficients $c_\alpha$ of
the products $\prod_i P_{\alpha_i}$ the variance due to input $i$ follows directly
(Sudret 2008): alone it is $\sum c_\alpha^2$ over the terms of $i$ only, in total over
all terms with $i$. The degree is chosen by leave-one-out cross-validation (Blatman and
Sudret 2010), in closed form.

An elasticity is the change of an outcome in per cent for 1 % of an input.
"""

import itertools
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy.polynomial import legendre
from scipy.linalg import solve_triangular

from jblast.quantities import QUANTITIES
from jblast.study.columns import StudyColumns
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
MAX_LANES = 12
"""Largest number of analysed lanes: each takes seconds."""
NO_EFFECT = 0.02
"""Total index below which an input has no effect, by declaration. Chance alone gives
terms over samples, at most 200/4000 of the unexplained variance for all inputs."""


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


def shares_from_samples(
    inputs: Mapping[str, Float[np.ndarray, " sample"]],
    values: Float[np.ndarray, " sample"],
    outcome: str = "",
    sensor: str | None = None,
    *,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Shares | None:
    """Return the sources of scatter of existing samples; None if there are too few.

    Args:
        inputs: Independent inputs by name; constant ones are ignored.
        values: Outcome; samples without a finite one are ignored.
        outcome: Its name.
        sensor: Its sensor.
        resamples: Number of resamples of the bootstrap.
        seed: Seed of the bootstrap.
    """
    names = [name for name, of in inputs.items() if np.ptp(of) > 0]
    good = np.isfinite(values)
    known = np.asarray(values, float)[good]
    if len(known) < max(MIN_ROWS, 3 * len(names)) or not names or not np.ptp(known):
        return None
    matrix = np.column_stack([np.asarray(inputs[name])[good] for name in names])
    if len(known) > MAX_ROWS:
        # evenly instead of at random, so that the result does not depend on a seed
        chosen = np.linspace(0, len(known) - 1, MAX_ROWS).astype(int)
        matrix, known = matrix[chosen], known[chosen]
    # unit variance: squared coefficients are shares
    scaled = (known - known.mean()) / known.std()
    fitted = expansion_of(matrix, scaled)
    indices = shares_of(fitted.powers, fitted.coefficients, 1.0)
    ends = [0.5 - LEVEL / 2, 0.5 + LEVEL / 2]
    # by input: lower and upper bound
    first_interval, total_interval = (
        np.quantile(found, ends, axis=0).T.tolist()
        for found in resampled(fitted, scaled, resamples, seed)
    )
    elastic, by_slope = fitted_slopes(inputs, values)
    numbers = tuple(
        InputShare(
            name,
            first,
            (first_interval[n][0], first_interval[n][1]),
            total,
            (total_interval[n][0], total_interval[n][1]),
            elastic[name],
            disagreement(first, total, by_slope[name]),
        )
        for n, (name, first, total) in enumerate(
            zip(names, *map(np.ndarray.tolist, indices), strict=True)
        )
    )
    method = f"an expansion in {len(fitted.powers)} polynomials"
    return Shares(outcome, sensor, fitted.explained, method, len(known), numbers)


class Expansion(NamedTuple):
    """Expansion of an outcome in products of orthonormal polynomials.

    Attributes:
        design: Products of polynomials at each sample, the constant first.
        powers: Degree of each input in each product.
        coefficients: Coefficients of the products.
        explained: Share of variance predicted by leave-one-out cross-validation.
    """

    design: Float[np.ndarray, "sample term"]
    powers: Int[np.ndarray, "term input"]
    coefficients: Float[np.ndarray, " term"]
    explained: float


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


def disagreement(first: float, total: float, by_slope: float) -> str | None:
    """Return the reason of a disagreement of slope and indices; None if they agree.

    Args:
        first: First-order index of the input.
        total: Its total index.
        by_slope: Its share of the variance if the outcome were linear: squared product
            of slope and standard deviation, over the sum.
    """
    if max(abs(by_slope - first), abs(by_slope - total)) <= DISAGREEMENT:
        return None
    if total - first > DISAGREEMENT:
        return "acts together with others"
    if by_slope < first:
        return "has a larger effect over its whole range than its slope at the middle"
    return "is steep at the middle, and levels off"


def expansion_of(
    inputs: Float[np.ndarray, "sample input"], values: Float[np.ndarray, " sample"]
) -> Expansion:
    """Return the expansion with the best predictions, over degrees."""
    from scipy.stats import rankdata

    ranks = (rankdata(inputs, axis=0) - 0.5) / len(inputs)
    found: list[Expansion] = []
    for degree in DEGREES:
        powers = powers_of(inputs.shape[1], degree)
        many = len(powers) * ROWS_A_TERM > len(values) or len(powers) > MAX_TERMS
        # the first degree is always fitted, however few samples there are
        if found and many:
            break
        design = design_of(ranks, powers)
        found.append(Expansion(design, powers, *fit(design, values)))
        if len(found) > int(np.argmax([e.explained for e in found])) + PATIENCE:
            break
    return max(found, key=lambda one: one.explained)


def fit(
    design: Float[np.ndarray, "sample term"], values: Float[np.ndarray, " sample"]
) -> tuple[Float[np.ndarray, " term"], float]:
    """Return coefficients and the share of variance predicted by leave-one-out."""
    # normal equations are accurate enough: the columns are nearly orthonormal
    gram = design.T @ design + 1e-9 * len(values) * np.eye(design.shape[1])
    root = np.linalg.cholesky(gram)
    rotated = np.asarray(
        solve_triangular(root, design.T, lower=True, check_finite=False)
    )
    found = np.asarray(solve_triangular(root.T, rotated @ values, check_finite=False))
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
) -> Float[np.ndarray, "sample term"]:
    """Return the products of orthonormal polynomials at each sample."""
    most = int(powers.max())
    order = np.arange(most + 1)
    # unit variance under the density of the inputs: squared coefficients are
    # variances
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


def lane_shares(columns: StudyColumns) -> tuple[Shares, ...]:
    """Return the sources of scatter of the first lanes, if their samples identify them.

    Axes over numbers count as sampled evenly from their values.
    """
    draws = len(columns.lanes[0].values) if columns.lanes else 0
    inputs = {name: values.ravel() for name, values in columns.inputs.items()}
    for axis in columns.numeric_axes:
        inputs[axis.name] = np.tile(axis.values[axis.at], draws)
    found = [
        shares_from_samples(inputs, lane.values.ravel(), lane.name, lane.sensor or None)
        for lane in columns.lanes[:MAX_LANES]
    ]
    return tuple(shares for shares in found if shares is not None)


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
