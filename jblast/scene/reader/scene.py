"""The reader of scene files: TOML to a scene and what is believed of its numbers."""

import math
import os
import tomllib
from dataclasses import replace
from typing import Any

from jblast.errors import InputError, read_text, shown
from jblast.quantity_table import QUANTITIES
from jblast.scene.air import Air
from jblast.scene.ground import Ground
from jblast.scene.parameters import with_values
from jblast.scene.random.spec import WorldSpec
from jblast.scene.reader.ambient import read_ambient
from jblast.scene.reader.camera import read_camera
from jblast.scene.reader.charges import read_charges
from jblast.scene.reader.clocks import read_clocks
from jblast.scene.reader.place import read_place
from jblast.scene.reader.priors import fixed_number, read_numbers
from jblast.scene.reader.schema import GROUND_PATHS, LAW_NAMES_LATER
from jblast.scene.reader.sensors import read_sensors
from jblast.scene.reader.tables import (
    choice,
    known_keys,
    name_of,
    not_yet,
    table,
    true_or_false,
)
from jblast.scene.reader.vehicle import read_vehicle
from jblast.scene.reader.world import read_random_blasts
from jblast.scene.scene import Scene
from jblast.scene.uncertain import UncertainScene


def read_scene(path: str | os.PathLike[str]) -> UncertainScene:
    """Read a scene file.

    Args:
        path: A TOML file; `jblast scene` writes one to start from.

    Returns:
        The scene, with the priors of what is not known.

    Raises:
        InputError: The file is no scene; the message names the table and key, what was
            expected there and what came.

    Example:
        `uncertain = jblast.read_scene("scene.toml")`
    """
    return scene_from_document(document_of(path), str(path))


def read_world(path: str | os.PathLike[str]) -> tuple[UncertainScene, WorldSpec]:
    """Read a scene file of random blasts.

    Args:
        path: A TOML file with [world].

    Returns:
        The scene without them, and what they are drawn by. Without [charge] its one
        charge never happens.

    Raises:
        InputError: As in `read_scene`, or there is no [world].
    """
    return world_from_document(document_of(path), str(path))


def read_scene_or_world(
    path: str | os.PathLike[str],
) -> tuple[UncertainScene, WorldSpec | None]:
    """Read a scene file that may have random blasts.

    Args:
        path: A TOML file.

    Returns:
        The scene; and what random blasts are drawn by, None where there are none.

    Raises:
        InputError: As in `read_scene` and `read_world`.
    """
    document = document_of(path)
    if "world" in document:
        return world_from_document(document, str(path))
    return scene_from_document(document, str(path)), None


def document_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the tables of a scene file as they stand, nothing checked.

    Raises:
        InputError: It cannot be read, or is no TOML.
    """
    text = read_text(path, "a scene in TOML")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: broken TOML: {error}") from None
    except (ValueError, RecursionError) as error:  # numbers of 5000 digits; [[[[[[
        raise InputError(f"{path}: broken TOML: {error}") from None


def world_from_document(
    document: dict[str, Any], source: str
) -> tuple[UncertainScene, WorldSpec]:
    """Build a scene and its random blasts from what TOML says.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_world`.
    """
    world = read_random_blasts(document, source)
    rest = {key: value for key, value in document.items() if key != "world"}
    if "charge" in document:
        return scene_from_document(rest, source), world
    uncertain = scene_from_document(rest | {"charge": {"mass_kg": 1.0}}, source)
    never = replace(uncertain.scene.charge, time_s=math.inf)
    return replace(uncertain, scene=replace(uncertain.scene, charge=never)), world


def scene_from_document(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene from what TOML says.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    known_keys(document, "", source)
    if "world" in document:
        raise InputError(
            f"{source}: [world]: expected blasts that are told one by one, in "
            "[charge], got random ones: jblast world draws them, and jblast fit fits "
            "what it wrote"
        )
    schema = document.get("schema", 1)
    if isinstance(schema, bool) or schema != 1:
        raise InputError(f"{source}: schema: expected 1, got {shown(schema)}")
    single = {name: table(document, name, source) for name in ("air", "ground", "law")}
    for name in ("temperature_k", "pressure_pa"):
        if name in single["air"] and "altitude_m" in single["air"]:
            raise InputError(
                f"{source}: [air] altitude_m: expected either altitude_m or {name}, "
                "got both"
            )
    if "path" in single["ground"]:
        choice(single["ground"]["path"], GROUND_PATHS, f"{source}: [ground] path")
    absorption = true_or_false(
        single["air"].get("absorption", False), f"{source}: [air] absorption"
    )
    sensors, offsets = read_sensors(document, source)
    own = [name.partition(".")[2] for name in offsets]
    clocks, clock_offsets = read_clocks(document, source, own)
    charges, numbers = read_charges(document, source, len(sensors))
    law, scatter = _law(single["law"], f"{source}: [law]")
    for name, entry in single.items():
        numbers |= read_numbers(entry, name, f"{source}: [{name}]")
    numbers |= offsets | clock_offsets
    scene = Scene(
        charge=charges[0],
        others=charges[1:],
        air=Air(absorption=absorption, absorption_scale=_scale(single["air"], source)),
        ground=Ground(path=single["ground"].get("path", "head")),
        sensors=sensors,
        ambient=read_ambient(document, source),
        camera=read_camera(document, source),
        vehicle=read_vehicle(document, source),
        clocks=clocks,
        law=law,
        scatter=scatter,
    )
    values = {name: value for name, (value, _) in numbers.items()}
    beliefs = {
        name: belief for name, (_, belief) in numbers.items() if belief is not None
    }
    place = read_place(document, source)
    return UncertainScene(with_values(scene, values), beliefs, source, place)


def _scale(air: dict[str, Any], source: str) -> float:
    """Return what the absorption of ISO 9613-1 is to be multiplied by."""
    where, value = f"{source}: [air] absorption_scale", air.get("absorption_scale", 1.0)
    number = fixed_number(value, where)
    if number < 0:
        raise InputError(
            f"{where}: expected a number that is not negative, got {shown(value)}"
        )
    return number


def _law(law: dict[str, Any], where: str) -> tuple[tuple[tuple[str, str], ...], bool]:
    """Return the laws asked for, and whether they scatter.

    Whether there is such a law is asked where laws are known: `sensors.resolve_laws`.
    """
    names = []
    for key in (key for key in law if key in QUANTITIES):
        name = name_of(law[key], f"{where} {key}")
        if name in LAW_NAMES_LATER:
            raise not_yet(f"{where} {key}", f'"{name}"')
        names.append((key, name))
    scatter = true_or_false(law.get("scatter", True), f"{where} scatter")
    return tuple(pair for pair in names if pair[1] != "auto"), scatter
