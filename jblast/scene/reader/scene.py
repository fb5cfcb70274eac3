"""Reader of scene files: from TOML to a scene with priors of its numbers.

All tables except those of sensors, clocks and random blasts are read here:
charges (one, or several with names), air, ground, position on the Earth, ambient sound,
camera and vehicle.
"""

import math
import os
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, read_text, shown
from jblast.parameters import PLACE_LIMITS
from jblast.quantities import QUANTITIES
from jblast.scene.camera import FORWARD, FRAMES_HZ, MOUNTS, Camera, look_at
from jblast.scene.charge import BURSTS, Charge, explosive_named
from jblast.scene.random_blasts import WorldSpec
from jblast.scene.reader.random_blasts import read_random_blasts
from jblast.scene.reader.sensors import read_clocks, read_sensors
from jblast.scene.reader.tables import (
    GROUND_PATHS,
    LISTS,
    VEHICLE_MODELS,
    Uncertain,
    choice,
    finite,
    fixed_list,
    fixed_number,
    known_keys,
    name_of,
    read_numbers,
    table,
    tables,
    true_or_false,
)
from jblast.scene.scene import Air, Ambient, Ground, Scene, VehicleSpec
from jblast.scene.uncertain import Place, UncertainScene, with_values
from jblast.types import as_float_array

MAX_SLOPE_DB_OCTAVE = 12.0
"""Maximum slope of ambient noise [dB/octave]: a steeper spectrum is nearly a tone."""
MAX_IMAGE_PX = 65_535
"""Maximum side of an image in pixels: event files have 16 bits for x and y."""
VECTOR_GAINS = ("kp_pos", "kd_pos", "ki_pos")
SCALAR_GAINS = ("kp_att", "kd_att", "integral_limit", "motor_lead")


def read_scene(path: str | os.PathLike[str]) -> UncertainScene:
    """Read a scene file.

    Args:
        path: A TOML file; `jblast scene` writes one to start from.

    Returns:
        The scene with the priors of its uncertain numbers.

    Raises:
        InputError: The file is not a valid scene; the message names table, key,
            expected and actual value.

    Example:
        `uncertain = jblast.read_scene("scene.toml")`
    """
    return scene_from_document(document_of(path), str(path))


def scene_of(scene: Any) -> UncertainScene:
    """Return a scene, which may be given by the path of its file.

    Raises:
        InputError: It is neither, or as in `read_scene`.
    """
    if isinstance(scene, str | os.PathLike):
        return read_scene(scene)
    if isinstance(scene, Scene):
        return UncertainScene(scene)
    if not isinstance(scene, UncertainScene):
        raise InputError(
            "scene: expected the path of a scene file or the result of "
            f"jblast.read_scene, got {type(scene).__name__}"
        )
    return scene


def read_world(path: str | os.PathLike[str]) -> tuple[UncertainScene, WorldSpec]:
    """Read a scene file of random blasts.

    Args:
        path: A TOML file with [world].

    Returns:
        The scene without random blasts, and their distribution. Without [charge] the
        scene has one charge that never detonates.

    Raises:
        InputError: As in `read_scene`, or there is no [world].
    """
    return world_from_document(document_of(path), str(path))


def read_scene_or_world(
    path: str | os.PathLike[str], *, needs_charge: bool = True
) -> tuple[UncertainScene, WorldSpec | None]:
    """Read a scene file that may have random blasts.

    Args:
        path: A TOML file.
        needs_charge: True: without [charge] the scene has a charge of free mass;
            False: a charge that never detonates.

    Returns:
        The scene, and the distribution of its random blasts, or None.

    Raises:
        InputError: As in `read_scene` and `read_world`.
    """
    return scene_or_world(document_of(path), str(path), needs_charge=needs_charge)


def scene_or_world(
    document: dict[str, Any], source: str, *, needs_charge: bool
) -> tuple[UncertainScene, WorldSpec | None]:
    """Return the result of `read_scene_or_world` for the tables of a file."""
    if "world" in document:
        return world_from_document(document, source)
    if "charge" in document or needs_charge:
        return scene_from_document(document, source), None
    return _without_blast(document, source), None


def document_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the unchecked tables of a scene file.

    Raises:
        InputError: It cannot be read, or is not TOML.
    """
    text = read_text(path, "a scene in TOML")
    try:
        return tomllib.loads(text)
    # Also a number of thousands of digits; deep nesting, as [[[[[[.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: broken TOML: {error}") from None


def world_from_document(
    document: dict[str, Any], source: str
) -> tuple[UncertainScene, WorldSpec]:
    """Build a scene and its random blasts from the tables of a file.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_world`.
    """
    world = read_random_blasts(document, source)
    # `scene_from_document` rejects random blasts, which a fit cannot use.
    rest = {key: value for key, value in document.items() if key != "world"}
    if "charge" in document:
        return scene_from_document(rest, source), world
    return _without_blast(rest, source), world


def _without_blast(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene without [charge]."""
    uncertain = scene_from_document(document | {"charge": {"mass_kg": 1.0}}, source)
    # A scene needs a charge: one that never detonates has no effect.
    never = replace(uncertain.scene.charge, time_s=math.inf)
    return replace(uncertain, scene=replace(uncertain.scene, charge=never))


def scene_from_document(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene from the tables of a file.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    known_keys(document, "", source)
    if "world" in document:
        raise InputError(
            f"{source}: [world]: expected single blasts in [charge], got random ones; "
            "run jblast world on this scene, and jblast fit on the files that it writes"
        )
    schema = document.get("schema", 1)
    if isinstance(schema, bool) or schema != 1:
        raise InputError(f"{source}: schema: expected 1, got {shown(schema)}")
    single = {name: table(document, name, source) for name in ("air", "ground", "law")}
    # The altitude determines both, by the standard atmosphere.
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
    # A sensor and a recorder of one name would have two offsets.
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
    # Numbers are set by name at the end: one table places them, not this function.
    values = {name: value for name, (value, _) in numbers.items()}
    beliefs = {
        name: belief for name, (_, belief) in numbers.items() if belief is not None
    }
    place = read_place(document, source)
    return UncertainScene(with_values(scene, values), beliefs, source, place)


def _scale(air: dict[str, Any], source: str) -> float:
    """Return the factor on the absorption of ISO 9613-1."""
    where, value = f"{source}: [air] absorption_scale", air.get("absorption_scale", 1.0)
    number = fixed_number(value, where)
    if number < 0:
        raise InputError(
            f"{where}: expected a number that is not negative, got {shown(value)}"
        )
    return number


def _law(law: dict[str, Any], where: str) -> tuple[tuple[tuple[str, str], ...], bool]:
    """Return the requested laws and their scatter flag."""
    # The reader imports no laws: unknown names are rejected by `sensors.resolve_laws`.
    names = []
    for key in (key for key in law if key in QUANTITIES):
        name = name_of(law[key], f"{where} {key}")
        names.append((key, name))
    scatter = true_or_false(law.get("scatter", True), f"{where} scatter")
    return tuple(pair for pair in names if pair[1] != "auto"), scatter


def read_charges(
    document: dict[str, Any], source: str, n_sensors: int
) -> tuple[tuple[Charge, ...], dict[str, Uncertain]]:
    """Read the charges of a scene file and their numbers.

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
        # The mass is what a scene is mostly for: without the key it is fitted.
        of_this = read_numbers({"mass_kg": "free"} | entry, "charge", where)
        label = f".{charge.name}" if several else ""
        # Names of several charges have the charge as suffix, as on the command line.
        numbers |= {f"{name}{label}": number for name, number in of_this.items()}
    return tuple(charges), numbers


def _entries(document: dict[str, Any], source: str) -> list[dict[str, Any]]:
    """Return the tables of charges: [charge], [[charge]], or an empty default."""
    if not isinstance(document.get("charge"), list):
        return [table(document, "charge", source)]
    entries = tables(document, "charge", source)
    if not entries:
        raise InputError(f"{source}: [[charge]]: expected a charge, got an empty list")
    return entries


def _charge(entry: dict[str, Any], where: str, n_sensors: int) -> Charge:
    """Read the words of a charge, and reject exclusive keys."""
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
            f"{where} time_s: expected a finite number, got inf; omit a charge that "
            "never happens (only scenes made in Python can have one)"
        )
    if "range_m" in entry and "position_m" in entry:
        raise InputError(
            f"{where} range_m: expected either range_m or position_m, got both"
        )
    # A range without a direction determines the distance to a single sensor only.
    if "range_m" in entry and n_sensors > 1:
        raise InputError(
            f"{where} range_m: expected one sensor (it is the distance to it), got "
            f"{n_sensors}"
        )
    return Charge(name=name, explosive=explosive, burst=entry.get("burst"))


def read_place(document: dict[str, Any], source: str) -> Place | None:
    """Read the table [place] of a scene file; None without one.

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
            # A latitude out of its range is probably a longitude.
            swapped = "; are lat_deg and lon_deg swapped?" if key == "lat_deg" else ""
            expected = f"a number that is {PLACE_LIMITS[key].words()}"
            raise InputError(
                f"{where} {key}: expected {expected}, got {shown(number)}{swapped}"
            )
    return Place(**numbers)


def read_ambient(document: dict[str, Any], source: str) -> Ambient | None:
    """Read the ambient sound of a scene file; None without one.

    A recording is only named, by its path relative to the scene file.

    Raises:
        InputError: As in `read_scene`.
    """
    if "ambient" not in document:
        return None
    where = f"{source}: [ambient]"
    entry = table(document, "ambient", source)
    given = [key for key in ("file", "level_pa") if key in entry]
    if len(given) != 1:
        raise InputError(
            f"{where} level_pa: expected either level_pa or file, "
            f"got {'both' if given else 'neither'}"
        )
    if "file" in entry and "slope_db_octave" in entry:
        raise InputError(
            f"{where} slope_db_octave: expected either a file or noise of a slope, "
            "got both"
        )
    if "level_pa" in entry and "full_scale_pa" in entry:
        raise InputError(
            f"{where} full_scale_pa: expected a file (it scales its samples), got "
            "level_pa"
        )
    numbers = {
        name: fixed_number(entry[key], f"{where} {key}")
        for name, key in (
            ("level", "level_pa"),
            ("slope", "slope_db_octave"),
            ("height", "height_m"),
            ("full_scale", "full_scale_pa"),
        )
        if key in entry
    }
    if numbers.get("level", 0.0) < 0:
        raise InputError(
            f"{where} level_pa: expected a number that is not negative, "
            f"got {shown(entry['level_pa'])}"
        )
    for name, key in (("height", "height_m"), ("full_scale", "full_scale_pa")):
        if numbers.get(name, 1.0) <= 0:
            raise InputError(
                f"{where} {key}: expected a number that is positive, "
                f"got {shown(entry[key])}"
            )
    if abs(numbers.get("slope", 0.0)) > MAX_SLOPE_DB_OCTAVE:
        raise InputError(
            f"{where} slope_db_octave: expected {-MAX_SLOPE_DB_OCTAVE:g} to "
            f"{MAX_SLOPE_DB_OCTAVE:g}, got {shown(entry['slope_db_octave'])}"
        )
    file = ""
    if "file" in entry:
        # Relative to the scene file, so that a folder can be moved as a whole.
        file = str(Path(source).parent / name_of(entry["file"], f"{where} file"))
    return Ambient(file=file, **numbers)


def read_camera(document: dict[str, Any], source: str) -> Camera | None:
    """Read the camera of a scene file; None without one.

    Position, direction, size and focal length have no default, except on a vehicle: at
    its centre, looking forward. The default principal point is the centre of the image.

    Raises:
        InputError: As in `read_scene`.
    """
    if "camera" not in document:
        return None
    where = f"{source}: [camera]"
    entry = table(document, "camera", source)
    mount = _mount(entry, document, where)
    place = "offset_m" if mount else "position_m"
    position = (
        np.zeros(3) if mount and place not in entry else _list(entry, place, where)
    )
    width, height = (_pixels(entry, key, where) for key in ("width", "height"))
    optional: dict[str, Any] = {}
    if "distortion" in entry:
        optional["distortion"] = _list(entry, "distortion", where)
    if "frames_hz" in entry:
        optional["frames_hz"] = _positive(entry["frames_hz"], f"{where} frames_hz")
    if "exposure_s" in entry:
        # The exposure of a frame ends before the next frame begins.
        interval = 1 / optional.get("frames_hz", FRAMES_HZ)
        exposure = finite(entry["exposure_s"], f"{where} exposure_s")
        if not 0 <= exposure <= interval:
            raise InputError(
                f"{where} exposure_s: expected between 0 and {interval:g}, the time "
                f"from frame to frame, got {shown(entry['exposure_s'])}"
            )
        optional["exposure_s"] = exposure
    if (key := "daylight_lux") in entry:
        optional["daylight"] = _positive(entry[key], f"{where} {key}")
    if "threshold" in entry:
        optional["threshold"] = _pair(entry, "threshold", where)
    return Camera(
        position=position,
        quaternion=np.array(FORWARD)
        if mount and "quaternion_xyzw" not in entry
        else _quaternion(entry, position, where),
        focal=_pair(entry, "focal_px", where),
        center=_list(entry, "center_px", where)
        if "center_px" in entry
        else np.array([(width - 1) / 2, (height - 1) / 2]),
        width=width,
        height=height,
        mount=mount,
        **optional,
    )


def _mount(entry: dict[str, Any], document: dict[str, Any], where: str) -> str:
    """Return the mount of the camera; "" without one."""
    if "mount" not in entry:
        if "offset_m" in entry:
            raise InputError(
                f'{where} offset_m: expected mount = "vehicle" with it, or position_m '
                "in its place, got no mount"
            )
        return ""
    mount = choice(entry["mount"], MOUNTS, f"{where} mount")
    for key, instead in (
        ("position_m", "offset_m, in the axes of the vehicle's body"),
        ("look_at_m", "quaternion_xyzw, camera to body, or neither to look forward"),
    ):
        if key in entry:
            raise InputError(
                f"{where} {key}: expected {instead}, for a camera on a vehicle, got "
                f"{shown(entry[key])}"
            )
    if "vehicle" not in document:
        raise InputError(
            f'{where} mount: expected a [vehicle] as mount, got "{mount}" without that '
            "table"
        )
    return mount


def _quaternion(entry: dict[str, Any], position: Float[np.ndarray, "3"], where: str):
    """Return the unit quaternion, camera to world, from either key."""
    given = [key for key in ("look_at_m", "quaternion_xyzw") if key in entry]
    if len(given) != 1:
        raise InputError(
            f"{where} look_at_m: expected either look_at_m or quaternion_xyzw, "
            f"got {'both' if given else 'neither'}"
        )
    numbers = _list(entry, given[0], where)
    if given == ["look_at_m"]:
        # There is no direction from a position to itself: the rotation would be NaN.
        if np.array_equal(numbers, position):
            raise InputError(
                f"{where} look_at_m: expected a position other than position_m, "
                f"got {shown(entry['look_at_m'])}"
            )
        return look_at(position, numbers)
    if not numbers.any():
        raise InputError(
            f"{where} quaternion_xyzw: expected {LISTS['quaternion_xyzw']} that is not "
            f"zero, got {shown(entry['quaternion_xyzw'])}"
        )
    scaled = (
        numbers / np.abs(numbers).max()
    )  # whose squares neither over- nor underflow
    return scaled / np.linalg.norm(scaled)


def _list(entry: dict[str, Any], key: str, where: str) -> Float[np.ndarray, " number"]:
    if key not in entry:
        raise InputError(f"{where} {key}: expected {LISTS[key]}, got nothing")
    return fixed_list(entry[key], f"{where} {key}", LISTS[key])


def _pair(entry: dict[str, Any], key: str, where: str) -> Float[np.ndarray, "2"]:
    """Return two positive numbers; a single one is used for both."""
    value, where = entry.get(key), f"{where} {key}"
    if value is None:
        raise InputError(f"{where}: expected a number or {LISTS[key]}, got nothing")
    if not isinstance(value, list):
        return np.full(2, _positive(value, where))
    pair = fixed_list(value, where, LISTS[key])
    for index, number in enumerate(pair.tolist()):
        _positive(number, f"{where}[{index}]")
    return pair


def _positive(value: Any, where: str) -> float:
    number = finite(value, where, "a positive number")
    if number <= 0:
        raise InputError(f"{where}: expected a positive number, got {shown(value)}")
    return number


def _pixels(entry: dict[str, Any], key: str, where: str) -> int:
    value = entry.get(key)
    # `type`, not `isinstance`: True is an int, too.
    if type(value) is not int or not 1 <= value <= MAX_IMAGE_PX:
        raise InputError(
            f"{where} {key}: expected a whole number of pixels, 1 to {MAX_IMAGE_PX}, "
            f"got {shown(value) if key in entry else 'nothing'}"
        )
    return value


def read_vehicle(document: dict[str, Any], source: str) -> VehicleSpec | None:
    """Read the vehicle of a scene file; None without one.

    Model and position have no default, except that a mission begins at its plan's home.
    Its numbers are fixed; an uncertain relative position is a prior of the charge.

    Raises:
        InputError: As in `read_scene`.
    """
    if "vehicle" not in document:
        return None
    entry = table(document, "vehicle", source)
    where = f"{source}: [vehicle]"
    for key, what in (
        ("model", f"one of {', '.join(VEHICLE_MODELS)}"),
        ("position_m", LISTS["position_m"]),
    ):
        if key not in entry and not (key == "position_m" and "mission" in entry):
            raise InputError(f"{where} {key}: expected {what}, got nothing")
    places = {
        name: fixed_list(entry[key], f"{where} {key}", LISTS[key])
        for name, key in (("position", "position_m"), ("velocity", "velocity_m_s"))
        if key in entry
    }
    control = _control(entry.get("control", {}), f"{where} control")
    if "mission" in entry:
        for key, given in (
            ("velocity_m_s", "velocity" in places),
            ("control target_m", "target" in control),
        ):
            if given:
                raise InputError(
                    f"{where} {key}: expected no value with a mission, which begins at "
                    "rest and has its own targets, got one"
                )
        name = name_of(entry["mission"], f"{where} mission")
        control["mission"] = str(Path(source).parent / name)
        control["placed"] = "position" in places
        # Replaced by the home of the plan, which is not read here.
        places.setdefault("position", np.zeros(3))
    return VehicleSpec(
        model=choice(entry["model"], VEHICLE_MODELS, f"{where} model"),
        **places,
        **control,
    )


def _control(entry: Any, where: str) -> dict[str, Any]:
    """Return the options of the table [vehicle] control."""
    if not isinstance(entry, dict):
        raise InputError(
            f"{where}: expected a table such as {{ integral = true }}, "
            f"got {shown(entry)}"
        )
    known_keys(entry, "control", where)
    options: dict[str, Any] = {"gains": _gains(entry, where)}
    if "integral" in entry:
        options["integral"] = true_or_false(entry["integral"], f"{where} integral")
    if "target_m" in entry:
        target = fixed_list(entry["target_m"], f"{where} target_m", LISTS["target_m"])
        options["target"] = as_float_array(target)
    if "yaw_rad" in entry:
        options["yaw"] = fixed_number(entry["yaw_rad"], f"{where} yaw_rad")
    return options


def _gains(entry: dict[str, Any], where: str) -> dict[str, Any]:
    """Return the gains, checked to be non-negative."""
    gains: dict[str, Any] = {}
    for key in (*VECTOR_GAINS, *SCALAR_GAINS):
        if key not in entry:
            continue
        at = f"{where} {key}"
        along = key in VECTOR_GAINS
        numbers = np.asarray(
            fixed_list(entry[key], at, LISTS[key])
            if along
            else fixed_number(entry[key], at)
        )
        if (numbers < 0).any():
            expected = "numbers that are" if along else "a number that is"
            raise InputError(
                f"{at}: expected {expected} not negative, got {shown(entry[key])}"
            )
        # Below 1 the lead would be a second lag.
        if key == "motor_lead" and numbers < 1:
            raise InputError(
                f"{at}: expected a factor of 1 and more, got {shown(entry[key])}"
            )
        # Zero gains with integral action would keep a state that does nothing.
        if key == "ki_pos" and not numbers.any():
            raise InputError(
                f"{at}: expected a number above zero, got {shown(entry[key])}; for no "
                "integral action write integral = false"
            )
        gains[key] = as_float_array(numbers)
    return gains
