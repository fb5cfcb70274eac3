"""What would end a null direction, or tell two solutions apart, in words."""

from jblast.inference.identifiability.findings import Cure, OtherMode, ResolvingDatum
from jblast.parameter_table import CHARGE_POSITION
from jblast.quantity_table import QUANTITIES

RANGING = "its range is the sound speed times what it comes after the flash"
WHERE = {
    "sensor": "at a sensor of the log",
    "place": "at a new place",
    "aside": "at a new place off the sensors' line",
    "range": "at a new range",
    "later": "at a later time",
}


def cure_words(cure: Cure) -> str:
    """Say which prior, measurement or datum would end a null direction."""
    known = f"a prior on, or a measurement of, {' or '.join(cure.parameters)}"
    added = "; ".join(datum_words(datum) for datum in cure.data)
    return f"{known}; or {added}" if added else known


def datum_words(datum: ResolvingDatum) -> str:
    """Say what to record, and where."""
    what = QUANTITIES[datum.quantity].with_article()
    bang = f" (the bang: {RANGING})" if datum.is_bang else ""
    clock = ", on a clock that is right" if datum.on_right_clock else ""
    return f"{what}{bang} {WHERE[datum.where]}{clock}"


def reason_words(other: OtherMode) -> str:
    """Say why another optimum is one."""
    what = "place" if set(CHARGE_POSITION) & set(other.differ) else "solution"
    names = ", ".join(sorted(other.differ)) or "all"
    return (
        f"another {what} of {names} explains the log nearly as well (chi squared "
        f"differs by {other.delta_chi2:.2g})"
    )
