"""The reader of a scene's charges: one, or several with a name each."""

import math
from typing import Any

from jblast.errors import InputError, shown
from jblast.scene.charge import BURSTS, Charge
from jblast.scene.explosives import explosive_named
from jblast.scene.reader.priors import Uncertain, read_numbers
from jblast.scene.reader.tables import choice, name_of, table, tables


def read_charges(
    document: dict[str, Any], source: str, n_sensors: int
) -> tuple[tuple[Charge, ...], dict[str, Uncertain]]:
    """Read the charges of a scene file, and every number that the file says of them.

    Raises:
        InputError: As in `read_scene`.
    """
    entries = _entries(document, source)
    several = len(entries) > 1
    charges: list[Charge] = []
    numbers: dict[str, Uncertain] = {}
    for index, entry in enumerate(entries, start=1):
        where = f"{source}: [charge]"
        if several:
            if "name" not in entry:
                raise InputError(
                    f"{source}: [[charge]] name: expected a name for charge {index} of "
                    f"{len(entries)}, got nothing"
                )
            where = f"{source}: [[charge]] {shown(entry['name'])}"
        charge = _charge(entry, where, n_sensors)
        if several and charge.name in [other.name for other in charges]:
            raise InputError(
                f"{where} name: expected each name once, got {shown(charge.name)} twice"
            )
        charges.append(charge)
        of_this = read_numbers({"mass_kg": "free"} | entry, "charge", where)
        label = f".{charge.name}" if several else ""
        numbers |= {f"{name}{label}": number for name, number in of_this.items()}
    return tuple(charges), numbers


def _entries(document: dict[str, Any], source: str) -> list[dict[str, Any]]:
    """Return the charges as written: [charge], [[charge]], or nothing for one."""
    if not isinstance(document.get("charge"), list):
        return [table(document, "charge", source)]
    entries = tables(document, "charge", source)
    if not entries:
        raise InputError(f"{source}: [[charge]]: expected a charge, got an empty list")
    return entries


def _charge(entry: dict[str, Any], where: str, n_sensors: int) -> Charge:
    """Read what of a charge is no number, and check what may not stand together."""
    name = name_of(entry["name"], f"{where} name") if "name" in entry else ""
    if "burst" in entry:
        choice(entry["burst"], BURSTS, f"{where} burst")
    explosive = entry.get("explosive", "TNT")
    if not isinstance(explosive, str):
        raise InputError(
            f"{where} explosive: expected a name in quotes, got {shown(explosive)}"
        )
    explosive = explosive_named(explosive, f"{where} explosive")
    if "tnt_factor" in entry and explosive != "TNT":
        raise InputError(
            f"{where} tnt_factor: expected either tnt_factor or an explosive, got both"
        )
    if entry.get("time_s") == math.inf:
        raise InputError(
            f"{where} time_s: expected a finite number, got inf: leave a charge that "
            "never happens out of the file; only a scene made in Python can have one"
        )
    if "range_m" in entry and "position_m" in entry:
        raise InputError(
            f"{where} range_m: expected either range_m or position_m, got both"
        )
    if "range_m" in entry and n_sensors > 1:
        raise InputError(
            f"{where} range_m: expected one sensor, to which it is the distance, "
            f"got {n_sensors}"
        )
    return Charge(name=name, explosive=explosive, burst=entry.get("burst"))
