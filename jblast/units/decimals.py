"""Numbers as they are written, in another unit: the product rounded once.

12.4 ms is 0.0124 s. In floating point 12.4 and 0.001 are rounded before they are
multiplied, and the product is 0.012400000000000001; in decimal arithmetic on the text
nothing is lost before the last step.
"""

from collections.abc import Sequence
from decimal import Context, Decimal
from fractions import Fraction
from math import nan

import numpy as np
from jaxtyping import Float

_DIGITS = Context(prec=40)
"""Twice those of a float and more, so that a product is rounded but once."""


def products(
    ratio: Fraction, texts: Sequence[str], *others: Sequence[str]
) -> Float[np.ndarray, " row"]:
    """Return written numbers times a ratio, each the float nearest to the product.

    Args:
        ratio: What they are multiplied by.
        texts: The numbers, by row; what is none gives NaN.
        *others: More numbers to multiply by, by row.
    """
    denominator = Decimal(ratio.denominator)
    factor = _DIGITS.divide(Decimal(ratio.numerator), denominator)
    return np.array([_product(factor, row) for row in zip(texts, *others, strict=True)])


def _product(factor: Decimal, texts: tuple[str, ...]) -> float:
    try:
        for text in texts:
            factor = _DIGITS.multiply(factor, Decimal(text))
        return float(factor)
    except (ArithmeticError, ValueError):  # no number, or no finite one
        return nan
