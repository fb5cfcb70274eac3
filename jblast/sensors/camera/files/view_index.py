"""What the indices of all sets of views have in common."""

import math
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, nearest, read_text, shown
from jblast.scene.reader.tables import finite, fixed_list
from jblast.sensors.camera.rendering.billboards import upright

INDEX = "views.toml"


def read_index(directory: Path) -> tuple[Path, dict[str, Any]]:
    """Return the path of a set's index and what stands in it.

    Raises:
        InputError: There is no such directory or index, or it is broken.
    """
    source = directory / INDEX
    if not source.is_file():
        what = "has no index" if directory.is_dir() else "no such directory"
        raise InputError(
            f"{directory}: {what}; expected a directory of views with {INDEX}"
        )
    try:
        index = tomllib.loads(read_text(source, "an index of views in TOML"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: broken TOML: {error}") from None
    return source, index


def view_entries(index: dict[str, Any], source: Path) -> list[Any]:
    """Return the views of an index, one at least."""
    entries = index.get("view")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{source}: expected views written [[view]], got none")
    return entries


def direction_of(
    entry: dict[str, Any], where: str
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return the unit vector from the blast to the viewer, and a level camera's up."""
    if ("azimuth_deg" in entry) == ("direction" in entry):
        both = "both" if "direction" in entry else "neither"
        raise InputError(
            f"{where}azimuth_deg: expected either azimuth_deg or direction, got {both}"
        )
    if "direction" in entry:
        at = f"{where}direction"
        vector = fixed_list(entry["direction"], at, "[east, north, up]")
        if "elevation_deg" in entry or not vector.any():
            got = "elevation_deg too" if vector.any() else shown(entry["direction"])
            raise InputError(
                f"{at}: expected [east, north, up] alone, not zero, got {got}"
            )
        direction = vector / np.linalg.norm(vector)
        return direction, upright(direction)
    azimuth = math.radians(finite(entry["azimuth_deg"], f"{where}azimuth_deg"))
    at = f"{where}elevation_deg"
    elevation = math.radians(finite(entry.get("elevation_deg", 0.0), at))
    if abs(elevation) > math.pi / 2:
        raise InputError(
            f"{at}: expected between -90 and 90, got {shown(entry['elevation_deg'])}"
        )
    towards = np.array([math.sin(azimuth), math.cos(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    flat, high = math.cos(elevation), math.sin(elevation)
    return flat * towards + high * up, flat * up - high * towards


def positive(value: Any, where: str) -> float:
    """Return a positive number of an index."""
    expected = "a positive number"
    number = finite(value, where, expected)
    if number <= 0:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return number


def known_keys(entry: dict[str, Any], known: Sequence[str], where: str) -> None:
    """Refuse keys that an index does not have."""
    for key in entry:
        if key not in known:
            raise InputError(
                f"{where}{shown(key)}: unknown key{nearest(key, known)}; "
                f"expected one of {', '.join(known)}"
            )
