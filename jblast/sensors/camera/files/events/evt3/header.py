"""The header of an EVT 3.0 file."""

from pathlib import Path
from typing import BinaryIO, NamedTuple

from jblast.errors import InputError

LONGEST = 1 << 16
"""Bytes of a header: none is nearly as long."""


class Header(NamedTuple):
    """What a header says.

    Attributes:
        size: Width and height; None if it does not tell them.
        words: How many words follow; None if it does not tell.
    """

    size: tuple[int, int] | None
    words: int | None


def header_of(width: int, height: int, words: int) -> bytes:
    """Return the header of our files, always of one length for an image.

    Prophesee's software finds by it which of its plug-ins reads the file.
    """
    lines = (
        "evt 3.0",
        f"format EVT3;height={height};width={width}",
        f"geometry {width}x{height}",
        "integrator_name jblast",
        "plugin_integrator_name Prophesee",
        "plugin_name hal_plugin_prophesee",
        f"words {words:020d}",
        "end",
    )
    return "".join(f"% {line}\n" for line in lines).encode()


def read_header(path: Path, file: BinaryIO) -> Header:
    """Read a header; the file then stands at its first word.

    Raises:
        InputError: There is none, or it is of another encoding.
    """
    said: dict[str, str] = {}
    start = file.tell()
    while file.tell() < LONGEST:
        line = file.readline(LONGEST)
        if not line.startswith(b"% "):
            break  # "end" may be left out
        start = file.tell()
        key, _, value = line[2:].decode("ascii", "replace").strip().partition(" ")
        if key == "end":
            break
        said[key] = value
    file.seek(start)
    encoding, _, options = said.get("format", "").partition(";")
    encoding = encoding or {"3.0": "EVT3"}.get(said.get("evt", ""), said.get("evt", ""))
    if encoding != "EVT3":
        got = f"one of {encoding}" if encoding else "none"
        raise InputError(f"{path}: expected the header of an EVT 3.0 file, got {got}")
    if said.get("endianness", "little") != "little":
        raise InputError(f"{path}: expected little-endian words, got big-endian ones")
    width, _, height = said.get("geometry", "").partition("x")
    fields = {"width": width, "height": height}
    for option in options.split(";"):
        key, _, value = option.partition("=")
        fields[key] = value
    size = None
    if fields["width"].isdecimal() and fields["height"].isdecimal():
        size = int(fields["width"]), int(fields["height"])
    words = said.get("words", "")
    return Header(size, int(words) if words.isdecimal() else None)
