"""A contact sheet: a few frames of a recording on one page, each with its time."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jblast.files import replacing
from jblast.report.figure_style import INK
from jblast.sensors.camera.files.images import srgb_bytes

COLUMNS = 4
ROWS = 3
WIDTH = 320
"""Width of a frame on the sheet [px]; frames are enlarged at most twice."""
GAP = 12
"""Space between frames [px]."""
FONT_SIZE = 16
"""Size of the labels [px]."""


def sheet_frames(
    times: Float[np.ndarray, " frame"], bursts: Sequence[float]
) -> list[int]:
    """Return the numbers of the frames to show.

    These are the first frame, and frames whose times since the first visible burst
    increase by equal factors: a fireball grows fast at first, then slowly.
    """
    most = COLUMNS * ROWS
    last = len(times) - 1
    after = [b for b in bursts if times[0] <= b <= times[last]]
    first = int(np.searchsorted(times, min(after, default=times[0]), side="right"))
    left = last - first + 1
    if left < most:
        later = np.arange(first, last + 1)
    else:
        steps = np.geomspace(1.0, left, most - 1)
        # neighbours that round to one frame move up to the next free one
        steps = np.maximum(np.rint(steps), np.arange(1, most))
        later = first - 1 + steps.astype(int)
    return sorted({0, *later.tolist()})[:most]


def write_contact_sheet(
    path: str | Path,
    frames: Sequence[np.ndarray],
    labels: Sequence[str],
) -> None:
    """Write frames of linear light, or of sRGB bytes, in rows, each above its label.

    Args:
        path: Output file; an existing one is replaced.
        frames: Frames of one size, full scale 1.
        labels: Label of each frame.
    """
    from PIL import Image, ImageDraw, ImageFont

    height, width = frames[0].shape[:2]
    across = min(WIDTH, 2 * width)
    size = across, max(1, round(height * across / width))
    columns = min(COLUMNS, len(frames))
    rows = math.ceil(len(frames) / columns)
    cell = across + GAP, size[1] + GAP + FONT_SIZE + 6
    sheet = Image.new("RGB", (columns * cell[0] + GAP, rows * cell[1] + GAP), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_SIZE)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        x, y = GAP + k % columns * cell[0], GAP + k // columns * cell[1]
        bytes_ = frame if frame.dtype == np.uint8 else srgb_bytes(frame)
        picture = Image.fromarray(bytes_)
        sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), (x, y))
        draw.text((x, y + size[1] + 3), label, fill=INK, font=font)
    with replacing(path) as temporary:
        sheet.save(temporary, format="PNG")


def time_label(time: float) -> str:
    """Return a time with three digits and its unit: "1.5 ms"."""
    size = abs(time)
    if size >= 1.0:
        return f"{time:.3g} s"
    if size >= 1e-3:
        return f"{1e3 * time:.3g} ms"
    return f"{1e6 * time:.3g} \N{MICRO SIGN}s" if size > 0 else "0"
