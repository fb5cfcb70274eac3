"""Images as files: PNG, WebP, depth images and folders of frames.

Linear light is written as sRGB of 8 bits. Frames of a folder are ordered by the numbers
in their names; unequal steps are an error. PNG with several channels of 16 bits is
decoded here, without interlacing, and all other PNG by Pillow.
"""

import io
import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from jblast.errors import InputError
from jblast.files import replacing
from jblast.scene import Camera, quaternion_matrix
from jblast.sensors.camera.geometry import pixel_rays
from jblast.sensors.camera.image import linear_to_srgb, luminance, srgb_to_linear, toned

NUMBER = re.compile(r"(\d+)")
ARRAYS = ".npy"
"""Suffix of frames of linear light as NumPy arrays: floats, full scale 1."""
COMPRESSION = 1
"""Level of zlib: a third of the time of the default 6, a tenth more bytes."""
CHANNELS = {2: 3, 4: 2, 6: 4}
"""Channels of PNG colour types with more than one: RGB, grey with alpha, RGBA."""
# Depth images have whole millimetres, as is usual for 16-bit PNG depth.
MILLIMETRE = 1e-3
EXPECTED = "a PNG of 16 bits, grey, in millimetres, or an .npy file in metres"


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
    if not directory.is_dir():
        what = "is no directory" if directory.exists() else "no such directory"
        raise InputError(f"{directory}: {what}; expected one with PNG frames")
    every = [*directory.iterdir()]
    names = [path for path in every if path.suffix.lower() == ".png"]
    if arrays and not names:
        names = [path for path in every if path.suffix.lower() == ARRAYS]
    # frame 10 after frame 9, with or without leading zeros
    files = sorted(names, key=lambda path: (_parts(path), path.name))
    if len(files) < 2:
        raise InputError(
            f"{directory}: expected at least two PNG frames, got {len(files)}"
        )
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
    changing = [
        i for i, column in enumerate(zip(*rows, strict=True)) if len({*column}) > 1
    ]
    if len(changing) != 1 or changing[0] % 2 == 0:
        return
    numbers = np.array([row[changing[0]][1] for row in rows])
    steps = np.diff(numbers)
    if steps.min() == 0:
        again = files[int(np.argmin(steps)) + 1]
        raise InputError(f"{again}: expected one frame per number, got two")
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
    """Yield the frames as blocks (frame, height, width) of linear light.

    8-bit grey is unchanged, for a table that decodes it; all else becomes floats with
    full scale 1, colours by their luminance.

    Args:
        files: PNG or `.npy` files of one size and bit depth.
        srgb: True if colours and 16-bit values are sRGB, false for linear light. Floats
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
                    f"{path}: expected grey of 8 bits in all frames or in none, got "
                    f"another kind than {files[0].name}"
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


def frame_and_bits(path: Path, *, srgb: bool = False) -> tuple[np.ndarray, int | None]:
    """Return one frame as `read_frames` does, and its bit depth; None for floats."""
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
    light = _loaded(path, expected)
    if not isinstance(light, np.ndarray) or light.dtype.kind != "f":
        kind = getattr(light, "dtype", "several arrays")
        raise InputError(f"{path}: expected {expected}, got {kind}")
    if light.ndim not in (2, 3) or (light.ndim == 3 and light.shape[2] != 3):
        raise InputError(f"{path}: expected {expected}, got shape {light.shape}")
    light = light.astype(float)
    return light if light.ndim == 2 else luminance(light)


def _loaded(path: Path, expected: str) -> Any:
    """Return the content of an .npy file, or of another file that NumPy reads.

    Raises:
        InputError: It cannot be read, or is not an array of numbers.
    """
    try:
        return np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or "it is not an array of numbers"
        raise InputError(f"{path}: expected {expected}, but {reason}") from None


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
        # opaque alpha is harmless and frequent; any transparency has no defined light
        if value[..., -1].min() < 1.0:
            raise InputError(
                f"{path}: expected an opaque frame, got a transparent one; composite "
                "it over its background first"
            )
        value = value[..., :-1]
    light = srgb_to_linear(value) if srgb else value
    return light[..., 0] if light.ndim == 3 and light.shape[2] == 1 else light


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
    alpha. Pillow drops the lower half of colours of 16 bits, so these are decoded here.

    Raises:
        InputError: It is not a PNG file, or incomplete.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        data = Path(path).read_bytes()
        is_png = data[:8] == b"\x89PNG\r\n\x1a\n" and data[12:16] == b"IHDR"
        # 16 bits in each of several channels
        if is_png and len(data) > 28 and data[24] == 16 and data[25] in CHANNELS:
            return _deep_channels(data)
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            # palettes and bits have no direct values
            if image.mode in ("1", "P", "PA"):
                image = image.convert("RGBA" if image.has_transparency_data else "RGB")
            pixels = np.asarray(image)
        if b"IEND" not in data:  # Pillow accepts some files that are cut short
            raise EOFError("cut short")
    except UnidentifiedImageError:
        raise InputError(f"{path}: expected a PNG image, got something else") from None
    except (OSError, SyntaxError, ValueError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: expected a complete PNG image, but it cannot be read ({reason})"
        ) from None
    return pixels


def _deep_channels(data: bytes) -> UInt16[np.ndarray, "height width channel"]:
    """Return the values of a PNG with 16 bits in each of several channels.

    References:
        W3C (2003), Portable Network Graphics specification, second edition: chunks in
        section 5, filters in section 9.
    """
    width, height, _, kind, _, _, interlaced = struct.unpack(">IIBBBBB", data[16:29])
    if interlaced:
        raise ValueError("colours of 16 bits are supported without interlacing only")
    packed, place, chunk = [], 8, b""
    while chunk != b"IEND":
        if place + 12 > len(data):
            raise EOFError("cut short")
        (size,), chunk = struct.unpack_from(">I", data, place), data[place + 4 :][:4]
        if chunk == b"IDAT":
            packed.append(data[place + 8 : place + 8 + size])
        place += 12 + size
    # two bytes per channel: the filters' distance to the left neighbour
    step = 2 * CHANNELS[kind]
    raw = np.frombuffer(zlib.decompress(b"".join(packed)), np.uint8)
    if raw.size != height * (1 + width * step):
        raise EOFError("cut short")
    lines = raw.reshape(height, 1 + width * step)
    bytes_ = _unfiltered(lines[:, 0], lines[:, 1:].reshape(height, width, step))
    return bytes_.view(">u2").astype(np.uint16)


def _unfiltered(
    filters: UInt8[np.ndarray, " height"], coded: UInt8[np.ndarray, "height width step"]
) -> UInt8[np.ndarray, "height width step"]:
    """Return the bytes of pixels from the filtered bytes of their rows.

    A pixel needs its neighbours to the left, above, and above to the left. Pixels of
    one antidiagonal do not depend on each other, so they are computed together.
    """
    if filters.max(initial=0) > 4:
        raise ValueError(f"unknown filter {filters.max()}")
    height, width, step = coded.shape
    out = np.zeros((height + 1, width + 1, step), np.int16)  # zeros left and above
    kinds = filters[:, None]
    for diagonal in range(height + width - 1):
        rows = np.arange(max(diagonal - width + 1, 0), min(diagonal, height - 1) + 1)
        columns = diagonal - rows
        left, above = out[rows + 1, columns], out[rows, columns + 1]
        corner, kind = out[rows, columns], kinds[rows]
        # Paeth's predictor, for filter 4
        guess = left + above - corner
        to_left, to_above, to_corner = (
            np.abs(guess - near) for near in (left, above, corner)
        )
        nearest = np.where(
            (to_left <= to_above) & (to_left <= to_corner),
            left,
            np.where(to_above <= to_corner, above, corner),
        )
        # the filters' numbers: none, left, above, mean, nearest (Paeth)
        predicted = np.select(
            [kind == number for number in range(5)],
            [np.zeros_like(left), left, above, (left + above) // 2, nearest],
        )
        out[rows + 1, columns + 1] = (coded[rows, columns] + predicted) & 255
    return out[1:, 1:].astype(np.uint8)


def check_whole_webp(path: Path) -> None:
    """Reject a file that is missing, cut short or no WebP image, by its first bytes.

    Raises:
        InputError: With the name of the file.
    """
    try:
        with path.open("rb") as file:
            head = file.read(12)
        size = path.stat().st_size
    except OSError as error:
        raise InputError(
            f"{path}: expected a WebP image, but it cannot be read ({error.strerror})"
        ) from None
    if len(head) < 12 or head[:4] != b"RIFF" or head[8:] != b"WEBP":
        raise InputError(f"{path}: expected a WebP image, got something else")
    expected = 8 + int.from_bytes(head[4:8], "little")
    if size < expected:
        raise InputError(
            f"{path}: expected a complete WebP image of {expected:,} bytes, got "
            f"{size:,}; it is cut short"
        )


def read_webp(path: Path) -> UInt8[np.ndarray, "height width 4"]:
    """Return red, green, blue and straight alpha.

    Raises:
        InputError: It cannot be read, or has no alpha.
    """
    from PIL import Image

    check_whole_webp(path)
    try:
        with Image.open(io.BytesIO(path.read_bytes()), formats=["WEBP"]) as image:
            mode, pixels = image.mode, np.asarray(image)
    except (OSError, SyntaxError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: expected a complete WebP image, but it cannot be read ({reason})"
        ) from None
    if mode != "RGBA":
        raise InputError(f"{path}: expected an image with alpha, got none")
    return pixels


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
    along = _array(path) if path.suffix.lower() == ARRAYS else _millimetres(path)
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
    # camera axis in the world: its component along a ray converts depth to distance
    axis = np.asarray(quaternion_matrix(camera.quaternion))[:, 2]
    ahead = np.tensordot(
        axis, np.asarray(pixel_rays(camera, ground=False).direction), 1
    )
    # pixels beyond the lens's fold have no direction: any finite divisor will do
    return along / np.where(ahead > 0.0, ahead, 1.0)


def _millimetres(path: Path) -> np.ndarray:
    values = read_png(path)
    # Pillow returns 16 bits as 32 in modes without a type of their own

    if values.ndim != 2 or values.dtype == np.uint8:
        bits = "8 bits" if values.dtype == np.uint8 else "colours"
        raise InputError(f"{path}: expected {EXPECTED}, got a PNG with {bits}")
    return np.where(values > 0, MILLIMETRE * values, np.inf)


def _array(path: Path) -> np.ndarray:
    values = _loaded(path, EXPECTED)
    if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
        kind = getattr(values, "dtype", "several arrays")
        raise InputError(f"{path}: expected floats, in metres, got {kind}")
    if values.ndim != 2:
        raise InputError(
            f"{path}: expected rows and columns, got an array of shape {values.shape}"
        )
    return values.astype(float)
