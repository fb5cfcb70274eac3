r"""Sobol' indices: what share of an outcome's variance each drawn number has.

The first index of a number is the share that it explains alone, the total one that of
all terms it takes part in (Sobol' 1993; Homma and Saltelli 1996); they differ where
numbers act together. From samples that are there already they follow from an expansion
(`expansion`); of a function that can be called again from the pairs of matrices of
Saltelli et al. (2010), by SciPy. Both are bootstrapped.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.study.sensitivity.expansion import Expansion, expansion_of, shares_of
from jblast.study.statistics import LEVEL

RESAMPLES = 200
GROUPS = 100
MOST_ROWS = 4000
"""Samples that an expansion is fitted to; of more, so many evenly chosen."""
LEAST_ROWS = 30
FAR = 0.1
"""Of first and total index, or of shares by slope and by variance: more is told."""


class SobolIndices(NamedTuple):
    """Of one outcome; each interval holds 90 %.

    Attributes:
        names: Of the drawn numbers.
        first: Share of the variance that each explains alone.
        first_interval: Its lower and upper end.
        total: Share of all terms that each takes part in.
        total_interval: Its lower and upper end.
        explained: Share of the variance of new samples that the method accounts for;
            the rest is noise that no drawn number makes, or steps too sharp for it.
        method: How they were found, in words.
        rows: Samples they were found from.
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
    """Return the indices of samples as they are; None where they do not tell any.

    Args:
        inputs: What was drawn, independently, by name; what does not vary is left out.
        values: The outcome; samples of which it is not finite are left out.
        resamples: Of the bootstrap.
        seed: Of it.
    """
    names = [name for name, of in inputs.items() if np.ptp(of) > 0]
    good = np.isfinite(values)
    values = np.asarray(values, float)[good]
    if len(values) < max(LEAST_ROWS, 3 * len(names)) or not names or not np.ptp(values):
        return None
    matrix = np.column_stack([np.asarray(inputs[name])[good] for name in names])
    if len(values) > MOST_ROWS:
        chosen = np.linspace(0, len(values) - 1, MOST_ROWS).astype(int)
        matrix, values = matrix[chosen], values[chosen]
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


def resampled(
    fitted: Expansion, values: Float[np.ndarray, " sample"], resamples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return first and total indices of a bootstrap, a row each.

    What is drawn again is one of `GROUPS` groups of samples, whose sums of products are
    made once: fits of thousands of samples cost what their coefficients do.
    """
    rng, count = np.random.default_rng(seed), len(values)
    groups = min(GROUPS, count)
    parts = [np.arange(n, count, groups) for n in range(groups)]
    grams = np.array([fitted.design[of].T @ fitted.design[of] for of in parts])
    sides = np.array([fitted.design[of].T @ values[of] for of in parts])
    squares = np.array([values[of] @ values[of] for of in parts])
    sizes = np.array([len(of) for of in parts])
    # so that terms without samples do not stop it; nothing else notices
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
        function: From standard normal coordinates of all numbers to the outcome.
        names: Of the numbers.
        points: Rows of each matrix, a power of two; the function is called of
            `points` times two more than there are numbers.
        resamples: Of the bootstrap.
        seed: Of the points and of the bootstrap.

    Raises:
        ValueError: `points` is no power of two, or an outcome is not finite.
    """
    from scipy.stats import norm, sobol_indices

    if points < 2 or points & (points - 1):
        raise ValueError(f"points: expected a power of two, got {points}")

    def called(columns):
        values = np.asarray(function(columns.T), float)
        if not np.isfinite(values).all():
            raise ValueError("expected an outcome of finite values, got others")
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
    """Return by number why its slope and its indices tell different things.

    Args:
        indices: Of the outcome.
        slope_shares: By number the share of the variance were the outcome as straight
            as at the middle: slope times standard deviation, squared, over the sum.
    """
    said = {}
    for n, name in enumerate(indices.names):
        if name not in slope_shares:
            continue
        first, total, by_slope = indices.first[n], indices.total[n], slope_shares[name]
        if abs(by_slope - first) <= FAR and abs(by_slope - total) <= FAR:
            continue
        if total - first > FAR:
            said[name] = "interaction"
        elif by_slope < first:
            said[name] = "range"
        else:
            said[name] = "nonlinearity"
    return said
