"""The reader of scene files: TOML to a scene and what is believed of its numbers."""

import os
import tomllib
from typing import Any

from jblast.errors import InputError, read_text, shown
from jblast.quantities import QUANTITIES
from jblast.scene.air import Air
from jblast.scene.charge import Charge
from jblast.scene.keys import (
    BURSTS,
    GROUND_PATHS,
    GROUND_PATHS_LATER,
    LAW_NAMES,
    LAW_NAMES_LATER,
    NUMBERS,
)
from jblast.scene.numbers import finite, read_number
from jblast.scene.priors import Belief
from jblast.scene.read_sensors import read_sensors
from jblast.scene.scene import Scene, with_values
from jblast.scene.tables import (
    choice,
    known_keys,
    name_of,
    not_yet,
    table,
    tables,
    triple,
)
from jblast.scene.uncertain import UncertainScene


def read_scene(path: str | os.PathLike[str]) -> UncertainScene:
    """Read a scene file.

    Raises:
        InputError: The file is no scene; the message names the table and key, what was
            expected there and what came.
    """
    text = read_text(path, "a scene in TOML")
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: broken TOML: {error}") from None
    except (ValueError, RecursionError) as error:  # numbers of 5000 digits; [[[[[[
        raise InputError(f"{path}: broken TOML: {error}") from None
    return scene_from_document(document, str(path))


def scene_from_document(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene from what TOML says.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    known_keys(document, "", source)
    schema = document.get("schema", 1)
    if isinstance(schema, bool) or schema != 1:
        raise InputError(f"{source}: schema: expected 1, got {shown(schema)}")
    single = {
        "charge": _the_charge(document, source),
        **{name: table(document, name, source) for name in ("air", "ground", "law")},
    }
    single["charge"].setdefault("mass_kg", "free")
    sensors = read_sensors(document, source)
    _check_charge(single["charge"], f"{source}: [charge]", len(sensors))
    _check_air(single["air"], f"{source}: [air]")
    if "path" in single["ground"]:
        where = f"{source}: [ground] path"
        choice(single["ground"]["path"], GROUND_PATHS, where, GROUND_PATHS_LATER)
    law, scatter = _law(single["law"], f"{source}: [law]")
    values, beliefs = _numbers(single, source)
    scene = Scene(
        charge=Charge(burst=single["charge"].get("burst", "surface")),
        air=Air(),
        sensors=sensors,
        law=law,
        scatter=scatter,
    )
    return UncertainScene(with_values(scene, values), beliefs, source)


def _numbers(
    single: dict[str, dict[str, Any]], source: str
) -> tuple[dict[str, float], dict[str, Belief]]:
    """Read every number that stands in the file, and what is believed of it."""
    values: dict[str, float] = {}
    beliefs: dict[str, Belief] = {}
    for number in NUMBERS:
        if number.key not in single[number.table]:
            continue
        value = single[number.table][number.key]
        where = f"{source}: [{number.table}] {number.key}"
        if number.index is not None:
            value = triple(value, where, "[east, north, up]")[number.index]
            where += f"[{number.index}]"
        values[number.parameter], belief = read_number(value, number, where)
        if belief is not None:
            beliefs[number.parameter] = belief
    return values, beliefs


def _the_charge(document: dict[str, Any], source: str) -> dict[str, Any]:
    """Return the one charge, written [charge] or [[charge]]."""
    if not isinstance(document.get("charge"), list):
        return dict(table(document, "charge", source))
    charges = tables(document, "charge", source)
    if len(charges) > 1:
        raise not_yet(f"{source}: [[charge]]", f"more than one charge ({len(charges)})")
    if not charges:
        raise InputError(f"{source}: [[charge]]: expected a charge, got an empty list")
    return dict(charges[0])


def _check_charge(charge: dict[str, Any], where: str, n_sensors: int) -> None:
    """Check what of a charge is no number, and what may not stand together."""
    if "name" in charge:
        name_of(charge["name"], f"{where} name")
    if "burst" in charge:
        choice(charge["burst"], BURSTS, f"{where} burst")
    explosive = charge.get("explosive", "TNT")
    if not isinstance(explosive, str):
        raise InputError(
            f"{where} explosive: expected a name in quotes, got {shown(explosive)}"
        )
    if explosive != "TNT":
        raise not_yet(f"{where} explosive", f'other than "TNT" ({shown(explosive)})')
    factor = charge.get("tnt_factor", 1.0)
    if factor == "free" or isinstance(factor, dict):
        raise not_yet(f"{where} tnt_factor", "other than 1.0")
    if finite(factor, f"{where} tnt_factor") <= 0:
        raise InputError(
            f"{where} tnt_factor: expected a positive number, got {shown(factor)}"
        )
    if factor != 1:
        raise not_yet(f"{where} tnt_factor", f"other than 1.0 ({shown(factor)})")
    if "range_m" in charge and "position_m" in charge:
        raise InputError(
            f"{where} range_m: expected either range_m or position_m, got both"
        )
    if "range_m" in charge and n_sensors > 1:
        raise InputError(
            f"{where} range_m: expected one sensor, to which it is the distance, "
            f"got {n_sensors}"
        )


def _check_air(air: dict[str, Any], where: str) -> None:
    """Check the wind, and that altitude stands alone."""
    for key in ("temperature_k", "pressure_pa"):
        if key in air and "altitude_m" in air:
            raise InputError(
                f"{where} altitude_m: expected either altitude_m or {key}, got both"
            )
    wind = air.get("wind_m_s", [0.0, 0.0])
    where = f"{where} wind_m_s"
    if not isinstance(wind, list) or len(wind) != 2:
        raise InputError(f"{where}: expected [east, north], got {shown(wind)}")
    for speed in wind:
        if speed == "free" or isinstance(speed, dict) or finite(speed, where) != 0:
            raise not_yet(where, f"other than [0.0, 0.0] ({shown(wind)})")


def _law(law: dict[str, Any], where: str) -> tuple[tuple[tuple[str, str], ...], bool]:
    """Return the laws asked for, and whether they scatter."""
    names = [
        (key, choice(law[key], LAW_NAMES, f"{where} {key}", LAW_NAMES_LATER))
        for key in law
        if key in QUANTITIES
    ]
    scatter = law.get("scatter", True)
    if not isinstance(scatter, bool):
        raise InputError(
            f"{where} scatter: expected true or false, got {shown(scatter)}"
        )
    return tuple(pair for pair in names if pair[1] != "auto"), scatter
