"""Where something begins: a root, or where a yes turns into a no."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import root_scalar


def crossing(
    function: Callable[[float], float], low: float, high: float, *, to: float = 1e-12
) -> float:
    """Return where a function passes through zero.

    Args:
        function: Of one number; its signs at `low` and `high` differ.
        low: One side.
        high: The other.
        to: Relative precision.
    """
    return float(root_scalar(function, bracket=(low, high), rtol=to).root)


def switching_point(
    answer: Callable[[float], bool | np.bool_],
    low: float,
    high: float,
    *,
    to: float = 1e-12,
) -> float:
    """Return where a question is answered otherwise, by bisection.

    Args:
        answer: Yes at one of `low` and `high`, no at the other.
        low: One side.
        high: The other.
        to: Relative precision.
    """
    found = root_scalar(
        lambda x: 0.5 - bool(answer(x)), bracket=(low, high), method="bisect", rtol=to
    )
    return float(found.root)
