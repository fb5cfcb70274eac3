"""One way in which a method fails: where, what it does there, what jblast does."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

Response = Literal["marks", "refuses", "falls back", "holds"]
"""What jblast does where a method fails; "holds" where that is avoided altogether."""


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
    failure: str
    boundary: float
    unit: str
    beyond: str
    response: Response
    message: str

    @property
    def cases(self) -> int:
        """Of how many cases the boundary is a count; 0 if it is none."""
        of, _, number = self.unit.partition(" ")
        return int(number) if of == "of" and number.isdigit() else 0

    def to_dict(self) -> dict[str, Any]:
        """Return it by the keys of `KEYS`."""
        return {key: getattr(self, attribute) for key, attribute in KEYS.items()}


KEYS = {
    "area": "area",
    "method": "method",
    "edge": "failure",
    "boundary": "boundary",
    "unit": "unit",
    "beyond": "beyond",
    "deed": "response",
    "said": "message",
}
"""Attributes by what files call them."""


def verified(response: Response, seen: bool | np.bool_, what: str) -> Response:
    """Return a response, once it was seen: a table claims no other.

    Args:
        response: What jblast is said to do.
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
