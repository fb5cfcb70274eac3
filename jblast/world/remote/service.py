"""The methods of the server. They take bytes: who sends garbage is named, too."""

import asyncio
import gc
import secrets
from collections.abc import Awaitable, Callable
from typing import Any

from jblast import __version__
from jblast.errors import InputError, shown
from jblast.world.remote.decode import (
    MOST_BYTES,
    Garbage,
    OtherProtocol,
    TooLarge,
    charge_of,
    check_protocol,
    entity_of,
    parsed,
)
from jblast.world.remote.encode import air_message
from jblast.world.remote.stream import Stream
from jblast.world.remote.table import Table
from jblast.world.remote.wire import METHODS, PROTOCOL, SERVICE, grpc, messages
from jblast.world.server import BufferFull, ScaledRealTime
from jblast.world.server.packet_buffer import CAPACITY
from jblast.world.server.registry import NameTaken, NotRegistered, WorldFull

STATUS = {
    TooLarge: "RESOURCE_EXHAUSTED",
    WorldFull: "RESOURCE_EXHAUSTED",
    NameTaken: "ALREADY_EXISTS",
    NotRegistered: "NOT_FOUND",
    OtherProtocol: "FAILED_PRECONDITION",
}
"""Of an error; of any other `INVALID_ARGUMENT`."""
SOON_S = 0.1
TOO_SLOW = f"too slow: {CAPACITY} packets waited for it, which is all that may"


def handler(table: Table, token: str) -> Any:
    """Return the methods, as `grpc.aio` asks for them.

    Args:
        table: What they share.
        token: That each call must show; "": none.
    """
    rpc = grpc()
    methods = {"Describe": _describe, "Register": _register}
    methods |= {"Announce": _announce, "Leave": _leave}
    handlers = {
        name: rpc.unary_unary_rpc_method_handler(_unary(table, token, name, method))
        for name, method in methods.items()
    }

    async def stream(_: Any, context: Any) -> None:
        await _check_token(context, token)
        await _streamed(table, context)

    handlers["Stream"] = rpc.stream_stream_rpc_method_handler(stream)
    return rpc.method_handlers_generic_handler(SERVICE, handlers)


def _unary(
    table: Table,
    token: str,
    name: str,
    method: Callable[[Table, Any, str], Any],
) -> Callable[[bytes, Any], Awaitable[bytes]]:
    """Return a method over bytes, its errors made statuses."""

    async def answered(data: bytes, context: Any) -> bytes:
        await _check_token(context, token)
        try:
            message = parsed(METHODS[name][0], data)
            return method(table, message, context.peer()).SerializeToString()
        except InputError as error:
            if isinstance(error, Garbage | TooLarge):
                table.drop("", context.peer(), str(error))
            return await _abort(context, _status_of(error), str(error))

    return answered


async def _streamed(table: Table, context: Any) -> None:
    """Play back to one client, and let go of it whatever it does."""
    stream = Stream(table, context)
    try:
        await stream.run()
    except asyncio.CancelledError:
        status, why = "DEADLINE_EXCEEDED", stream.session.why
        if table.closing:
            status = "UNAVAILABLE"
        else:
            table.drop(stream.name, context.peer(), why or "went away")
        if not why:  # there is nobody to tell, and gRPC cancels nothing but this
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
    except Exception:  # it reads nothing: a write hangs, and nothing can follow it
        asyncio.get_running_loop().call_later(SOON_S, gc.collect)  # closes its call


async def _check_token(context: Any, token: str) -> None:
    """Refuse a call that does not show the token."""
    if not token:
        return
    shows = dict(context.invocation_metadata() or ()).get("authorization", "")
    if not secrets.compare_digest(str(shows).encode(), f"Bearer {token}".encode()):
        detail = "authorization: expected 'Bearer', a blank and the token of the server"
        await _abort(context, "UNAUTHENTICATED", detail)


async def _abort(context: Any, status: str, detail: str) -> Any:
    """End a call with a status; never returns."""
    await context.abort(getattr(grpc().StatusCode, status), detail)


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
        world.clock.begin()
        if first:
            raise InputError(
                "first_packet: expected 0 in real time, where the present comes first, "
                f"got {first}"
            )
        first = world.times.at(table.now_s)
    if not world.times.start_s(first) < world.ends_s:
        raise InputError(
            f"first_packet: expected one before the world ends at {world.ends_s:g} s, "
            f"got {first}"
        )
    ticket = table.join(entity, first, peer)
    return messages().Registered(ticket=ticket, first_packet=first)


def _announce(table: Table, message: Any, peer: str) -> Any:
    now = table.now_s
    table.world.schedule.announce(charge_of(message), now)
    return messages().Announced(now_s=now)


def _leave(table: Table, message: Any, peer: str) -> Any:
    entity = table.registry.of(message.name, message.ticket)
    if entity.name in table.sessions:
        raise InputError(
            f"entity {shown(entity.name)}: expected one without a stream, got one that "
            "streams: closing that is leaving"
        )
    table.leave(entity.name)
    return messages().Left()
