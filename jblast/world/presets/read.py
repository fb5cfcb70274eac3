"""The reader of a scene file by a preset."""

import os

from jblast.errors import InputError, nearest, shown
from jblast.scene import UncertainScene, WorldSpec, read_world
from jblast.scene.reader.scene import document_of, world_from_document
from jblast.world.presets.preset import Preset, with_preset
from jblast.world.presets.thesis import PRESETS


def preset_named(name: str | None) -> Preset | None:
    """Return a preset by its name; None by None.

    Raises:
        InputError: There is none of that name.
    """
    if name is None:
        return None
    if name not in PRESETS:
        raise InputError(
            f"preset: expected one of {', '.join(PRESETS)}, got {shown(name)}"
            f"{nearest(name, PRESETS)}"
        )
    return PRESETS[name]


def read_world_by(
    path: str | os.PathLike[str], preset: Preset | None
) -> tuple[UncertainScene, WorldSpec]:
    """Read a scene file of random blasts, a preset taken in.

    Args:
        path: A TOML file; by a preset it may leave out [world].
        preset: By which blasts act; None: as the scene says.

    Raises:
        InputError: As in `read_world` and `with_preset`.

    Example:
        `read_world_by("world.toml", PRESETS["thesis-as-coded"])`
    """
    if preset is None:
        return read_world(path)
    return world_from_document(
        with_preset(document_of(path), preset, str(path)), str(path)
    )
