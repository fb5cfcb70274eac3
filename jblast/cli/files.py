"""Files a command writes: never over an existing one unless told so."""

from pathlib import Path

from jblast.errors import InputError


def refuse_existing(path: str | Path, *, force: bool) -> None:
    """Raise InputError if a file is there already and may not be overwritten."""
    if Path(path).exists() and not force:
        raise InputError(
            f"{path}: exists already; expected a new file, or --force to overwrite it"
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
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
