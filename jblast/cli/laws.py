"""What `--law` asks for: one law for all it gives, or laws for single quantities."""

from collections.abc import Sequence

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.errors import InputError, nearest
from jblast.quantities import QUANTITIES
from jblast.registry import LAWS, names, names_for
from jblast.scene.keys import LAW_NAMES, LAW_NAMES_LATER


def chosen_laws(words: Sequence[str]) -> dict[str, str]:
    """Turn the words after `--law` into a law for each quantity; later words win.

    Raises:
        InputError: There is no such quantity or law, or the law does not give it.
    """
    chosen: dict[str, str] = {}
    for word in (part for item in words for part in item.split(",")):
        quantity, equals, name = word.rpartition("=")
        if equals:
            if quantity not in QUANTITIES:
                raise InputError(
                    f"--law {word}: expected a quantity before '=', got {quantity!r}"
                    f"{nearest(quantity, QUANTITIES)}"
                )
            if name != "auto" and name not in names_for(quantity):
                raise InputError(
                    f"--law {word}: expected auto or one of "
                    f"{', '.join(names_for(quantity)) or '(none yet)'}, got {name!r}"
                )
            chosen[quantity] = name
        elif name == "auto":
            chosen = {}
        elif name in names():
            chosen |= {q: n for q, n in LAWS if n == name}
        elif name in (*LAW_NAMES, *LAW_NAMES_LATER):
            raise InputError(f"--law {name}: not supported yet")
        else:
            raise InputError(
                f"--law {word}: expected auto, NAME or QUANTITY=NAME with NAME one of "
                f"{', '.join(names())}, got {word!r}{nearest(name, names())}"
            )
    return chosen
