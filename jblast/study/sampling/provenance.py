"""What a store says of how it came about, and whether another run may go on with it."""

import json
import platform
import tomllib
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

import jblast
from jblast.errors import InputError, shown
from jblast.study.engine.store import SCHEMA, Store
from jblast.study.file.read import sha256_of
from jblast.study.file.study import Study
from jblast.study.sampling.work import Work


def attributes_of(work: Work) -> dict[str, Any]:
    """Return the attributes of a new store."""
    study = work.study
    return {
        "jblast_study_schema": SCHEMA,
        "study": study.text,
        "study_sha256": sha256_of(study.text),
        **_scenes(study),
        "seed": study.seed,
        "design": study.design,
        "keep": study.keep,
        "allow_code": study.allow_code,
        "samples": work.numbering.samples,
        "block": work.numbering.block,
        "cells": work.numbering.cells,
        "variants": work.numbering.variants,
        "complete": False,
        "jblast": jblast.__version__,
        "jax": jax.__version__,
        "numpy": np.__version__,
        "platform": platform.platform(),
        "device": work.mesh.devices.flat[0].device_kind,
        "notes": list(work.notes),
    }


def _scenes(study: Study) -> dict[str, Any]:
    """Return what is said of the scene; of several by the name of each."""
    texts = dict(study.scenes)
    scene = next(iter(texts.values()), "") if len(texts) < 2 else texts
    whole = scene if isinstance(scene, str) else json.dumps(scene)
    return {"scene": scene, "scene_sha256": sha256_of(whole)}


def scenes_of(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Return the scenes of a store by the names its study has for them."""
    scene = attributes["scene"]
    if isinstance(scene, Mapping):
        return dict(scene)
    return {tomllib.loads(attributes["study"])["scene"]: scene}


def refuse_other(store: Store, work: Work) -> None:
    """Refuse to go on with the store of another study.

    Raises:
        InputError: The study, its scene or the version of jblast is another; the
            message says what changed.
    """
    new, old = attributes_of(work), store.attributes
    if new["study_sha256"] != old["study_sha256"]:
        what = _changes(str(old["study"]), new["study"])
        raise InputError(
            f"{work.study.source}: has changed since {store.path} was begun{what}; "
            "what is computed stays there: change it back, or write to another store"
        )
    if new["scene_sha256"] != old["scene_sha256"]:
        what = _changes(str(old["scene"]), str(new["scene"]))
        raise InputError(
            f"{work.study.uncertain.source}: the scene has changed since {store.path} "
            f"was begun{what}; what is computed stays there: change it back, or write "
            "to another store"
        )
    for name in ("jblast", "block"):
        if new[name] != old[name]:
            raise InputError(
                f"{store.path}: was begun by {name} {old[name]}, this is {name} "
                f"{new[name]}: samples would not belong together; write to another "
                "store"
            )


def _changes(old: str, new: str) -> str:
    """Return which keys differ, in words."""
    try:
        before, after = _flat(tomllib.loads(old)), _flat(tomllib.loads(new))
    except tomllib.TOMLDecodeError:
        return ""
    said = [
        f"{key} was {shown(before.get(key, 'not there'), 40)}, is "
        f"{shown(after.get(key, 'not there'), 40)}"
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key)
    ]
    return f" ({'; '.join(said[:4])})" if said else " (in comments or spaces alone)"


def _flat(tables: Any, name: str = "") -> dict[str, Any]:
    """Return all values by their whole keys."""
    if isinstance(tables, dict):
        pairs = ((f"{name}.{k}" if name else k, v) for k, v in tables.items())
    elif isinstance(tables, list) and any(isinstance(one, dict) for one in tables):
        pairs = ((f"{name}[{n}]", v) for n, v in enumerate(tables))
    else:
        return {name: tables}
    found: dict[str, Any] = {}
    for key, value in pairs:
        found |= _flat(value, key)
    return found
