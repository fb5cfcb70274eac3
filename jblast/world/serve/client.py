"""Python client: registers entities and receives their packets."""

import queue
from collections.abc import Iterator
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.world.serve.entities import Entity, Motion, NewBlast
from jblast.world.serve.messages import (
    METHODS,
    SERVICE,
    DescribeRequest,
    Request,
    World,
    decoded,
    encoded,
    grpc,
)
from jblast.world.serve.staging import Packet

CALL_TIMEOUT_S = 30.0
"""Timeout of a call with a single answer [s]; staging may compile for some seconds."""


class ServedStream:
    """Stream of packets to one entity and of its reports."""

    def __init__(self, call: Any, entity: Entity, first_packet: int):
        """Open the stream and register the entity."""
        self._requests: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._request(Request(entity, first_packet))
        # The iterator ends at the None that `close` puts into the queue.
        self._replies = call(iter(self._requests.get, None))

    def ask(self, packets: int = 1, motion: Motion | None = None) -> None:
        """Request more packets, in lockstep, and report the entity's motion.

        Args:
            packets: Number of additional packets.
            motion: Motion of the entity; None: as last reported.
        """
        self._request(Request(packets=packets, motion=motion))

    def next(self) -> Packet | None:
        """Return the next packet; None after the last.

        Raises:
            InputError: The server reported an error; the message is the server's.
        """
        try:
            packet = decoded("Packet", next(self._replies))
        except StopIteration:
            return None
        except grpc().RpcError as error:
            raise _server_error(error) from None
        if packet.force is not None:
            rows = np.reshape(packet.force.values, (-1, 6))
            packet = packet._replace(force=packet.force._replace(values=rows))
        return packet

    def packets(self, ahead: int = 1) -> Iterator[Packet]:
        """Yield all packets; in lockstep, `ahead` of them are requested in advance."""
        self.ask(ahead)
        while (packet := self.next()) is not None:
            yield packet
            self.ask()

    def close(self) -> None:
        """Close the stream and leave the world."""
        # None ends the iterator of requests, which closes this half of the stream.
        self._requests.put(None)
        if self._replies.is_active():
            for _ in self._replies:  # packets in transit
                pass

    def _request(self, request: Request) -> None:
        self._requests.put(encoded("Request", request))


class Client:
    """A client of one server."""

    def __init__(self, channel: Any):
        """Create a client on a gRPC channel, which `close` closes."""
        self._channel = channel

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the channel and all open streams."""
        self._channel.close()

    def describe(self) -> World:
        """Return the description of the world.

        Raises:
            InputError: The server is not reachable.
        """
        return self._call("Describe", DescribeRequest())

    def stream(self, entity: Entity, first_packet: int = 0) -> ServedStream:
        """Register an entity and open its stream.

        Args:
            entity: The entity, with a unique name.
            first_packet: Number of the first packet, in lockstep.
        """
        call = self._channel.stream_stream(f"/{SERVICE}/Stream")
        return ServedStream(call, entity, first_packet)

    def announce(self, blast: NewBlast) -> World:
        """Add a blast for all entities and return the description of the world.

        Raises:
            InputError: The server rejects the blast.
        """
        return self._call("Announce", blast)

    def _call(self, method: str, value: Any) -> Any:
        given, answer = METHODS[method]
        call = self._channel.unary_unary(f"/{SERVICE}/{method}")
        try:
            data = call(encoded(given, value), timeout=CALL_TIMEOUT_S)
        except grpc().RpcError as error:
            raise _server_error(error) from None
        return decoded(answer, data)


def connect(address: str) -> Client:
    """Return a client of a server.

    Args:
        address: HOST:PORT.

    Raises:
        InputError: gRPC is not installed.
    """
    rpc = grpc()
    # Packets of long records exceed gRPC's default limit of 4 MiB; the server is
    # trusted.
    options = [("grpc.max_receive_message_length", -1)]
    return Client(rpc.insecure_channel(address, options))


def _server_error(error: Any) -> InputError:
    """Return a server's message as an error."""
    return InputError(f"server: {error.details()} ({error.code().name})")
