"""Python client: registers entities and receives their packets.

Packets, announcements and motions have the types of `world.server`.
"""

import queue
import warnings
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, NamedTuple

from jblast.errors import InputError
from jblast.world.remote.messages import (
    METHODS,
    PROTOCOL,
    SERVICE,
    grpc,
    messages,
    packet_of,
    vector_message,
)
from jblast.world.server import Motion, Packet
from jblast.world.server.registry import SENSES

CALL_TIMEOUT_S = 30.0
"""Timeout of a call with a single answer [s]; staging may compile for some seconds."""


class Ticket(NamedTuple):
    """Registration of an entity.

    Attributes:
        name: Name of the entity.
        word: Secret token of the entity.
        first_packet: Number of its first packet.
    """

    name: str
    word: str
    first_packet: int


class ServedStream:
    """Stream of packets to one entity and of its reports; closing it leaves the world.

    Attributes:
        ticket: Ticket of the entity.
    """

    def __init__(self, call: Any, ticket: Ticket):
        """Open the stream of a registered entity."""
        self.ticket = ticket
        self._asks: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._asks.put(messages().Ask(name=ticket.name, ticket=ticket.word))
        # The iterator ends at the None that `close` puts into the queue.
        self._replies = call(iter(self._asks.get, None))

    def ask(self, packets: int = 1, motion: Motion | None = None) -> None:
        """Request more packets, in lockstep, and report the entity's motion.

        Args:
            packets: Number of additional packets.
            motion: Motion of the entity; None: as last reported.
        """
        ask = messages().Ask(packets=packets)
        if motion is not None:
            ask.motion.CopyFrom(_motion_message(motion))
        self._asks.put(ask)

    def next(self) -> Packet | None:
        """Return the next packet; None after the last.

        Raises:
            InputError: The server reported an error; the message is the server's.
        """
        try:
            return packet_of(next(self._replies))
        except StopIteration:
            return None
        except grpc().RpcError as error:
            raise _server_error(error) from None

    def packets(self, ahead: int = 1) -> Iterator[Packet]:
        """Yield all packets; in lockstep, `ahead` of them are requested in advance."""
        self.ask(ahead)
        while (packet := self.next()) is not None:
            yield packet
            self.ask()

    def close(self) -> None:
        """Close the stream and leave the world."""
        # None ends the iterator of requests, which closes this half of the stream.
        self._asks.put(None)
        if self._replies.is_active():
            for _ in self._replies:  # packets in transit
                pass


class Client:
    """A client of one server."""

    def __init__(self, channel: Any):
        """Create a client on a gRPC channel, which `close` closes."""
        self._channel = channel

    def __enter__(self) -> "Client":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the channel and all open streams."""
        self._channel.close()

    def describe(self) -> Any:
        """Return the message `World` of the server.

        Raises:
            InputError: The server rejects the call or is not reachable.
        """
        return self._ask("Describe", messages().DescribeRequest(protocol=PROTOCOL))

    def register(
        self,
        name: str,
        senses: Sequence[str],
        *,
        position_m: Sequence[float] | None = None,
        path: tuple[Sequence[float], Sequence[Sequence[float]]] | None = None,
        vehicle: str = "",
        samples_hz: float = 0.0,
        first_packet: int = 0,
    ) -> Ticket:
        """Register an entity.

        Args:
            name: Unique among entities.
            senses: Some of flash, ground, pressure, sound, force.
            position_m: East, north, up [m]; alternatively `path`.
            path: Times [s] and positions [m].
            vehicle: Vehicle model for the force.
            samples_hz: Sampling rate of pressure and sound; 0: 8000 Hz.
            first_packet: Number of the first packet, in lockstep.

        Raises:
            InputError: The server rejects the registration.
        """
        to = messages()
        for sense in senses:
            if sense not in SENSES:
                raise InputError(
                    f"senses: expected some of {', '.join(SENSES)}, got {sense!r}"
                )
        registration = to.Registration(
            protocol=PROTOCOL,
            name=name,
            senses=[SENSES.index(sense) + 1 for sense in senses],
            vehicle=vehicle,
            samples_hz=samples_hz,
            first_packet=first_packet,
        )
        if position_m is not None:
            registration.position_m.CopyFrom(vector_message(position_m))
        for time, place in zip(*(path or ((), ())), strict=True):
            registration.path.add(time_s=time, position_m=vector_message(place))
        given = self._ask("Register", registration)
        return Ticket(name, given.ticket, given.first_packet)

    def stream(self, ticket: Ticket) -> ServedStream:
        """Open the stream of a registered entity (`ServedStream`)."""
        to = messages()
        call = self._channel.stream_stream(
            f"/{SERVICE}/Stream",
            request_serializer=to.Ask.SerializeToString,
            response_deserializer=to.Packet.FromString,
        )
        return ServedStream(lambda asks: call(asks), ticket)

    def leave(self, ticket: Ticket) -> None:
        """Remove an entity that has no stream.

        Raises:
            InputError: The server rejects the call.
        """
        name, word, _ = ticket
        self._ask("Leave", messages().LeaveRequest(name=name, ticket=word))

    def announce(
        self,
        shot: str,
        time_s: float,
        position_m: Sequence[float],
        mass_kg: float,
        explosive: str = "",
    ) -> float:
        """Add a blast for all entities and return the time of the world [s].

        A warning names entities whose next packet begins after the blast: they receive
        only waves that have not arrived yet.

        Raises:
            InputError: The server rejects the blast.
        """
        new = messages().NewBlast(
            protocol=PROTOCOL,
            shot=shot,
            time_s=time_s,
            position_m=vector_message(position_m),
            mass_kg=mass_kg,
            explosive=explosive,
        )
        answer = self._ask("Announce", new)
        if answer.missed:
            warnings.warn(
                f"blast {shot!r} at {time_s:g} s: entities past this time receive only "
                f"waves that have not arrived yet: {', '.join(answer.missed)}",
                stacklevel=2,
            )
        return answer.now_s

    def _ask(self, method: str, message: Any) -> Any:
        answer = getattr(messages(), METHODS[method][1])
        call = self._channel.unary_unary(
            f"/{SERVICE}/{method}",
            request_serializer=type(message).SerializeToString,
            response_deserializer=answer.FromString,
        )
        try:
            return call(message, timeout=CALL_TIMEOUT_S)
        except grpc().RpcError as error:
            raise _server_error(error) from None


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


def _motion_message(motion: Motion) -> Any:
    to = messages()
    x, y, z, w = (float(number) for number in motion.quaternion)
    return to.Motion(
        time_s=motion.time_s,
        position_m=vector_message(motion.position_m),
        velocity_m_s=vector_message(motion.velocity_m_s),
        quaternion=to.Quaternion(x=x, y=y, z=z, w=w),
        body_rate_rad_s=vector_message(motion.body_rate_rad_s),
    )
