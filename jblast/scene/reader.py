"""Reader of scene files: from TOML to a scene with priors of its numbers.

The table of keys (`scene.keys`) states form, bounds and relations of the keys. Here the
classes of a scene are made of the checked values, with the conditions between keys that
need a computation.
"""

import math
import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import InputError, read_text, require, shown
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
from jblast.scene.uncertain import Belief, Place, Prior, UncertainScene, Uniform
from jblast.scene.values import SceneKey, Table, Uncertain, known
from jblast.types import as_float_array


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


def scene_from_document(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene from the tables of a file.

    Args:
        document: The tables of the file.
        source: The file's name, for the messages.

    Raises:
        InputError: As in `read_scene`.
    """
    require(
        "world" not in document,
        f"{source}: [world]",
        "single blasts in [charge]",
        "random ones; run jblast world on this scene, and jblast fit on the files that "
        "it writes",
    )
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
    world = _File(document, source).world()
    rest = {key: value for key, value in document.items() if key != "world"}
    read = scene_from_document if "charge" in document else _without_blast
    return read(rest, source), world


def _without_blast(document: dict[str, Any], source: str) -> UncertainScene:
    """Build a scene without [charge]."""
    uncertain = scene_from_document(document | {"charge": {"mass_kg": 1.0}}, source)
    # A scene needs a charge: one that never detonates has no effect.
    never = replace(uncertain.scene.charge, time_s=math.inf)
    return replace(uncertain, scene=replace(uncertain.scene, charges=(never,)))


SENSOR_KEYS = [key.name for key in KEYS["sensor"]]
"""Keys of sensors of any kind."""


class _File:
    """Tables of a scene file, from which the parts of a scene are read.

    Attributes:
        document: The tables of the file.
        source: The file's name, for messages.
        beliefs: Priors of the numbers that have been read, and free numbers.
    """

    def __init__(self, document: dict[str, Any], source: str):
        self.document, self.source = document, source
        self.beliefs: dict[str, Belief] = {}

    def scene(self) -> UncertainScene:
        """Return the scene of the file."""
        tables = [name for name in KEYS if name not in WITHIN]
        for name in self.document:
            known(name, ("schema", *tables), f"{self.source}:", "table")
        schema = self.document.get("schema", 1)
        first = type(schema) is int and schema == 1
        require(first, f"{self.source}: schema", "1", shown(schema))
        law = self.single("law")
        names = {name: law.pop(name) for name in QUANTITIES if name in law}
        sensors = tuple(self.sensor(*each) for each in self.named("sensor"))
        charges = tuple(self.charge(*each, len(sensors)) for each in self.charges())
        scene = Scene(
            charges=charges,
            air=Air(**self.single("air")),
            ground=Ground(**self.single("ground")),
            sensors=sensors,
            ambient=self.ambient() if "ambient" in self.document else None,
            camera=self.camera() if "camera" in self.document else None,
            vehicle=self.vehicle() if "vehicle" in self.document else None,
            clocks=tuple(self.clock(*each) for each in self.named("clock")),
            # The reader imports no laws: `sensors.resolve_laws` rejects unknown names.
            law=tuple(pair for pair in names.items() if pair[1] != "auto"),
            **law,
        )
        place = Place(**self.single("place")) if "place" in self.document else None
        return UncertainScene(scene, self.beliefs, self.source, place)

    def fields(
        self, entry: dict[str, Any], keys: Iterable[SceneKey], where: str, of: str = ""
    ) -> dict[str, Any]:
        """Return the checked values of a table, by field of a class.

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
            both = f"either {key.name} or {' or '.join(others)}"
            require(not others, at, both, "both")
            value = key.value.read(value, at)
            for words in key.needs if value is not None else ():
                require(words.split()[0] in entry, at, f"{words} with it", "none")
            if isinstance(key.value, Table):
                value = self.table(value, key.value.name, at)
            if not isinstance(key.value, Uncertain):
                found[key.field or key.name] = value
                continue
            starts: dict[str, list[float]] = {}
            for row, (start, belief) in zip(key.value.rows, value, strict=True):
                field = key.field or row.attribute.rpartition(".")[2]
                starts.setdefault(field, []).append(start)
                if belief is not None:
                    self.beliefs[f"{row.name}{of}"] = belief
            found |= {f: v if len(v) > 1 else v[0] for f, v in starts.items()}
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
        require(
            isinstance(entry, dict), where, f"one table written [{name}]", shown(entry)
        )
        return self.table(entry, name, where)

    def named(self, name: str) -> Iterator[tuple[dict[str, Any], str, str]]:
        """Yield each of several tables, its place in the file, and its name."""
        entries, where = self.document.get(name, []), f"{self.source}: [[{name}]]"
        several = isinstance(entries, list) and all(
            isinstance(one, dict) for one in entries
        )
        require(several, where, f"tables written [[{name}]]", shown(entries))
        names: set[str] = set()
        for number, entry in enumerate(entries, start=1):
            for key in entry:
                known(key, keys_of(name), where, "key")
            at, word = f"{where} name", entry.get("name")
            good = isinstance(word, str) and word.strip()
            got = "nothing" if word is None else shown(word)
            require(good, at, f"a name in quotes for {name} {number}", got)
            word = word.strip()
            require(word not in names, at, "each name once", f"{shown(word)} twice")
            names.add(word)
            yield entry, f"{where} {shown(word)}", f".{word}"

    def charges(self) -> Iterator[tuple[dict[str, Any], str, str]]:
        """Yield the tables of charges: [charge], [[charge]], or an empty default."""
        entries, where = self.document.get("charge", {}), f"{self.source}: [charge]"
        if not isinstance(entries, list):
            require(
                isinstance(entries, dict),
                where,
                "a table written [charge]",
                shown(entries),
            )
            entries = [entries]
        require(entries, f"{self.source}: [[charge]]", "a charge", "an empty list")
        # A single charge has plain names, also if the file names it.
        if len(entries) == 1 and isinstance(entries[0], dict):
            yield entries[0], where, ""
        else:
            yield from self.named("charge")

    def charge(
        self, entry: dict[str, Any], where: str, of: str, sensors: int
    ) -> Charge:
        """Return a charge of a scene with a number of sensors."""
        never = "a finite number; omit a charge that never happens"
        require(entry.get("time_s") != math.inf, f"{where} time_s", never, "inf")
        # The mass is what a scene is mostly for: without the key it is fitted.
        values = self.table({"mass_kg": "free"} | entry, "charge", where, of)
        both = "tnt_factor" in values and values.get("explosive", "TNT") != "TNT"
        require(
            not both,
            f"{where} tnt_factor",
            "either tnt_factor or an explosive",
            "both",
        )
        # A range without a direction determines the distance to a single sensor only.
        require(
            "range_m" not in entry or sensors <= 1,
            f"{where} range_m",
            "one sensor (it is the distance to it)",
            sensors,
        )
        return Charge(**values)

    def clock(self, entry: dict[str, Any], where: str, of: str) -> Clock:
        """Return the clock of a recorder."""
        # A sensor and a recorder of one name would have two offsets.
        own = [one for one, *_, name in self.named("sensor") if name == of]
        require(
            not any("clock_offset_s" in one for one in own),
            f"{where} name",
            "another name than that of a [[sensor]] with a clock_offset_s",
            shown(of[1:]),
        )
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
        self.check_mount(values, where)
        position = values.setdefault("position", np.zeros(3))
        if (target := values.pop("look_at", None)) is not None:
            # There is no direction from a position to itself.
            require(
                (target != position).any(),
                f"{where} look_at_m",
                "a position other than position_m",
                shown(target.tolist()),
            )
            values["quaternion"] = look_at(position, target)
        quaternion = np.asarray(values.get("quaternion", FORWARD))
        values["quaternion"] = quaternion / np.linalg.norm(quaternion)
        values.setdefault(
            "center", np.array([values["width"] - 1, values["height"] - 1]) / 2
        )
        # The exposure of a frame ends before the next frame begins.
        interval = 1 / values.get("frames_hz", FRAMES_HZ)
        require(
            values.get("exposure_s", 0) <= interval,
            f"{where} exposure_s",
            f"between 0 and {interval:g}, the time from frame to frame",
            values.get("exposure_s"),
        )
        return Camera(**values)

    def check_mount(self, values: Mapping[str, Any], where: str) -> None:
        """Reject a mount without a vehicle."""
        carried = "mount" not in values or "vehicle" in self.document
        require(carried, f"{where} mount", "a [vehicle] as mount", "none")

    def vehicle(self) -> VehicleSpec:
        """Return the vehicle; a mission begins at the home of its plan."""
        values, where = self.single("vehicle"), f"{self.source}: [vehicle]"
        control = values.pop("control", {})
        fields = ("integral", "target", "yaw")
        values |= {name: control.pop(name) for name in fields if name in control}
        values["gains"] = {name: as_float_array(gain) for name, gain in control.items()}
        if "mission" not in values:
            require(
                "position" in values,
                f"{where} position_m",
                "[east, north, up]",
                "nothing",
            )
            return VehicleSpec(**values)
        require(
            "target" not in values,
            f"{where} control target_m",
            "no value with a mission, which has its own targets",
            "one",
        )
        values["mission"] = str(Path(self.source).parent / values["mission"])
        # The home of the plan is not read here.
        home = {"position": np.zeros(3), "placed": "position" in values}
        return VehicleSpec(**(home | values))

    def sensor(self, entry: dict[str, Any], where: str, of: str) -> Sensor:
        """Return a sensor; a missing position is NaN until a log gives it."""
        values = self.fields(entry, KEYS["sensor"], where, of)
        self.check_mount(values, where)
        kind = values.get("kind", "")
        own = {key.name: key for key in kind_keys(kind)}
        given = [key for key in entry if key not in SENSOR_KEYS]
        for key in given:
            expected = f"one of {', '.join(own)}" if own else "no further key"
            require(
                key in own, f"{where} {key}", f"{expected} for kind {shown(kind)}", key
            )
        options = self.fields(entry, own.values(), where)
        records = values.get("records", ())
        require(
            "times_s" not in values or any(name in TIMED for name, _ in records),
            f"{where} times_s",
            f"one of {', '.join(TIMED)} in records (only these have times)",
            "none",
        )
        position = values.setdefault("position_m", np.full(3, np.nan))
        # Sound in the ground has no law; a geophone records its motion.
        require(
            kind != "microphone" or not position[2] < 0,
            f"{where} position_m[2]",
            "a microphone on the ground or above it",
            f"{position[2]:g} m",
        )
        if "mount" in values:
            _check_mountable(SENSOR_KINDS.get(kind), records, where)
        if kind == "imu":
            require(
                not given or "mount" in values,
                f"{where} {given[0] if given else ''}",
                'mount = "vehicle" for the samples of an imu',
                "no mount",
            )
            return Sensor(**values, imu=Imu(**options) if given else None)
        settings = [key.name for key in SENSOR_KINDS[kind or "pressure"].keys]
        return Sensor(
            **values,
            settings={name: options.pop(name) for name in settings if name in options},
            instrument=_instrument(options, entry, where) if options else None,
        )

    def world(self) -> WorldSpec:
        """Return the distribution of random blasts.

        Raises:
            InputError: There is no [world], a value in it is invalid, the blasts do not
                fit with their gap, or its vehicle is missing.
        """
        where = f"{self.source}: [world]"
        require("world" in self.document, where, "a table of random blasts", "none")
        values = self.single("world")
        region = values.pop("region", {})
        once = not ("about" in values and "about" in region)
        require(once, f"{where} about", "it once", "it in region_m, too")
        values |= {name: region[name] for name in ("about",) if name in region}
        require(
            values.get("about") != "vehicle" or "vehicle" in self.document,
            f"{where} about",
            "a [vehicle] as centre of the region",
            '"vehicle" without that table',
        )
        if "box" in region:
            values["region"] = Box(*region["box"])
        if "ring" in region:
            values["region"] = Ring(*region["ring"])
        count, rate, chance, tick = (
            values.pop(name, None) for name in ("count", "rate", "probability", "tick")
        )
        if count is not None:
            values["occurrence"] = ByCount(count)
        if rate is not None:
            values["occurrence"] = ByRate(rate)
        if chance is not None:
            values["occurrence"] = ByTick(chance, tick)
        world = WorldSpec(**values)
        _check_times(world, where)
        return world


def _instrument(
    options: dict[str, Any], entry: dict[str, Any], where: str
) -> Instrument:
    """Return the instrument of a sensor."""
    high, low = corners = options.pop("filter_hz", (None, None))
    half = options.get("rate", RATE_HZ) / 2
    for index, corner in enumerate(corners):
        # Above the Nyquist frequency a digital filter is not defined.
        require(
            corner is None or corner < half,
            f"{where} filter_hz[{index}]",
            f"a corner below {half:g}, half of rate_hz",
            corner,
        )
    require(
        high is None or low is None or high < low,
        f"{where} filter_hz",
        "the high-pass corner below the low-pass one, as in [20, 20000]",
        shown(entry.get("filter_hz")),
    )
    return Instrument(**options, high_pass=high, low_pass=low)


def _check_mountable(
    kind: SensorKind | None, records: Iterable[tuple[str, float]], where: str
) -> None:
    """Reject a sensor in the ground, or records whose motion is not supported."""
    reason = kind.unmounted if kind else ""
    require(not reason, f"{where} mount", "a sensor that a vehicle can carry", reason)
    for quantity, _ in records:
        # A sum of arrivals, a timed radius and an image have no single position of a
        # moving sensor.
        apart = len(components(quantity)) > 1 or quantity in (*TIMED, *BY_CAMERA)
        of_ground = quantity.startswith("ground_") and quantity != "ground_arrival_s"
        require(
            not apart and not of_ground,
            f"{where} records {quantity}",
            "a quantity that a sensor on a vehicle can record",
            quantity,
        )


def _check_times(world: WorldSpec, where: str) -> None:
    """Reject times that do not fit the requested blasts."""
    uniform = isinstance(world.time, Uniform)
    if not isinstance(world.occurrence, ByCount):
        interval = "{ uniform = [from, to] } with rate_hz or probability, the interval"
        require(uniform, f"{where} time_s", f"{interval} with blasts", "another form")
        return
    gap = world.gap
    least = float(getattr(gap, "lo", 0.0) if isinstance(gap, Prior) else gap)
    # Sampling sorts uniform times within the interval less the gaps; for another
    # distribution that changes its shape.
    even = uniform or not isinstance(world.time, Prior)
    require(
        even or (least == 0 and not isinstance(gap, Prior)),
        f"{where} gap_s",
        "0 between times that are not uniform",
        "a gap",
    )
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
    require(
        (count - 1) * gap <= last - first and not at_once,
        f"{where} count",
        f"at most {most}, which fit between {first:g} and {last:g} s at gap_s {gap:g}",
        count,
    )
