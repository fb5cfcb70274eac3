"""Depth images: how far away what stands in a picture is."""

import io
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.scene import Camera, quaternion_matrix
from jblast.sensors.camera.files.png import read_png
from jblast.sensors.camera.geometry.pixel_rays import pixel_rays

MILLIMETRE = 1e-3
EXPECTED = "a PNG of 16 bits, grey, in millimetres, or an .npy file in metres"


def read_depth(path: str | Path, camera: Camera) -> Float[np.ndarray, "height width"]:
    """Return how far away along each pixel's ray the background is [m].

    Files tell the distance along the camera's axis, as depth cameras do (ROS REP 118).
    A PNG's 0 means that nothing is known there, and is taken for infinitely far; so is
    an infinite number of an .npy file.

    Args:
        path: A grey PNG of 16 bits in millimetres, or an .npy file of floats in metres.
        camera: Whose image size it must have; its lens and pose give the rays.

    Raises:
        InputError: It is none of these, has another size, or a distance that is none.
    """
    path = Path(path)
    along = _array(path) if path.suffix.lower() == ".npy" else _millimetres(path)
    if along.shape != (camera.height, camera.width):
        rows, columns = along.shape
        raise InputError(
            f"{path}: expected {camera.width} x {camera.height} pixels as the camera "
            f"has, got {columns} x {rows}"
        )
    if not (along > 0.0).all():
        row, column = np.unravel_index(np.argmin(along > 0.0), along.shape)
        raise InputError(
            f"{path}: expected distances above 0 m, got {along[row, column]:g} at row "
            f"{row}, column {column}"
        )
    axis = np.asarray(quaternion_matrix(camera.quaternion))[:, 2]
    ahead = np.tensordot(
        axis, np.asarray(pixel_rays(camera, ground=False).direction), 1
    )
    return along / np.where(ahead > 0.0, ahead, 1.0)  # of a pixel without direction


def _millimetres(path: Path) -> np.ndarray:
    values = read_png(path)
    # Pillow gives 16 bits as 32 where it has no type of its own for them
    if values.ndim != 2 or values.dtype == np.uint8:
        bits = "8 bits" if values.dtype == np.uint8 else "colours"
        raise InputError(f"{path}: expected {EXPECTED}, got a PNG with {bits}")
    return np.where(values > 0, MILLIMETRE * values, np.inf)


def _array(path: Path) -> np.ndarray:
    try:
        values = np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or "it is no array of numbers"
        raise InputError(f"{path}: expected {EXPECTED}, but {reason}") from None
    if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
        kind = getattr(values, "dtype", "several arrays")
        raise InputError(f"{path}: expected floats, in metres, got {kind}")
    if values.ndim != 2:
        raise InputError(
            f"{path}: expected rows and columns, got an array of shape {values.shape}"
        )
    return values.astype(float)
