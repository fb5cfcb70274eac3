"""The reader of where on the Earth a scene is."""

from typing import Any

from jblast.errors import InputError, shown
from jblast.parameter_table import PLACE_LIMITS
from jblast.scene.reader.priors import fixed_number
from jblast.scene.reader.tables import table
from jblast.scene.uncertain import Place


def read_place(document: dict[str, Any], source: str) -> Place | None:
    """Read the table [place] of a scene file; None where there is none.

    Raises:
        InputError: As in `read_scene`.
    """
    if "place" not in document:
        return None
    entry, where = table(document, "place", source), f"{source}: [place]"
    for key in ("lat_deg", "lon_deg"):
        if key not in entry:
            raise InputError(f"{where} {key}: expected a number, got nothing")
    numbers = {key: fixed_number(entry[key], f"{where} {key}") for key in entry}
    for key, number in numbers.items():
        if not PLACE_LIMITS[key].allows(number):
            swapped = "; are lat_deg and lon_deg swapped?" if key == "lat_deg" else ""
            expected = f"a number that is {PLACE_LIMITS[key].words()}"
            raise InputError(
                f"{where} {key}: expected {expected}, got {shown(number)}{swapped}"
            )
    return Place(**numbers)
