"""Laws named by words of a command."""

from collections.abc import Collection, Sequence

from jblast.errors import argument, nearest, require
from jblast.quantities import QUANTITIES, components
from jblast.registry import LAWS, names, names_for


def laws_named(words: Sequence[str], quantities: Collection[str]) -> dict[str, str]:
    """Return a law for each quantity from command-line words; later words win.

    Args:
        words: "auto", NAME or QUANTITY=NAME, several with commas between.
        quantities: Quantities of the log: a word that concerns none is rejected.

    Raises:
        InputError: There is no such quantity or law, the law does not predict the
            quantity, or the log does not contain it.
    """
    # a difference of arrivals needs the laws of both arrivals
    needed = {part for quantity in quantities for part, _ in components(quantity)}
    chosen: dict[str, str] = {}
    for word in (part.strip() for item in words for part in item.split(",")):
        where = f"{argument('laws')} {word}"
        quantity, equals, name = word.rpartition("=")
        given = (
            _law_of_quantity(where, quantity, name)
            if equals
            else _laws_of_name(where, name)
        )
        of_log = f"a law for a quantity of the log ({', '.join(sorted(needed))})"
        found = f"one for {', '.join(sorted(given))}"
        require(needed & given.keys(), where, of_log, found)
        chosen |= given
    return chosen


def _law_of_quantity(where: str, quantity: str, name: str) -> dict[str, str]:
    """Return the law of one quantity."""
    hint = nearest(quantity, QUANTITIES)
    known = quantity in QUANTITIES
    require(known, where, "a quantity before '='", f"{quantity!r}{hint}")
    parts, options = [part for part, _ in components(quantity)], names_for(quantity)
    of_parts = f"a law for one of {' and '.join(parts)}, of which {quantity} is made"
    require(parts == [quantity], where, of_parts)
    either = f"auto or one of {', '.join(options) or '(none yet)'}"
    is_law = name == "auto" or name in options
    require(is_law, where, either, f"{name!r}{nearest(name, options)}")
    return {quantity: name}


def _laws_of_name(where: str, name: str) -> dict[str, str]:
    """Return the named law for every quantity that it predicts."""
    if name == "auto":
        return dict.fromkeys(QUANTITIES, "auto")
    forms = f"auto, NAME or QUANTITY=NAME with NAME one of {', '.join(names())}"
    require(name in names(), where, forms, f"{name!r}{nearest(name, names())}")
    return {quantity: law for quantity, law in LAWS if law == name}
