"""Reader of scene files: from TOML to a scene with priors of its numbers.

The table of keys (`scene.keys`) states form, bounds and relations of the keys. Here the
classes of a scene are made of the checked values, with the conditions between keys that
need a computation.
"""

import math
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, read_text, require, shown
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import BY_CAMERA, TIMED, components
from jblast.scene.camera import FORWARD, FRAMES_HZ, Camera, look_at
from jblast.scene.charge import Charge
from jblast.scene.keys import KEYS, WITHIN, keys_of
from jblast.scene.random_blasts import Box, ByCount, ByTick, WorldSpec
from jblast.scene.scene import Air, Ambient, Ground, Scene, VehicleSpec
from jblast.scene.sensor import RATE_HZ, Clock, Imu, Instrument, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.scene.uncertain import (
    Belief,
    Free,
    Place,
    Prior,
    UncertainScene,
    Uniform,
    with_values,
)
from jblast.scene.values import POSITION, File, SceneKey, Table, Word, known


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
    if isinstance(scene, Scene):
        return UncertainScene(scene)
    if isinstance(scene, UncertainScene):
        return scene
    expected = "the path of a scene file or the result of jblast.read_scene"
    is_path = isinstance(scene, str | os.PathLike)
    require(is_path, "scene", expected, type(scene).__name__)
    return read_scene(scene)


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
    document, source = document_of(path), str(path)
    if "world" in document:
        return world_from_document(document, source)
    return _File(document, source).scene(needs_charge=needs_charge), None


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


def scene_from_document(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene from the tables of a file.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    single = "single blasts in [charge]; run jblast world on this scene"
    require("world" not in document, f"{source}: [world]", single, "random ones")
    return _File(document, source).scene()


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
    file = _File(document, source)
    return file.scene(needs_charge=False), file.world()


class _File:
    """Tables of a scene file, from which the parts of a scene are read.

    Attributes:
        document: The tables of the file.
        source: The file's name, for messages.
        starts: Values of the numbers that have been read, by name.
        beliefs: Priors of these numbers, and free numbers; others are fixed.
    """

    def __init__(self, document: dict[str, Any], source: str):
        self.document, self.source = document, source
        self.starts: dict[str, float] = {}
        self.beliefs: dict[str, Belief] = {}

    def scene(self, *, needs_charge: bool = True) -> UncertainScene:
        """Return the scene; without [charge] its charge is free, or never detonates."""
        document, tables = self.document, [name for name in KEYS if name not in WITHIN]
        for name in document:
            known(name, ("schema", *tables), f"{self.source}:", "table")
        schema = document.get("schema", 1)
        first = type(schema) is int and schema == 1
        require(first, f"{self.source}: schema", "1", shown(schema))
        law, tables = self.single("law"), document.keys()
        # The reader imports no laws: `sensors.resolve_laws` rejects unknown names.
        chosen = law.get("law", {}).items()
        law["law"] = tuple((quantity, one) for quantity, one in chosen if one != "auto")
        sensors = tuple(self.sensor(*each) for each in self.each("sensor"))
        # A scene needs a charge: one that never detonates has no effect.
        charges: tuple[Charge, ...] = (Charge(time_s=math.inf),)
        if needs_charge or "charge" in document:
            each = self.each("charge")
            charges = tuple(self.charge(*one, len(sensors)) for one in each)
        scene = Scene(
            charges=charges,
            air=Air(**self.single("air")),
            ground=Ground(**self.single("ground")),
            sensors=sensors,
            ambient=Ambient(**self.single("ambient")) if "ambient" in tables else None,
            camera=self.camera() if "camera" in tables else None,
            vehicle=self.vehicle() if "vehicle" in tables else None,
            clocks=tuple(self.clock(*each) for each in self.each("clock")),
            **law,
        )
        place = Place(**self.single("place")) if "place" in tables else None
        # One table places the numbers, not this class.
        scene = with_values(scene, self.starts)
        return UncertainScene(scene, self.beliefs, self.source, place)

    def table(
        self, entry: dict[str, Any], keys: dict[str, SceneKey], where: str, of: str = ""
    ) -> dict[str, Any]:
        """Return the checked values of a table by field, without uncertain numbers.

        Args:
            entry: The table.
            keys: Its keys by name.
            where: File and table, for messages.
            of: Suffix of names of numbers: the charge or clock, as ".phone".

        Raises:
            InputError: A key is unknown, missing or excluded by another, or a value is
                invalid.
        """
        found: dict[str, Any] = {}
        # A table of the file is named in brackets: "[vehicle] as mount".
        given = {*entry, *(f"[{name}]" for name in self.document)}
        # Unknown keys are rejected: an ignored one would silently leave a default.
        kind = f" for kind {shown(entry['kind'])}" if "kind" in entry else ""
        for name in entry:
            known(name, keys, where, f"key{kind}")
        for name, key in keys.items():
            at, value = f"{where} {name}", entry.get(name, key.default)
            others = [words for words in key.instead if words.split()[0] in entry]
            if value is None:
                form = " or ".join((key.value.form, *key.instead))
                require(not key.needed or others, at, form, "nothing")
                continue
            require(not others, at, f"either {name} or {' or '.join(others)}", "both")
            read = key.value.read(value, at)
            is_word = read is None  # "none" or "float", which need nothing
            for words in key.needs:
                beside = is_word or words.split()[0] in given
                require(beside, at, f"{words} with it", "none")
            if key.rows:
                several = read if isinstance(read, list) else [read]
                for row, one in zip(key.rows, several, strict=True):
                    self.put(f"{row.name}{of}", one, row.default)
                continue
            if isinstance(key.value, Table):
                inner = {key.name: key for key in key.value.keys}
                found |= self.table(read, inner, at, of)
                continue
            if isinstance(key.value, File):
                # Relative to the scene file, so that a folder can be moved as a whole.
                read = str(Path(self.source).parent / read)
            part, _, field = (key.field or name).rpartition(".")
            inner = found.setdefault(part, {}) if part else found
            require(field not in inner, at, "it once", "it twice")
            inner[field] = key.make(read) if key.make else read
        return found

    def put(self, name: str, value: float | Belief, default: float) -> None:
        """Store a number, or the belief about it and the start of its fit."""
        if isinstance(value, Belief):
            self.beliefs[name] = value
            value = default if isinstance(value, Free) else value.middle
        self.starts[name] = value

    def single(self, name: str) -> dict[str, Any]:
        """Return the checked values of a table that a file has once, or not at all."""
        entry, where = self.document.get(name, {}), f"{self.source}: [{name}]"
        expected = f"one table written [{name}]"
        require(isinstance(entry, dict), where, expected, shown(entry))
        return self.table(entry, keys_of(name), where)

    def each(self, name: str) -> Iterator[tuple[dict[str, Any], str, str]]:
        """Yield each of several tables, its place in the file, and its suffix."""
        where, of_charge = f"{self.source}: [[{name}]]", name == "charge"
        entries = self.document.get(name, [{}] if of_charge else [])
        if of_charge and isinstance(entries, dict):
            entries = [entries]
        tables = isinstance(entries, list) and all(isinstance(x, dict) for x in entries)
        require(tables, where, f"tables written [[{name}]]", shown(entries))
        require(entries or not of_charge, where, "a charge", "an empty list")
        if of_charge and len(entries) == 1:
            # A single charge has plain names, also if the file names it.
            yield entries[0], f"{self.source}: [charge]", ""
            return
        names: list[str] = []
        for number, entry in enumerate(entries, start=1):
            word = entry.get("name")
            label = word.strip() if isinstance(word, str) else ""
            once = not label or label not in names
            require(once, f"{where} name", "each name once", f"{shown(label)} twice")
            names.append(label)
            yield entry, f"{where} {shown(label) if label else number}", f".{label}"

    def charge(
        self, entry: dict[str, Any], where: str, of: str, sensors: int
    ) -> Charge:
        """Return a charge of a scene with a number of sensors."""
        # The mass is what a scene is mostly for: without the key it is fitted.
        values = self.table({"mass_kg": "free"} | entry, keys_of("charge"), where, of)
        named = not of or "name" in values
        require(named, f"{where} name", "a name in quotes", "nothing")
        both = "tnt_factor" in entry and values.get("explosive", "TNT") != "TNT"
        either = "either tnt_factor or an explosive"
        require(not both, f"{where} tnt_factor", either, "both")
        # A range without a direction determines the distance to a single sensor only.
        alone = "range_m" not in entry or sensors <= 1
        require(alone, f"{where} range_m", "one sensor (its distance)", sensors)
        return Charge(**values)

    def clock(self, entry: dict[str, Any], where: str, of: str) -> Clock:
        """Return the clock of a recorder."""
        # A sensor and a recorder of one name would have two offsets.
        own = f"{CLOCK_OFFSET}{of}" not in self.starts
        other = "another name than that of a [[sensor]] with a clock_offset_s"
        require(own, f"{where} name", other, shown(of[1:]))
        return Clock(**self.table(entry, keys_of("clock"), where, of))

    def camera(self) -> Camera:
        """Return the camera; on a vehicle it is by default at its centre."""
        values, where = self.single("camera"), f"{self.source}: [camera]"
        position = values.setdefault("position", [0.0, 0.0, 0.0])
        quaternion = values.get("quaternion", FORWARD)
        if (target := values.pop("look_at", None)) is not None:
            # There is no direction from a position to itself.
            other = "another place than position_m"
            require(target != position, f"{where} look_at_m", other, target)
            quaternion = look_at(np.array(position), np.array(target))
        values["quaternion"] = np.asarray(quaternion) / np.linalg.norm(quaternion)
        middle = [(values["width"] - 1) / 2, (values["height"] - 1) / 2]
        values.setdefault("center", middle)
        # The exposure of a frame ends before the next frame begins.
        interval = 1 / values.get("frames_hz", FRAMES_HZ)
        expected = f"between 0 and {interval:g}, the time from frame to frame"
        exposure = values.get("exposure_s", 0.0)
        require(exposure <= interval, f"{where} exposure_s", expected, exposure)
        return Camera(**values)

    def vehicle(self) -> VehicleSpec:
        """Return the vehicle; a mission begins at the home of its plan."""
        values, where = self.single("vehicle"), f"{self.source}: [vehicle]"
        placed, mission = "position" in values, "mission" in values
        require(placed or mission, f"{where} position_m", POSITION, "nothing")
        own = "no value with a mission, which has its own targets"
        held = not mission or "target" not in values
        require(held, f"{where} control target_m", own, "one")
        # The home of a plan is not read here.
        known: dict[str, Any] = {"position": np.zeros(3), "placed": placed}
        return VehicleSpec(**known | values)

    def sensor(self, entry: dict[str, Any], where: str, of: str) -> Sensor:
        """Return a sensor; a missing position is NaN until a log gives it."""
        kind = entry.get("kind", "")
        if kind:
            kind = Word(SENSOR_KINDS).read(kind, f"{where} kind")
        values = self.table(entry, keys_of("sensor", kind), where, of)
        records = values.get("records", {})
        timed = "times_s" not in values or any(name in TIMED for name in records)
        expected = f"one of {', '.join(TIMED)} in records (only these have times)"
        require(timed, f"{where} times_s", expected, "none")
        position = values.setdefault("position_m", [math.nan] * 3)
        # Sound in the ground has no law; a geophone records its motion.
        above = kind != "microphone" or not position[2] < 0
        expected = "a microphone on the ground or above it"
        require(above, f"{where} position_m[2]", expected, f"{position[2]:g} m")
        if "mount" in values:
            reason = SENSOR_KINDS[kind].unmounted if kind else ""
            carried = "a sensor that a vehicle can carry"
            require(not reason, f"{where} mount", carried, reason)
            fixed = ", ".join(filter(_is_of_fixed_place, records))
            expected = "quantities that a sensor on a vehicle can record"
            require(not fixed, f"{where} records {fixed}", expected, fixed)
        if "imu" in values:
            values["imu"] = Imu(**values["imu"])
        if (own := values.get("instrument")) is not None:
            high, low = own.pop("filter_hz", (None, None))
            half = own.get("rate", RATE_HZ) / 2
            # Above the Nyquist frequency a digital filter is not defined.
            expected = f"corners below {half:g}, half of rate_hz"
            below = max(high or 0.0, low or 0.0) < half
            require(below, f"{where} filter_hz", expected, shown([high, low]))
            values["instrument"] = Instrument(**own, high_pass=high, low_pass=low)
        values["records"] = tuple(records.items())
        return Sensor(**values)

    def world(self) -> WorldSpec:
        """Return the distribution of random blasts.

        Raises:
            InputError: There is no [world], a value in it is invalid, the blasts do not
                fit with their gap, or its vehicle is missing.
        """
        where = f"{self.source}: [world]"
        random = "world" in self.document
        require(random, where, "a table of random blasts", "none")
        values = self.single("world")
        if isinstance(box := values.get("region"), Box):
            east, north, up = box.high - box.low
            area = "a box with an area, its first corner south-west and not higher"
            wide, got = east > 0 and north > 0 and up >= 0, f"{east:g} {north:g} {up:g}"
            require(wide, f"{where} region_m box", area, got)
        found = values.get("about") != "vehicle" or "vehicle" in self.document
        require(found, f"{where} about", "a [vehicle] as centre of the region", "none")
        if (tick := values.pop("tick", None)) is not None:
            values["occurrence"] = ByTick(values["occurrence"], tick)
        world = WorldSpec(**values)
        _check_times(world, where)
        return world


def _is_of_fixed_place(quantity: str) -> bool:
    """Return whether a moving sensor has no single position for a quantity.

    It has none for a sum of arrivals, a timed radius and an image.
    """
    of_ground = quantity.startswith("ground_") and quantity != "ground_arrival_s"
    several = len(components(quantity)) > 1
    return of_ground or several or quantity in (*TIMED, *BY_CAMERA)


def _check_times(world: WorldSpec, where: str) -> None:
    """Reject times that do not fit the requested blasts."""
    uniform = isinstance(world.time, Uniform)
    if not isinstance(world.occurrence, ByCount):
        expected = "{ uniform = [from, to] }, the interval with blasts"
        require(uniform, f"{where} time_s", expected, "another form")
        return
    gap = world.gap
    least = float(getattr(gap, "lo", 0.0) if isinstance(gap, Prior) else gap)
    # Sampling sorts uniform times within the interval less the gaps; for another
    # distribution that changes its shape.
    apart = least > 0 or isinstance(gap, Prior)
    sorted_well = uniform or not isinstance(world.time, Prior) or not apart
    expected = "0 between times that are not uniform"
    require(sorted_well, f"{where} gap_s", expected, "a gap")
    check_fits(world.occurrence.count, *world.window, least, where)


def check_fits(count: int, first: float, last: float, gap: float, where: str) -> None:
    """Reject more blasts than fit into an interval with their gap.

    Args:
        count: Number of blasts.
        first: Beginning of the interval [s].
        last: End of the interval [s].
        gap: Minimum time between two blasts [s].
        where: File and table, for the message.

    Raises:
        InputError: They do not fit.
    """
    # Two blasts at one fixed time would be one: also refused without a gap.
    at_once = count > 1 and first == last
    most = int((last - first) / gap) + 1 if last > first and gap else 1
    expected = f"at most {most}, which fit between {first:g} and {last:g} s"
    fits = (count - 1) * gap <= last - first and not at_once
    require(fits, f"{where} count", f"{expected} at gap_s {gap:g}", count)
