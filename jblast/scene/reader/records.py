"""What a sensor of a scene records, and how well: a share carries its % sign."""

import re
from typing import Any

from jblast.errors import InputError, nearest, shown
from jblast.quantities import ADDITIVE, DIRECTIONS
from jblast.quantity_table import QUANTITIES
from jblast.scene.reader.foreign_keys import in_other_unit
from jblast.scene.reader.priors import finite

SHARE = re.compile(r"\s*(\d+\.?\d*(?:e[+-]?\d+)?|\.\d+(?:e[+-]?\d+)?)\s*%\s*", re.I)
"""A sigma as a share of the value: "5%"."""


def read_records(records: Any, where: str) -> tuple[tuple[str, float], ...]:
    """Read what a sensor records, and the sigma of each.

    A sigma is a plain number in seconds for times and in radians for directions; of all
    else it is a share of the value, "5%". A plain number there could be a share or an
    error in the unit of the quantity, as it is in a log, so it is refused.

    Args:
        records: What stands in the file.
        where: File, table and key, for the messages.

    Returns:
        Quantity and sigma; seconds, radians, or relative.

    Raises:
        InputError: It is no table, a quantity is unknown, or a sigma is not as said.
    """
    if not isinstance(records, dict):
        raise InputError(
            f"{where}: expected {{ QUANTITY = sigma }}, got {shown(records)}"
        )
    pairs = []
    for quantity, sigma in records.items():
        if quantity not in QUANTITIES:
            other = in_other_unit(quantity, QUANTITIES)
            raise InputError(
                f"{where}: unknown quantity {shown(quantity)}"
                f"{other or nearest(quantity, QUANTITIES)}; "
                f"expected one of {', '.join(QUANTITIES)}"
            )
        read = _additive if quantity in ADDITIVE else _share
        pairs.append((quantity, read(sigma, quantity, f"{where} {quantity}")))
    return tuple(pairs)


def share_text(share: float) -> str:
    """Write a share of the value as a scene file has it: 0.05 is "5%"."""
    return f'"{100 * share:.3g}%"'


def _additive(sigma: Any, quantity: str, where: str) -> float:
    unit = "radians" if quantity in DIRECTIONS else "seconds"
    expected = f"a positive sigma in {unit}"
    number = finite(sigma, where, f"{expected}, without a sign")
    if number <= 0:
        raise InputError(f"{where}: expected {expected}, got {shown(sigma)}")
    return number


def _share(sigma: Any, quantity: str, where: str) -> float:
    expected = 'a positive share of the value with its % sign, as "5%"'
    share_match = SHARE.fullmatch(sigma) if isinstance(sigma, str) else None
    if share_match is not None and (share := float(share_match.group(1)) / 100) > 0:
        return finite(share, where, expected)
    advice = ""
    if isinstance(sigma, int | float) and not isinstance(sigma, bool) and sigma > 0:
        unit = QUANTITIES[quantity].unit
        advice = (
            f"; if this is a share, multiply by 100 and write {share_text(sigma)}, "
            f"if it is in {unit}, divide by the value first"
        )
    raise InputError(f"{where}: expected {expected}, got {shown(sigma)}{advice}")
