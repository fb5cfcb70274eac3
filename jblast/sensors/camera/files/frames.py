"""A directory of frames in order of their names, PNG or arrays, block by block."""

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import InputError
from jblast.sensors.camera.files.png import read_png
from jblast.sensors.camera.image.compositing import srgb_to_linear
from jblast.sensors.camera.image.grey_composite import luminance

NUMBER = re.compile(r"(\d+)")

ARRAYS = ".npy"
"""Suffix of frames of linear light as NumPy writes them: floats, full scale 1."""


def frame_files(directory: str | Path, *, arrays: bool = False) -> list[Path]:
    """Return the PNG files of a directory in order; numbers in names count as numbers.

    Args:
        directory: Where they are.
        arrays: Whether `.npy` files are taken where there are no PNG files.

    Raises:
        InputError: There is no such directory, it holds fewer than two frames, or the
            numbers of its frames have a gap.
    """
    directory = Path(directory)
    if not directory.is_dir():
        what = "is no directory" if directory.exists() else "no such directory"
        raise InputError(f"{directory}: {what}; expected one with PNG frames")
    every = [*directory.iterdir()]
    names = [path for path in every if path.suffix.lower() == ".png"]
    if arrays and not names:
        names = [path for path in every if path.suffix.lower() == ARRAYS]
    files = sorted(names, key=lambda path: (_parts(path), path.name))
    if len(files) < 2:
        raise InputError(
            f"{directory}: expected at least two PNG frames, got {len(files)}"
        )
    _check_gaps(files)
    return files


def _parts(path: Path) -> list[tuple[str, int]]:
    """Cut a name into text and numbers."""
    words = NUMBER.split(path.stem)
    return [(w, -1) if i % 2 == 0 else ("", int(w)) for i, w in enumerate(words)]


def _check_gaps(files: list[Path]) -> None:
    """Refuse frames whose names differ in one number alone, and not by equal steps."""
    rows = [_parts(path) for path in files]
    if len({len(row) for row in rows}) > 1:
        return
    changing = [
        i for i, column in enumerate(zip(*rows, strict=True)) if len({*column}) > 1
    ]
    if len(changing) != 1 or changing[0] % 2 == 0:
        return
    numbers = np.array([row[changing[0]][1] for row in rows])
    steps = np.diff(numbers)
    if steps.min() == 0:
        again = files[int(np.argmin(steps)) + 1]
        raise InputError(f"{again}: expected one frame of each number, got two")
    if steps.max() != steps.min():
        at = int(np.argmax(steps))
        missing = int(numbers[at] + steps.min())
        raise InputError(
            f"{files[at].parent}: frame {missing} is missing between "
            f"{files[at].name} and {files[at + 1].name}"
        )


def read_frames(
    files: list[Path], *, srgb: bool = False, block: int = 16
) -> Iterator[np.ndarray]:
    """Return the frames as blocks (frame, height, width) of linear light.

    8-bit grey stays as it is, for a table of its own to decode; all else becomes
    floats with full scale 1, colours by their luminance.

    Args:
        files: PNG or `.npy` files of one size and bit depth.
        srgb: Whether colours and 16-bit values are sRGB, and not linear light. Floats
            are linear light.
        block: Frames of a block.

    Raises:
        InputError: A file cannot be read, has another size or kind than the first, or
            is transparent.
    """
    first: np.ndarray | None = None
    bits: int | None = None
    for start in range(0, len(files), block):
        frames = []
        for path in files[start : start + block]:
            frame, depth = frame_and_bits(path, srgb=srgb)
            if first is None:
                first, bits = frame, depth
            if frame.shape != first.shape:
                raise InputError(
                    f"{path}: expected {_size(first)} pixels as in {files[0].name}, "
                    f"got {_size(frame)}"
                )
            if frame.dtype != first.dtype:
                raise InputError(
                    f"{path}: expected grey of 8 bits in all frames or in none; "
                    f"{files[0].name} is of another kind"
                )
            if depth != bits:
                raise InputError(
                    f"{path}: expected {_depth(bits)} as in {files[0].name}, got "
                    f"{_depth(depth)}"
                )
            frames.append(frame)
        yield np.stack(frames)


def _size(frame: np.ndarray) -> str:
    return f"{frame.shape[1]} x {frame.shape[0]}"


def _depth(bits: int | None) -> str:
    return "floats" if bits is None else f"{bits} bits"


def read_frame(path: Path, *, srgb: bool = False) -> np.ndarray:
    """Return one frame as `read_frames` does."""
    return frame_and_bits(path, srgb=srgb)[0]


def frame_and_bits(path: Path, *, srgb: bool = False) -> tuple[np.ndarray, int | None]:
    """Return one frame as `read_frames` does, and its bit depth; None of floats."""
    if path.suffix.lower() == ARRAYS:
        return _read_array(path), None
    pixels = read_png(path)
    bits = 8 if pixels.dtype == np.uint8 else 16
    if pixels.ndim == 2 and bits == 8:
        return pixels, bits
    light = _light(path, pixels, srgb)
    return light if light.ndim == 2 else luminance(light), bits


def _read_array(path: Path) -> Float[np.ndarray, "height width"]:
    """Return the grey light of a file of floats; colours by their luminance."""
    expected = "floats of shape (height, width) or (height, width, 3)"
    try:
        light = np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or "it is no array of numbers"
        raise InputError(f"{path}: expected {expected}, but {reason}") from None
    if not isinstance(light, np.ndarray) or light.dtype.kind != "f":
        kind = getattr(light, "dtype", "several arrays")
        raise InputError(f"{path}: expected {expected}, got {kind}")
    if light.ndim not in (2, 3) or (light.ndim == 3 and light.shape[2] != 3):
        raise InputError(f"{path}: expected {expected}, got shape {light.shape}")
    light = light.astype(float)
    return light if light.ndim == 2 else luminance(light)


def read_colours(
    path: Path, *, srgb: bool = True
) -> Float[np.ndarray, "height width 3"]:
    """Return the linear light of an opaque PNG, full scale 1; grey in all channels.

    Args:
        path: The file.
        srgb: Whether its values are sRGB, or linear light.

    Raises:
        InputError: It cannot be read, or is transparent.
    """
    light = _light(path, read_png(path), srgb)
    return np.stack([light] * 3, axis=-1) if light.ndim == 2 else light


def read_pictures(files: Sequence[Path]) -> UInt8[np.ndarray, "frame height width 4"]:
    """Read frames with alpha, of one size and 8 bits.

    Raises:
        InputError: One is not so; the message names the file.
    """
    pictures: list[np.ndarray] = []
    for path in files:
        picture = read_png(path)
        if picture.dtype != np.uint8:
            picture = (picture >> 8).astype(np.uint8)
        if picture.ndim == 3 and picture.shape[2] == 2:  # grey and alpha
            picture = picture[..., [0, 0, 0, 1]]
        if picture.ndim != 3 or picture.shape[2] != 4:
            raise InputError(
                f"{path}: expected a frame with alpha (RGBA), got one without"
            )
        if pictures and picture.shape != pictures[0].shape:
            (height, width), (rows, columns) = pictures[0].shape[:2], picture.shape[:2]
            raise InputError(
                f"{path}: expected {width} x {height} pixels as in {files[0].name}, "
                f"got {columns} x {rows}"
            )
        pictures.append(picture)
    return np.stack(pictures)


def _light(path: Path, pixels: np.ndarray, srgb: bool) -> np.ndarray:
    """Return linear light without alpha: (height, width) or with three channels."""
    value = pixels / (255.0 if pixels.dtype == np.uint8 else 65535.0)
    if value.ndim == 3 and value.shape[2] in (2, 4):
        if value[..., -1].min() < 1.0:
            raise InputError(
                f"{path}: expected an opaque frame, got a transparent one; lay it over "
                "its background first"
            )
        value = value[..., :-1]
    light = srgb_to_linear(value) if srgb else value
    return light[..., 0] if light.ndim == 3 and light.shape[2] == 1 else light
