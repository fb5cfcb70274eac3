"""Which files of a folder were baked: they may be overwritten, others are one's own."""

import json
import tomllib
from pathlib import Path
from typing import Any

from jblast.errors import InputError, read_text
from jblast.sensors.camera.bake.set_files import MAKER, view_file


def read_json(path: Path, expected: str) -> Any:
    """Return what a JSON file of ours holds.

    Raises:
        InputError: It is not there, or is no JSON.
    """
    try:
        return json.loads(read_text(path, expected))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: expected {expected} in JSON, got something else ({error})"
        ) from None


def baked_views(index: Path) -> set[str]:
    """Return the files of a finished set, by its index; none of one made otherwise."""
    try:
        found = tomllib.loads(index.read_text(encoding="utf-8"))
        if found["made"]["by"] != MAKER:
            return set()
        names = {str(view["file"]) for view in found["view"]}
    except (OSError, ValueError, KeyError, TypeError):  # no index, or none of ours
        return set()
    return names & {view_file(number) for number in range(len(names))}


def recipe_views(recipe: Any) -> set[str]:
    """Return the files of a set that is half made, by its recipe; None: nothing is."""
    if not isinstance(recipe, dict) or not isinstance(recipe.get("directions"), list):
        return set()
    return {view_file(number) for number in range(len(recipe["directions"]))}
