"""MAVLink 2 by pymavlink: links on loopback, messages, and an autopilot's axes.

An autopilot's axes are north, east, down, and forward, right, down for the body, with
the scalar of a quaternion first. Axes here are east, north, up, and forward, left, up,
with the scalar last.
"""

import contextlib
import functools
import os
import socket
import struct
import threading
import time
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np
from jaxtyping import Float, Num

from jblast.addresses import host_and_port
from jblast.errors import InputError, argument, needed, require, shown
from jblast.missions.route import geodetic
from jblast.observations.places import Frame

PEERS = {"mavlink": "autopilot", "ground_station": "ground station"}
"""Peer of a link, by the name of the argument with its address."""
HEARTBEAT_S = 1.0
"""Interval between two heartbeats: the protocol's rate."""
FIX = {"fix_type": 3, "satellites_visible": 12}
"""Fields of a satellite receiver: GPS_FIX_TYPE_3D_FIX, and a number of satellites that
is typical of an open sky."""


class LinkLost(Exception):
    """The peer has disconnected; the message states the reason."""


class Link:
    """Messages to and from one peer: a TCP client, or the owner of a UDP port.

    Attributes:
        address: Address: by TCP the link listens on it, by UDP it sends to it.
        now_s: Time of the messages in the log.

    Args:
        kind: "tcp" or "udp".
        where: HOST:PORT; port 0 selects a free one, by TCP.
        name: Name of the argument, for messages.
        who: MAVLink system and component of the sender.

    Raises:
        InputError: The port is in use, or pymavlink is not installed.
    """

    def __init__(self, kind: str, where: str, name: str, who: tuple[int, int]):
        self._gone = f"the {PEERS.get(name, 'peer')} has disconnected"
        self.address, self.now_s = f"{kind}:{where}", 0.0
        self._log: BinaryIO | None = None
        device = f"{'tcpin' if kind == 'tcp' else 'udpout'}:{where}"
        try:
            self._end: Any = tools().mavlink_connection(
                device, source_system=who[0], source_component=who[1], dialect="common"
            )
            if kind == "tcp":
                host, port = self._end.listen.getsockname()
                self.address = f"tcp:{host}:{port}"
            else:
                # A connected socket reports that nobody listens at the address.
                self._end.port.connect(self._end.destination_addr)
        except OSError as error:
            raise InputError(
                f"{argument(name)}: expected a free port of this machine, got "
                f"{self.address}, which is in use or not available ({error.strerror})"
            ) from None

    @property
    def connected(self) -> bool:
        """True if there is a peer to send to; a waiting TCP client is accepted."""
        if self.address.startswith("tcp"):
            self._end.recv(0)
        return self._end.port is not None

    @property
    def lost(self) -> int:
        """Number of missing messages, by the sender's count."""
        return self._end.mav_loss

    @property
    def damaged(self) -> int:
        """Number of messages with a wrong checksum."""
        return self._end.mav.total_receive_errors

    def keep(self, path: str) -> None:
        """Write all messages to a file, in the format of MAVLink's tools (.tlog).

        Raises:
            InputError: The file cannot be written.
        """
        try:
            self._log = open(path, "wb")  # noqa: SIM115 - closed with the link
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written: {error.strerror or error}"
            ) from None

    def send(self, *messages: Any) -> None:
        """Send messages in one write, so that the peer reads them together."""
        coder, frames = self._end.mav, []
        for message in messages:
            frames.append(message.pack(coder))
            coder.seq = (coder.seq + 1) % 256
            self._keep(frames[-1])
        self._end.write(b"".join(frames))

    def receive(self, timeout_s: float) -> Any | None:
        """Return the next message; None after the timeout.

        Raises:
            LinkLost: The peer has disconnected.
        """
        until = time.monotonic() + timeout_s
        while True:
            # First, as pymavlink passes over the error of a UDP port without an owner.
            self._check()
            message = self._end.recv_msg()
            left = until - time.monotonic()
            if message is None and (left <= 0 or not self._end.select(left)):
                return None
            if message is not None and message.get_type() != "BAD_DATA":
                self._keep(bytes(message.get_msgbuf()))
                return message

    @contextlib.contextmanager
    def beating(self, heartbeat: Any) -> Iterator[None]:
        """Send a heartbeat each second, as while programs compile."""
        ended = threading.Event()

        def beat() -> None:
            while True:
                if self.connected:
                    self.send(heartbeat)
                if ended.wait(HEARTBEAT_S):
                    return

        other = threading.Thread(target=beat, daemon=True)
        other.start()
        try:
            yield
        finally:
            ended.set()
            other.join()

    def close(self) -> None:
        """Close the link and its log."""
        self._end.close()
        if self._log is not None:
            self._log.close()

    def _check(self) -> None:
        """Raise `LinkLost` if the peer is gone; pymavlink waits for another."""
        heard = self._end.mav_count > 0
        try:
            port = self._end.port
            ended = heard if port is None else not port.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return
        except ConnectionRefusedError:
            # Before the peer listens, by UDP.
            ended = heard
        except OSError:
            ended = True
        if ended:
            raise LinkLost(self._gone)

    def _keep(self, frame: bytes) -> None:
        if self._log is not None:
            self._log.write(struct.pack(">Q", round(1e6 * self.now_s)) + frame)


@contextlib.contextmanager
def ending(service: Any) -> Iterator[None]:
    """Write the reason of the end of a service to its attribute `ended`."""
    try:
        yield
    except (LinkLost, InputError) as end:
        service.ended = str(end)
    except KeyboardInterrupt:
        service.ended = "interrupted"


def read_address(text: str, name: str, ports: dict[str, int]) -> tuple[str, str]:
    """Read an address; defaults are this machine and the usual port.

    Args:
        text: "tcp", "tcp:HOST" or "tcp:HOST:PORT", or the same with "udp".
        name: Name of the argument, for messages.
        ports: Default port by kind.

    Returns:
        "tcp" or "udp", and HOST:PORT.

    Raises:
        InputError: The address is invalid or not loopback.
    """
    kind, _, rest = text.partition(":")
    where, expected = argument(name), "tcp:HOST:PORT or udp:HOST:PORT"
    # pymavlink's links have no IPv6 addresses, which have more colons.
    require(kind in ports and rest.count(":") < 2, where, expected, shown(text))
    host, colon, port = rest.partition(":")
    whole = f"{host or '127.0.0.1'}:{port if colon else ports[kind]}"
    host, number = host_and_port(whole, where, expected, got=text)
    return kind, f"{'127.0.0.1' if host == 'localhost' else host}:{number}"


@functools.cache
def tools() -> ModuleType:
    """Import pymavlink's links, with MAVLink 2 and the messages of `common.xml`.

    Raises:
        InputError: pymavlink is not installed.
    """
    os.environ |= {"MAVLINK20": "1", "MAVLINK_DIALECT": "common"}
    found = needed(
        "pymavlink.mavutil", "mavlink", "MAVLink", "messages are packed and read"
    )
    found.set_dialect("common")  # another program may have imported it with its own
    return found


def dialect() -> ModuleType:
    """Return pymavlink's messages of `common.xml`."""
    return tools().mavlink


@functools.cache
def _zeros(name: str) -> tuple[Any, dict[str, Any]]:
    """Return the class of a message, and its fields, each of zeros."""
    kind = getattr(dialect(), f"MAVLink_{name.lower()}_message")
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    counts = zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    return kind, {
        field: b"\0" if types[field] == "char" else [0] * count if count else 0
        for field, count in counts
    }


def message(name: str, **values: Any) -> Any:
    """Return a message; missing fields are zero."""
    kind, zeros = _zeros(name)
    encoded = {
        field: value.encode("ascii", "replace") if isinstance(value, str) else value
        for field, value in values.items()
    }
    return kind(**zeros | encoded)


def answer(received: Any, name: str, **values: Any) -> Any:
    """Return a message to the sender of another one."""
    system, component = received.get_srcSystem(), received.get_srcComponent()
    return message(name, target_system=system, target_component=component, **values)


def place_fields(frame: Frame, place_m: Float[np.ndarray, "3"]) -> dict[str, int]:
    """Return latitude and longitude [1e-7 degree], and height [mm]."""
    lat, lon, alt = geodetic(frame, place_m).tolist()
    return {"lat": round(1e7 * lat), "lon": round(1e7 * lon), "alt": round(1e3 * alt)}


def named(names: Sequence[str], numbers: Num[np.ndarray, " n"]) -> dict[str, Any]:
    """Return numbers by the names of their fields."""
    return dict(zip(names, numbers.tolist(), strict=True))


def whole(names: Sequence[str], numbers: Float[np.ndarray, " n"]) -> dict[str, Any]:
    """Return numbers as signed integers of 16 bits, where larger ones would wrap."""
    return named(names, np.clip(np.round(numbers), -32_767, 32_767).astype(int))


def down(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Convert between east, north, up and north, east, down; its own inverse."""
    return vectors[..., [1, 0, 2]] * np.array([1.0, 1.0, -1.0])


def right(vectors: Float[np.ndarray, "*row 3"]) -> Float[np.ndarray, "*row 3"]:
    """Convert between forward, left, up and forward, right, down; its own inverse."""
    return vectors * np.array([1.0, -1.0, -1.0])


def scalar_first(
    quaternion: Float[np.ndarray, "*row 4"],
) -> Float[np.ndarray, "*row 4"]:
    """Return attitudes (x, y, z, w) as an autopilot's (w, x, y, z), w >= 0.

    The product of half a turn about (1, 1, 0) (world axes), the attitude, and half a
    turn about x (body axes).
    """
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    whole = np.stack([-w - z, -x - y, y - x, z - w], axis=-1) * np.sqrt(0.5)
    return np.where(whole[..., :1] < 0, -whole, whole)


def euler(attitude: Float[np.ndarray, "*row 4"]) -> Float[np.ndarray, "*row 3"]:
    """Return roll, pitch and yaw of an autopilot's attitude (w, x, y, z) [rad]."""
    w, x, y, z = np.moveaxis(attitude, -1, 0)
    return np.stack(
        [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ],
        axis=-1,
    )
