"""Candidates for the right side of an equation: names, and how to compute them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pysindy
from jaxtyping import Float


@dataclass(frozen=True)
class Candidates:
    """Terms that an equation may have.

    Attributes:
        names: One a term.
        evaluate: From the columns, states before inputs, (place, column), to the terms,
            (place, term).
    """

    names: tuple[str, ...]
    evaluate: Callable[[Float[np.ndarray, "place column"]], np.ndarray]


def polynomial(
    columns: Sequence[str], degree: int = 2, *, signed_squares: bool = False
) -> Candidates:
    """Return all products of columns up to a degree, the constant among them.

    Args:
        columns: Names of states, then of inputs.
        degree: Of the products at most.
        signed_squares: Also |x| x of each column, as in drag.
    """
    library = pysindy.PolynomialLibrary(degree=degree)
    library.fit(np.zeros((1, len(columns))))  # pyright: ignore[reportArgumentType] (arrays are taken)
    names = library.get_feature_names(list(columns))
    powers = np.asarray(library.powers_)
    if signed_squares:
        names += [f"|{name}| {name}" for name in columns]

    def evaluate(values: Float[np.ndarray, "place column"]) -> np.ndarray:
        products = np.prod(values[:, None, :] ** powers, axis=2)
        if not signed_squares:
            return products
        return np.concatenate([products, np.abs(values) * values], axis=1)

    return Candidates(tuple(names), evaluate)


def powers(name: str, exponents: Sequence[float]) -> Candidates:
    """Return powers of one positive column: $R^{-3/2}$ and others."""
    exponent = np.asarray(exponents, float)

    def evaluate(values: Float[np.ndarray, "place column"]) -> np.ndarray:
        return values[:, :1] ** exponent

    return Candidates(tuple(f"{name}^{e:g}" if e else "1" for e in exponent), evaluate)
