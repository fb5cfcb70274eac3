"""Packages that serve one format each: absent, they are asked for in one message."""

import warnings
from importlib import import_module
from pathlib import Path
from types import ModuleType

from jblast.errors import InputError


def needed(module: str, extra: str, path: Path, what: str) -> ModuleType:
    """Import what reads a format.

    Args:
        module: Its name.
        extra: The extra of jblast that installs it.
        path: The file that is to be read.
        what: The format.

    Raises:
        InputError: It is not installed.
    """
    try:
        with warnings.catch_warnings():  # of its own age: nobody here can mend it
            warnings.simplefilter("ignore", DeprecationWarning)
            return import_module(module)
    except ImportError:
        raise InputError(
            f"{path}: {what} is read by the package {module.partition('.')[0]}, which "
            f"is not installed; pip install 'jblast[{extra}]'"
        ) from None
