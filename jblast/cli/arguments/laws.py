"""What `--law` asks for: one law for all it gives, or laws for single quantities."""

from collections.abc import Collection, Sequence

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.errors import InputError, nearest
from jblast.quantity_table import QUANTITIES
from jblast.registry import LAWS, names, names_for
from jblast.scene.reader.schema import LAW_NAMES_LATER
from jblast.sensors.layout import components


def chosen_laws(words: Sequence[str], quantities: Collection[str]) -> dict[str, str]:
    """Turn the words after `--law` into a law for each quantity; later words win.

    Args:
        words: What stood after each `--law`.
        quantities: What the log holds: a word that concerns none of it is refused.

    Raises:
        InputError: There is no such quantity or law, the law does not give it, or the
            log does not hold it.
    """
    needed = {part for quantity in quantities for part, _ in components(quantity)}
    chosen: dict[str, str] = {}
    for word in (part.strip() for item in words for part in item.split(",")):
        quantity, equals, name = word.rpartition("=")
        given = _for_one(word, quantity, name) if equals else _for_all(word)
        if not needed & given.keys():
            raise InputError(
                f"--law {word}: expected a law for something the log holds "
                f"({', '.join(sorted(needed))}), got one for "
                f"{', '.join(sorted(given))}"
            )
        chosen |= given
    return chosen


def _for_one(word: str, quantity: str, name: str) -> dict[str, str]:
    """Return the law of QUANTITY=NAME."""
    if quantity not in QUANTITIES:
        raise InputError(
            f"--law {word}: expected a quantity before '=', got {quantity!r}"
            f"{nearest(quantity, QUANTITIES)}"
        )
    parts = [part for part, _ in components(quantity)]
    if parts != [quantity]:
        raise InputError(
            f"--law {word}: {quantity} is made of {' and '.join(parts)}; "
            "expected a law for one of these"
        )
    if name != "auto" and name not in names_for(quantity):
        if _waits(name):
            raise InputError(f"--law {word}: {name} is not supported yet")
        raise InputError(
            f"--law {word}: expected auto or one of "
            f"{', '.join(names_for(quantity)) or '(none yet)'}, got {name!r}"
            f"{nearest(name, names_for(quantity))}"
        )
    return {quantity: name}


def _for_all(name: str) -> dict[str, str]:
    """Return the law of NAME for every quantity it gives."""
    if name == "auto":
        return dict.fromkeys(QUANTITIES, "auto")
    if name in names():
        return {quantity: law for quantity, law in LAWS if law == name}
    if _waits(name):
        raise InputError(f"--law {name}: {name} is not supported yet")
    raise InputError(
        f"--law {name}: expected auto, NAME or QUANTITY=NAME with NAME one of "
        f"{', '.join(names())}, got {name!r}{nearest(name, names())}"
    )


def _waits(name: str) -> bool:
    """Return whether a law is of the contract and not built yet."""
    return name in LAW_NAMES_LATER and name not in names()
