"""All outcomes there are, found by name."""

from collections.abc import Sequence

# each enters what it calculates into the table
import jblast.study.outcome.detection as _detection
import jblast.study.outcome.fit as _fit
import jblast.study.outcome.quantities as _quantities
import jblast.study.outcome.vehicle as _vehicle
from jblast.errors import InputError, argument, nearest, shown
from jblast.study.outcome.family import FAMILIES, OUTCOMES, Family, Outcome
from jblast.study.outcome.own import CODE, own_outcome

LISTED = (_detection, _fit, _quantities, _vehicle)


def outcomes_named(
    names: Sequence[str], source: str, *, allow_code: bool = False
) -> tuple[Outcome, ...]:
    """Return outcomes by name.

    Args:
        names: As the study's file has them.
        source: That file, for messages.
        allow_code: Whether functions of the user's own may be run.

    Raises:
        InputError: There is no such outcome; the message names the nearest.
    """
    found = []
    for name in names:
        if name.startswith(CODE):
            if not allow_code:
                raise InputError(
                    f"{source}: outcomes: {shown(name)} is code that would be run: "
                    f"expected {argument('allow_code')} with it"
                )
            found.append(own_outcome(name))
        elif name in OUTCOMES:
            found.append(OUTCOMES[name])
        else:
            raise InputError(
                f"{source}: outcomes: unknown outcome {shown(name)}"
                f"{nearest(name, OUTCOMES)}; expected one of {', '.join(OUTCOMES)}"
            )
    return tuple(found)


def families_of(outcomes: Sequence[Outcome]) -> dict[str, tuple[Family, list[str]]]:
    """Return families by name, and which of their outcomes are asked for."""
    found: dict[str, tuple[Family, list[str]]] = {}
    for outcome in outcomes:
        family = FAMILIES[outcome.family]
        found.setdefault(family.name, (family, []))[1].append(outcome.name)
    return found
