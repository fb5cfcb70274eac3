"""Files a command reads and writes: named, and never over an existing one unasked."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.errors import InputError
from jblast.files import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = (".png", ".svg", ".pdf")
"""What a name of a figure may end in."""


def path(text: str) -> str:
    """Return the path an argument holds; an empty one is an unset shell variable.

    Raises:
        ArgumentTypeError: It is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a path, got {text!r}")
    return text


def refuse_existing(path: str | Path, *, force: bool) -> None:
    """Raise InputError if a file is there already and may not be overwritten."""
    if Path(path).exists() and not force:
        raise InputError(
            f"{path}: exists already; expected a new file, or --force to overwrite it"
        )


def check_figure(option: str, file: str, *, force: bool) -> None:
    """Refuse a figure that cannot be drawn, before anything is computed.

    Raises:
        InputError: It is of no kind we draw, or exists already.
    """
    if Path(file).suffix.lower() not in FIGURES:
        raise InputError(f"{option} {file}: expected a name in {', '.join(FIGURES)}")
    refuse_existing(file, force=force)


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Say in one line that a file or directory cannot be written, if it cannot.

    Raises:
        InputError: What is done inside raises an OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"{path}: cannot be written ({reason}); expected a place to write to"
        ) from None


def save_text(text: str, file: str | Path) -> None:
    """Write text.

    Raises:
        InputError: It cannot be written.
    """
    with writing(file):
        write_text(file, text)


def save_figure(figure: "Figure", file: str | Path) -> None:
    """Write a figure of Matplotlib.

    Raises:
        InputError: It cannot be written.
    """
    from jblast.report.figure_files import write_figure

    with writing(file):
        write_figure(figure, file)
