"""WebP files with alpha, read as they stand."""

from io import BytesIO
from pathlib import Path

from jaxtyping import UInt8
from numpy import asarray, ndarray

from jblast.errors import InputError


def check_whole_webp(path: Path) -> None:
    """Refuse a file that is missing, cut short or no WebP, by its first bytes.

    Raises:
        InputError: It is; the message names it.
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
    wanted = 8 + int.from_bytes(head[4:8], "little")
    if size < wanted:
        raise InputError(
            f"{path}: expected a whole WebP image of {wanted:,} bytes, got {size:,}; "
            "it is cut short"
        )


def read_webp(path: Path) -> UInt8[ndarray, "height width 4"]:
    """Return red, green, blue and straight alpha.

    Raises:
        InputError: It cannot be read, or has no alpha.
    """
    from PIL import Image

    check_whole_webp(path)
    try:
        with Image.open(BytesIO(path.read_bytes()), formats=["WEBP"]) as image:
            mode, pixels = image.mode, asarray(image)
    except (OSError, SyntaxError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: expected a whole WebP image, but it cannot be read ({reason})"
        ) from None
    if mode != "RGBA":
        raise InputError(f"{path}: expected an image with alpha, got none")
    return pixels
