"""What the methods of a server share: the world, who takes part, who is dropped."""

import asyncio
import functools
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

from jblast.world.drawn import DrawnWorld
from jblast.world.server import (
    Announcement,
    BlastSchedule,
    Entity,
    Lockstep,
    PacketTimes,
    Registry,
    Stager,
)
from jblast.world.server.clock import Clock
from jblast.world.server.playback import Wanted


class ServedWorld(NamedTuple):
    """What is served.

    Attributes:
        drawn: Its blasts, air and ground.
        schedule: Of the blasts.
        times: Of packets.
        clock: How time goes on.
        ends_s: When it ends; infinite: never [s].
    """

    drawn: DrawnWorld
    schedule: BlastSchedule
    times: PacketTimes
    clock: Clock
    ends_s: float

    @property
    def lockstep(self) -> bool:
        """Whether time goes on as clients ask."""
        return isinstance(self.clock, Lockstep)


class Joined(NamedTuple):
    """One who registered.

    Attributes:
        since: When, by the clock of the machine [s].
        first: Number of its first packet.
        peer: Where it speaks from.
    """

    since: float
    first: int
    peer: str


class Session:
    """A stream that is open.

    Attributes:
        task: That plays it back.
        waits_since: Since when it waits for its client, by the clock of the machine.
        why: What it is dropped for; "" while it is not.
    """

    def __init__(self, task: "asyncio.Task[object] | None"):
        self.task = task
        self.waits_since = time.monotonic()
        self.why = ""


class Table:
    """Who takes part in a world that is served, and how far it has come.

    Attributes:
        world: The world.
        registry: Who takes part, and who was dropped.
        sessions: Streams that are open, by name.
        sent: Packets that were sent.
        late: Of those in real time, how many were made after their time was over.
        closing: Whether the server stops, and cancels all that goes on.
        foremost_s: In lockstep, how far the foremost entity has come [s].
    """

    def __init__(
        self,
        world: ServedWorld,
        patience_s: float,
        say: Callable[[str], object],
    ):
        """Begin with nobody.

        Args:
            world: What is served.
            patience_s: How long a client may keep the server waiting [s].
            say: Is told a line of each who is dropped.
        """
        self.world = world
        self.registry = Registry()
        self.sessions: dict[str, Session] = {}
        self.sent = self.late = 0
        self.foremost_s = 0.0
        self.closing = False
        self.stager = Stager(world.drawn)
        self._patience_s, self._say = patience_s, say
        self._joined: dict[str, Joined] = {}
        self._thread = ThreadPoolExecutor(1, "staging")

    @property
    def now_s(self) -> float:
        """How far the world has come [s]."""
        clock = self.world.clock
        if isinstance(clock, Lockstep):
            return self.foremost_s
        return max(clock.world_s(), 0.0)

    def join(self, entity: Entity, first: int, peer: str) -> str:
        """Let an entity in; return its ticket.

        Raises:
            InputError: As in `Registry.register`.
        """
        ticket = self.registry.register(entity).ticket
        self._joined[entity.name] = Joined(time.monotonic(), first, peer)
        return ticket

    def first_packet(self, name: str) -> int:
        """Return where the packets of one who joined begin."""
        return self._joined[name].first

    def leave(self, name: str) -> None:
        """Let go of one who goes as it should."""
        self._joined.pop(name, None)
        self.registry.leave(name)

    def drop(self, name: str, peer: str, why: str) -> None:
        """Let go of one who does not, and say so."""
        self._joined.pop(name, None)
        self.registry.drop(name, peer, why)
        who = f"{name!r} ({peer})" if name else peer
        self._say(f"dropped {who}: {why}")

    async def stage(self, wanted: Wanted) -> Announcement:
        """Stage a blast in the thread that does it: others are played back meanwhile.

        Raises:
            InputError: As in `Stager.stage`.
        """
        loop = asyncio.get_running_loop()
        call = functools.partial(self.stager.stage, *wanted)
        return await loop.run_in_executor(self._thread, call)

    async def watch(self) -> None:
        """Drop those who keep the server waiting; for ever."""
        patience = self._patience_s
        while True:
            await asyncio.sleep(min(patience / 4, 1.0))
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
        """End the streams that are open, each of which is told."""
        self.closing = True
        for session in self.sessions.values():
            if not session.why and session.task:
                session.why = "the server stops"
                session.task.cancel()
        for _ in range(100):
            if not self.sessions:
                return
            await asyncio.sleep(0.01)

    def close(self) -> None:
        """Let go of the thread that stages."""
        self._thread.shutdown(wait=False, cancel_futures=True)
