"""Figures as files, each written completely or not at all, and as bytes for a page."""

import base64
import io
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jblast.files import replacing

PACKED = 3
"""Of 9: lines are packed as well as at Matplotlib's 6, in two thirds of the time."""


def write_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure; the suffix says which format.

    Raises:
        OSError: It cannot be written; what was there before is as it was.
    """
    with replacing(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix[1:])


def write_drawn(draw: Callable[[], Figure], path: Path) -> Figure | None:
    """Draw and write a figure; None, and a warning that names it, where that fails.

    Whatever went wrong with a picture, what was computed is kept.
    """
    try:
        figure = draw()
        write_figure(figure, path)
    except Exception as error:
        warnings.warn(f"{path.name} was not written: {error!r}", stacklevel=2)
        return None
    return figure


@dataclass(frozen=True)
class Picture:
    """A figure as a PNG file, drawn once for whoever shows it.

    Attributes:
        png: The file.
        width: How wide it is on a page [1/96 inch].
    """

    png: bytes
    width: int

    @property
    def source(self) -> str:
        """The file as an address that holds it."""
        return f"data:image/png;base64,{base64.b64encode(self.png).decode('ascii')}"


def picture_of(figure: Figure) -> Picture:
    """Draw a figure."""
    return Picture(image_bytes(figure, "png"), round(96 * figure.get_figwidth()))


def image_bytes(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of its own, the same each time it is drawn."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # a sensor's name may hold signs the font lacks; it is drawn with boxes
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .*missing from font")
        _laid_out(figure)
        if kind == "png":
            _write_png(figure, buffer)
        else:
            no_date = {"Date": None} if kind == "svg" else None
            figure.savefig(buffer, format=kind, facecolor="white", metadata=no_date)
    return buffer.getvalue()


def _write_png(figure: Figure, buffer: io.BytesIO) -> None:
    """Draw on white and write what is seen: Matplotlib writes an opaque layer, too."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    figure.set_facecolor("white")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    colours = np.asarray(canvas.buffer_rgba())[:, :, :3]
    inch = (figure.dpi, figure.dpi)
    Image.fromarray(np.ascontiguousarray(colours)).save(
        buffer, format="png", compress_level=PACKED, dpi=inch
    )


def _laid_out(figure: Figure) -> None:
    """Lay a figure out, once; Matplotlib does it twice for each file it writes."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)
