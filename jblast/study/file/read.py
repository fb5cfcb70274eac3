"""The reader of study files: TOML to a study."""

import copy
import hashlib
import itertools
import os
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from jblast.errors import InputError, nearest, read_text, shown
from jblast.scene import UncertainScene
from jblast.scene.reader.scene import scene_from_document
from jblast.scene.uncertain import Free
from jblast.study.file.axes import Drawn, put, read_axes
from jblast.study.file.fields import (
    design_of,
    keep_of,
    options_of,
    outcomes_of,
    size_of,
    whole_of,
)
from jblast.study.file.study import Axis, Study

KEYS = (
    *("scene", "seed", "samples", "sd_target", "design", "keep", "outcomes"),
    *("axes", "options"),
)


def read_study(path: str | os.PathLike[str], *, allow_code: bool = False) -> Study:
    """Read the file of a study.

    Args:
        path: A TOML file; its `scene` is a path from where it lies.
        allow_code: Whether outcomes may be functions of the user's own, as
            `python:module.function`.

    Raises:
        InputError: The file is no study, or its scene no scene; the message names the
            key, what was expected there and what came.

    Example:
        `study = jblast.study.read_study("study.toml")`
    """
    text = read_text(path, "a study in TOML")
    source = str(path)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: expected a study in TOML, got {error}") from None
    texts = {
        name: read_text(Path(path).parent / name, f"the scene of {source}, in TOML")
        for name in _scene_names(document.get("scene"), source)
    }
    study = study_from_document(document, texts, source, Path(path).parent)
    return replace(study, text=text, allow_code=allow_code)


def study_from_text(
    text: str, scenes: Mapping[str, str], *, allow_code: bool = False
) -> Study:
    """Return the study that texts say, as a store holds them: scenes by their names."""
    study = study_from_document(tomllib.loads(text), scenes, "study", Path())
    return replace(study, text=text, allow_code=allow_code)


def _scene_names(value: Any, source: str) -> tuple[str, ...]:
    """Return the paths of the scenes, one or several."""
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
    """Build a study from what TOML says.

    Args:
        document: The tables of the file.
        scenes: What the files of scenes say, by their names.
        source: The file's name, for the messages.
        folder: Where the scenes lie, for the messages.

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
    found = [_tables(scenes[name], str(folder / name)) for name in names]
    numbers, words, drawn = read_axes(document.get("axes", {}), found[0], source)
    variants, believed = [], []
    for name, scene in zip(names, found, strict=True):
        for values in itertools.product(*(axis.values for axis in words)):
            one = copy.deepcopy(scene)
            for axis, value in zip(words, values, strict=True):
                put(one, axis.key, value, f"{source}: [axes] {axis.key}")
            uncertain = scene_from_document(one, str(folder / name))
            believed.append(uncertain)
            variants.append(_settled(uncertain, numbers, drawn, source))
    _refuse_other_numbers(variants, source)
    if len(names) > 1:
        stems = tuple(Path(name).stem for name in names)
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
        keep=keep_of(document.get("keep", "all"), source),
        numbers=numbers,
        words=words,
        options=options_of(document.get("options", {}), source),
        scenes=dict(scenes),
        source=source,
    )


def _tables(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: expected a scene in TOML, got {error}") from None


def _refuse_other_numbers(variants: list[UncertainScene], source: str) -> None:
    """Refuse scenes of which other numbers are drawn."""
    first = tuple(variants[0].beliefs)
    for one in variants[1:]:
        if tuple(one.beliefs) != first:
            raise InputError(
                f"{source}: scene: expected the same numbers with a prior in each, in "
                f"one order, {', '.join(first) or 'none'}; got "
                f"{', '.join(one.beliefs) or 'none'} in {one.source}"
            )


def _settled(
    uncertain: UncertainScene, numbers, drawn: tuple[Drawn, ...], source: str
) -> UncertainScene:
    """Return the scene with what the axes draw, and without what they set.

    Raises:
        InputError: A number is free.
    """
    beliefs = dict(uncertain.beliefs)
    for axis in numbers:
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
