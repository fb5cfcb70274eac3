"""What `--views` names: the set that comes with jblast, or a folder."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.scene import Camera, Scene
    from jblast.sensors.camera.rendering.billboards import Views
    from jblast.sensors.camera.rendering.view_set import ViewSet

SHIPPED_SET = "explosion"


def views_named(word: str, scene: "Scene", camera: "Camera") -> "ViewSet":
    """Return the pictures that `--views` names.

    Of an explosion set a camera that stands still has only those views read that it is
    shown.

    Args:
        word: "explosion", which is the set that comes with jblast even where there is a
            folder of this name (that is ./explosion); else a folder.
        scene: Where the charges are.
        camera: Who looks.

    Raises:
        InputError: They cannot be read, or all were taken from below the burst and the
            camera looks on from above it; the message names the file.
    """
    from jblast.sensors.camera.files.explosion_set import (
        explosion_views,
        is_explosion_set,
    )
    from jblast.sensors.camera.files.views import read_views

    shipped = word == SHIPPED_SET
    if not shipped and not is_explosion_set(word):
        return _from_a_side_of_the_camera(read_views(word), word, scene, camera)
    folder = None if shipped else word
    if camera.mount:
        return explosion_views(folder)  # it goes where it is taken
    eye = np.asarray(camera.position, float)
    places = np.array([[float(x) for x in c.position_m] for c in scene.charges])
    return explosion_views(folder, towards=eye - places)


def _from_a_side_of_the_camera(
    views: "Views", word: str, scene: "Scene", camera: "Camera"
) -> "Views":
    """Return the pictures, if one shows what a camera above the burst would see."""
    from jblast.sensors.camera.files.view_index import INDEX

    if camera.mount or (views.direction[:, 2] >= 0.0).any():
        return views
    height = float(np.asarray(camera.position)[2])
    if any(height > float(charge.position_m[2]) for charge in scene.charges):
        raise InputError(
            f"{Path(word) / INDEX}: elevation_deg: expected views from above the "
            f"burst, where the camera is, got {len(views.direction)} from below alone"
        )
    return views


def folder_named(word: str | None) -> str | None:
    """Return the folder of one's own that `--views` names; None where it names none."""
    return None if word == SHIPPED_SET else word
