"""What a choice of method is made of, and what it says."""

from dataclasses import asdict, dataclass


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
        reason: Why, in one sentence.
        predicted_error: Its relative error; NaN if nothing is known.
        tolerance: What was asked for, relative; zero asks for the best.
        met: Whether it suffices.
        cost_s: Seconds a reading.
        candidates: All methods that were looked at, the cheapest first.
        span: Smallest and largest scaled distance [m/kg^(1/3)].
        reference_uncertainty: How far the reference itself may be off there.
    """

    quantity: str
    method: str
    reason: str
    predicted_error: float
    tolerance: float
    met: bool
    cost_s: float
    candidates: tuple[Candidate, ...]
    span: tuple[float, float]
    reference_uncertainty: float

    def document(self) -> dict:
        """Return what `jblast choose --json` prints."""
        document = asdict(self)
        del document["span"], document["reference_uncertainty"]  # the reason tells them
        return document
