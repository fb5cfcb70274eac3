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
"""Of a frame on the sheet [px]; none is made larger than twice its size."""
GAP = 12
LETTERS = 16
"""Height of the letters [px]."""


def sheet_frames(
    times: Float[np.ndarray, " frame"], bursts: Sequence[float]
) -> list[int]:
    """Return which frames to show: early ones close together, late ones far apart.

    The first frame, and others whose times since the first burst seen grow by equal
    factors; of several frames as wanted the same, one.
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
    frames: Sequence[Float[np.ndarray, "height width 3"]],
    labels: Sequence[str],
) -> None:
    """Write frames of linear light in rows, each over its label; all or nothing.

    Args:
        path: An existing file is replaced.
        frames: All of one size, full scale 1.
        labels: What is said of each.
    """
    from PIL import Image, ImageDraw, ImageFont

    height, width = frames[0].shape[:2]
    across = min(WIDTH, 2 * width)
    size = across, max(1, round(height * across / width))
    columns = min(COLUMNS, len(frames))
    rows = math.ceil(len(frames) / columns)
    cell = across + GAP, size[1] + GAP + LETTERS + 6
    sheet = Image.new("RGB", (columns * cell[0] + GAP, rows * cell[1] + GAP), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(LETTERS)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        x, y = GAP + k % columns * cell[0], GAP + k // columns * cell[1]
        picture = Image.fromarray(srgb_bytes(frame))
        sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), (x, y))
        draw.text((x, y + size[1] + 3), label, fill=INK, font=font)
    with replacing(path) as temporary:
        sheet.save(temporary, format="PNG")


def time_label(time: float) -> str:
    """Return a time in words, three digits: "1.5 ms"."""
    size = abs(time)
    if size >= 1.0:
        return f"{time:.3g} s"
    if size >= 1e-3:
        return f"{1e3 * time:.3g} ms"
    return f"{1e6 * time:.3g} \N{MICRO SIGN}s" if size > 0 else "0"
