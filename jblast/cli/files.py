"""Files a command reads and writes: named, and never over an existing one unasked."""

import argparse
from pathlib import Path

from jblast.errors import InputError

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


def save_figure(figure, file: str | Path) -> None:
    """Write a figure of Matplotlib.

    Raises:
        InputError: It cannot be written.
    """
    try:
        figure.savefig(file)
    except OSError as error:
        raise unwritable(file, error) from None


def unwritable(path: str | Path, error: OSError) -> InputError:
    """Return the error for a file or directory that cannot be written."""
    reason = error.strerror or str(error)
    return InputError(
        f"{path}: cannot be written ({reason}); expected a place to write to"
    )


def write_text(path: str | Path, text: str, *, force: bool) -> None:
    """Write a text file.

    Raises:
        InputError: It exists and `force` is not given, or it cannot be written.
    """
    refuse_existing(path, force=force)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise unwritable(path, error) from None
