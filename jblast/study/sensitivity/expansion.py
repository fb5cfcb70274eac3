r"""An outcome as a sum of orthonormal polynomials of the numbers it is drawn from.

Each number is replaced by its rank, as a uniform or as a normal score, whichever serves
better, so that no prior need be known. Of the coefficients $c_\alpha$ of the products
$\prod_i P_{\alpha_i}$ the variance that number $i$ has a part in follows at once
(Sudret 2008): alone $\sum c_\alpha^2$ over those of it only, in all over those that it
enters. The degree is chosen by leaving out one sample at a time (Blatman and
Sudret 2010), in closed form.
"""

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy.polynomial import hermite_e, legendre
from scipy.linalg import solve_triangular
from scipy.special import factorial, ndtri

DEGREES = range(1, 11)
ROWS_A_TERM = 5
"""Samples to a coefficient, at least."""
MOST_TERMS = 200
PATIENCE = 3
"""Degrees that are no better, after which none higher is tried."""
FAMILIES = ("hermite", "legendre")


class Expansion(NamedTuple):
    """What was fitted.

    Attributes:
        design: Products of polynomials at each sample, the constant first.
        powers: Degree of each number in each product.
        coefficients: Of the products.
        explained: Share of the variance of a sample left out that is predicted.
        family: Polynomials of which score.
    """

    design: Float[np.ndarray, "sample term"]
    powers: Int[np.ndarray, "term input"]
    coefficients: Float[np.ndarray, " term"]
    explained: float
    family: str


def expansion_of(
    inputs: Float[np.ndarray, "sample input"], values: Float[np.ndarray, " sample"]
) -> Expansion:
    """Fit expansions of several degrees, and return that which predicts best."""
    ranks = uniform_scores(inputs)
    best: list[Expansion] = []
    for family in FAMILIES:
        own: list[Expansion] = []
        for degree in DEGREES:
            powers = powers_of(inputs.shape[1], degree)
            many = len(powers) * ROWS_A_TERM > len(values) or len(powers) > MOST_TERMS
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
    """Return coefficients and the share of variance predicted, one sample left out."""
    # by the normal equations: the columns are nearly orthogonal as they come
    gram = design.T @ design + 1e-9 * len(values) * np.eye(design.shape[1])
    root = np.linalg.cholesky(gram)
    rotated = solve_triangular(root, design.T, lower=True, check_finite=False)
    found = solve_triangular(root.T, rotated @ values, check_finite=False)
    left = np.maximum(1 - np.sum(rotated**2, axis=0), 1e-12)
    off = (values - design @ found) / left
    variance = np.var(values)
    return found, float(1 - np.mean(off**2) / variance) if variance > 0 else 0.0


def uniform_scores(
    inputs: Float[np.ndarray, "sample input"],
) -> Float[np.ndarray, "sample input"]:
    """Return the rank of each value, from 0 to 1."""
    from scipy.stats import rankdata

    return (rankdata(inputs, axis=0) - 0.5) / len(inputs)


def powers_of(inputs: int, degree: int) -> Int[np.ndarray, "term input"]:
    """Return all degrees of products of a total degree at most that."""
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
    if family == "hermite":
        each = hermite_e.hermevander(ndtri(ranks), most) / np.sqrt(factorial(order))
    else:
        each = legendre.legvander(2 * ranks - 1, most) * np.sqrt(2 * order + 1)
    found = np.ones((len(ranks), len(powers)))
    for n in range(ranks.shape[1]):
        found *= each[:, n, powers[:, n]]
    return found


def shares_of(
    powers: Int[np.ndarray, "term input"],
    coefficients: Float[np.ndarray, " term"],
    variance: float,
) -> tuple[Float[np.ndarray, " input"], Float[np.ndarray, " input"]]:
    """Return first and total shares of a variance."""
    squares, entered = coefficients**2, powers > 0
    alone = entered & (entered.sum(axis=1) == 1)[:, None]
    scale = variance if variance > 0 else 1.0
    return squares @ alone / scale, squares @ entered / scale
