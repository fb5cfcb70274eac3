"""Frames of MAVLink 2 by pymavlink: packed, and taken out of a stream of bytes."""

import functools
import struct
from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

from jblast.errors import InputError, nearest, needed

MAGIC, MAGIC_1 = 0xFD, 0xFE
"""First byte of a frame of version 2, and of version 1."""


class Message(NamedTuple):
    """A message that came.

    Attributes:
        name: As `common.xml` has it; "" of one that is not known there.
        system: Who sent it.
        component: Which part of whom.
        values: By field.
        frame: Its bytes, with its signature if it has one.
    """

    name: str
    system: int
    component: int
    values: dict[str, Any]
    frame: bytes


@functools.cache
def dialect() -> ModuleType:
    """Import the messages of `common.xml` as MAVLink's own generator wrote them.

    Raises:
        InputError: pymavlink is not installed.
    """
    return needed(
        "pymavlink.dialects.v20.common",
        "mavlink",
        "MAVLink",
        "messages are packed and read",
    )


@functools.cache
def _kinds() -> dict[str, Any]:
    """Return the classes of messages, by name."""
    return {kind.msgname: kind for kind in dialect().mavlink_map.values()}


@functools.cache
def _zeros(name: str) -> dict[str, Any]:
    """Return the fields of a message, each of zeros."""
    kind = _kinds()[name]
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    counts = zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    return {
        field: b"\0" if types[field] == "char" else [0] * count if count else 0
        for field, count in counts
    }


class Sender:
    """Packs messages, and counts them.

    Args:
        system: Who sends them.
        component: Which part of whom.

    Raises:
        InputError: pymavlink is not installed.
    """

    def __init__(self, system: int, component: int):
        self._coder = dialect().MAVLink(None, system, component)

    def pack(self, name: str, **values: Any) -> bytes:
        """Return a frame; fields that are not named are zero.

        Raises:
            InputError: There is no such message or field, or a number does not fit.
        """
        if name not in _kinds():
            raise InputError(f"message {name!r}: not known{nearest(name, _kinds())}")
        fields = _zeros(name)
        for field in values.keys() - fields.keys():
            raise InputError(f"{name} {field}: no such field{nearest(field, fields)}")
        said = {
            field: value.encode("ascii", "replace") if isinstance(value, str) else value
            for field, value in values.items()
        }
        try:
            frame = _kinds()[name](**fields | said).pack(self._coder)
        except (struct.error, OverflowError, IndexError) as error:
            raise InputError(
                f"{name}: expected numbers that fit their fields, got {error}"
            ) from None
        self._coder.seq = (self._coder.seq + 1) % 256
        return frame


class Receiver:
    """Takes messages out of bytes as they come.

    Attributes:
        damaged: How many frames had a wrong checksum.
        lost: How many are missing by the senders' own count.

    Raises:
        InputError: pymavlink is not installed.
    """

    def __init__(self):
        self._parser = dialect().MAVLink(None)
        self._parser.robust_parsing = True  # bytes between frames are passed over
        self._last: dict[tuple[int, int], int] = {}
        self.damaged = self.lost = 0

    @property
    def heard(self) -> bool:
        """Whether anybody has been heard."""
        return bool(self._last)

    def feed(self, data: bytes) -> Iterator[Message]:
        """Yield the messages that are whole with some more bytes.

        Raises:
            InputError: They are of MAVLink 1.
        """
        came = self._parser.parse_char(data)
        while came is not None:
            kind, frame = came.get_type(), bytes(came.get_msgbuf())
            known = not kind.startswith("UNKNOWN_")
            if kind == "BAD_DATA" or (frame[0] == MAGIC_1 and not known):
                self.damaged += frame[0] == MAGIC
                self._look_again(frame)
            elif frame[0] == MAGIC_1:
                raise InputError(
                    "expected messages of MAVLink 2, got one of MAVLink 1 (first byte "
                    "0xFE); PX4 sends version 2 with MAV_PROTO_VER = 2"
                )
            else:
                sequence, system, component = frame[4:7]
                self._count((system, component), sequence)
                names = came.get_fieldnames() if known else []
                values = {field: getattr(came, field) for field in names}
                yield Message(kind if known else "", system, component, values, frame)
            came = self._parser.parse_char(b"")

    def _look_again(self, damaged: bytes) -> None:
        """Give back what may begin a frame in bytes that were none.

        A frame that breaks off is taken to reach into the next, which would be lost.
        """
        begin = damaged.find(MAGIC, 1)
        if begin > 0:
            parser = self._parser
            parser.buf = bytearray(damaged[begin:]) + parser.buf[parser.buf_index :]
            parser.buf_index = 0

    def _count(self, who: tuple[int, int], sequence: int) -> None:
        if who in self._last:
            self.lost += (sequence - self._last[who] - 1) % 256
        self._last[who] = sequence
