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
from typing import Any, Literal, NamedTuple

import numpy as np

from jblast.errors import InputError, nearest, read_text, shown
from jblast.parameters import CLOCK_OFFSET, PARAMETERS
from jblast.scene import UncertainScene
from jblast.scene.reader import scene_from_document
from jblast.scene.uncertain import Free, LogUniform, Prior, Uniform, parameter_named
from jblast.scene.values import finite

KEYS = (
    *("scene", "seed", "samples", "sd_target", "design", "keep", "outcomes"),
    *("axes", "options"),
)
MAX_SAMPLES_FOR_TARGETS = 100_000_000
"""Default number of samples of a study that ends at its target errors.

By declaration: an error falls with the square root, and 1e8 samples lower it to 1e-4 of
the scatter.
"""
MAX_VALUES = 100_000
"""Largest number of values of an axis, by declaration: a mistyped count is no study."""
RANGE_KEYS = ("from", "to", "count", "scale")
SCALES = ("linear", "log")
Design = Literal["random", "sobol"]
DESIGNS: tuple[Design, ...] = ("random", "sobol")
"""Kinds of samples of the priors."""
Keep = Literal["all"] | int
KEEP = 1_000_000
"""Default number of stored samples: the rank of a quantile from them has a standard
error of 2e-4 at 5 % and 95 %."""
MAX_SAMPLES = 2**40
"""Largest number of samples, 1e12: a sample's number is a counter of its random key."""


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
        for name in _scene_names(document.get("scene"), source)
    }
    study = study_from_document(document, texts, source, Path(path).parent)
    return replace(study, text=text, allow_code=allow_code)


def study_from_text(
    text: str, scenes: Mapping[str, str], *, allow_code: bool = False
) -> Study:
    """Return the study whose study and scene files are stored as texts."""
    study = study_from_document(tomllib.loads(text), scenes, "study", Path())
    return replace(study, text=text, allow_code=allow_code)


def _scene_names(value: Any, source: str) -> tuple[str, ...]:
    """Return the paths of one or several scenes."""
    names = value if isinstance(value, list) else [value]
    if not names or not all(isinstance(name, str) and name for name in names):
        raise InputError(
            f"{source}: scene: expected the path of a scene, or a list of paths, got "
            f"{shown(value)}"
        )
    return tuple(names)


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
        if key not in KEYS:
            raise InputError(
                f"{source}: {key}: unknown key{nearest(key, KEYS)}; expected one of "
                f"{', '.join(KEYS)}"
            )
    names = _scene_names(document.get("scene"), source)
    found = [_toml(scenes[name], str(folder / name), "scene") for name in names]
    numbers, words, drawn = read_axes(document.get("axes", {}), found[0], source)
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
    samples, targets = size_of(document, source)
    return Study(
        variants=tuple(variants),
        believed=tuple(believed),
        outcomes=outcomes_of(document.get("outcomes"), source),
        seed=whole_of(document.get("seed", 0), f"{source}: seed", 0, 2**63 - 1),
        samples=samples,
        sd_target=targets,
        design=design_of(document.get("design", "random"), source),
        keep=keep_of(document.get("keep", KEEP), source),
        numbers=numbers,
        words=words,
        options=options_of(document.get("options", {}), source),
        scenes=dict(scenes),
        source=source,
    )


def _toml(text: str, source: str, kind: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: expected a {kind} in TOML, got {error}") from None


def _check_same_priors(variants: list[UncertainScene], source: str) -> None:
    """Check that all scenes have priors of the same parameters, in one order."""
    first = tuple(variants[0].beliefs)
    for one in variants[1:]:
        if tuple(one.beliefs) != first:
            raise InputError(
                f"{source}: scene: expected priors of the same parameters in each "
                f"scene, in one order: {', '.join(first) or 'none'}; got "
                f"{', '.join(one.beliefs) or 'none'} in {one.source}"
            )


class Drawn(NamedTuple):
    """Axis that is sampled.

    Attributes:
        key: Name of a scene parameter.
        prior: Prior that replaces the one of the scene.
    """

    key: str
    prior: Prior


def _with_axes(
    uncertain: UncertainScene, numbers, drawn: tuple[Drawn, ...], source: str
) -> UncertainScene:
    """Return the scene with the priors of axes, without priors of listed parameters.

    Raises:
        InputError: A parameter is free.
    """
    beliefs = dict(uncertain.beliefs)
    for axis in numbers:
        # a prior of a listed parameter would only take up random numbers
        beliefs.pop(axis.key, None)
    for one in drawn:
        beliefs[one.key] = one.prior
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


def size_of(document: dict[str, Any], source: str) -> tuple[int, dict[str, float]]:
    """Return the number of samples, and the target standard errors by outcome."""
    targets = document.get("sd_target", {})
    if not isinstance(targets, dict):
        raise InputError(
            f"{source}: sd_target: expected a standard error by outcome, as "
            f"{{ air_arrival_s = 1e-4 }}, got {shown(targets)}"
        )
    for name, value in targets.items():
        number = finite(value, f"{source}: sd_target {name}", "a positive number")
        if number <= 0:
            raise InputError(
                f"{source}: sd_target {name}: expected a positive number, got "
                f"{shown(value)}"
            )
    outcomes = document.get("outcomes")
    for name in targets:
        if isinstance(outcomes, list) and name not in outcomes:
            raise InputError(
                f"{source}: sd_target {name}: expected one of the outcomes, got "
                f"{name}{nearest(name, [str(one) for one in outcomes])}"
            )
    if "samples" not in document:
        if not targets:
            raise InputError(
                f"{source}: samples: expected a number of samples, or sd_target, got "
                "neither"
            )
        return MAX_SAMPLES_FOR_TARGETS, {
            name: float(value) for name, value in targets.items()
        }
    samples = whole_of(document["samples"], f"{source}: samples", 1, MAX_SAMPLES)
    return samples, {name: float(value) for name, value in targets.items()}


def whole_of(value: Any, where: str, least: int, most: int) -> int:
    """Return a whole number within limits."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)  # 1e6 is a float in TOML
    # a bool is an int in Python
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{where}: expected a whole number, got {shown(value)}")
    if not least <= value <= most:
        raise InputError(
            f"{where}: expected a whole number from {least} to {most:,}, got {value}"
        )
    return value


def design_of(value: Any, source: str) -> Design:
    """Return the kind of samples."""
    if value not in DESIGNS:
        raise InputError(
            f"{source}: design: expected one of {', '.join(DESIGNS)}, got "
            f"{shown(value)}{nearest(str(value), DESIGNS)}"
        )
    return value


def keep_of(value: Any, source: str) -> Keep:
    """Return which samples are stored."""
    if value == "all":
        return "all"
    return whole_of(value, f"{source}: keep", 1, MAX_SAMPLES)


def outcomes_of(value: Any, source: str) -> tuple[str, ...]:
    """Return the names of the outcomes; the registry checks that they exist."""
    if (
        not isinstance(value, list)
        or not value
        or not all(isinstance(name, str) and name for name in value)
    ):
        raise InputError(
            f"{source}: outcomes: expected a list of names, as "
            f'["air_arrival_s"], got {shown(value)}'
        )
    twice = [name for name in value if value.count(name) > 1]
    if twice:
        raise InputError(
            f"{source}: outcomes: expected each once, got {twice[0]} "
            f"{value.count(twice[0])} times"
        )
    return tuple(value)


def options_of(value: Any, source: str) -> dict[str, Any]:
    """Return the options of outcomes."""
    if not isinstance(value, dict):
        raise InputError(f"{source}: [options]: expected a table, got {shown(value)}")
    return dict(value)


def read_axes(
    table: Any, scene: dict[str, Any], source: str
) -> tuple[tuple[Axis, ...], tuple[Axis, ...], tuple[Drawn, ...]]:
    """Return the axes over parameters, over other scene keys, and the sampled axes.

    Args:
        table: Content of [axes].
        scene: Tables of the scene file.
        source: Name of the study file, for messages.

    Raises:
        InputError: A parameter or key does not exist, or its values are invalid.
    """
    if not isinstance(table, dict):
        raise InputError(f"{source}: [axes]: expected a table, got {shown(table)}")
    numbers, words, drawn = [], [], []
    for key, value in table.items():
        where = f"{source}: [axes] {key}"
        if not _is_number(key):
            words.append(Axis(key, _words(key, value, scene, where)))
        elif isinstance(value, dict) and "count" not in value:
            low, high, scale = _bounds_and_scale(key, value, where)
            prior = LogUniform(low, high) if scale == "log" else Uniform(low, high)
            drawn.append(Drawn(key, prior))
        elif isinstance(value, dict):
            numbers.append(Axis(key, _range(key, value, where)))
        else:
            numbers.append(Axis(key, _listed(key, value, where)))
    return tuple(numbers), tuple(words), tuple(drawn)


def _is_number(key: str) -> bool:
    # "charge_mass_kg.NAME" is a parameter of one of several charges
    base = key.partition(".")[0]
    return base in PARAMETERS or base == CLOCK_OFFSET


def _listed(key: str, value: Any, where: str) -> tuple[float, ...]:
    if not isinstance(value, list) or not value:
        raise InputError(
            f"{where}: expected a list of values, or a range such as "
            f"{{ from = 1, to = 10, count = 5 }}, got {shown(value)}"
        )
    return tuple(_allowed(key, one, where) for one in value)


def _allowed(key: str, value: Any, where: str) -> float:
    """Return a value within the bounds of a parameter."""
    bounds = parameter_named(key).bounds
    return bounds.checked(finite(value, where), where, got=value)


def _bounds_and_scale(
    key: str, value: dict[str, Any], where: str
) -> tuple[float, float, str]:
    for name in value:
        if name not in RANGE_KEYS:
            raise InputError(
                f"{where} {name}: unknown key{nearest(name, RANGE_KEYS)}; expected "
                f"one of {', '.join(RANGE_KEYS)}"
            )
    low, high = (
        _allowed(key, value.get(name), f"{where} {name}") for name in ("from", "to")
    )
    scale = value.get("scale", "linear")
    if scale not in SCALES:
        raise InputError(
            f"{where} scale: expected one of {', '.join(SCALES)}, got {shown(scale)}"
        )
    if not low < high:
        raise InputError(f"{where}: expected from < to, got {low:g} and {high:g}")
    if scale == "log" and not low > 0:
        raise InputError(f"{where} from: expected above 0 on a log scale, got {low:g}")
    return low, high, scale


def _range(key: str, value: dict[str, Any], where: str) -> tuple[float, ...]:
    low, high, scale = _bounds_and_scale(key, value, where)
    count = value["count"]
    if isinstance(count, bool) or not isinstance(count, int):
        raise InputError(f"{where} count: expected a whole number, got {shown(count)}")
    if not 2 <= count <= MAX_VALUES:
        raise InputError(
            f"{where} count: expected from 2 to {MAX_VALUES:,}, got {count}"
        )
    # both end exactly at `to`, unlike sums of steps
    spread = np.geomspace if scale == "log" else np.linspace
    return tuple(float(one) for one in spread(low, high, count))


def _words(key: str, value: Any, scene: dict[str, Any], where: str) -> tuple[Any, ...]:
    """Return the values of an axis over a key of the scene file."""
    table, dot, _ = key.partition(".")
    known = [*PARAMETERS, *scene]
    if not dot or table not in scene:
        raise InputError(
            f"{where}: unknown axis{nearest(key, known)}; expected a parameter of "
            f"the scene, one of {', '.join(PARAMETERS)}, or a key of one of its "
            'tables, as "vehicle.model"'
        )
    if not isinstance(value, list) or not value:
        raise InputError(f"{where}: expected a list of values, got {shown(value)}")
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
        if isinstance(at, list):
            named = [one for one in at if isinstance(one, dict)]
            found = next((one for one in named if one.get("name") == step), None)
        else:
            found = at.get(step)
        if not isinstance(found, dict | list):
            names = [str(one.get("name")) for one in at] if isinstance(at, list) else at
            raise InputError(
                f"{where}: the scene has no {step}{nearest(step, names)}; expected one "
                f"of {', '.join(names)}"
            )
        at = found
    if isinstance(at, list):
        # a list of tables without a name: the value is set in all of them
        for one in at:
            one[last] = value
    else:
        at[last] = value
