"""A failure mode of a method: its condition, its effect, and jblast's response.

Its boundary is found as a root, or as the value where a condition changes from true to
false.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import root_scalar

from jblast.errors import whole_number

Response = Literal["marks", "refuses", "falls back", "holds"]
"""What jblast does where a method fails; "holds" where that is avoided altogether."""


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


def first_failure(failed: Bool[np.ndarray, " level"], what: str) -> int:
    """Return the first level at which a method fails.

    Args:
        failed: By level, from harmless to hopeless.
        what: Method, for the message.

    Raises:
        RuntimeError: It fails at no level, so the levels contain no boundary.
    """
    if not failed.any():
        raise RuntimeError(
            f"{what}: expected a failure at one of {failed.size} levels, got none: the "
            "boundary lies beyond them"
        )
    return int(np.argmax(failed))


def boundary_at(
    limit: float,
    measured: Float[np.ndarray, " level"],
    levels: Float[np.ndarray, " level"],
    what: str,
) -> float:
    """Return the level at which a rising measure passes a limit, linear in between.

    Args:
        limit: Largest harmless value of the measure.
        measured: By level, rising.
        levels: From harmless to hopeless.
        what: Method, for the message.

    Raises:
        RuntimeError: The measure does not pass the limit between two of the levels.
    """
    if not measured[0] <= limit < measured[-1]:
        raise RuntimeError(
            f"{what}: expected {measured[0]:g} to {measured[-1]:g}, measured at "
            f"{levels[0]:g} and {levels[-1]:g}, to contain {limit:g}"
        )
    return float(np.interp(limit, measured, levels))


@dataclass(frozen=True)
class FailureMode:
    """One failure mode of one method, as measured.

    Attributes:
        area: Where it belongs: "laws", "wave forms", "solver", "clocks", "fits",
            "walks" and so on.
        method: The method, or the law and its quantity.
        failure: What goes wrong, in a few words.
        boundary: Where it begins, in the unit; a share of cases has the unit "of N".
        unit: Unit of the boundary; "" for a pure number.
        beyond: What the method alone does past it, with the figure measured.
        response: What jblast does there.
        message: How: the mark, the message, or what takes over.
    """

    area: str
    method: str
    failure: str = field(metadata={"key": "edge"})
    boundary: float
    unit: str
    beyond: str
    response: Response = field(metadata={"key": "deed"})
    message: str = field(metadata={"key": "said"})

    @property
    def cases(self) -> int:
        """Of how many cases the boundary is a count; 0 if it is none."""
        of, _, number = self.unit.partition(" ")
        return whole_number(number) or 0 if of == "of" else 0


def verified(response: Response, seen: bool | np.bool_, what: str) -> Response:
    """Return a response, once it was seen: a table claims no other.

    Args:
        response: Stated response of jblast.
        seen: Whether it did, just now.
        what: Where, for the message.

    Raises:
        RuntimeError: It did not.
    """
    if not seen:
        raise RuntimeError(
            f"{what}: jblast was seen not to do what it should: {response}"
        )
    return response
