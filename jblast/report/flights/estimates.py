"""What blasts do to what a vehicle takes for its state."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from numpy.typing import ArrayLike

from jblast.autopilot.estimator.thrown import Thrown
from jblast.report.flights.answer import EstimateThrown
from jblast.report.tables import aligned

PARTS = {"position": "place", "velocity": "moves", "attitude": "turn"}
UNITS = {"place": "_m", "moves": "_m_s", "turn": "_rad"}


def estimates_thrown(
    thrown: Thrown, blasts: Iterable[str], of: Callable[[Any], Any]
) -> tuple[EstimateThrown, ...]:
    """Return what each blast did to the estimate.

    Args:
        thrown: It, the blasts last.
        blasts: Their names.
        of: What is told of the vehicles' numbers.
    """
    found = thrown._asdict()
    return tuple(
        EstimateThrown(charge=name, **{k: of(v[..., n]) for k, v in found.items()})
        for n, name in enumerate(blasts)
    )


def estimate_lines(
    estimates: Sequence[tuple[str, Thrown | None]],
    blasts: Sequence[str],
    number: Callable[[str, ArrayLike], str],
) -> list[str]:
    """Return lines on the estimates of flights; none where they flew by the truth.

    Args:
        estimates: What the blasts did to each, behind its name; None: nothing is.
        blasts: Names of the charges.
        number: Words a number by the name of its unit.
    """
    rows = []
    for own, thrown in estimates:
        if thrown is None:
            continue
        found = thrown._asdict()
        for n, blast in enumerate(blasts):
            cells = []
            for part in PARTS.values():
                unit = UNITS[part]
                before = number(f"{part}{unit}", found[f"{part}_before{unit}"][..., n])
                after = number(f"{part}{unit}", found[f"{part}{unit}"][..., n])
                cells.append(f"{before} -> {after}")
            name = blast or "the charge"
            rows.append((f"{name}, {own}" if own else name, *cells))
    if not rows:
        return []
    head = ("error of the estimate", *PARTS)
    return [
        "",
        *aligned([head, *rows]),
        "Root mean square in the second before each blast -> greatest until the next,",
        "10 s at most.",
    ]
