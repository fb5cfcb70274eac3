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
"""Compression level of PNG: line figures are as small as at Matplotlib's 6, in two
thirds of the time."""


def write_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure in the format of the suffix.

    Raises:
        OSError: It cannot be written; an existing file is unchanged.
    """
    # the suffix is given, as the temporary file has another one
    with replacing(path) as temporary:
        figure.savefig(temporary, format=Path(path).suffix[1:])


def write_drawn(draw: Callable[[], Figure], path: Path) -> Figure | None:
    """Draw and write a figure; on failure warn and return None.

    A figure that cannot be drawn must not lose the computed numbers.
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
    """A figure as a PNG file, drawn once for file and page.

    Attributes:
        png: Content of the file.
        width: Width on a page [1/96 inch].
    """

    png: bytes
    width: int

    @property
    def source(self) -> str:
        """The file as a data URL."""
        return f"data:image/png;base64,{base64.b64encode(self.png).decode('ascii')}"


def picture_of(figure: Figure) -> Picture:
    """Return a drawn figure."""
    # 96 pixels of CSS are an inch
    return Picture(image_bytes(figure, "png"), round(96 * figure.get_figwidth()))


def image_bytes(figure: Figure, kind: str) -> bytes:
    """Return the content of a figure's file, the same each time it is drawn."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # names of sensors may have characters that the font lacks, drawn as boxes
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .*missing from font")
        # the layout is executed once here; Matplotlib does it twice for each file
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        if kind == "png":
            _write_png(figure, buffer)
        else:
            # a date would make files of equal figures differ
            no_date = {"Date": None} if kind == "svg" else None
            figure.savefig(buffer, format=kind, facecolor="white", metadata=no_date)
    return buffer.getvalue()


def _write_png(figure: Figure, buffer: io.BytesIO) -> None:
    """Draw on white and write a PNG."""
    # written by Pillow, as Matplotlib would add an opaque alpha channel
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
