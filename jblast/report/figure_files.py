"""Figures as files of a report, each drawn once for file and page."""

import base64
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from jblast.report.figures import figure_bytes, write_figure


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
    return Picture(figure_bytes(figure), round(96 * figure.get_figwidth()))
