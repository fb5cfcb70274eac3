"""Study file: scene, axes and requested outcomes.

A study file is TOML. It names a scene, the number of samples and the outcomes, and may
vary parameters of the scene along axes:

    [axes]
    charge_mass_kg = [1, 10, 100]
    charge_east_m = { from = 5, to = 50, count = 10 }
    air_temperature_k = { from = 260, to = 300 }
    "vehicle.model" = ["crazyflie", "hummingbird"]

Listed values are crossed with each other, and each combination has its own draws. A
range without a count is sampled, uniformly or uniformly in ln.
"""

import copy
import hashlib
import itertools
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, nearest, read_text, require, shown
from jblast.parameters import CLOCK_OFFSET, PARAMETERS, POSITIVE
from jblast.scene import UncertainScene
from jblast.scene.reader import scene_from_document
from jblast.scene.uncertain import Free, LogUniform, Prior, Uniform, parameter_named
from jblast.scene.values import (
    File,
    Number,
    Numbers,
    Table,
    Text,
    Value,
    Whole,
    Word,
    known,
)

MAX_SAMPLES_FOR_TARGETS = 100_000_000
"""Default number of samples of a study that ends at its target errors.

By declaration: an error falls with the square root, and 1e8 samples lower it to 1e-4 of
the scatter.
"""
MAX_VALUES = 100_000
"""Largest number of values of an axis, by declaration: a mistyped count is no study."""
Design = Literal["random", "sobol"]
DESIGNS: tuple[Design, ...] = ("random", "sobol")
"""Kinds of samples of the priors."""
Keep = Literal["all"] | int
KEEP = 1_000_000
"""Default number of stored samples: the rank of a quantile from them has a standard
error of 2e-4 at 5 % and 95 %."""
MAX_SAMPLES = 2**40
"""Largest number of samples, 1e12: a sample's number is a counter of its random key."""
KEYS: dict[str, Value] = {
    "scene": Numbers("the path of a scene, or a list of paths", File()),
    "seed": Whole(0, 2**63 - 1),
    "samples": Whole(1, MAX_SAMPLES),
    "sd_target": Table("a standard error by outcome, as { air_arrival_s = 1e-4 }"),
    "design": Word(DESIGNS),
    "keep": Whole(1, MAX_SAMPLES, word="all"),
    "outcomes": Numbers("a list of names in quotes", Text()),
    "axes": Table("a table"),
    "options": Table("a table"),
}
"""Keys of a study file, and the kinds of their values."""
RANGE: dict[str, Value] = {
    "count": Whole(2, MAX_VALUES),
    "scale": Word(("linear", "log")),
}
"""Keys of a range, besides from and to."""


@dataclass(frozen=True)
class Axis:
    """Listed values of one parameter, which are crossed with the random samples.

    Attributes:
        key: Name of a scene parameter, or key of the scene file as "vehicle.model".
        values: Values, in the order of the file.
    """

    key: str
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Study:
    """Monte Carlo study of a scene.

    Attributes:
        variants: The scene for each combination of `words`, with the priors of axes.
        believed: The same scenes with their own priors, for fits within the study.
        outcomes: Names of the requested outcomes.
        seed: Seed of all samples.
        samples: Number of draws: samples of each combination of the axes.
        sd_target: Target standard error by outcome; the study ends when all are
            reached.
        design: Kind of samples.
        keep: Number of stored samples, the first ones, or "all"; statistics are of all.
        numbers: Axes over scene parameters, crossed with each other.
        words: Axes over other keys of the scene file, crossed likewise.
        options: Options of outcomes.
        allow_code: Whether outcomes may be Python functions of the user.
        text: Content of the study file; "" for a study made in Python.
        scenes: Content of the scene files, by their names in the study file.
        source: Name of the study file, for messages.
        prepared: Cache of prepared variants, by their number.
    """

    variants: tuple[UncertainScene, ...]
    believed: tuple[UncertainScene, ...]
    outcomes: tuple[str, ...]
    seed: int = 0
    samples: int = 1000
    sd_target: Mapping[str, float] = field(default_factory=dict)
    design: Design = "random"
    keep: Keep = KEEP
    numbers: tuple[Axis, ...] = ()
    words: tuple[Axis, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    allow_code: bool = False
    text: str = ""
    scenes: Mapping[str, str] = field(default_factory=dict)
    source: str = "study"
    prepared: dict[int, Any] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def uncertain(self) -> UncertainScene:
        """The first variant of the scene."""
        return self.variants[0]

    @property
    def cells(self) -> tuple[tuple[float, ...], ...]:
        """Combinations of the values of `numbers`; a single empty one without axes."""
        return tuple(itertools.product(*(axis.values for axis in self.numbers)))

    @property
    def table(self) -> Float[np.ndarray, "cell axis"]:
        """The same as an array; a study without axes has one cell with no values."""
        return np.array(self.cells, float).reshape(len(self.cells), -1)

    @property
    def drawn(self) -> tuple[str, ...]:
        """Names of the sampled parameters, in the order of the random keys."""
        return tuple(self.uncertain.beliefs)


def read_study(path: str | os.PathLike[str], *, allow_code: bool = False) -> Study:
    """Read the file of a study.

    Args:
        path: TOML file; its `scene` is a path relative to the file.
        allow_code: Whether outcomes may be Python functions of the user, as
            `python:module.function`.

    Raises:
        InputError: A key of the study or of its scene is invalid; the message has the
            key, the expected and the found value.

    Example:
        `study = jblast.study.read_study("study.toml")`
    """
    text = read_text(path, "a study in TOML")
    source = str(path)
    document = _toml(text, source, "study")
    texts = {
        name: read_text(Path(path).parent / name, f"the scene of {source}, in TOML")
        for name in _value("scene", document, source)
    }
    study = study_from_document(document, texts, source, Path(path).parent)
    return replace(study, text=text, allow_code=allow_code)


def study_from_text(
    text: str, scenes: Mapping[str, str], *, allow_code: bool = False
) -> Study:
    """Return the study whose study and scene files are stored as texts."""
    study = study_from_document(tomllib.loads(text), scenes, "study", Path())
    return replace(study, text=text, allow_code=allow_code)


def _value(key: str, document: dict[str, Any], source: str) -> Any:
    """Return a checked value of a study file; None without one."""
    value = document.get(key)
    if key == "scene" and not isinstance(value, list):
        value = [value]
    required = key in ("scene", "outcomes")
    return (
        KEYS[key].read(value, f"{source}: {key}")
        if required or key in document
        else None
    )


def study_from_document(
    document: dict[str, Any], scenes: Mapping[str, str], source: str, folder: Path
) -> Study:
    """Build a study from a TOML document.

    Args:
        document: Tables of the study file.
        scenes: Contents of the scene files, by their names.
        source: Name of the study file, for messages.
        folder: Folder of the scene files, for messages.

    Raises:
        InputError: As in `read_study`.
    """
    for key in document:
        known(key, KEYS, f"{source}:", "key")
    given = {key: _value(key, document, source) for key in KEYS}
    given = {key: value for key, value in given.items() if value is not None}
    names, outcomes = given.pop("scene"), given["outcomes"]
    for name in outcomes:
        times = outcomes.count(name)
        once = f"{source}: outcomes", "each once", f"{name} {times} times"
        require(times == 1, *once)
    targets = {
        name: Number(POSITIVE).read(value, f"{source}: sd_target {name}")
        for name, value in given.get("sd_target", {}).items()
    }
    for name in targets:
        known(name, outcomes, f"{source}: sd_target", "outcome")
    sized = bool(targets) or "samples" in given
    require(sized, f"{source}: samples", "a number of samples, or sd_target", "neither")
    if "samples" not in given:
        given["samples"] = MAX_SAMPLES_FOR_TARGETS
    if "keep" in document:
        given["keep"] = given.get("keep", "all")
    found = [_toml(scenes[name], str(folder / name), "scene") for name in names]
    axes = given.pop("axes", {})
    numbers, words, drawn = read_axes(axes, found[0], source)
    variants, believed = [], []
    for name, scene in zip(names, found, strict=True):
        for values in itertools.product(*(axis.values for axis in words)):
            # `put` changes the tables in place
            one = copy.deepcopy(scene)
            for axis, value in zip(words, values, strict=True):
                put(one, axis.key, value, f"{source}: [axes] {axis.key}")
            uncertain = scene_from_document(one, str(folder / name))
            believed.append(uncertain)
            variants.append(_with_axes(uncertain, numbers, drawn, source))
    _check_same_priors(variants, source)
    if len(names) > 1:
        stems = tuple(Path(name).stem for name in names)
        # several scenes are an axis too, which varies slowest
        words = (Axis("scene", stems), *words)
    return Study(
        variants=tuple(variants),
        believed=tuple(believed),
        numbers=numbers,
        words=words,
        scenes=dict(scenes),
        source=source,
        **given | {"outcomes": tuple(outcomes), "sd_target": targets},
    )


def _toml(text: str, source: str, kind: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: expected a {kind} in TOML, got {error}") from None


def _check_same_priors(variants: list[UncertainScene], source: str) -> None:
    """Check that all scenes have priors of the same parameters, in one order."""
    first = tuple(variants[0].beliefs)
    words = "priors of the same parameters in each scene, in one order: "
    words += ", ".join(first) or "none"
    for one in variants[1:]:
        got = f"{', '.join(one.beliefs) or 'none'} in {one.source}"
        require(tuple(one.beliefs) == first, f"{source}: scene", words, got)


def _with_axes(
    uncertain: UncertainScene, numbers, drawn: Mapping[str, Prior], source: str
) -> UncertainScene:
    """Return the scene with the priors of axes, without priors of listed parameters.

    Raises:
        InputError: A parameter is free.
    """
    beliefs = dict(uncertain.beliefs)
    for axis in numbers:
        # a prior of a listed parameter would only take up random numbers
        beliefs.pop(axis.key, None)
    beliefs |= drawn
    for name, belief in beliefs.items():
        if isinstance(belief, Free):
            raise InputError(
                f"{uncertain.source or source}: {name} is free and cannot be drawn; "
                "give it a value or a prior in the scene, or values in [axes] of "
                f"{source}"
            )
    return replace(uncertain, beliefs=beliefs)


def sha256_of(text: str) -> str:
    """Return the SHA-256 of a text, in hexadecimal digits."""
    return hashlib.sha256(text.encode()).hexdigest()


def read_axes(
    table: dict[str, Any], scene: dict[str, Any], source: str
) -> tuple[tuple[Axis, ...], tuple[Axis, ...], dict[str, Prior]]:
    """Return the axes over parameters, over other scene keys, and the sampled axes.

    Args:
        table: Content of [axes].
        scene: Tables of the scene file.
        source: Name of the study file, for messages.

    Raises:
        InputError: A parameter or key does not exist, or its values are invalid.
    """
    numbers, words, drawn = [], [], {}
    for key, value in table.items():
        where = f"{source}: [axes] {key}"
        # "charge_mass_kg.NAME" is a parameter of one of several charges
        base = key.partition(".")[0]
        if base not in PARAMETERS and base != CLOCK_OFFSET:
            words.append(Axis(key, _words(key, value, scene, where)))
            continue
        number = Number(parameter_named(key).bounds)
        if not isinstance(value, dict):
            some = "a list of values, or a range { from = 1, to = 10, count = 5 }"
            numbers.append(Axis(key, tuple(Numbers(some, number).read(value, where))))
            continue
        low, high, count, scale = _range(number, value, where)
        log = scale == "log"
        if count is None:
            drawn[key] = LogUniform(low, high) if log else Uniform(low, high)
        else:
            # both end exactly at `to`, unlike sums of steps
            spread = (np.geomspace if log else np.linspace)(low, high, count)
            numbers.append(Axis(key, tuple(map(float, spread))))
    return tuple(numbers), tuple(words), drawn


def _range(
    number: Number, value: dict[str, Any], where: str
) -> tuple[float, float, int | None, str]:
    """Return the ends of a range, its count and its scale."""
    keys = {"from": number, "to": number, **RANGE}
    for name in value:
        known(name, keys, where, "key")
    given = {"from": None, "to": None, "scale": "linear"} | value
    read: dict[str, Any] = {
        name: keys[name].read(one, f"{where} {name}") for name, one in given.items()
    }
    low, high = read["from"], read["to"]
    require(low < high, where, "from < to", f"{low:g} and {high:g}")
    log = read["scale"] == "log"
    require(low > 0 or not log, f"{where} from", "above 0 on a log scale", f"{low:g}")
    return low, high, read.get("count"), read["scale"]


def _words(key: str, value: Any, scene: dict[str, Any], where: str) -> tuple[Any, ...]:
    """Return the values of an axis over a key of the scene file."""
    table, dot, _ = key.partition(".")
    expected = (
        f"a parameter of the scene, one of {', '.join(PARAMETERS)}, or a key of one of "
        'its tables, as "vehicle.model"'
    )
    advice = nearest(key, [*PARAMETERS, *scene])
    require(dot and table in scene, where, expected, f"an unknown axis{advice}")
    some = isinstance(value, list) and value
    require(some, where, "a list of values", shown(value))
    return tuple(value)


def put(document: dict[str, Any], key: str, value: Any, where: str) -> None:
    """Set a value in the tables of a scene file.

    Args:
        document: Tables, changed in place.
        key: Key such as "vehicle.model"; for a list of tables the second word is a
            name: "sensor.gate.position_m".
        value: New value.
        where: File and key, for messages.

    Raises:
        InputError: The table does not exist.
    """
    *tables, last = key.split(".")
    at: Any = document
    for step in tables:
        named = at
        if isinstance(at, list):
            named = {one["name"]: one for one in at if "name" in one}
        some = (
            name
            for name, one in named.items()
            # a list of tables, not of numbers
            for each in [one if isinstance(one, list) else [one]]
            if all(isinstance(part, dict) for part in each)
        )
        known(step, some, f"{where}:", "table of the scene")
        at = named[step]
    if isinstance(at, list):
        # a list of tables without a name: the value is set in all of them
        for one in at:
            one[last] = value
    else:
        at[last] = value
