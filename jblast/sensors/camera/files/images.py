"""Images as files: PNG, WebP, depth images and folders of frames.

Linear light is written as sRGB of 8 bits. Frames of a folder are ordered by the numbers
in their names; unequal steps are an error. Pillow reads PNG, except for colours of 16
bits, of which it drops the lower half: these are read by PyAV.
"""

import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from jblast.errors import needed, read_bytes, reading, require
from jblast.files import replacing
from jblast.scene import Camera, quaternion_matrix
from jblast.sensors.camera.geometry import pixel_rays
from jblast.sensors.camera.image import linear_to_srgb, luminance, srgb_to_linear, toned

NUMBER = re.compile(r"(\d+)")
ARRAYS = ".npy"
"""Suffix of frames of linear light as NumPy arrays: floats, full scale 1."""
COMPRESSION = 1
"""Level of zlib: a third of the time of the default 6, a tenth more bytes."""
CHANNELS = {2: [0, 1, 2], 4: [0, 3], 6: [0, 1, 2, 3]}
"""Channels of PNG colour types with more than one, as of red, green, blue and alpha."""
MILLIMETRE = 1e-3
"""Unit of 16-bit PNG depth, as is usual [m]."""


def frame_files(directory: str | Path, *, arrays: bool = False) -> list[Path]:
    """Return the PNG files of a directory, ordered by the numbers in their names.

    Args:
        directory: The directory.
        arrays: True to accept `.npy` files if there are no PNG files.

    Raises:
        InputError: There is no such directory, it has fewer than two frames, or the
            numbers of its frames have a gap.
    """
    directory = Path(directory)
    what = "a file" if directory.exists() else "no such directory"
    require(directory.is_dir(), directory, "a directory with PNG frames", what)
    found: list[Path] = []
    for suffix in (".png", ARRAYS)[: 1 + arrays]:
        found = found or [p for p in directory.iterdir() if p.suffix.lower() == suffix]
    # frame 10 after frame 9, with or without leading zeros
    files = sorted(found, key=lambda path: (_parts(path), path.name))
    require(len(files) > 1, directory, "at least two PNG frames", f"{len(files)}")
    _check_gaps(files)
    return files


def _parts(path: Path) -> list[tuple[str, int]]:
    """Return text and numbers of a name, alternating."""
    words = NUMBER.split(path.stem)
    return [(w, -1) if i % 2 == 0 else ("", int(w)) for i, w in enumerate(words)]


def _check_gaps(files: list[Path]) -> None:
    """Reject frames whose names differ in a single number with unequal steps."""
    rows = [_parts(path) for path in files]
    # names of different patterns: gaps cannot be recognised
    if len({len(row) for row in rows}) > 1:
        return
    changing = [column for column in zip(*rows, strict=True) if len({*column}) > 1]
    if len(changing) != 1 or changing[0][0][0]:
        return
    numbers = np.array([number for _, number in changing[0]])
    steps = np.diff(numbers)
    again = files[int(np.argmin(steps)) + 1]
    require(steps.min() > 0, again, "one frame per number", "two")
    at = int(np.argmax(steps))
    expected = f"frame {numbers[at] + steps.min()} after {files[at].name}"
    is_even = steps.max() == steps.min()
    require(is_even, files[at].parent, expected, files[at + 1].name)


def frame_and_bits(path: Path, *, srgb: bool = False) -> tuple[np.ndarray, int | None]:
    """Return one frame as grey linear light, full scale 1, and its bit depth.

    Grey of 8 bits is unchanged, for a table that decodes it.

    Args:
        path: A PNG or `.npy` file.
        srgb: True if colours and 16-bit values are sRGB, false for linear light. Floats
            are linear light.

    Raises:
        InputError: It cannot be read, or is transparent.
    """
    if path.suffix.lower() == ARRAYS:
        light, bits = _floats(path), None
        is_image = light.ndim == 2 or light.shape[2:] == (3,)
        expected = "floats of shape (height, width) or (height, width, 3)"
        require(is_image, path, expected, f"shape {light.shape}")
    else:
        light = read_png(path)
        bits = 8 if light.dtype == np.uint8 else 16
        if light.ndim > 2 or bits > 8:
            light = _light(path, light, srgb)
    return light if light.ndim == 2 else luminance(light), bits


def _floats(path: Path) -> np.ndarray:
    """Return the array of a file of floats."""
    expected = "an array of floats"
    data = io.BytesIO(read_bytes(path, expected))
    with reading(path, expected):
        values = np.lib.format.read_array(data, allow_pickle=False)
    require(values.dtype.kind == "f", path, expected, f"{values.dtype}")
    return values.astype(float)


def read_colours(
    path: Path, *, srgb: bool = True
) -> Float[np.ndarray, "height width 3"]:
    """Return the linear light of an opaque PNG, full scale 1; grey in all channels.

    Args:
        path: The file.
        srgb: True if its values are sRGB, false for linear light.

    Raises:
        InputError: It cannot be read, or is transparent.
    """
    light = _light(path, read_png(path), srgb)
    return np.stack([light] * 3, axis=-1) if light.ndim == 2 else light


def read_pictures(files: Sequence[Path]) -> UInt8[np.ndarray, "frame height width 4"]:
    """Return frames with alpha, of one size, in 8 bits.

    Raises:
        InputError: A frame has no alpha or another size; the message names the file.
    """
    pictures: list[np.ndarray] = []
    for path in files:
        picture = read_png(path)
        # the upper byte of 16 bits: an 8-bit display needs no more
        if picture.dtype != np.uint8:
            picture = (picture >> 8).astype(np.uint8)
        if picture.shape[2:] == (2,):  # grey and alpha
            picture = picture[..., [0, 0, 0, 1]]
        is_rgba = picture.shape[2:] == (4,)
        require(is_rgba, path, "a frame with alpha (RGBA)", "one without")
        pictures.append(picture)
        check_size(path, picture.shape[1::-1], pictures[0].shape[1::-1])
    return np.stack(pictures)


def check_size(
    path: Path, size: tuple[int, ...], expected: Camera | tuple[int, ...]
) -> None:
    """Reject an image of another width and height than a camera's or the first."""
    if isinstance(expected, Camera):
        width, height, whose = expected.width, expected.height, "as the camera has"
    else:
        (width, height), whose = expected, "as in the first frame"
    got = f"{size[0]} x {size[1]}"
    require(size == (width, height), path, f"{width} x {height} pixels {whose}", got)


def _light(path: Path, pixels: np.ndarray, srgb: bool) -> np.ndarray:
    """Return linear light without alpha: (height, width) or with three channels."""
    value = pixels / (255.0 if pixels.dtype == np.uint8 else 65535.0)
    if value.shape[2:] in ((2,), (4,)):
        # opaque alpha is harmless and frequent; any transparency has no defined light
        expected = "an opaque frame; composite it over its background first"
        require(value[..., -1].min() == 1.0, path, expected, "a transparent one")
        value = value[..., :-1]
    light = srgb_to_linear(value) if srgb else value
    return light[..., 0] if light.shape[2:] == (1,) else light


def write_png(
    path: str | Path, image: Float[np.ndarray, "height width channel"]
) -> None:
    """Write an image as sRGB of 8 bits, rounded to the nearest.

    Light above 1 keeps its hue and tends to white (`image.toned`). Files are not
    flushed to disk: frames are many, and can be made again.

    Args:
        path: An existing file is replaced.
        image: Linear light, full scale 1: grey, red-green-blue, or with straight alpha.
    """
    write_values(path, srgb_bytes(image))


def write_values(
    path: str | Path, values: UInt8[np.ndarray, "height width channel"]
) -> None:
    """Write 8-bit values unchanged; otherwise as `write_png`."""
    # Pillow is installed with Matplotlib
    from PIL import Image

    pixels = Image.fromarray(values[..., 0] if values.shape[2] == 1 else values)
    with replacing(path, durable=False) as temporary:
        pixels.save(temporary, format="PNG", compress_level=COMPRESSION)


def srgb_bytes(image: Float[np.ndarray, "height width channel"]) -> np.ndarray:
    """Return linear light as sRGB of 8 bits; the fourth channel is alpha."""
    # single precision, far finer than 8 bits, is several times faster
    image = image.astype(np.float32)
    if image.shape[-1] != 4:
        return np.rint(255.0 * linear_to_srgb(toned(image))).astype(np.uint8)
    alpha = np.clip(image[..., 3:], 0.0, 1.0)
    shown = linear_to_srgb(toned(image[..., :3]))
    return np.rint(255.0 * np.concatenate([shown, alpha], axis=-1)).astype(np.uint8)


def read_png(path: str | Path) -> np.ndarray:
    """Return the values of a PNG file, 8 or 16 bits.

    A palette is resolved. There are one to four channels, the last of two or four being
    alpha.

    Raises:
        InputError: It is not a PNG file, or incomplete.
    """
    from PIL import Image

    expected = "a complete PNG image"
    data = read_bytes(path, expected)
    require(data.startswith(b"\x89PNG\r\n\x1a\n"), path, expected, "something else")
    with (
        reading(path, expected),
        Image.open(io.BytesIO(data), formats=["PNG"]) as image,
    ):
        # Pillow accepts some files that are cut short
        require(b"IEND" in data, path, expected, "one that is cut short")
        if data[24] == 16 and data[25] in CHANNELS:
            return _deep_colours(path, data)
        # palettes and bits have no direct values
        if image.mode in ("1", "P", "PA"):
            image = image.convert("RGBA" if image.has_transparency_data else "RGB")
        return np.asarray(image)


def _deep_colours(
    path: str | Path, data: bytes
) -> UInt16[np.ndarray, "height width channel"]:
    """Return the values of a PNG with 16 bits in each of several channels."""
    av = needed("av", "video", path, "PNG with colours of 16 bits is read")
    with av.open(io.BytesIO(data), format="png_pipe") as file:
        frame = next(file.decode(video=0)).reformat(format="rgba64be")
    return frame.to_ndarray()[..., CHANNELS[data[25]]]


def check_whole_webp(path: Path) -> None:
    """Reject a file that is missing, cut short or no WebP image, by its first bytes.

    Raises:
        InputError: With the name of the file.
    """
    expected = "a complete WebP image"
    head = read_bytes(path, expected, 12)
    is_webp = head[:4] == b"RIFF" and head[8:] == b"WEBP"
    require(is_webp, path, expected, "something else")
    size, whole = path.stat().st_size, 8 + int.from_bytes(head[4:8], "little")
    require(size >= whole, path, expected, f"{size:,} of {whole:,} bytes")


def read_webp(path: Path) -> UInt8[np.ndarray, "height width 4"]:
    """Return red, green, blue and straight alpha.

    Raises:
        InputError: It cannot be read, or has no alpha.
    """
    from PIL import Image

    check_whole_webp(path)
    with reading(path, "a complete WebP image"), Image.open(path) as image:
        require(image.mode == "RGBA", path, "an image with alpha", f"{image.mode}")
        return np.asarray(image)


def read_depth(path: str | Path, camera: Camera) -> Float[np.ndarray, "height width"]:
    """Return the distance of the background along each pixel's ray [m].

    Files contain the distance along the camera's axis, as depth cameras do (ROS REP
    118). A PNG's 0 means unknown, and becomes infinite; an .npy file may contain
    infinite distances.

    Args:
        path: A grey PNG of 16 bits in millimetres, or an .npy file of floats in metres.
        camera: Camera, whose image size it must have; its lens and pose give the rays.

    Raises:
        InputError: It is none of these, has another size, or a distance of 0 or less.
    """
    path = Path(path)
    if path.suffix.lower() == ARRAYS:
        along, is_depth = _floats(path), True
    else:
        along = read_png(path)
        is_depth = along.dtype != np.uint8
        along = np.where(along > 0, MILLIMETRE * along, np.inf)
    expected = "a grey PNG of 16 bits, in millimetres, or an .npy file in metres"
    got = f"an array of shape {along.shape}" if is_depth else "8 bits"
    require(is_depth and along.ndim == 2, path, expected, got)
    check_size(path, along.shape[::-1], camera)
    for row, column in np.argwhere(~(along > 0.0))[:1]:
        got = f"{along[row, column]:g} at row {row}, column {column}"
        require(False, path, "distances above 0 m", got)
    # camera axis in the world: its component along a ray converts depth to distance
    axis = np.asarray(quaternion_matrix(camera.quaternion))[:, 2]
    ahead = np.tensordot(
        axis, np.asarray(pixel_rays(camera, ground=False).direction), 1
    )
    # pixels beyond the lens's fold have no direction: any finite divisor will do
    return along / np.where(ahead > 0.0, ahead, 1.0)
