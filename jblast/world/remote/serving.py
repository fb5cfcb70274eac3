"""Server of a world: address and life cycle."""

import asyncio
import contextlib
import gc
import math
import os
import signal
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from typing import Any

from jblast.addresses import host_and_port
from jblast.errors import InputError, argument
from jblast.results import Document
from jblast.scene import read_scene_or_world
from jblast.world.drawn import DrawnWorld, draw_world
from jblast.world.remote.messages import MOST_BYTES, grpc
from jblast.world.remote.service import ServedWorld, Table, handler
from jblast.world.server import (
    BlastSchedule,
    Lockstep,
    ScaledRealTime,
    Stager,
    checked_entity,
)
from jblast.world.server.registry import SENSES, packet_times

ADDRESS = "127.0.0.1:50551"
GARBAGE_THRESHOLDS = (700, 10, 10)
"""Python's default thresholds of garbage collection, restored for the server: under
those of commands a server that runs for days would collect rarely, and its memory would
grow."""
GRACE_S = 0.5
"""Time for open streams to end once the server stops [s]; declared."""


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
    """

    address: str = ADDRESS
    packets_hz: float = 100.0
    lead_s: float = 5.0
    speed: float | None = None
    ends_s: float = math.inf
    patience_s: float = 60.0


class Serving:
    """A running server.

    Attributes:
        address: HOST:PORT of its socket.
        table: Table of its clients.
    """

    def __init__(self, address: str, table: Table):
        self.address, self.table = address, table


def checked_address(options: Options) -> tuple[str, int]:
    """Return the host (an IPv6 address in brackets) and the port.

    Raises:
        InputError: The address is invalid, or not loopback.
    """
    host, port = host_and_port(options.address, argument("address"), "HOST:PORT")
    return f"[{host}]" if ":" in host else host, port


@dataclass(frozen=True)
class DroppedClient:
    """A disconnected client.

    Attributes:
        entity: Its registered name; "" if it had none.
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
    settings = Options(ends_s=math.inf if seconds is None else seconds, **options)
    # an address beyond this machine is refused before any work
    checked_address(settings)
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
    table = server.table
    return ServedAnswer(
        scene=world.source,
        seed=world.seed,
        address=server.address,
        blasts=len(table.world.schedule.charges),
        packets=table.sent,
        late=table.late,
        dropped=tuple(DroppedClient(*one) for one in table.registry.dropped),
        dropped_count=table.registry.dropped_count,
    )


@contextlib.asynccontextmanager
async def listening(
    world: DrawnWorld, options: Options, report_line: Callable[[str], object]
) -> AsyncIterator[Serving]:
    """Serve a world while the context lasts.

    Args:
        world: Blasts, air and ground.
        options: Options of the server.
        report_line: Receives a line for each client that is disconnected.

    Raises:
        InputError: An option is invalid, or the port is in use.
    """
    rpc = grpc()
    host, port = checked_address(options)
    times = packet_times(options.packets_hz)
    _check_times(options)
    clock: Any = Lockstep()
    if options.speed is not None:
        clock = ScaledRealTime(options.speed)
    schedule = BlastSchedule(world, options.lead_s)
    served = ServedWorld(world, schedule, times, clock, options.ends_s)
    table = Table(served, options.patience_s, report_line)
    if options.speed is not None:
        # In lockstep a client may wait for a compilation; in real time packets would be
        # late.
        _compile_programs(table.stager, world)
    server = rpc.aio.server(
        options=[
            ("grpc.so_reuseport", 0),  # else a second server shares the port silently
            # Larger than `MOST_BYTES`, so that `parsed` rejects a large message with a
            # reason.
            ("grpc.max_receive_message_length", 4 * MOST_BYTES),
            # Detects clients that vanished without closing the connection, within 30 s.
            ("grpc.keepalive_time_ms", 20_000),
            ("grpc.keepalive_timeout_ms", 10_000),
        ]
    )
    server.add_generic_rpc_handlers((handler(table),))
    try:
        bound = server.add_insecure_port(f"{host}:{port}")
    except RuntimeError:
        bound = 0
    if not bound:
        table.close()
        raise InputError(
            f"{argument('address')}: expected a free port of this machine, got "
            f"{options.address}, which is in use or not available"
        )
    await server.start()
    watch = asyncio.create_task(table.watch())
    try:
        yield Serving(f"{host}:{bound}", table)
    finally:
        watch.cancel()
        await table.end()
        await server.stop(GRACE_S)
        table.close()


def _compile_programs(stager: Stager, world: DrawnWorld) -> None:
    """Compile the programs of staging, before the real-time clock starts."""
    for charge in world.charges[:1]:
        east, north, up = (float(x) for x in charge.position_m)
        place = [east + 30.0, north, max(up, 0.0) + 1.5]
        someone = checked_entity("x", SENSES, position_m=place, vehicle="hummingbird")
        stager.stage(someone, charge)


def _check_times(options: Options) -> None:
    """Reject times and speeds that are not positive."""
    for name, value in (
        ("speed", options.speed),
        ("ends_s", options.ends_s),
        ("patience_s", options.patience_s),
    ):
        if value is not None and not value > 0:
            raise InputError(
                f"{argument(name)}: expected a positive number, got {value:g}"
            )


@contextlib.contextmanager
def serving(
    world: DrawnWorld,
    options: Options | None = None,
    report_line: Callable[[str], object] = lambda line: None,
) -> Iterator[Serving]:
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
    begun: list[Serving | BaseException] = []
    ready = threading.Event()
    stop: list[Callable[[], object]] = []

    async def run() -> None:
        over = asyncio.Event()
        loop = asyncio.get_running_loop()
        stop.append(lambda: loop.call_soon_threadsafe(over.set))
        async with listening(world, options or Options(), report_line) as server:
            begun.append(server)
            ready.set()
            await over.wait()

    def work() -> None:
        try:
            asyncio.run(run())
        except BaseException as error:
            begun.append(error)
        finally:
            ready.set()

    # A daemon thread does not keep the process alive after an error in the caller.
    thread = threading.Thread(target=work, name="serving", daemon=True)
    thread.start()
    ready.wait()
    if isinstance(begun[0], BaseException):
        raise begun[0]
    try:
        yield begun[0]
    finally:
        stop[0]()
        thread.join()
