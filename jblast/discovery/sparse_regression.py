"""Sparse regression on candidate terms with PySINDy's optimizers.

Candidates for the right side of an equation are named functions of the states, such as
polynomials. Standard deviations of coefficients follow from the noise of the record; a
term counts as significant at `SIGNIFICANT` of them.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

with warnings.catch_warnings():
    # PySINDy loads numpyro where it is installed, whose progress bar warns in notebooks
    warnings.filterwarnings("ignore", "IProgress not found")
    import pysindy

SIGNIFICANT = 3.0
"""Standard deviations by which a coefficient must differ from zero: by chance 0.3 %."""
RIDGE = 1e-10
"""Ridge penalty for columns of unit mean square: too small to change a coefficient."""
REPEATED = 1e-6
"""Residual share of a term after regression on earlier ones below which it repeats
them."""
COLLINEAR = 10.0
"""Variance inflation factor of two terms above which they count as nearly collinear:
the usual limit (Marquardt 1970, Technometrics 12:591). Regression on one then leaves
less than a third of the other."""


@dataclass(frozen=True)
class Candidates:
    """Candidate terms of an equation.

    Attributes:
        names: Name of each term.
        evaluate: Function from the columns (states, then inputs), shape (place,
            column), to the terms, shape (place, term).
    """

    names: tuple[str, ...]
    evaluate: Callable[[Float[np.ndarray, "place column"]], np.ndarray]


def polynomial(
    columns: Sequence[str], degree: int = 2, *, signed_squares: bool = False
) -> Candidates:
    """Return all products of columns up to a degree, with the constant.

    Args:
        columns: Names of states, then of inputs.
        degree: Largest degree of a product.
        signed_squares: Whether |x| x of each column is included, as in drag.
    """
    library = pysindy.PolynomialLibrary(degree=degree)
    library.fit(np.zeros((1, len(columns))))  # type: ignore (arrays are taken)
    names = library.get_feature_names(list(columns))
    powers = np.asarray(library.powers_)
    if signed_squares:
        names += [f"|{name}| {name}" for name in columns]

    def evaluate(values: Float[np.ndarray, "place column"]) -> np.ndarray:
        # Not by the library: its `transform` copies and checks each record.
        products = np.prod(values[:, None, :] ** powers, axis=2)
        if not signed_squares:
            return products
        return np.concatenate([products, np.abs(values) * values], axis=1)

    return Candidates(tuple(names), evaluate)


class Regression(NamedTuple):
    """Regression problem of one equation, with windows as rows.

    Attributes:
        terms: Integral of each candidate.
        covariance: Covariance of the noise of the left side.
    """

    terms: Float[np.ndarray, "window term"]
    covariance: Float[np.ndarray, "window window"]


def least_squares(
    regression: Regression,
    left: Float[np.ndarray, " window"],
    kept: Bool[np.ndarray, " term"],
) -> tuple[Float[np.ndarray, " term"], Float[np.ndarray, " term"]]:
    """Return coefficients and their standard deviations; zero for other terms.

    If the residuals exceed the noise, the standard deviations are scaled by the ratio.
    """
    # for nearly collinear terms the pseudo-inverse gives the smallest coefficients
    inverse = np.linalg.pinv(regression.terms[:, kept])
    found = inverse @ left
    over = np.mean((left - regression.terms[:, kept] @ found) ** 2)
    noise = np.mean(np.diag(regression.covariance))
    variance = np.sum((inverse @ regression.covariance) * inverse, axis=1)
    # never smaller than by noise: a lucky fit does not make a term significant
    if over > noise:
        variance *= over / noise if noise > 0.0 else 1.0
    coefficients, sds = np.zeros(kept.shape), np.zeros(kept.shape)
    coefficients[kept], sds[kept] = found, np.sqrt(np.maximum(variance, 0.0))
    return coefficients, sds


def sparse_terms(
    regression: Regression, left: Float[np.ndarray, " window"], threshold: float
) -> Bool[np.ndarray, " term"]:
    """Return a mask of the terms of an equation, by backward selection.

    Sequentially thresholded least squares (Brunton, Proctor and Kutz 2016, PNAS
    113:3932) is applied to terms and left side of unit mean square, so that the
    threshold has no unit. It keeps pairs of similar terms that cancel. Therefore the
    least significant coefficient below three standard deviations is dropped and the
    rest thresholded again, until all are significant.

    Args:
        regression: Regression problem.
        left: Left side of the equation.
        threshold: Smallest share of the left side's root mean square of a term.
    """
    size = np.sqrt(np.mean(regression.terms**2, axis=0))
    whole = np.sqrt(np.mean(left**2))
    # a term that is zero along the record cannot be scaled
    kept = size > 0.0
    while np.any(kept):
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=RIDGE, max_iter=50)
        with warnings.catch_warnings():  # an empty equation is a valid result
            warnings.simplefilter("ignore")
            optimizer.fit(regression.terms[:, kept] / size[kept], left / whole)
        kept[kept] = optimizer.coef_[0] != 0.0
        if not np.any(kept):
            break
        coefficients, sds = least_squares(regression, left, kept)
        certain = np.full(kept.shape, np.inf)
        sure = kept & (sds > 0.0)
        certain[sure] = np.abs(coefficients[sure]) / sds[sure]
        worst = np.argmin(certain)
        # one at a time: the significance of the others increases with each one dropped
        if certain[worst] >= SIGNIFICANT:
            break
        kept[worst] = False
    return kept


def repeated_terms(
    terms: Float[np.ndarray, "window term"],
) -> Bool[np.ndarray, " term"]:
    """Return a mask of candidates that are sums of earlier ones on this record."""
    size = np.linalg.norm(terms, axis=0)
    unit = terms / np.where(size > 0.0, size, 1.0)
    repeats = np.zeros(terms.shape[1], bool)
    for term in range(terms.shape[1]):
        earlier = unit[:, :term][:, ~repeats[:term]]
        over = unit[:, term]
        if earlier.shape[1]:
            over = over - earlier @ np.linalg.lstsq(earlier, over)[0]
        repeats[term] = np.linalg.norm(over) < REPEATED
    return repeats


def exchangeable_terms(
    regression: Regression,
    left: Float[np.ndarray, " window"],
    kept: Bool[np.ndarray, " term"],
    linear: Bool[np.ndarray, " term"] | None = None,
) -> list[tuple[int, int]]:
    """Return pairs of a term of an equation and a candidate that could replace it.

    Given the other terms of the equation, the two are nearly collinear: their variance
    inflation factor is above `COLLINEAR`. With both in the equation, the coefficient of
    the original term is less than three standard deviations from zero, so that the
    equation with the candidate in its place is not rejected. Of two columns the same is
    tested given a constant, and given the other columns, too: one may be the sum of the
    other one, of further columns and of a constant.

    Args:
        regression: Regression problem with all candidates, repeated ones too.
        left: Left side of the equation.
        kept: Mask of the terms of the equation.
        linear: Mask of the constant, which is the first term, and of single columns.
    """
    pairs = []
    linear = np.zeros(kept.shape, bool) if linear is None else linear
    constant = linear & (np.arange(len(kept)) == 0)
    for own in np.flatnonzero(kept).tolist():
        for other in np.flatnonzero(~kept).tolist():
            columns = linear[[own, other]].all() and not constant[[own, other]].any()
            for beside in (kept, kept | constant, kept | linear)[: 3 if columns else 1]:
                rest = beside.copy()
                rest[[own, other]] = False
                if _exchangeable(regression, left, rest, own, other):
                    pairs.append((own, other))
                    break
    return pairs


def _exchangeable(
    regression: Regression,
    left: Float[np.ndarray, " window"],
    rest: Bool[np.ndarray, " term"],
    own: int,
    other: int,
) -> bool:
    """Return whether a candidate could replace a term next to the rest of the terms."""
    terms, pair = regression.terms, regression.terms[:, [own, other]]
    size = np.linalg.norm(pair, axis=0)
    # by the pseudo-inverse: columns of the rest may be sums of others
    free = pair - terms[:, rest] @ (np.linalg.pinv(terms[:, rest]) @ pair)
    left_over = np.linalg.norm(free, axis=0)
    # a term that equals a sum of the rest is replaced by none of them
    if np.any(left_over <= REPEATED * size):
        return False
    cosine = float(free[:, 0] @ free[:, 1] / np.prod(left_over))
    independent = 1.0 - min(cosine**2, 1.0)
    if independent * COLLINEAR > 1.0:
        return False
    both = rest.copy()
    both[[own, other]] = True
    found, sds = least_squares(regression, left, both)
    same = independent < REPEATED**2
    return bool(same or abs(found[own]) < SIGNIFICANT * sds[own])
