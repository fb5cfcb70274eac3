"""A link that MAVLink is spoken over: one peer, by TCP or UDP, on this machine."""

import select
import socket
import time
from collections import deque
from collections.abc import Callable

from jblast.autopilot.mavlink.address import Address
from jblast.autopilot.mavlink.wire import Message, Receiver
from jblast.errors import InputError, argument


class LinkLost(Exception):
    """The peer has gone; the message says how."""


class Link:
    """Messages to and from one peer.

    By TCP it listens and takes the first who comes; by UDP it sends to the address, and
    what comes from there is the peer's; or, where it is to listen, whoever speaks first
    is.

    Attributes:
        address: Where it listens, or sends to.
        receiver: What came, and what was lost of it.
        keep: Is given each frame that goes out or came in.

    Args:
        address: Where.
        name: Of the argument, for messages.
        listens: Whether a UDP peer speaks first.
        keep: As above; may be set later.

    Raises:
        InputError: The port is taken.
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
        self._waiting: deque[Message] = deque()
        self._peer: socket.socket | None = None
        self._heard_from: object = None
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        kind = socket.SOCK_STREAM if address.kind == "tcp" else socket.SOCK_DGRAM
        self._listens = listens or address.kind == "tcp"
        self._socket = socket.socket(family, kind)
        try:
            if address.kind == "tcp":
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
                f", which is taken or cannot be listened on ({error.strerror})"
            ) from None
        self.address = address

    @property
    def connected(self) -> bool:
        """Whether there is somebody to send to."""
        return self._peer is not None and (
            self.address.kind == "tcp"
            or not self._listens
            or self._heard_from is not None
        )

    def accept(self, timeout_s: float) -> bool:
        """Wait for a peer by TCP; return whether one has come."""
        if self._peer is None and self._ready(self._socket, timeout_s):
            self._peer, _ = self._socket.accept()
            self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._peer is not None

    def send(self, *frames: bytes) -> None:
        """Send some frames.

        Raises:
            LinkLost: The peer has gone.
        """
        if self._peer is None:
            raise LinkLost("nobody has connected")
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
                raise LinkLost("nobody listens there any more") from None
        except OSError as error:
            raise LinkLost(error.strerror or str(error)) from None

    def receive(self, timeout_s: float) -> Message | None:
        """Return the next message; None where none comes in time.

        Raises:
            LinkLost: The peer has gone.
            InputError: It speaks MAVLink 1.
        """
        until = time.monotonic() + timeout_s
        while not self._waiting:
            left = until - time.monotonic()
            if self._peer is None or not self._ready(self._peer, max(left, 0.0)):
                return None
            self._take()
        return self._waiting.popleft()

    def _take(self) -> None:
        """Take in what has come."""
        peer = self._peer
        if peer is None:
            return
        try:
            if self.address.kind == "tcp":
                data = peer.recv(65536)
                if not data:
                    raise LinkLost("the connection was closed")
            else:
                data, who = peer.recvfrom(65536)
                if self._heard_from is None:
                    self._heard_from = who
                if who != self._heard_from:
                    return
        except ConnectionRefusedError:
            if self.receiver.heard:
                raise LinkLost("nobody listens there any more") from None
            return
        except OSError as error:
            raise LinkLost(error.strerror or str(error)) from None
        for message in self.receiver.feed(data):
            self.keep(message.frame)
            self._waiting.append(message)

    def close(self) -> None:
        """Hang up."""
        if self._peer is not None:
            self._peer.close()
        self._socket.close()

    @staticmethod
    def _ready(one: socket.socket, timeout_s: float) -> bool:
        return bool(select.select([one], [], [], timeout_s)[0])
