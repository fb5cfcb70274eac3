"""Which controllers a scene's vehicle is flown with."""

from collections.abc import Sequence

from jblast.errors import InputError

BOTH_HOLDS = ("with_integral", "without_integral")
"""Flown where nothing is said."""


def named_controllers(
    controllers: Sequence[str] | None, own: str | None
) -> tuple[str, ...]:
    """Return the controllers to fly, each once.

    Args:
        controllers: Those asked for; None: both holds.
        own: The scene's own hold; None where it does not say.

    Raises:
        InputError: An empty list is asked for.
    """
    if controllers is None:
        return BOTH_HOLDS[::-1] if own == BOTH_HOLDS[1] else BOTH_HOLDS
    if not controllers:
        raise InputError("controllers: expected one or more, got none")
    hold = BOTH_HOLDS[0] if own is None else own
    return tuple(dict.fromkeys(hold if x == "hold" else x for x in controllers))
