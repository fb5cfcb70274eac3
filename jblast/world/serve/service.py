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
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

from jblast import __version__
from jblast.addresses import host_and_port
from jblast.errors import InputError, argument, require, shown
from jblast.results import Document
from jblast.scene import read_scene_or_world
from jblast.world.drawn import DrawnWorld, draw_world
from jblast.world.serve.entities import (
    SENSES,
    BlastSchedule,
    Entity,
    Knot,
    NewBlast,
    Refused,
    packet_times,
)
from jblast.world.serve.messages import (
    METHODS,
    MOST_BYTES,
    SERVICE,
    Announced,
    DescribeRequest,
    Request,
    World,
    decoded,
    encoded,
    grpc,
)
from jblast.world.serve.staging import Packet, Playback, Staged, Stager, StagingRequest

T = TypeVar("T")
ADDRESS = "127.0.0.1:50551"
MOST_ENTITIES = 10_000
"""Maximum number of simultaneous entities; declared."""
MOST_PACKETS = 256
"""Maximum number of packets per request, and of packets that a client may be behind
the wall clock: 2.56 s at 100 Hz; declared. Older data would hide a slow client."""
MAX_DROPPED = 1000
"""Number of disconnected clients that are stored and reported; bounds memory."""
STAGED_AHEAD_S = 2.0
"""Lead of staging before the announcement of a blast, with a real-time clock [s].

Staging takes milliseconds; a first compilation takes longer and may delay packets.
"""
GARBAGE_THRESHOLDS = (700, 10, 10)
"""Python's default thresholds of garbage collection, restored for the server: under
those of commands a server that runs for days would collect rarely, and its memory would
grow."""
SETTLED_S = 1.0
"""Timeout of a pending write to a client that is disconnected [s]; declared."""
CANCEL_DELAY_S = 0.05
"""Delay after the end of a stream [s]: gRPC first reports the end of a broken call and
cancels it shortly afterwards."""
COLLECT_DELAY_S = 0.1
"""Delay of the garbage collection that closes a hanging call [s]; declared.

Long enough for the event loop to process the end of the call before.
"""


@dataclass(frozen=True)
class Options:
    """Options of a server.

    Attributes:
        address: HOST:PORT; port 0 selects a free port.
        packets_hz: Packets per second of the world's time.
        lead_s: Lead of the announcement before a blast [s].
        speed: World time per real time [-]; None: lockstep.
        ends_s: End of the world [s]; infinite: never.
        patience_s: Maximum time that a client may keep the server waiting [s].

    Raises:
        InputError: An option is invalid, or the address is not loopback.
    """

    address: str = ADDRESS
    packets_hz: float = 100.0
    lead_s: float = 5.0
    speed: float | None = None
    ends_s: float = math.inf
    patience_s: float = 60.0

    def __post_init__(self) -> None:
        host_and_port(self.address, argument("address"), "HOST:PORT")
        packet_times(self.packets_hz)
        finite = 0 <= self.lead_s < math.inf
        require(finite, argument("lead_s"), "0 s or more", f"{self.lead_s:g} s")
        for name in ("speed", "ends_s", "patience_s"):
            value = getattr(self, name)
            positive = value is None or value > 0
            require(positive, argument(name), "a positive number", f"{value}")


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
        world: Blasts, air and ground.
        options: Options of the server.
        schedule: Schedule of the blasts.
        times: Times of the packets.
        stager: Computation of blasts for entities.
        streams: Open streams by name of the entity.
        sent: Number of sent packets.
        late: Number of packets completed after their end in real time.
        dropped: Disconnected clients, the latest last.
        dropped_count: Total number of disconnected clients.
        foremost_s: Time of the most advanced entity, in lockstep [s]; for information.
        closing: True while gRPC cancels all calls.
    """

    def __init__(
        self, world: DrawnWorld, options: Options, report_line: Callable[[str], object]
    ):
        """Create a server without clients.

        Args:
            world: Blasts, air and ground.
            options: Options of the server.
            report_line: Receives a line for each client that is disconnected, and for
                each blast that an entity does not receive.
        """
        self.address, self.world, self.options = options.address, world, options
        self.schedule = BlastSchedule(world, options.lead_s)
        self.times = packet_times(options.packets_hz)
        self.stager = Stager(world)
        self.streams: dict[str, Stream] = {}
        self.sent = self.late = self.dropped_count = 0
        self.dropped: deque[DroppedClient] = deque(maxlen=MAX_DROPPED)
        self.foremost_s, self.closing = 0.0, False
        self._began: float | None = None
        self._report_line, self._reported = report_line, 0
        # One thread: JAX uses all cores itself, and stagings keep their order.
        self._thread = ThreadPoolExecutor(1, "staging")

    @property
    def now_s(self) -> float:
        """Current time of the world [s]; by the wall clock, since the first client."""
        if self.options.speed is None:
            return self.foremost_s
        if self._began is None:
            return 0.0
        return (time.monotonic() - self._began) * self.options.speed

    def wait_s(self, time_s: float) -> float:
        """Return the real time until a time of the world by the wall clock [s]."""
        speed = self.options.speed or math.inf
        return max((time_s - self.now_s) / speed, 0.0)

    def enter(self, stream: "Stream", entity: Entity, first: int) -> Playback:
        """Register the entity of a stream, and return its packets.

        Raises:
            InputError: Its first packet is invalid.
            Refused: Its name is taken, or there are too many entities.
        """
        ends_s = self.options.ends_s
        if self.options.speed is not None:
            expected = "0 in real time (streams begin at the current time)"
            require(not first, "first_packet", expected, str(first))
            self._began = self._began or time.monotonic()
            first = self.times.at(self.now_s)
        begins = self.times.start_s(first) < ends_s
        expected = f"a packet before the end of the world at {ends_s:g} s"
        require(begins, "first_packet", expected, str(first))
        if entity.name in self.streams:
            taken = f"entity {shown(entity.name)}: expected another name, got that of "
            raise Refused(f"{taken}a registered entity", "ALREADY_EXISTS")
        if len(self.streams) >= MOST_ENTITIES:
            full = f"expected at most {MOST_ENTITIES:,} entities, got one more"
            raise Refused(full, "RESOURCE_EXHAUSTED")
        self.streams[entity.name] = stream
        return Playback(
            entity, self.schedule, self.times, self.stager, first=first, until_s=ends_s
        )

    def drop(self, name: str, peer: str, why: str) -> None:
        """Store and report a disconnected client."""
        self.dropped.append(DroppedClient(name, peer, why))
        self.dropped_count += 1
        self.report(f"dropped {f'{name!r} ({peer})' if name else peer}: {why}")

    def report(self, line: str) -> None:
        """Report a line, up to the number of stored disconnections."""
        if self._reported <= MAX_DROPPED:
            full = self._reported == MAX_DROPPED
            self._report_line("further lines are left out" if full else line)
        self._reported += 1

    async def stage(self, wanted: StagingRequest) -> Staged | None:
        """Stage a blast in a worker thread, so that other streams continue.

        Returns:
            The blast; None if an added blast has no waves for this entity, which has
            moved into the charge.

        Raises:
            InputError: As in `Stager.stage`, for a blast of the scene.
        """
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._thread, self.stager.stage, wanted)
        except InputError as error:
            # Another client's blast never ends a stream.
            if wanted.charge.name not in self.schedule.added:
                raise
            shot, name = shown(wanted.charge.name), shown(wanted.entity.name)
            self.report(f"blast {shot} was not sent to {name}: {error}")
            return None

    def describe(self, request: DescribeRequest) -> World:
        """Return the description of the world."""
        world, options = self.world, self.options
        return World(
            version=__version__,
            scene=world.source,
            seed=world.seed,
            packets_hz=options.packets_hz,
            lead_s=options.lead_s,
            speed=options.speed or 0.0,
            ends_s=options.ends_s,
            now_s=self.now_s,
            air=self.stager.air,
        )

    def announce(self, blast: NewBlast) -> Announced:
        """Add a blast of a client.

        Raises:
            InputError: As in `BlastSchedule.announce`.
        """
        # In lockstep each client has its own clock: acceptance depends on none of them.
        now = 0.0 if self.options.speed is None else self.now_s
        played = [one.playback for one in self.streams.values() if one.playback]
        self.schedule.announce(blast, now, [one.entity for one in played])
        missed = [one.entity.name for one in played if blast.time_s < one.time_s]
        return Announced(self.now_s, tuple(sorted(missed)))

    def close(self) -> None:
        """Shut down the worker thread."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def handler(self) -> Any:
        """Return the method handlers for `grpc.aio`."""
        rpc = grpc()
        unary = rpc.unary_unary_rpc_method_handler
        methods = {"Describe": self.describe, "Announce": self.announce}
        handlers = {name: unary(self._unary(name, m)) for name, m in methods.items()}

        async def stream(_: Any, context: Any) -> None:
            await self._stream(context)

        handlers["Stream"] = rpc.stream_stream_rpc_method_handler(stream)
        return rpc.method_handlers_generic_handler(SERVICE, handlers)

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

    async def _stream(self, context: Any) -> None:
        """Serve the stream of one client and remove its entity in any case."""
        stream = Stream(self, context)
        sending = asyncio.create_task(stream.run())
        try:
            while not sending.done():
                # One timer per stream: a timeout of each packet would double its cost.
                await asyncio.wait({sending}, timeout=min(stream.limit_s / 4, 1.0))
                stream.check()
            sending.result()
        except asyncio.CancelledError:  # by gRPC: the client cannot get a status
            if not self.closing:
                self.drop(stream.name, context.peer(), "went away")
        except InputError as error:
            self.drop(stream.name, context.peer(), str(error))
            # gRPC sends a status only after a pending write.
            stream.over = True
            await asyncio.wait({sending}, timeout=SETTLED_S)
            await _abort(context, error)
        finally:
            stream.close(sending)


async def _abort(context: Any, error: InputError) -> Any:
    """Abort a call with the status of an error; raises in gRPC and never returns."""
    status = error.status if isinstance(error, Refused) else "INVALID_ARGUMENT"
    try:
        await context.abort(getattr(grpc().StatusCode, status), str(error))
    except grpc().aio.AbortError:
        raise
    except Exception:  # the client does not read: a hanging write blocks the abort
        # Collecting the call object closes the call.
        asyncio.get_running_loop().call_later(COLLECT_DELAY_S, gc.collect)


class Stream:
    """The stream of one client: one loop for lockstep and the wall clock.

    Attributes:
        name: Name of its entity; "" before the registration.
        playback: Packets of its entity; None before the registration.
        limit_s: Maximum delay by the client [s].
        over: True if no further packet is to be sent.
    """

    def __init__(self, server: Server, context: Any):
        """Create the server's end of a stream."""
        options = server.options
        self.name, self.over = "", False
        self.playback: Playback | None = None
        self._server, self._context = server, context
        self._lockstep = options.speed is None
        # In lockstep each delay counts by itself. By the wall clock a client may take
        # as long for a packet as the packet lasts, and longer delays add up.
        self._period_s, self.limit_s = math.inf, options.patience_s
        if options.speed is not None:
            self._period_s = 1.0 / (options.packets_hz * options.speed)
            self.limit_s = MOST_PACKETS * self._period_s
        self._delay_s, self._waits_since = 0.0, math.inf
        self._until = 0
        self._reading: asyncio.Task[Request | None] | None = None
        self._staged: dict[str, asyncio.Task[Staged | None]] = {}

    async def run(self) -> None:
        """Send packets until the client closes the stream or the world ends.

        Raises:
            InputError: A message of the client is invalid.
        """
        request = await self._by_client(self._read())
        if request is None:
            return
        assert request.entity is not None
        self.name = request.entity.name
        first = request.first_packet
        self.playback = self._server.enter(self, request.entity, first)
        self._until = self.playback.number
        self._take(self.playback, request)
        while await self._granted(self.playback):
            packet = await self._packet(self.playback)
            await self._by_client(self._context.write(encoded("Packet", packet)))
            self._server.sent += 1
            if packet.last:
                return

    def check(self) -> None:
        """Reject a client that keeps the server waiting.

        Raises:
            Refused: The delay is too long.
        """
        if self._delay_s + time.monotonic() - self._waits_since > self.limit_s:
            slow = f"too slow: kept the server waiting for {self.limit_s:g} s"
            raise Refused(slow, "DEADLINE_EXCEEDED")

    def close(self, sending: asyncio.Task[None]) -> None:
        """Stop its tasks and remove its entity."""
        for task in (sending, self._reading, *self._staged.values()):
            if task is not None:
                task.cancel()
        if self.playback is not None:
            del self._server.streams[self.name]

    async def _by_client(self, action: Awaitable[T]) -> T:
        """Await an action of the client, whose duration is its delay."""
        self._waits_since = begun = time.monotonic()
        result = await action
        self._waits_since, took_s = math.inf, time.monotonic() - begun
        self._delay_s = max(self._delay_s + took_s - self._period_s, 0.0)
        return result

    async def _read(self) -> Request | None:
        """Return the next message of the client; None at the end of its stream."""
        data = await self._context.read()
        if data is grpc().aio.EOF:
            await asyncio.sleep(CANCEL_DELAY_S)
            return None
        request = decoded("Request", data)
        right = (request.entity is None) == (self.playback is not None)
        expected = "an entity in the first message only"
        got = "none" if request.entity is None else "another one"
        require(right, "request entity", expected, got)
        return request

    def _take(self, playback: Playback, request: Request) -> None:
        expected = f"at most {MOST_PACKETS} per request"
        few = request.packets <= MOST_PACKETS
        require(few, "request packets", expected, request.packets)
        self._until += request.packets
        playback.motion = request.motion or playback.motion

    async def _granted(self, playback: Playback) -> bool:
        """Process requests until a packet may be sent; False if there is none."""
        while not (self.over or (self._lockstep and playback.number < self._until)):
            if self._lockstep:
                request = await self._by_client(self._read())
            else:
                self._reading = self._reading or asyncio.create_task(self._read())
                wait_s = self._server.wait_s(playback.time_s)
                if not (await asyncio.wait({self._reading}, timeout=wait_s))[0]:
                    return True
                request, self._reading = self._reading.result(), None
            if request is None:
                return False
            self._take(playback, request)
        return not self.over

    async def _packet(self, playback: Playback) -> Packet:
        """Return the next packet after staging its blasts."""
        server = self._server
        if not self._lockstep:
            for one in playback.soon(STAGED_AHEAD_S):
                if one.charge.name not in self._staged:
                    task = asyncio.create_task(server.stage(one))
                    self._staged[one.charge.name] = task
        staged = []
        for one in playback.wanted():
            ahead = self._staged.pop(one.charge.name, None)
            staged.append(await (ahead or server.stage(one)))
        packet = playback.next([one for one in staged if one is not None])
        if self._lockstep:
            server.foremost_s = max(server.foremost_s, playback.time_s)
        else:
            server.late += server.now_s > playback.time_s
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
        InputError: As in `read_scene_or_world`, `draw_world` and `listening`.
    """
    # an address beyond this machine is refused before any work
    settings = Options(ends_s=math.inf if seconds is None else seconds, **options)
    uncertain, spec = read_scene_or_world(scene)
    world = draw_world(uncertain, spec, seed, until_s=settings.ends_s)
    # objects of the imports live to the end: they need not be visited again
    gc.freeze()
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    return asyncio.run(_serve(world, settings, report))


async def _serve(
    world: DrawnWorld, options: Options, report_line: Callable[[str], object]
) -> ServedAnswer:
    over, loop = asyncio.Event(), asyncio.get_running_loop()
    # An event instead of an exception: the server closes and the summary is returned.
    for number in (signal.SIGINT, signal.SIGTERM):
        # The event loops of Windows have no handlers of signals.
        with contextlib.suppress(NotImplementedError, ValueError):
            loop.add_signal_handler(number, over.set)
    async with listening(world, options, report_line) as server:
        count, speed = len(world.charges), options.speed
        pace = f"at {speed:g} times real time" if speed else "in lockstep"
        report_line(
            f"{world.source} with {count} blast{'' if count == 1 else 's'} on "
            f"{server.address}, {options.packets_hz:g} packets a second, {pace}"
        )
        await over.wait()
    return ServedAnswer(
        scene=world.source,
        seed=world.seed,
        address=server.address,
        blasts=len(server.schedule.charges),
        packets=server.sent,
        late=server.late,
        dropped=tuple(server.dropped),
        dropped_count=server.dropped_count,
    )


@contextlib.asynccontextmanager
async def listening(
    world: DrawnWorld, options: Options, report_line: Callable[[str], object]
) -> AsyncIterator[Server]:
    """Serve a world while the context lasts.

    Args:
        world: Blasts, air and ground.
        options: Options of the server.
        report_line: Receives a line for each client that is disconnected.

    Raises:
        InputError: The port is in use.
    """
    rpc, server = grpc(), Server(world, options, report_line)
    if options.speed is not None and world.charges:
        # In lockstep a client may wait for a compilation; in real time packets would be
        # late.
        east, north, up = (float(x) for x in world.charges[0].position_m)
        place = Knot([east + 30.0, north, max(up, 0.0) + 1.5])
        someone = Entity("x", SENSES, [place], vehicle="hummingbird")
        server.stager.stage(StagingRequest(someone, world.charges[0]))
    link = rpc.aio.server(
        options=[
            ("grpc.so_reuseport", 0),  # else a second server shares the port silently
            ("grpc.max_receive_message_length", MOST_BYTES),
            # Detects clients that vanished without closing the connection, within 30 s.
            ("grpc.keepalive_time_ms", 20_000),
            ("grpc.keepalive_timeout_ms", 10_000),
        ]
    )
    link.add_generic_rpc_handlers((server.handler(),))
    host, _, _ = options.address.rpartition(":")
    try:
        server.address = f"{host}:{link.add_insecure_port(options.address)}"
    except RuntimeError:
        raise InputError(
            f"{argument('address')}: expected a free port of this machine, got "
            f"{options.address}, which is in use or not available"
        ) from None
    await link.start()
    try:
        yield server
    finally:
        server.closing = True
        await link.stop(None)
        server.close()


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
        InputError: As in `listening`.

    Example:
        `with serving(world) as server: client = connect(server.address)`
    """
    loop = asyncio.new_event_loop()
    # A daemon thread does not keep the process alive after an error in the caller.
    thread = threading.Thread(target=loop.run_forever, name="serving", daemon=True)
    thread.start()
    server = listening(world, options or Options(), report_line)

    def run(step: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(step, loop).result()

    try:
        opened = run(server.__aenter__())
        try:
            yield opened
        finally:
            run(server.__aexit__(None, None, None))
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
