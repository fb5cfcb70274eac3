"""PNG files: linear light written as sRGB of 8 bits, and values read as they stand."""

from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import InputError
from jblast.files import replacing
from jblast.sensors.camera.image.compositing import linear_to_srgb

COMPRESSION = 1
"""Of zlib: a third of the time of the usual 6, a tenth more bytes."""


def write_png(
    path: str | Path, image: Float[np.ndarray, "height width channel"]
) -> None:
    """Write an image as sRGB of 8 bits, rounded to the nearest.

    Light outside 0 to 1 is written as the nearest that a screen can show. Frames
    do not wait for the disk: they come by the hundred, and can be made again.

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
    image = np.clip(image, 0.0, 1.0).astype(np.float32)
    shown = linear_to_srgb(image)
    if image.shape[-1] == 4:
        shown[..., 3] = image[..., 3]
    return np.rint(255.0 * shown).astype(np.uint8)


def read_png(path: str | Path) -> np.ndarray:
    """Return the values of a PNG file as they stand: of 8 or of 16 bits.

    A palette is looked up; there are one to four channels, the last of two or four
    being alpha.

    Raises:
        InputError: It is no PNG file, or not a whole one.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        data = Path(path).read_bytes()
        with Image.open(BytesIO(data), formats=["PNG"]) as image:
            if image.mode in ("1", "P", "PA"):
                image = image.convert("RGBA" if image.has_transparency_data else "RGB")
            pixels = np.asarray(image)
        if b"IEND" not in data:  # some cuts the decoder lets pass
            raise EOFError("cut short")
    except UnidentifiedImageError:
        raise InputError(f"{path}: expected a PNG image, got something else") from None
    except (OSError, SyntaxError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: expected a whole PNG image, but it cannot be read ({reason})"
        ) from None
    return pixels
