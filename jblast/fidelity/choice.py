"""What a choice of method is made of: `report.choice` words it."""

from dataclasses import dataclass

from jblast.scene.charge import Burst


@dataclass(frozen=True)
class Candidate:
    """One method that gives the quantity, over all places of a scene.

    Attributes:
        method: Its name.
        error: Largest relative difference to the reference; infinite where the method
            or the reference does not hold.
        predicted_error: The larger of that and of how far the reference may be off.
        cost_s: Seconds a reading, many at once, where it was measured.
        valid: Whether it holds at all places.
        is_reference: Whether it is the reference everywhere.
    """

    method: str
    error: float
    predicted_error: float
    cost_s: float
    valid: bool
    is_reference: bool


@dataclass(frozen=True)
class Choice:
    """What suffices, or what comes nearest to it.

    Attributes:
        quantity: What was asked for.
        method: The cheapest method within the tolerance; else the best there is.
        predicted_error: Its relative error; NaN if nothing is known.
        tolerance: What was asked for, relative; zero asks for the best.
        met: Whether it suffices.
        cost_s: Seconds a reading.
        candidates: All methods that were looked at, the cheapest first.
        span: Smallest and largest scaled distance [m/kg^(1/3)].
        reference_uncertainty: How far the reference itself may be off there.
        by_height: The curve sets that the heights of charges left, where none was said.
        notes: What contradicts the heights, a sentence each.
    """

    quantity: str
    method: str
    predicted_error: float
    tolerance: float
    met: bool
    cost_s: float
    candidates: tuple[Candidate, ...]
    span: tuple[float, float]
    reference_uncertainty: float
    by_height: tuple[Burst, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class TakenLaw:
    """The law that a quantity is read by.

    Attributes:
        name: Its name.
        choice: By which it was taken; None where it was asked for. What suits the
            answer may be another method than the one taken before it was known.
    """

    name: str
    choice: Choice | None = None
