"""One stream: what comes to one entity, sent as it asks or as time goes on."""

import asyncio
import contextlib
import time
from collections.abc import Iterator
from typing import Any

from jblast.errors import InputError
from jblast.world.remote.decode import motion_of, parsed
from jblast.world.remote.encode import packet_message
from jblast.world.remote.table import Session, Table
from jblast.world.remote.wire import grpc
from jblast.world.server import (
    Announcement,
    Packet,
    PacketBuffer,
    Playback,
    ScaledRealTime,
)
from jblast.world.server.packet_buffer import CAPACITY
from jblast.world.server.playback import Wanted

STAGED_AHEAD_S = 2.0
"""In real time blasts are staged so long before they are told [s of the world]."""
CATCH_UP_S = 2.0
"""So long after a blast was staged a full buffer is waited for: the first ones compile
programs, and who takes packets is not to blame that they come all at once."""
SETTLES_S = 1.0
"""How long a write may go on of one who is dropped."""
LINGER_S = 0.05
"""Of one that was cut off gRPC says first that it has done, and then cancels."""
WAITS_FOR_NOBODY = float("inf")


@contextlib.contextmanager
def _first_error() -> Iterator[None]:
    """Have a group of tasks raise what its first one did, and not a group of it."""
    try:
        yield
    except BaseExceptionGroup as group:
        raise group.exceptions[0] from None


class Stream:
    """The stream of one client.

    Attributes:
        name: Of the entity, once it is known; "" before.
        session: That may be dropped.
    """

    def __init__(self, table: Table, context: Any):
        """Take the stream that a client opens."""
        self.name = ""
        self.session = Session(asyncio.current_task())
        self._table, self._context = table, context
        self._end = grpc().aio.EOF
        self._writing: asyncio.Future[None] | None = None
        self._staged: dict[tuple[str, int], asyncio.Task[Announcement]] = {}

    async def run(self) -> None:
        """Play back until the client has had enough, or the world ends.

        Raises:
            InputError: What the client sends cannot be used.
            BufferFull: It is too slow.
        """
        table = self._table
        ask = await self._read()
        if ask is None:
            return
        entity = table.registry.of(ask.name, ask.ticket)
        if entity.name in table.sessions:
            raise InputError(
                f"entity {entity.name!r}: expected one stream, got another"
            )
        self.name = entity.name
        table.sessions[self.name] = self.session
        world = table.world
        playback = Playback(
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
        """Send as many packets as are asked for, each time."""
        table, write = self._table, self._context.write
        while ask is not None:
            self._reported(playback, ask)
            if ask.packets > CAPACITY:
                raise InputError(
                    f"packets: expected at most {CAPACITY} at a time, got {ask.packets}"
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
        """Send packets as time goes on, while the client may say how it moves."""
        self._reported(playback, ask)
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
        """Take note of what the client reports; when it has done, it still listens."""
        while (ask := await self._read(patient=True)) is not None:
            self._reported(playback, ask)

    async def _fill(
        self,
        playback: Playback,
        clock: ScaledRealTime,
        buffer: PacketBuffer[Packet],
        filled: asyncio.Event,
    ) -> None:
        """Put each packet into the buffer as its time begins."""
        table, times = self._table, self._table.world.times
        patient_until = 0.0
        while True:
            await asyncio.sleep(clock.wait_s(playback.time_s))
            self._stage_ahead(playback)
            wanted = playback.wanted()
            packet = await self._next(playback, wanted)
            if wanted:  # perhaps that made us late, which is no fault of the client
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
        """Send what waits in the buffer, to the last."""
        while True:
            self.session.waits_since = WAITS_FOR_NOBODY
            await filled.wait()
            filled.clear()
            for packet in buffer.read():
                self.session.waits_since = time.monotonic()
                data = packet_message(packet).SerializeToString()
                self._writing = writing = asyncio.ensure_future(
                    self._context.write(data)
                )
                # a write that is broken off would leave no way to say why
                await asyncio.shield(writing)
                self._table.sent += 1
                if packet.last:
                    return

    async def settled(self) -> None:
        """Wait a moment for what is being written."""
        if self._writing is not None:
            await asyncio.wait({self._writing}, timeout=SETTLES_S)

    async def _next(self, playback: Playback, wanted: list[Wanted]) -> Packet:
        """Return the next packet, what it needs staged before."""
        staged = []
        for one in wanted:
            ahead = self._staged.pop((one.charge.name, one.revision), None)
            self.session.waits_since = WAITS_FOR_NOBODY  # it waits for us
            staged.append(await (ahead or self._table.stage(one)))
        return playback.next(staged)

    def _stage_ahead(self, playback: Playback) -> None:
        """Begin with what will be told soon."""
        for wanted in playback.soon(STAGED_AHEAD_S):
            key = wanted.charge.name, wanted.revision
            if key not in self._staged:
                self._staged[key] = asyncio.create_task(self._table.stage(wanted))

    async def _read(self, *, patient: bool = False) -> Any:
        """Return what the client asks next; None: it has done.

        Args:
            patient: Whether it may take as long as it likes.

        Raises:
            InputError: It cannot be read.
        """
        if not patient:
            self.session.waits_since = time.monotonic()
        data = await self._context.read()
        if data is self._end:
            await asyncio.sleep(LINGER_S)
            return None
        return parsed("Ask", data)

    def _reported(self, playback: Playback, ask: Any) -> None:
        if ask.HasField("motion"):
            playback.report(motion_of(ask.motion))
