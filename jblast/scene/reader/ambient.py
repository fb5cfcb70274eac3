"""The reader of a scene's ambient sound."""

from pathlib import Path
from typing import Any

from jblast.errors import InputError, shown
from jblast.scene.ambient import Ambient
from jblast.scene.reader.priors import fixed_number
from jblast.scene.reader.tables import name_of, table

STEEPEST = 12.0
"""Slope beyond which a spectrum is one frequency and no colour [dB/octave]."""


def read_ambient(document: dict[str, Any], source: str) -> Ambient | None:
    """Read the ambient sound of a scene file; None where it has none.

    A recording is named here, by its place beside the scene file, and read elsewhere.

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
            f"{where} full_scale_pa: expected a file, whose samples it scales, "
            "got level_pa"
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
    if abs(numbers.get("slope", 0.0)) > STEEPEST:
        raise InputError(
            f"{where} slope_db_octave: expected {-STEEPEST:g} to {STEEPEST:g}, "
            f"got {shown(entry['slope_db_octave'])}"
        )
    file = ""
    if "file" in entry:
        file = str(Path(source).parent / name_of(entry["file"], f"{where} file"))
    return Ambient(file=file, **numbers)
