"""What a planned layout could tell, as values."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.fidelity import TakenLaw
from jblast.inference.identifiability.findings import (
    EstimableCombination,
    NullDirection,
    OtherMode,
)
from jblast.inference.posterior.estimate import Spread
from jblast.inference.posterior.finding import Finding
from jblast.json_values import plain


@dataclass(frozen=True)
class AddedDatum:
    """One row that could be added to a layout, and what it would leave unknown.

    Attributes:
        quantity: What would be recorded.
        sensor: Beside which sensor of the layout; "" off the sensors' line.
        position: Where [m]; None in a scene without places.
        charge: Name of the charge, or "".
        sigma: Its error: seconds, or relative.
        is_default: Whether the error is our guess, the layout recording no such.
        law: Which law would read it.
        law_valid: Whether that holds there.
        parameter: The number that it would tell more of.
        left: How far that may be off then.
    """

    quantity: str
    sensor: str
    position: Float[np.ndarray, "3"] | None
    charge: str
    sigma: float
    is_default: bool
    law: str
    law_valid: bool
    parameter: str
    left: Spread


@dataclass(frozen=True)
class Sensitivity:
    """How well one number is known, by what is known of another.

    Attributes:
        parameter: The one.
        on: The other.
        if_known: How far the one may be off were the other known.
        without_prior: Likewise were the other's prior not believed; None if it has
            none.
    """

    parameter: str
    on: str
    if_known: Spread
    without_prior: Spread | None


@dataclass(frozen=True)
class BoundSummary:
    """What a layout could tell.

    Attributes:
        at: The numbers taken for true.
        law: Name of the law that reads each quantity.
        law_reason: What it was taken by: `report.law_reason` words it.
        law_valid: Whether every row lies where its law holds.
        parameters: How far each open number may be off.
        free: Names of what is open.
        identifiable: Whether the readings would leave one answer.
        null_directions: Directions in which no datum moves.
        ambiguities: Other optima that the data could not rule out.
        determined: Combinations of unidentified numbers that are identified.
        noise: Distribution of the independent errors.
        n_observations: Rows of the planned log.
        help: Rows that could be added, the most helpful first.
        leans_on: What the number known worst rests on, the most first.
        mass_exponents: Least and largest slope of ln of each quantity in ln mass.
        warnings: What is to be told beside the numbers.
    """

    at: Mapping[str, float]
    law: Mapping[str, str]
    law_reason: Mapping[str, TakenLaw]
    law_valid: bool
    parameters: Mapping[str, Spread]
    free: tuple[str, ...]
    identifiable: bool
    null_directions: tuple[NullDirection, ...]
    ambiguities: tuple[OtherMode, ...]
    determined: tuple[EstimableCombination, ...]
    noise: str
    n_observations: int
    help: tuple[AddedDatum, ...]
    leans_on: tuple[Sensitivity, ...]
    mass_exponents: Mapping[str, tuple[float, float]]
    warnings: tuple[Finding, ...]

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Names of the open numbers of which nothing would be known."""
        return tuple(n for n, s in self.parameters.items() if not s.is_known)

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it; null is what is not a finite number."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}
