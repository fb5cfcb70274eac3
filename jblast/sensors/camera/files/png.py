"""PNG files: linear light written as sRGB of 8 bits, and values read as they stand."""

import struct
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from jblast.errors import InputError
from jblast.files import replacing
from jblast.sensors.camera.image.compositing import linear_to_srgb
from jblast.sensors.camera.image.tone import toned

COMPRESSION = 1
"""Of zlib: a third of the time of the usual 6, a tenth more bytes."""


def write_png(
    path: str | Path, image: Float[np.ndarray, "height width channel"]
) -> None:
    """Write an image as sRGB of 8 bits, rounded to the nearest.

    Light above 1 keeps its hue and tends to white (`image.tone`). Frames do not wait
    for the disk: they come by the hundred, and can be made again.

    Args:
        path: An existing file is replaced.
        image: Linear light, full scale 1: grey, red-green-blue, or with straight alpha.
    """
    write_values(path, srgb_bytes(image))


def write_values(
    path: str | Path, values: UInt8[np.ndarray, "height width channel"]
) -> None:
    """Write values as they are; as `write_png` otherwise."""
    # Pillow comes with Matplotlib
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
    """Return the values of a PNG file as they stand: of 8 or of 16 bits.

    A palette is looked up; there are one to four channels, the last of two or four
    being alpha. Pillow drops the lower half of colours of 16 bits, so these are
    decoded here.

    Raises:
        InputError: It is no PNG file, or not a whole one.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        data = Path(path).read_bytes()
        if _has_deep_channels(data):
            return _deep_channels(data)
        with Image.open(BytesIO(data), formats=["PNG"]) as image:
            if image.mode in ("1", "P", "PA"):
                image = image.convert("RGBA" if image.has_transparency_data else "RGB")
            pixels = np.asarray(image)
        if b"IEND" not in data:  # some cuts the decoder lets pass
            raise EOFError("cut short")
    except UnidentifiedImageError:
        raise InputError(f"{path}: expected a PNG image, got something else") from None
    except (OSError, SyntaxError, ValueError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: expected a whole PNG image, but it cannot be read ({reason})"
        ) from None
    return pixels


CHANNELS = {2: 3, 4: 2, 6: 4}
"""Of colour types with more than one: RGB, grey with alpha, RGBA."""


def _has_deep_channels(data: bytes) -> bool:
    """Return whether a file has 16 bits in each of several channels."""
    is_png = data[:8] == b"\x89PNG\r\n\x1a\n" and data[12:16] == b"IHDR"
    return is_png and len(data) > 28 and data[24] == 16 and data[25] in CHANNELS


def _deep_channels(data: bytes) -> UInt16[np.ndarray, "height width channel"]:
    """Return the values of a PNG with 16 bits in each of several channels.

    References:
        W3C (2003), Portable Network Graphics specification, second edition: chunks in
        section 5, filters in section 9.
    """
    width, height, _, kind, _, _, interlaced = struct.unpack(">IIBBBBB", data[16:29])
    if interlaced:
        raise ValueError("colours of 16 bits are read without interlacing only")
    packed, place, chunk = [], 8, b""
    while chunk != b"IEND":
        if place + 12 > len(data):
            raise EOFError("cut short")
        (size,), chunk = struct.unpack_from(">I", data, place), data[place + 4 :][:4]
        if chunk == b"IDAT":
            packed.append(data[place + 8 : place + 8 + size])
        place += 12 + size
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
    """Return the bytes of pixels from those that the filters of their rows left.

    A pixel needs its neighbours to the left, above, and above to the left. Pixels of
    one antidiagonal need none of each other: all of them are computed together.
    """
    if filters.max(initial=0) > 4:
        raise ValueError(f"unknown filter {filters.max()}")
    height, width, step = coded.shape
    out = np.zeros((height + 1, width + 1, step), np.int16)  # nothing left and above
    kinds = filters[:, None]
    for diagonal in range(height + width - 1):
        rows = np.arange(max(diagonal - width + 1, 0), min(diagonal, height - 1) + 1)
        columns = diagonal - rows
        left, above = out[rows + 1, columns], out[rows, columns + 1]
        corner, kind = out[rows, columns], kinds[rows]
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
