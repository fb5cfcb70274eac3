"""Reader of scene files: from TOML to a scene with priors of its numbers.

The table of keys (`scene.keys`) states form, bounds and relations of the keys. Here the
classes of a scene are made of the checked values, with the conditions between keys that
need a computation.
"""

import math
import os
import tomllib
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, read_text, require, shown
from jblast.parameters import CLOCK_OFFSET
from jblast.quantities import BY_CAMERA, QUANTITIES, TIMED, components
from jblast.scene.camera import FORWARD, FRAMES_HZ, Camera, look_at
from jblast.scene.charge import Charge
from jblast.scene.keys import KEYS, WITHIN, keys_of
from jblast.scene.random_blasts import (
    Box,
    ByCount,
    ByRate,
    ByTick,
    Ring,
    WorldSpec,
)
from jblast.scene.scene import Air, Ambient, Ground, Scene, VehicleSpec
from jblast.scene.sensor import RATE_HZ, Clock, Imu, Instrument, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS, SensorKind, kind_keys
from jblast.scene.uncertain import (
    Belief,
    Place,
    Prior,
    UncertainScene,
    Uniform,
    with_values,
)
from jblast.scene.values import POSITION, SceneKey, Table, Uncertain, known
from jblast.types import as_numbers


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
    require(
        isinstance(scene, UncertainScene),
        "scene",
        "the path of a scene file or the result of jblast.read_scene",
        type(scene).__name__,
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


SENSOR_KEYS = [key.name for key in KEYS["sensor"]]
"""Keys of sensors of any kind."""


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
        law = self.single("law")
        names = {name: law.pop(name) for name in QUANTITIES if name in law}
        sensors = tuple(self.sensor(*each) for each in self.named("sensor"))
        # A scene needs a charge: one that never detonates has no effect.
        charges: tuple[Charge, ...] = (Charge(time_s=math.inf),)
        if needs_charge or "charge" in document:
            charges = tuple(self.charge(*each, len(sensors)) for each in self.charges())
        scene = Scene(
            charges=charges,
            air=Air(**self.single("air")),
            ground=Ground(**self.single("ground")),
            sensors=sensors,
            ambient=self.ambient() if "ambient" in document else None,
            camera=self.camera() if "camera" in document else None,
            vehicle=self.vehicle() if "vehicle" in document else None,
            clocks=tuple(self.clock(*each) for each in self.named("clock")),
            # The reader imports no laws: `sensors.resolve_laws` rejects unknown names.
            law=tuple(pair for pair in names.items() if pair[1] != "auto"),
            **law,
        )
        place = Place(**self.single("place")) if "place" in document else None
        # One table places the numbers, not this class.
        scene = with_values(scene, self.starts)
        return UncertainScene(scene, self.beliefs, self.source, place)

    def fields(
        self, entry: dict[str, Any], keys: Iterable[SceneKey], where: str, of: str = ""
    ) -> dict[str, Any]:
        """Return the checked values of a table by field, without uncertain numbers.

        Args:
            entry: The table.
            keys: Keys to read.
            where: File and table, for messages.
            of: Suffix of names of numbers: the charge or clock, as ".phone".

        Raises:
            InputError: A value is invalid, or a key is missing or excluded by another.
        """
        found: dict[str, Any] = {}
        for key in keys:
            at, value = f"{where} {key.name}", entry.get(key.name, key.default)
            others = [words for words in key.instead if words.split()[0] in entry]
            if value is None:
                either = f"either {' or '.join((key.name, *key.instead))}"
                expected = either if key.instead else key.value.form
                got = "neither" if key.instead else "nothing"
                require(not key.needed or others, at, expected, got)
                continue
            excluded = f"either {key.name} or {' or '.join(others)}"
            require(not others, at, excluded, "both")
            read = key.value.read(value, at)
            if isinstance(key.value, Uncertain):
                for row, (start, belief) in zip(key.value.rows, read, strict=True):
                    self.starts[f"{row.name}{of}"] = start
                    if belief is not None:
                        self.beliefs[f"{row.name}{of}"] = belief
                continue
            if isinstance(key.value, Table):
                read = self.table(read, key.value.name, at)
            found[key.field or key.name] = read
            # A table of the file is named in brackets: "[vehicle] as mount".
            given = {*entry, *(f"[{name}]" for name in self.document)}
            for words in key.needs if read is not None else ():
                require(words.split()[0] in given, at, f"{words} with it", "none")
        return found

    def table(
        self, entry: dict[str, Any], name: str, where: str, of: str = ""
    ) -> dict[str, Any]:
        """Return the checked values of a table with the keys of its name."""
        keys = keys_of(name)
        # Unknown keys are rejected: an ignored one would silently leave a default.
        for key in entry:
            known(key, keys, where, "key")
        return self.fields(entry, keys.values(), where, of)

    def single(self, name: str) -> dict[str, Any]:
        """Return the checked values of a table that a file has once, or not at all."""
        entry, where = self.document.get(name, {}), f"{self.source}: [{name}]"
        expected = f"one table written [{name}]"
        require(isinstance(entry, dict), where, expected, shown(entry))
        return self.table(entry, name, where)

    def named(self, name: str) -> Iterator[tuple[dict[str, Any], str, str]]:
        """Yield each of several tables, its place in the file, and its name."""
        entries, where = self.document.get(name, []), f"{self.source}: [[{name}]]"
        tables = isinstance(entries, list) and all(isinstance(x, dict) for x in entries)
        require(tables, where, f"tables written [[{name}]]", shown(entries))
        names: list[str] = []
        for number, entry in enumerate(entries, start=1):
            for key in entry:
                known(key, keys_of(name), where, "key")
            at, word = f"{where} name", entry.get("name")
            named = isinstance(word, str) and word.strip()
            got = "nothing" if word is None else shown(word)
            require(named, at, f"a name in quotes for {name} {number}", got)
            names.append(str(word).strip())
            once = names.count(names[-1]) == 1
            require(once, at, "each name once", f"{shown(names[-1])} twice")
            yield entry, f"{where} {shown(names[-1])}", f".{names[-1]}"

    def charges(self) -> Iterator[tuple[dict[str, Any], str, str]]:
        """Yield the tables of charges: [charge], [[charge]], or an empty default."""
        entries, where = self.document.get("charge", {}), f"{self.source}: [charge]"
        require(entries != [], where, "a charge", "an empty list")
        if isinstance(entries, list) and len(entries) > 1:
            yield from self.named("charge")
            return
        # A single charge has plain names, also if the file names it.
        entry = entries[0] if isinstance(entries, list) else entries
        expected = "a table written [charge]"
        require(isinstance(entry, dict), where, expected, shown(entry))
        yield entry, where, ""

    def charge(
        self, entry: dict[str, Any], where: str, of: str, sensors: int
    ) -> Charge:
        """Return a charge of a scene with a number of sensors."""
        never = "a finite number; omit a charge that never happens"
        require(entry.get("time_s") != math.inf, f"{where} time_s", never, "inf")
        # The mass is what a scene is mostly for: without the key it is fitted.
        values = self.table({"mass_kg": "free"} | entry, "charge", where, of)
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
        return Clock(**self.table(entry, "clock", where, of))

    def ambient(self) -> Ambient:
        """Return the ambient sound; a recording is only named."""
        values = self.single("ambient")
        if "file" in values:
            # Relative to the scene file, so that a folder can be moved as a whole.
            values["file"] = str(Path(self.source).parent / values["file"])
        return Ambient(**values)

    def camera(self) -> Camera:
        """Return the camera; on a vehicle it is by default at its centre."""
        values, where = self.single("camera"), f"{self.source}: [camera]"
        position = values.setdefault("position", np.zeros(3))
        if (target := values.pop("look_at", None)) is not None:
            # There is no direction from a position to itself.
            apart, other = (
                (target != position).any(),
                "a position other than position_m",
            )
            require(apart, f"{where} look_at_m", other, target.tolist())
            values["quaternion"] = look_at(position, target)
        quaternion = np.asarray(values.get("quaternion", FORWARD))
        values["quaternion"] = quaternion / np.linalg.norm(quaternion)
        size = np.array([values["width"], values["height"]])
        values.setdefault("center", (size - 1) / 2)
        # The exposure of a frame ends before the next frame begins.
        interval = 1 / values.get("frames_hz", FRAMES_HZ)
        expected = f"between 0 and {interval:g}, the time from frame to frame"
        exposure = values.get("exposure_s", 0.0)
        require(exposure <= interval, f"{where} exposure_s", expected, exposure)
        return Camera(**values)

    def vehicle(self) -> VehicleSpec:
        """Return the vehicle; a mission begins at the home of its plan."""
        values, where = self.single("vehicle"), f"{self.source}: [vehicle]"
        control = values.pop("control", {})
        fields = ("integral", "target", "yaw")
        values |= {name: control.pop(name) for name in fields if name in control}
        values["gains"] = {name: as_numbers(gain) for name, gain in control.items()}
        placed, mission = "position" in values, "mission" in values
        require(placed or mission, f"{where} position_m", POSITION, "nothing")
        if mission:
            own = "no value with a mission, which has its own targets"
            require("target" not in values, f"{where} control target_m", own, "one")
            values["mission"] = str(Path(self.source).parent / values["mission"])
        # The home of a plan is not read here.
        return VehicleSpec(**{"position": np.zeros(3), "placed": placed} | values)

    def sensor(self, entry: dict[str, Any], where: str, of: str) -> Sensor:
        """Return a sensor; a missing position is NaN until a log gives it."""
        values = self.fields(entry, KEYS["sensor"], where, of)
        kind, mounted = values.get("kind", ""), "mount" in values
        own = {key.name: key for key in kind_keys(kind)}
        given = [key for key in entry if key not in SENSOR_KEYS]
        for key in given:
            expected = f"one of {', '.join(own)}" if own else "no further key"
            expected += f" for kind {shown(kind)}"
            require(key in own, f"{where} {key}", expected, key)
        options = self.fields(entry, own.values(), where)
        records = values.get("records", ())
        timed = "times_s" not in values or any(name in TIMED for name, _ in records)
        expected = f"one of {', '.join(TIMED)} in records (only these have times)"
        require(timed, f"{where} times_s", expected, "none")
        position = values.setdefault("position_m", np.full(3, np.nan))
        # Sound in the ground has no law; a geophone records its motion.
        above = kind != "microphone" or not position[2] < 0
        expected = "a microphone on the ground or above it"
        require(above, f"{where} position_m[2]", expected, f"{position[2]:g} m")
        if mounted:
            _check_mountable(SENSOR_KINDS.get(kind), records, where)
        if kind == "imu":
            at = f"{where} {''.join(given[:1])}"
            expected = 'mount = "vehicle" for the samples of an imu'
            require(mounted or not given, at, expected, "none")
            return Sensor(**values, imu=Imu(**options) if given else None)
        settings = [key.name for key in SENSOR_KINDS[kind or "pressure"].keys]
        return Sensor(
            **values,
            settings={name: options.pop(name) for name in settings if name in options},
            instrument=_instrument(options, where) if options else None,
        )

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
        region = values.pop("region", {})
        once = not ("about" in values and "about" in region)
        require(once, f"{where} about", "it once", "it in region_m, too")
        about = values.get("about", region.get("about", "world"))
        found = about != "vehicle" or "vehicle" in self.document
        require(found, f"{where} about", "a [vehicle] as centre of the region", "none")
        values["about"] = about
        for name, shape in (("box", Box), ("ring", Ring)):
            if name in region:
                values["region"] = shape(*region[name])
        tick = values.pop("tick", None)
        for name, occurrence in (
            ("count", ByCount),
            ("rate", ByRate),
            ("probability", partial(ByTick, tick=tick)),
        ):
            if name in values:
                values["occurrence"] = occurrence(values.pop(name))
        world = WorldSpec(**values)
        _check_times(world, where)
        return world


def _instrument(options: dict[str, Any], where: str) -> Instrument:
    """Return the instrument of a sensor."""
    high, low = options.pop("filter_hz", (None, None))
    half = options.get("rate", RATE_HZ) / 2
    for index, corner in enumerate((high, low)):
        # Above the Nyquist frequency a digital filter is not defined.
        below, at = corner is None or corner < half, f"{where} filter_hz[{index}]"
        require(below, at, f"a corner below {half:g}, half of rate_hz", corner)
    return Instrument(**options, high_pass=high, low_pass=low)


def _check_mountable(
    kind: SensorKind | None, records: Iterable[tuple[str, float]], where: str
) -> None:
    """Reject a sensor in the ground, or records whose motion is not supported."""
    reason = kind.unmounted if kind else ""
    require(not reason, f"{where} mount", "a sensor that a vehicle can carry", reason)
    for name, _ in records:
        # A sum of arrivals, a timed radius and an image have no single position of a
        # moving sensor.
        apart = len(components(name)) > 1 or name in (*TIMED, *BY_CAMERA)
        of_ground = name.startswith("ground_") and name != "ground_arrival_s"
        expected = "a quantity that a sensor on a vehicle can record"
        require(not apart and not of_ground, f"{where} records {name}", expected, name)


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
