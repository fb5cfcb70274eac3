"""MAVLink 2 by pymavlink: frames, and links by TCP and UDP."""

import functools
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, NamedTuple

from jblast.addresses import host_and_port
from jblast.errors import InputError, argument, nearest, needed, shown

MAGIC, MAGIC_1 = 0xFD, 0xFE
"""First byte of a frame of MAVLink 2, and of MAVLink 1."""


class LinkLost(Exception):
    """The peer has disconnected; the message states the reason."""


class Address(NamedTuple):
    """Address of a link.

    Attributes:
        kind: "tcp" or "udp".
        host: Loopback address.
        port: Port; 0 selects a free one.
    """

    kind: str
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.kind}:{host}:{self.port}"


class Message(NamedTuple):
    """A received message.

    Attributes:
        name: Name in `common.xml`; "" if unknown.
        system: MAVLink system of the sender.
        component: MAVLink component of the sender.
        values: Values by field.
        frame: Bytes of the frame, including a signature.
    """

    name: str
    system: int
    component: int
    values: dict[str, Any]
    frame: bytes

    @property
    def sender(self) -> tuple[int, int]:
        """System and component of the sender."""
        return self.system, self.component


PEERS = {"mavlink": "autopilot", "ground_station": "ground station"}
"""Peer of a link, by the name of the argument with its address."""


class Link:
    """Messages to and from one peer.

    A TCP link listens and accepts the first client. A UDP link sends to the address and
    receives from it; with `listens` the first sender becomes the peer.

    Attributes:
        address: Address that it listens on or sends to.
        receiver: Parser of received bytes, with counts of lost frames.
        keep: Called with each sent or received frame.

    Args:
        address: Address.
        name: Name of the argument, for messages.
        listens: True if a UDP peer sends first.
        keep: As above; may be set later.

    Raises:
        InputError: The port is in use.
    """

    def __init__(
        self,
        address: Address,
        name: str,
        *,
        listens: bool = False,
        keep: Callable[[bytes], object] = lambda frame: None,
    ):
        self.receiver, self.keep = Receiver(), keep
        self._gone = f"the {PEERS.get(name, 'peer')} has disconnected"
        self._waiting: deque[Message] = deque()
        self._peer: socket.socket | None = None
        self._heard_from: object = None
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        kind = socket.SOCK_STREAM if address.kind == "tcp" else socket.SOCK_DGRAM
        self._listens = listens or address.kind == "tcp"
        self._socket = socket.socket(family, kind)
        try:
            if address.kind == "tcp":
                # Otherwise the port stays blocked for a minute after a restart.
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if self._listens:
                self._socket.bind((address.host, address.port))
                address = address._replace(port=self._socket.getsockname()[1])
            else:
                self._socket.connect((address.host, address.port))
            if address.kind == "tcp":
                self._socket.listen(1)
            else:
                self._peer = self._socket
        except OSError as error:
            self._socket.close()
            raise InputError(
                f"{argument(name)}: expected a free port of this machine, got {address}"
                f", which is in use or not available ({error.strerror})"
            ) from None
        self.address = address

    @property
    def connected(self) -> bool:
        """True if there is a peer to send to."""
        return self._peer is not None and (
            self.address.kind == "tcp"
            or not self._listens
            or self._heard_from is not None
        )

    def accept(self, timeout_s: float) -> bool:
        """Wait for a TCP client; return whether one is connected."""
        if self._peer is None and self._ready(self._socket, timeout_s):
            self._peer, _ = self._socket.accept()
            # Nagle's algorithm would delay small messages and slow down the lockstep.
            self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._peer is not None

    def send(self, *frames: bytes) -> None:
        """Send some frames.

        Raises:
            LinkLost: The peer has disconnected.
        """
        if self._peer is None:
            raise LinkLost("no client has connected")
        for frame in frames:
            self.keep(frame)
        try:
            if self.address.kind == "tcp":
                self._peer.sendall(b"".join(frames))
            else:
                for frame in frames:
                    if self._heard_from is None or not self._listens:
                        self._socket.send(frame)
                    else:
                        self._socket.sendto(frame, self._heard_from)  # type: ignore[arg-type]
        except ConnectionRefusedError:
            if self.receiver.heard:
                raise LinkLost(self._gone) from None
        except OSError as error:
            raise LinkLost(error.strerror or str(error)) from None

    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message; None after the timeout.

        Raises:
            LinkLost: The peer has disconnected.
            InputError: The peer sends MAVLink 1.
        """
        until = time.monotonic() + timeout_s
        while not self._waiting:
            left = until - time.monotonic()
            if self._peer is None or not self._ready(self._peer, max(left, 0.0)):
                return None
            self._take()
        return self._waiting.popleft()

    def _take(self) -> None:
        """Read available bytes into the receiver."""
        peer = self._peer
        if peer is None:
            return
        try:
            if self.address.kind == "tcp":
                data = peer.recv(65536)
                if not data:
                    raise LinkLost(self._gone)
            else:
                data, who = peer.recvfrom(65536)
                if self._heard_from is None:
                    self._heard_from = who
                # Datagrams of any other sender are ignored: a link has one peer.
                if who != self._heard_from:
                    return
        except ConnectionRefusedError:
            if self.receiver.heard:
                raise LinkLost(self._gone) from None
            return
        except OSError as error:
            raise LinkLost(error.strerror or str(error)) from None
        for message in self.receiver.feed(data):
            self.keep(message.frame)
            self._waiting.append(message)

    def close(self) -> None:
        """Close the link."""
        if self._peer is not None:
            self._peer.close()
        self._socket.close()

    @staticmethod
    def _ready(one: socket.socket, timeout_s: float) -> bool:
        return bool(select.select([one], [], [], timeout_s)[0])


@functools.cache
def dialect() -> ModuleType:
    """Import pymavlink's generated messages of `common.xml`.

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


def message_name(number: int) -> str:
    """Return the name of a message by its number; "" if unknown."""
    kind = dialect().mavlink_map.get(number)
    return "" if kind is None else kind.msgname


class Sender:
    """Packing of messages, with their sequence numbers.

    Args:
        system: MAVLink system of the sender.
        component: MAVLink component of the sender.

    Raises:
        InputError: pymavlink is not installed.
    """

    def __init__(self, system: int, component: int):
        self._coder = dialect().MAVLink(None, system, component)

    def pack(self, name: str, **values: Any) -> bytes:
        """Return a frame; missing fields are zero.

        Raises:
            InputError: The message or a field is unknown, or a number does not fit.
        """
        if name not in _kinds():
            raise InputError(f"message {name!r}: not known{nearest(name, _kinds())}")
        fields = _zeros(name)
        for field in values.keys() - fields.keys():
            raise InputError(f"{name} {field}: no such field{nearest(field, fields)}")
        encoded = {
            field: value.encode("ascii", "replace") if isinstance(value, str) else value
            for field, value in values.items()
        }
        try:
            frame = _kinds()[name](**fields | encoded).pack(self._coder)
        except (struct.error, OverflowError, IndexError) as error:
            raise InputError(
                f"{name}: expected numbers that fit their fields, got {error}"
            ) from None
        self._coder.seq = (self._coder.seq + 1) % 256
        return frame

    def pack_to(self, who: tuple[int, int], name: str, **values: Any) -> bytes:
        """Return a frame for one system and component, as by `pack`."""
        return self.pack(name, target_system=who[0], target_component=who[1], **values)


class Receiver:
    """Parser of messages in a stream of bytes.

    Attributes:
        damaged: Number of frames with a wrong checksum.
        lost: Number of missing frames, by the senders' sequence numbers.

    Raises:
        InputError: pymavlink is not installed.
    """

    def __init__(self):
        self._parser = dialect().MAVLink(None)
        self._parser.robust_parsing = True  # skips bytes between frames
        self._last: dict[tuple[int, int], int] = {}
        self.damaged = self.lost = 0

    @property
    def heard(self) -> bool:
        """True after the first valid frame."""
        return bool(self._last)

    def feed(self, data: bytes) -> Iterator[Message]:
        """Yield the messages completed by additional bytes.

        Raises:
            InputError: A message is of MAVLink 1.
        """
        came = self._parser.parse_char(data)
        while came is not None:
            kind, frame = came.get_type(), bytes(came.get_msgbuf())
            known = not kind.startswith("UNKNOWN_")
            if kind == "BAD_DATA" or (frame[0] == MAGIC_1 and not known):
                self.damaged += frame[0] == MAGIC
                self._recover(frame)
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

    def _recover(self, damaged: bytes) -> None:
        """Return the possible beginning of a frame in damaged bytes to the parser."""
        # The parser extends a truncated frame into the next one, which would be lost.
        begin = damaged.find(MAGIC, 1)
        if begin > 0:
            parser = self._parser
            parser.buf = bytearray(damaged[begin:]) + parser.buf[parser.buf_index :]
            parser.buf_index = 0

    def _count(self, who: tuple[int, int], sequence: int) -> None:
        if who in self._last:
            # Sequence numbers are bytes and wrap around.
            self.lost += (sequence - self._last[who] - 1) % 256
        self._last[who] = sequence


class TelemetryLog:
    """A log in the format .tlog of MAVLink's tools, written during a flight.

    Each frame follows its time, microseconds in eight bytes, big-endian. An
    interruption leaves a valid file.

    Args:
        path: The file, which is overwritten.

    Raises:
        InputError: The file cannot be written.
    """

    def __init__(self, path: str | Path):
        self.now_s = 0.0
        try:
            self._file = Path(path).open("wb")  # noqa: SIM115 - closed by the context
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written: {error.strerror or error}"
            ) from None

    def keep(self, frame: bytes) -> None:
        """Write a frame with the current time."""
        stamp = struct.pack(">Q", round(1e6 * self.now_s))
        self._file.write(stamp + frame)

    def __enter__(self) -> "TelemetryLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()


def read_address(text: str, name: str, port: int) -> Address:
    """Read an address; defaults are this machine and the usual port.

    Args:
        text: "tcp", "tcp:HOST" or "tcp:HOST:PORT", or the same with "udp".
        name: Name of the argument, for messages.
        port: Default port.

    Raises:
        InputError: The address is invalid or not loopback.
    """
    where = argument(name)
    kind, _, rest = text.partition(":")
    expected = "tcp:HOST:PORT or udp:HOST:PORT"
    if kind not in ("tcp", "udp"):
        raise InputError(f"{where}: expected {expected}, got {shown(text)}")
    whole = rest if ":" in rest else f"{rest}:{port}"
    whole = f"127.0.0.1{whole}" if whole.startswith(":") else whole
    host, number = host_and_port(whole, where, expected, got=text)
    return Address(kind, "127.0.0.1" if host == "localhost" else host, number)
