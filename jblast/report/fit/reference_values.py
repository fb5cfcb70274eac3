"""The accepted value of a published event, beside what was fitted."""

from collections.abc import Mapping
from dataclasses import dataclass

from jblast.inference.fitting.summary import Summary
from jblast.inference.posterior.estimate import Estimate
from jblast.report.numbers import finite, printed_number

Accepted = Mapping[str, tuple[float | int, str]]
"""Parameter name -> (its accepted value in SI, where that comes from)."""


@dataclass(frozen=True)
class Comparison:
    """An accepted value against the 90 % interval of the same parameter.

    Attributes:
        value: The accepted value with its unit.
        label: Where it comes from.
        inside: Whether it lies in the interval; None where there is no interval.
    """

    value: str
    label: str
    inside: bool | None

    @property
    def verdict(self) -> str:
        """Return "inside", "outside", or "no interval"."""
        if self.inside is None:
            return "no interval"
        return "inside" if self.inside else "outside"


def estimates_of(found: Summary) -> dict[str, Estimate]:
    """Return fitted and derived numbers in one table."""
    return {**found.estimates, **found.derived}


def compare(
    name: str, estimate: Estimate, accepted: Accepted | None
) -> Comparison | None:
    """Compare one estimate with its accepted value; None where none is given."""
    if accepted is None or name not in accepted:
        return None
    value, label = accepted[name]
    low, high = finite(estimate.q05), finite(estimate.q95)
    inside = None if low is None or high is None else bool(low <= value <= high)
    return Comparison(printed_number(name, value), label, inside)


def not_fitted(found: Summary, accepted: Accepted | None) -> list[str]:
    """Return the accepted names that an answer says nothing of."""
    return [name for name in accepted or {} if name not in estimates_of(found)]
