"""The methods of the server, and the stream of packets to one entity."""

import asyncio
import contextlib
import functools
import gc
import time
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

from jblast import __version__
from jblast.errors import InputError, shown
from jblast.world.drawn import DrawnWorld
from jblast.world.remote.messages import (
    METHODS,
    MOST_BYTES,
    PROTOCOL,
    SERVICE,
    InvalidMessage,
    OtherProtocol,
    TooLarge,
    air_message,
    charge_of,
    check_protocol,
    entity_of,
    grpc,
    messages,
    motion_of,
    packet_message,
    parsed,
)
from jblast.world.server import (
    Announcement,
    BlastSchedule,
    BufferFull,
    Entity,
    Lockstep,
    Packet,
    PacketBuffer,
    PacketTimes,
    Playback,
    Registry,
    ScaledRealTime,
    Stager,
)
from jblast.world.server.playback import StagingRequest
from jblast.world.server.registry import (
    CAPACITY,
    MAX_DROPPED,
    Clock,
    NameTaken,
    NotRegistered,
    WorldFull,
)

STATUS = {
    TooLarge: "RESOURCE_EXHAUSTED",
    WorldFull: "RESOURCE_EXHAUSTED",
    NameTaken: "ALREADY_EXISTS",
    NotRegistered: "NOT_FOUND",
    OtherProtocol: "FAILED_PRECONDITION",
}
"""gRPC status by type of error; all others have `INVALID_ARGUMENT`."""
COLLECT_DELAY_S = 0.1
"""Delay of the garbage collection that closes a hanging call [s]; declared.

Long enough for the event loop to process the end of the call before.
"""
TOO_SLOW = f"too slow: {CAPACITY} packets are waiting, the maximum"


async def _abort(context: Any, status: str, detail: str) -> Any:
    """Abort a call with a status; raises in gRPC and never returns."""
    await context.abort(getattr(grpc().StatusCode, status), detail)


STAGED_AHEAD_S = 2.0
"""Lead of staging before the announcement of a blast, with a real-time clock [s].

Staging takes milliseconds; a first compilation takes longer and may delay packets.
"""
CATCH_UP_S = 2.0
"""Time after staging in which a full buffer is accepted [s of real time].

The first blasts compile programs; afterwards their packets arrive all together.
"""
WRITE_TIMEOUT_S = 1.0
"""Timeout of a pending write to a client that is disconnected [s]; declared."""
CANCEL_DELAY_S = 0.05
"""Delay after the end of a stream [s]: gRPC first reports the end of a broken call and
cancels it shortly afterwards."""
NOT_WAITING = float("inf")


class ServedWorld(NamedTuple):
    """A served world and its options.

    Attributes:
        drawn: Blasts, air and ground.
        schedule: Schedule of the blasts.
        times: Times of the packets.
        clock: Clock of the world.
        ends_s: End of the world [s]; infinite: never.
    """

    drawn: DrawnWorld
    schedule: BlastSchedule
    times: PacketTimes
    clock: Clock
    ends_s: float

    @property
    def lockstep(self) -> bool:
        """True if time advances with the clients' requests."""
        return isinstance(self.clock, Lockstep)


class Table:
    """The clients of a served world, and its progress.

    Attributes:
        world: The world.
        registry: Registered entities and disconnected clients.
        sessions: Open streams by name.
        sent: Number of sent packets.
        late: Number of packets completed after their end in real time.
        closing: True while the server stops and cancels all calls.
        foremost_s: Time of the most advanced entity, in lockstep [s]; for information.
    """

    def __init__(
        self,
        world: ServedWorld,
        patience_s: float,
        report_line: Callable[[str], object],
    ):
        """Create a table without clients.

        Args:
            world: The served world.
            patience_s: Maximum time that a client may keep the server waiting [s].
            report_line: Receives a line for each client that is disconnected, and for
                each blast that an entity does not receive.
        """
        self.world = world
        self.registry = Registry()
        self.sessions: dict[str, Session] = {}
        self.sent = self.late = 0
        self.foremost_s = 0.0
        self.closing = False
        self.stager = Stager(world.drawn)
        self._patience_s, self._report_line = patience_s, report_line
        self._joined: dict[str, Joined] = {}
        self._reported = 0
        # One thread: JAX uses all cores itself, and stagings keep their order.
        self._thread = ThreadPoolExecutor(1, "staging")

    @property
    def now_s(self) -> float:
        """Current time of the world [s]."""
        clock = self.world.clock
        if isinstance(clock, Lockstep):
            return self.foremost_s
        return max(clock.world_s(), 0.0)

    def join(self, entity: Entity, first: int, peer: str) -> str:
        """Register an entity and return its ticket.

        Raises:
            InputError: As in `Registry.register`.
        """
        ticket = self.registry.register(entity).ticket
        self._joined[entity.name] = Joined(time.monotonic(), first, peer)
        return ticket

    def first_packet(self, name: str) -> int:
        """Return the first packet of a registered entity."""
        return self._joined[name].first

    def leave(self, name: str) -> None:
        """Remove a client that leaves by itself."""
        self._joined.pop(name, None)
        self.registry.leave(name)

    def drop(self, name: str, peer: str, why: str) -> None:
        """Disconnect a client, with a message."""
        self._joined.pop(name, None)
        self.registry.drop(name, peer, why)
        who = f"{name!r} ({peer})" if name else peer
        self.report(f"dropped {who}: {why}")

    def report(self, line: str) -> None:
        """Report a line, up to the number of stored disconnections."""
        if self._reported <= MAX_DROPPED:
            full = self._reported == MAX_DROPPED
            self._report_line("further lines are left out" if full else line)
        self._reported += 1

    async def stage(self, wanted: StagingRequest) -> Announcement | None:
        """Stage a blast in a worker thread, so that other streams continue.

        Returns:
            The announcement; None if an added blast has no waves for this entity, which
            has moved into the charge.

        Raises:
            InputError: As in `Stager.stage`, for a blast of the scene.
        """
        loop = asyncio.get_running_loop()
        call = functools.partial(self.stager.stage, *wanted)
        try:
            return await loop.run_in_executor(self._thread, call)
        except InputError as error:
            # Another client's blast never ends a stream.
            if wanted.charge.name not in {x.name for x in self.world.schedule.added}:
                raise
            shot, name = shown(wanted.charge.name), shown(wanted.entity.name)
            self.report(f"blast {shot} was not sent to {name}: {error}")
            return None

    async def watch(self) -> None:
        """Disconnect clients that keep the server waiting, until cancelled."""
        patience = self._patience_s
        while True:
            await asyncio.sleep(min(patience / 4, 1.0))
            # The monotonic clock is not affected by adjustments of the system time.
            latest = time.monotonic() - patience
            for session in self.sessions.values():
                if session.waits_since < latest and not session.why and session.task:
                    session.why = f"kept the server waiting for {patience:g} s"
                    session.task.cancel()
            for name, joined in list(self._joined.items()):
                if name not in self.sessions and joined.since < latest:
                    why = f"registered, and opened no stream for {patience:g} s"
                    self.drop(name, joined.peer, why)

    async def end(self) -> None:
        """End the open streams, each with a message, within about a second."""
        self.closing = True
        for session in self.sessions.values():
            if not session.why and session.task:
                session.why = "the server stops"
                session.task.cancel()
        # Bounded, so that a client which does not read cannot keep the server alive.
        for _ in range(100):
            if not self.sessions:
                return
            await asyncio.sleep(0.01)

    def close(self) -> None:
        """Shut down the worker thread."""
        self._thread.shutdown(wait=False, cancel_futures=True)


def handler(table: Table) -> Any:
    """Return the method handlers for `grpc.aio`.

    Args:
        table: Shared state of all calls.
    """
    rpc = grpc()
    methods = {"Describe": _describe, "Register": _register}
    methods |= {"Announce": _announce, "Leave": _leave}
    handlers = {
        name: rpc.unary_unary_rpc_method_handler(_unary(table, name, method))
        for name, method in methods.items()
    }

    async def stream(_: Any, context: Any) -> None:
        await _streamed(table, context)

    handlers["Stream"] = rpc.stream_stream_rpc_method_handler(stream)
    return rpc.method_handlers_generic_handler(SERVICE, handlers)


def _unary(
    table: Table,
    name: str,
    method: Callable[[Table, Any, str], Any],
) -> Callable[[bytes, Any], Awaitable[bytes]]:
    """Return a method from bytes to bytes that converts errors to statuses."""

    async def answered(data: bytes, context: Any) -> bytes:
        try:
            message = parsed(METHODS[name][0], data)
            return method(table, message, context.peer()).SerializeToString()
        except InputError as error:
            # Other errors are mistakes of a valid client, which may try again.
            if isinstance(error, InvalidMessage | TooLarge):
                table.drop("", context.peer(), str(error))
            return await _abort(context, _status_of(error), str(error))

    return answered


async def _streamed(table: Table, context: Any) -> None:
    """Serve the stream of one client and remove the client in any case."""
    stream = Stream(table, context)
    try:
        await stream.run()
    except asyncio.CancelledError:
        status, why = "DEADLINE_EXCEEDED", stream.session.why
        if table.closing:
            status = "UNAVAILABLE"
        else:
            table.drop(stream.name, context.peer(), why or "went away")
        if not why:  # cancelled by gRPC: the client is gone and cannot get a status
            return
    except BufferFull:
        status, why = "RESOURCE_EXHAUSTED", TOO_SLOW
        table.drop(stream.name, context.peer(), why)
    except InputError as error:
        status, why = _status_of(error), str(error)
        table.drop(stream.name, context.peer(), why)
    else:
        table.leave(stream.name)
        return
    await stream.settled()
    try:
        await _abort(context, status, why)
    except grpc().aio.AbortError:
        raise
    except Exception:  # the client does not read: a hanging write blocks the abort
        # Collecting the call object closes the call.
        asyncio.get_running_loop().call_later(COLLECT_DELAY_S, gc.collect)


def _status_of(error: InputError) -> str:
    return STATUS.get(type(error), "INVALID_ARGUMENT")


def _describe(table: Table, message: Any, peer: str) -> Any:
    check_protocol(message.protocol)
    world = table.world
    speed = world.clock.speed if isinstance(world.clock, ScaledRealTime) else 0.0
    return messages().World(
        protocol=PROTOCOL,
        version=__version__,
        scene=world.drawn.source,
        seed=world.drawn.seed,
        packets_hz=float(world.times.rate),
        lead_s=world.schedule.lead_s,
        lockstep=world.lockstep,
        speed=speed,
        ends_s=world.ends_s,
        now_s=table.now_s,
        air=air_message(table.stager.scene),
        buffer_packets=CAPACITY,
        message_bytes=MOST_BYTES,
    )


def _register(table: Table, message: Any, peer: str) -> Any:
    entity, first = entity_of(message), message.first_packet
    world = table.world
    if isinstance(world.clock, ScaledRealTime):
        # The clock starts with the first client, so that nobody misses the first blast.
        world.clock.begin()
        if first:
            raise InputError(
                "first_packet: expected 0 in real time (streams begin at the current "
                f"time), got {first}"
            )
        first = world.times.at(table.now_s)
    if not world.times.start_s(first) < world.ends_s:
        raise InputError(
            f"first_packet: expected a packet before the end of the world at "
            f"{world.ends_s:g} s, got {first}"
        )
    ticket = table.join(entity, first, peer)
    return messages().Registered(ticket=ticket, first_packet=first)


def _announce(table: Table, message: Any, peer: str) -> Any:
    charge, world = charge_of(message), table.world
    # In lockstep each client has its own clock: acceptance depends on none of them.
    now = 0.0 if world.lockstep else table.now_s
    world.schedule.announce(charge, now, table.registry.entities())
    missed = [
        name
        for name, session in table.sessions.items()
        if session.playback is not None
        and float(charge.time_s) < session.playback.time_s
    ]
    return messages().Announced(now_s=table.now_s, missed=sorted(missed))


def _leave(table: Table, message: Any, peer: str) -> Any:
    entity = table.registry.of(message.name, message.ticket)
    if entity.name in table.sessions:
        raise InputError(
            f"entity {shown(entity.name)}: expected an entity without a stream, got "
            "one with an open stream; close the stream to leave"
        )
    table.leave(entity.name)
    return messages().Left()


@contextlib.contextmanager
def _first_error() -> Iterator[None]:
    """Raise the first error of a task group instead of an exception group."""
    try:
        yield
    except BaseExceptionGroup as group:
        raise group.exceptions[0] from None


class Stream:
    """The stream of one client.

    Attributes:
        name: Name of the entity; "" until known.
        session: Session that the table can cancel.
    """

    def __init__(self, table: Table, context: Any):
        """Create the server's end of a stream."""
        self.name = ""
        self.session = Session(asyncio.current_task())
        self._table, self._context = table, context
        self._end = grpc().aio.EOF
        self._writing: asyncio.Future[None] | None = None
        self._staged: dict[tuple[str, int], asyncio.Task[Announcement | None]] = {}

    async def run(self) -> None:
        """Send packets until the client closes the stream or the world ends.

        Raises:
            InputError: A message of the client is invalid.
            BufferFull: The client is too slow.
        """
        table = self._table
        ask = await self._read()
        if ask is None:
            return
        entity = table.registry.of(ask.name, ask.ticket)
        if entity.name in table.sessions:
            raise InputError(
                f"entity {entity.name!r}: expected one stream, got a second one"
            )
        self.name = entity.name
        table.sessions[self.name] = self.session
        world = table.world
        self.session.playback = playback = Playback(
            entity,
            world.schedule,
            world.times,
            table.stager,
            first=table.first_packet(self.name),
            until_s=world.ends_s,
        )
        try:
            if isinstance(world.clock, ScaledRealTime):
                await self._by_the_clock(playback, ask, world.clock)
            else:
                await self._as_asked(playback, ask)
        finally:
            del table.sessions[self.name]
            for task in self._staged.values():
                task.cancel()

    async def _as_asked(self, playback: Playback, ask: Any) -> None:
        """Send the requested number of packets after each request."""
        table, write = self._table, self._context.write
        while ask is not None:
            self._store_motion(playback, ask)
            if ask.packets > CAPACITY:
                raise InputError(
                    f"packets: expected at most {CAPACITY} per request, got "
                    f"{ask.packets}"
                )
            for _ in range(ask.packets):
                packet = await self._next(playback, playback.wanted())
                table.foremost_s = max(table.foremost_s, playback.time_s)
                self.session.waits_since = time.monotonic()
                await write(packet_message(packet).SerializeToString())
                table.sent += 1
                if packet.last:
                    return
            ask = await self._read()

    async def _by_the_clock(
        self, playback: Playback, ask: Any, clock: ScaledRealTime
    ) -> None:
        """Send packets in real time and accept reports of motion."""
        self._store_motion(playback, ask)
        buffer: PacketBuffer[Packet] = PacketBuffer()
        filled = asyncio.Event()
        with _first_error():
            async with asyncio.TaskGroup() as group:
                tasks = [
                    group.create_task(self._listen(playback)),
                    group.create_task(self._fill(playback, clock, buffer, filled)),
                ]
                await self._empty(buffer, filled)
                for task in tasks:
                    task.cancel()

    async def _listen(self, playback: Playback) -> None:
        """Store reports of motion until the client stops sending."""
        while (ask := await self._read(patient=True)) is not None:
            self._store_motion(playback, ask)

    async def _fill(
        self,
        playback: Playback,
        clock: ScaledRealTime,
        buffer: PacketBuffer[Packet],
        filled: asyncio.Event,
    ) -> None:
        """Put each packet into the buffer at its beginning."""
        table, times = self._table, self._table.world.times
        patient_until = 0.0
        while True:
            await asyncio.sleep(clock.wait_s(playback.time_s))
            self._stage_ahead(playback)
            wanted = playback.wanted()
            packet = await self._next(playback, wanted)
            if wanted:  # staging may delay packets without a fault of the client
                patient_until = time.monotonic() + CATCH_UP_S
            table.late += clock.world_s() > times.start_s(packet.number + 1)
            while (
                buffer.waiting == buffer.capacity and time.monotonic() < patient_until
            ):
                await asyncio.sleep(1.0 / float(times.rate))
            buffer.write(packet)
            filled.set()
            if packet.last:
                return

    async def _empty(self, buffer: PacketBuffer[Packet], filled: asyncio.Event) -> None:
        """Send the packets of the buffer, up to the last one."""
        while True:
            self.session.waits_since = NOT_WAITING
            await filled.wait()
            filled.clear()
            for packet in buffer.read():
                self.session.waits_since = time.monotonic()
                data = packet_message(packet).SerializeToString()
                self._writing = writing = asyncio.ensure_future(
                    self._context.write(data)
                )
                # A cancelled write would break the call before its status is sent.
                await asyncio.shield(writing)
                self._table.sent += 1
                if packet.last:
                    return

    async def settled(self) -> None:
        """Wait for a pending write, up to a timeout."""
        if self._writing is not None:
            await asyncio.wait({self._writing}, timeout=WRITE_TIMEOUT_S)

    async def _next(self, playback: Playback, wanted: list[StagingRequest]) -> Packet:
        """Return the next packet after staging its blasts."""
        staged = []
        for one in wanted:
            ahead = self._staged.pop((one.charge.name, one.revision), None)
            self.session.waits_since = NOT_WAITING  # the client waits for the server
            staged.append(await (ahead or self._table.stage(one)))
        return playback.next([one for one in staged if one is not None])

    def _stage_ahead(self, playback: Playback) -> None:
        """Begin to stage blasts that will be announced soon."""
        for wanted in playback.soon(STAGED_AHEAD_S):
            key = wanted.charge.name, wanted.revision
            if key not in self._staged:
                self._staged[key] = asyncio.create_task(self._table.stage(wanted))

    async def _read(self, *, patient: bool = False) -> Any:
        """Return the next message of the client; None at the end of its stream.

        Args:
            patient: Do not limit the waiting time.

        Raises:
            InputError: The message is invalid.
        """
        if not patient:
            self.session.waits_since = time.monotonic()
        data = await self._context.read()
        if data is self._end:
            await asyncio.sleep(CANCEL_DELAY_S)
            return None
        return parsed("Ask", data)

    def _store_motion(self, playback: Playback, ask: Any) -> None:
        if ask.HasField("motion"):
            playback.report(motion_of(ask.motion))


class Joined(NamedTuple):
    """A registered client.

    Attributes:
        since: Time of the registration, monotonic clock [s].
        first: Number of its first packet.
        peer: Network address.
    """

    since: float
    first: int
    peer: str


class Session:
    """An open stream.

    Attributes:
        task: Task that serves the stream.
        playback: Packets of its entity; None before the first message.
        waits_since: Time since which the server waits for the client, monotonic clock
            [s].
        why: Reason of its disconnection; "" while connected.
    """

    def __init__(self, task: "asyncio.Task[object] | None"):
        self.task = task
        self.playback: Playback | None = None
        self.waits_since = time.monotonic()
        self.why = ""
