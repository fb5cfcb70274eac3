"""Figures as files, written whole or not at all, and as bytes for a page."""

import io
import os
import warnings
from pathlib import Path

from matplotlib.figure import Figure

from jblast.files import replacing


def write_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure; the suffix says which format.

    Raises:
        OSError: It cannot be written; what was there before is as it was.
    """
    with replacing(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix[1:])


def image_bytes(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of its own, the same each time it is drawn."""
    buffer = io.BytesIO()
    no_date = {"Date": None} if kind == "svg" else {"Software": None}
    with warnings.catch_warnings():
        # a sensor's name may hold signs the font lacks; it is drawn with boxes
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .*missing from font")
        figure.savefig(buffer, format=kind, facecolor="white", metadata=no_date)
    return buffer.getvalue()
