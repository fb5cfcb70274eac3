"""Frames of MAVLink 2: packed, and taken out of a stream of bytes."""

import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

from jblast.autopilot.mavlink.checksum import checksum
from jblast.autopilot.mavlink.definitions import BY_NAME, BY_NUMBER, Definition
from jblast.errors import InputError, nearest

MAGIC, MAGIC_1 = 0xFD, 0xFE
"""First byte of a frame of version 2, and of version 1."""
SIGNED = 0x01
HEAD, TAIL, SIGNATURE = 10, 2, 13
"""Bytes before and behind the payload, and of a signature."""
_HEAD = struct.Struct("<BBBBBBBHB")


class Message(NamedTuple):
    """A message that came.

    Attributes:
        name: As `common.xml` has it; "" of one that is not spoken here.
        number: On the wire.
        system: Who sent it.
        component: Which part of whom.
        sequence: Counted by the sender, modulo 256.
        values: By field.
        frame: Its bytes.
    """

    name: str
    number: int
    system: int
    component: int
    sequence: int
    values: dict[str, Any]
    frame: bytes


class Sender:
    """Packs messages, and counts them.

    Args:
        system: Who sends them.
        component: Which part of whom.
    """

    def __init__(self, system: int, component: int):
        self.system, self.component, self._sequence = system, component, 0

    def pack(self, name: str, **values: Any) -> bytes:
        """Return a frame; fields that are not named are zero.

        Raises:
            InputError: There is no such message or field, or a number does not fit.
        """
        if name not in BY_NAME:
            raise InputError(f"message {name!r}: not known{nearest(name, BY_NAME)}")
        definition = BY_NAME[name]
        payload = packed(definition, values)
        sequence, self._sequence = self._sequence, (self._sequence + 1) % 256
        number = definition.number
        head = _HEAD.pack(
            *(MAGIC, len(payload), 0, 0, sequence, self.system, self.component),
            *(number & 0xFFFF, number >> 16),
        )
        crc = checksum(head[1:] + payload + bytes([definition.extra]))
        return head + payload + struct.pack("<H", crc)


def packed(definition: Definition, values: dict[str, Any]) -> bytes:
    """Return a payload, less the zeros at its end.

    Raises:
        InputError: A field is not known, or its value does not fit.
    """
    flat: list[Any] = []
    for field, count in definition.fields:
        value = values.get(field, 0)
        if count:
            flat += [*value] if field in values else [0] * count
        elif isinstance(value, str):
            flat.append(value.encode("ascii", "replace"))
        else:
            flat.append(value or b"" if field == "text" else value)
    names = [field for field, _ in definition.fields]
    for field in values:
        if field not in names:
            raise InputError(
                f"{definition.name} {field}: no such field{nearest(field, names)}"
            )
    try:
        whole = definition.layout.pack(*flat)
    except struct.error as error:
        raise InputError(
            f"{definition.name}: expected numbers that fit their fields, got {error}"
        ) from None
    return whole.rstrip(b"\0") or b"\0"


def unpacked(definition: Definition, payload: bytes) -> dict[str, Any]:
    """Return the fields of a payload, whose end may be cut off, or be of later date."""
    size = definition.layout.size
    flat = iter(definition.layout.unpack(payload[:size].ljust(size, b"\0")))
    values: dict[str, Any] = {}
    for field, count in definition.fields:
        value = [next(flat) for _ in range(count)] if count else next(flat)
        values[field] = (
            value.split(b"\0")[0].decode("ascii", "replace")
            if isinstance(value, bytes)
            else value
        )
    return values


class Receiver:
    """Takes messages out of bytes as they come.

    Attributes:
        damaged: How many frames had a wrong checksum.
        lost: How many are missing by the senders' own count.
    """

    def __init__(self):
        self._rest = b""
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
        buffer = self._rest + data
        at = 0
        while len(buffer) - at >= HEAD + TAIL:
            first = buffer[at]
            if first == MAGIC_1 and _is_version_1(buffer[at:]):
                self._rest = b""
                raise InputError(
                    "expected messages of MAVLink 2, got one of MAVLink 1 (first byte "
                    "0xFE); PX4 sends version 2 with MAV_PROTO_VER = 2"
                )
            if first != MAGIC:
                at += 1
                continue
            signed = buffer[at + 2] & SIGNED
            end = at + HEAD + buffer[at + 1] + TAIL
            whole = end + (SIGNATURE if signed else 0)
            if len(buffer) < whole:
                break
            message = self._message(buffer[at:end])
            if message is None:
                self.damaged += 1
                at += 1
                continue
            self._count(message)
            at = whole
            yield message
        self._rest = buffer[at:]

    def _message(self, frame: bytes) -> Message | None:
        """Return what a frame says; None where its checksum is wrong."""
        _, size, _, _, sequence, system, component, low, high = _HEAD.unpack(
            frame[:HEAD]
        )
        number = low | high << 16
        definition = BY_NUMBER.get(number)
        if definition is None:
            return Message("", number, system, component, sequence, {}, frame)
        crc = checksum(frame[1:-TAIL] + bytes([definition.extra]))
        if frame[-TAIL:] != struct.pack("<H", crc):
            return None
        values = unpacked(definition, frame[HEAD : HEAD + size])
        return Message(
            definition.name, number, system, component, sequence, values, frame
        )

    def _count(self, message: Message) -> None:
        who = message.system, message.component
        if who in self._last:
            self.lost += (message.sequence - self._last[who] - 1) % 256
        self._last[who] = message.sequence


def _is_version_1(buffer: bytes) -> bool:
    """Whether a frame of MAVLink 1 whose checksum is right begins here."""
    end = 6 + buffer[1] + TAIL
    definition = BY_NUMBER.get(buffer[5])
    if definition is None or len(buffer) < end:
        return False
    crc = checksum(buffer[1 : end - TAIL] + bytes([definition.extra]))
    return buffer[end - TAIL : end] == struct.pack("<H", crc)
