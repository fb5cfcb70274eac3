"""Server of a world by gRPC: methods, streams of packets, and life cycle.

gRPC is used because C++ plugins can generate their client from the `.proto` file. It
also validates messages and has bidirectional streams with flow control, which is the
only buffer between server and client.
"""

import asyncio
import contextlib
import gc
import math
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

from jblast import __version__
from jblast.errors import InputError, argument, require, shown
from jblast.results import Document
from jblast.scene import Charge, read_scene_or_world
from jblast.world.drawn import DrawnWorld, draw_world
from jblast.world.serve.entities import (
    SENSES,
    Entity,
    Knot,
    Motion,
    NewBlast,
    Options,
    Refused,
    ServedWorld,
)
from jblast.world.serve.messages import (
    METHODS,
    MOST_BYTES,
    SERVICE,
    DescribeRequest,
    Request,
    World,
    decoded,
    encoded,
    grpc,
)
from jblast.world.serve.staging import Packet, Playback, Staged, air_of, stage

T = TypeVar("T")
MOST_CALLS = 10_000
"""Maximum number of simultaneous calls and streams; declared, gRPC refuses more."""
MAX_DROPPED = 1000
"""Number of disconnected clients that are stored; bounds memory."""
STAGED_AHEAD_S = 2.0
"""Lead of staging before the announcement of a blast, with a real-time clock [s].

Staging takes 10 to 30 ms for each entity; a first compilation takes longer and may
delay packets.
"""
GARBAGE_THRESHOLDS = (700, 10, 10)
"""Python's default thresholds of garbage collection, restored for the server: under
those of commands a server that runs for days would collect rarely, and its memory would
grow."""
CANCEL_DELAY_S = 0.05
"""Delay after the end of a stream [s]: gRPC first reports the end of a broken call and
cancels it shortly afterwards."""


@dataclass(frozen=True)
class DroppedClient:
    """A disconnected client.

    Attributes:
        entity: Name of its entity; "" if it had none.
        peer: Its address.
        why: Reason for the disconnection.
    """

    entity: str
    peer: str
    why: str


@dataclass(frozen=True)
class ServedAnswer(Document):
    """The answer of `jblast serve` after the server was stopped.

    Attributes:
        scene: The scene's file.
        seed: Seed of all random draws.
        address: HOST:PORT of the server.
        blasts: Number of blasts, including those announced by clients.
        packets: Number of packets sent.
        late: Number of packets in real time that were computed too late.
        dropped: Disconnected clients, the latest 1,000.
        dropped_count: Number of disconnected clients.
    """

    scene: str
    seed: int
    address: str
    blasts: int
    packets: int
    late: int
    dropped: tuple[DroppedClient, ...]
    dropped_count: int


class Server:
    """A served world and its clients.

    Attributes:
        address: HOST:PORT of its socket.
        options: Options of the server.
        world: Blasts, air and ground, and times of packets.
        streams: Packets of each registered entity, by its name.
        sent: Number of sent packets.
        late: Number of packets completed after their end in real time.
        dropped: Disconnected clients, the latest last.
        dropped_count: Total number of disconnected clients.
        report_line: Receives a line for each client that is disconnected, and for each
            blast that an entity does not receive.
        closing: True while gRPC cancels all calls.
    """

    def __init__(
        self,
        drawn: DrawnWorld,
        options: Options,
        report_line: Callable[[str], object],
    ):
        """Create a server without clients."""
        self.address, self.options = options.address, options
        self.world, self._drawn = ServedWorld(drawn, options), drawn
        self.streams: dict[str, Playback] = {}
        self.sent = self.late = self.dropped_count = 0
        self.dropped: deque[DroppedClient] = deque(maxlen=MAX_DROPPED)
        self.report_line = report_line
        self.closing = False
        self._began: float | None = None
        # One thread: JAX uses all cores itself, and stagings keep their order.
        self._thread = ThreadPoolExecutor(1, "staging")
        self._link: Any = None

    async def open(self) -> None:
        """Open the port.

        Raises:
            InputError: The port is in use.
        """
        rpc, world = grpc(), self.world
        if self.options.speed is not None and world.charges:
            # In lockstep a client may wait for a compilation; in real time packets
            # would be late.
            east, north, up = (float(x) for x in world.charges[0].position_m)
            place = Knot([east + 30.0, north, max(up, 0.0) + 1.5])
            someone = Entity("x", SENSES, [place], vehicle="hummingbird")
            stage(world, someone, world.charges[0])
        self._link = link = rpc.aio.server(
            maximum_concurrent_rpcs=MOST_CALLS,
            options=[
                ("grpc.so_reuseport", 0),  # else a second server shares it silently
                ("grpc.max_receive_message_length", MOST_BYTES),
                # Detects clients that vanished without closing the connection, within
                # 30 s.
                ("grpc.keepalive_time_ms", 20_000),
                ("grpc.keepalive_timeout_ms", 10_000),
            ],
        )
        unary = rpc.unary_unary_rpc_method_handler
        handlers = {
            "Describe": unary(self._unary("Describe", self.describe)),
            "Announce": unary(self._unary("Announce", self.announce)),
            "Stream": rpc.stream_stream_rpc_method_handler(self._stream),
        }
        link.add_generic_rpc_handlers(
            (rpc.method_handlers_generic_handler(SERVICE, handlers),)
        )
        host, _, _ = self.options.address.rpartition(":")
        try:
            self.address = f"{host}:{link.add_insecure_port(self.options.address)}"
        except RuntimeError:
            raise InputError(
                f"{argument('address')}: expected a free port of this machine, got "
                f"{self.options.address}, which is in use or not available"
            ) from None
        await link.start()

    async def close(self) -> None:
        """Close the port and all streams."""
        self.closing = True
        if self._link is not None:
            await self._link.stop(None)
        self._thread.shutdown(wait=False, cancel_futures=True)

    @property
    def now_s(self) -> float:
        """Time of the world [s]: by the wall clock, or that of the foremost entity."""
        if self.options.speed is None:
            return max((one.time_s for one in self.streams.values()), default=0.0)
        if self._began is None:
            return 0.0
        return (time.monotonic() - self._began) * self.options.speed

    def enter(self, entity: Entity, first: int) -> Playback:
        """Register an entity, and return its packets.

        Raises:
            InputError: Its first packet is invalid.
            Refused: Its name is taken.
        """
        ends_s = self.options.ends_s
        if self.options.speed is not None:
            expected = "0 in real time (streams begin at the current time)"
            require(not first, "first_packet", expected, str(first))
            self._began = self._began or time.monotonic()
            first = self.world.times.at(self.now_s)
        begins = self.world.times.start_s(first) < ends_s
        expected = f"a packet before the end of the world at {ends_s:g} s"
        require(begins, "first_packet", expected, str(first))
        if entity.name in self.streams:
            taken = f"entity {shown(entity.name)}: expected another name, got that of "
            raise Refused(f"{taken}a registered entity", "ALREADY_EXISTS")
        self.streams[entity.name] = playback = Playback(entity, self.world, first)
        return playback

    def drop(self, name: str, peer: str, why: str) -> None:
        """Store and report a disconnected client."""
        self.dropped.append(DroppedClient(name, peer, why))
        self.dropped_count += 1
        self.report_line(f"dropped {f'{name!r} ({peer})' if name else peer}: {why}")

    async def stage(
        self, entity: Entity, charge: Charge, motion: Motion | None
    ) -> Staged | None:
        """Stage a blast in a worker thread, so that other streams continue.

        Returns:
            The blast; None if an added blast has no waves for this entity, which is in
            the charge.

        Raises:
            InputError: As in `staging.stage`, for a blast of the scene.
        """
        loop, work = asyncio.get_running_loop(), (self.world, entity, charge, motion)
        try:
            return await loop.run_in_executor(self._thread, stage, *work)
        except InputError as error:
            # Another client's blast never ends a stream.
            if charge.name not in self.world.added:
                raise
            shot, name = shown(charge.name), shown(entity.name)
            self.report_line(f"blast {shot} was not sent to {name}: {error}")
            return None

    def describe(self, request: DescribeRequest) -> World:
        """Return the description of the world."""
        options = self.options
        return World(
            version=__version__,
            scene=self._drawn.source,
            seed=self._drawn.seed,
            packets_hz=options.packets_hz,
            lead_s=options.lead_s,
            speed=options.speed or 0.0,
            ends_s=options.ends_s,
            now_s=self.now_s,
            air=air_of(self.world.scene),
        )

    def announce(self, blast: NewBlast) -> World:
        """Add a blast of a client, and return the description of the world.

        Raises:
            InputError: As in `ServedWorld.announce`.
        """
        # In lockstep each client has its own clock: acceptance depends on none of them.
        self.world.announce(blast, 0.0 if self.options.speed is None else self.now_s)
        return self.describe(DescribeRequest())

    def _unary(
        self, name: str, method: Callable[[Any], Any]
    ) -> Callable[[bytes, Any], Awaitable[bytes]]:
        """Return a method from bytes to bytes that converts errors to statuses."""
        given, answer = METHODS[name]

        async def answered(data: bytes, context: Any) -> bytes:
            try:
                return encoded(answer, method(decoded(given, data)))
            except InputError as error:
                return await _abort(context, error)

        return answered

    async def _stream(self, _: Any, context: Any) -> None:
        """Serve the stream of one client and remove its entity in any case."""
        stream, why = Stream(self, context), None
        try:
            await stream.run()
        # By gRPC, which may end a write first: the client cannot get a status.
        except (asyncio.CancelledError, grpc().aio.BaseError):
            if not self.closing:
                self.drop(stream.name, context.peer(), "went away")
        except InputError as error:
            self.drop(stream.name, context.peer(), str(error))
            why = error
        finally:
            stream.close()
        if why is not None:
            # gRPC sends the status after a pending write, so maybe never.
            await _abort(context, why)


async def _abort(context: Any, error: InputError) -> Any:
    """Abort a call with the status of an error; raises in gRPC and never returns."""
    status = error.status if isinstance(error, Refused) else "INVALID_ARGUMENT"
    await context.abort(getattr(grpc().StatusCode, status), str(error))


class Stream:
    """The stream of one client: one loop for lockstep and the wall clock.

    Attributes:
        name: Name of its entity; "" before the registration.
    """

    def __init__(self, server: Server, context: Any):
        """Create the server's end of a stream."""
        self.name = ""
        self._server, self._context, self._until = server, context, 0
        self._playback: Playback | None = None
        self._reading: asyncio.Task[Request | None] | None = None
        self._staged: dict[str, asyncio.Task[Staged | None]] = {}

    async def run(self) -> None:
        """Send packets until the client closes the stream or the world ends.

        Raises:
            InputError: A message of the client is invalid, or it is too slow.
        """
        request = await self._by_client(self._read())
        if request is None:
            return
        assert request.entity is not None
        playback = self._server.enter(request.entity, request.first_packet)
        self.name, self._playback = request.entity.name, playback
        self._until = playback.number
        self._take(playback, request)
        last = False
        while not last and await self._granted(playback):
            packet = await self._packet(playback)
            await self._by_client(self._context.write(encoded("Packet", packet)))
            self._server.sent += 1
            last = packet.last

    def close(self) -> None:
        """Stop its tasks and remove its entity."""
        for task in (self._reading, *self._staged.values()):
            if task is not None:
                task.cancel()
        if self._playback is not None:
            del self._server.streams[self.name]

    async def _by_client(self, action: Awaitable[T]) -> T:
        """Await an action of the client.

        Raises:
            Refused: It takes too long.
        """
        patience_s = self._server.options.patience_s
        try:
            async with asyncio.timeout(patience_s):
                return await action
        except TimeoutError:
            slow = f"too slow: kept the server waiting for {patience_s:g} s"
            raise Refused(slow, "DEADLINE_EXCEEDED") from None

    async def _read(self) -> Request | None:
        """Return the next message of the client; None at the end of its stream."""
        data = await self._context.read()
        if data is grpc().aio.EOF:
            await asyncio.sleep(CANCEL_DELAY_S)
            return None
        request = decoded("Request", data)
        right = (request.entity is None) == (self._playback is not None)
        expected = "an entity in the first message only"
        got = "none" if request.entity is None else "another one"
        require(right, "request entity", expected, got)
        return request

    def _take(self, playback: Playback, request: Request) -> None:
        self._until += request.packets
        playback.motion = request.motion or playback.motion

    async def _granted(self, playback: Playback) -> bool:
        """Process requests until a packet may be sent; False if there is none."""
        server, speed = self._server, self._server.options.speed
        while speed or playback.number >= self._until:
            if speed:
                self._reading = self._reading or asyncio.create_task(self._read())
                wait_s = max((playback.time_s - server.now_s) / speed, 0.0)
                if not (await asyncio.wait({self._reading}, timeout=wait_s))[0]:
                    break
                request, self._reading = self._reading.result(), None
            else:
                request = await self._by_client(self._read())
            if request is None:
                return False
            self._take(playback, request)
        return True

    async def _packet(self, playback: Playback) -> Packet:
        """Return the next packet after staging its blasts."""
        server, speed = self._server, self._server.options.speed
        entity, motion = playback.entity, playback.motion
        for charge in playback.soon(STAGED_AHEAD_S) if speed else ():
            if charge.name not in self._staged:
                task = asyncio.create_task(server.stage(entity, charge, motion))
                self._staged[charge.name] = task
        staged = [
            await (
                self._staged.pop(charge.name, None)
                or server.stage(entity, charge, motion)
            )
            for charge in playback.wanted()
        ]
        packet = playback.next([one for one in staged if one is not None])
        server.late += speed is not None and server.now_s > playback.time_s
        return packet


def serve_world(
    scene: str | os.PathLike[str],
    *,
    seconds: float | None = None,
    seed: int = 0,
    report: Callable[[str], object] = lambda line: None,
    **options: Any,
) -> ServedAnswer:
    """Serve the world of a scene until SIGINT or SIGTERM, and return a summary.

    Args:
        scene: Scene file.
        seconds: Duration of the world; None: unlimited.
        seed: Seed of all random draws.
        report: Receives a line when clients can connect, and for each client that is
            disconnected.
        options: Options of the server, by field of `Options`.

    Raises:
        InputError: As in `Options`, `read_scene_or_world`, `draw_world` and `serving`.
    """
    # an address beyond this machine is refused before any work
    settings = Options(ends_s=math.inf if seconds is None else seconds, **options)
    uncertain, spec = read_scene_or_world(scene)
    world = draw_world(uncertain, spec, seed, until_s=settings.ends_s)
    # objects of the imports live to the end: they need not be visited again
    gc.freeze()
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    over = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: over.set())
    with serving(world, settings, report) as server:
        count, speed = len(world.charges), settings.speed
        pace = f"at {speed:g} times real time" if speed else "in lockstep"
        report(
            f"{world.source} with {count} blast{'' if count == 1 else 's'} on "
            f"{server.address}, {settings.packets_hz:g} packets a second, {pace}"
        )
        over.wait()
    return ServedAnswer(
        scene=world.source,
        seed=world.seed,
        address=server.address,
        blasts=len(server.world.charges),
        packets=server.sent,
        late=server.late,
        dropped=tuple(server.dropped),
        dropped_count=server.dropped_count,
    )


@contextlib.contextmanager
def serving(
    world: DrawnWorld,
    options: Options | None = None,
    report_line: Callable[[str], object] = lambda line: None,
) -> Iterator[Server]:
    """Serve a world in a thread of this process while the context lasts.

    Args:
        world: Blasts, air and ground.
        options: Options of the server; None: the defaults.
        report_line: Receives a line for each client that is disconnected.

    Raises:
        InputError: As in `Server.open`.

    Example:
        `with serving(world) as server: client = connect(server.address)`
    """
    loop = asyncio.new_event_loop()
    # A daemon thread does not keep the process alive after an error in the caller.
    thread = threading.Thread(target=loop.run_forever, name="serving", daemon=True)
    thread.start()

    def run(step: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(step, loop).result()

    server = Server(world, options or Options(), report_line)
    try:
        run(server.open())
        yield server
    finally:
        run(server.close())
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
