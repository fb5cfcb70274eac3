"""What `jblast serve` says: where it listens, and in the end what came of it."""

from dataclasses import asdict, dataclass
from typing import Any

from jblast.world import DrawnWorld
from jblast.world.remote.serving import Options, Serving


@dataclass(frozen=True)
class DroppedClient:
    """A client that was dropped.

    Attributes:
        entity: Name it had registered; "" if it had not.
        peer: Where it spoke from.
        why: What it did.
    """

    entity: str
    peer: str
    why: str


@dataclass(frozen=True)
class ServedAnswer:
    """What came of a server, when it was stopped.

    Attributes:
        scene: The scene's file.
        seed: Of all that is drawn.
        address: HOST:PORT that it listened on.
        blasts: Of the world, with those that clients announced.
        packets: That were sent.
        late: Packets in real time that were made after their time was over.
        dropped: Clients that were dropped, the latest 1,000.
        dropped_count: How many were dropped.
    """

    scene: str
    seed: int
    address: str
    blasts: int
    packets: int
    late: int
    dropped: tuple[DroppedClient, ...]
    dropped_count: int


def served_answer(server: Serving) -> ServedAnswer:
    """Return what came of a server."""
    table = server.table
    return ServedAnswer(
        scene=table.world.drawn.source,
        seed=table.world.drawn.seed,
        address=server.address,
        blasts=len(table.world.schedule.charges),
        packets=table.sent,
        late=table.late,
        dropped=tuple(DroppedClient(*one) for one in table.registry.dropped),
        dropped_count=table.registry.dropped_count,
    )


def serving_line(world: DrawnWorld, address: str, options: Options) -> str:
    """Return what is said once clients may come."""
    count = len(world.charges)
    pace = "in lockstep"
    if options.speed is not None:
        pace = f"at {options.speed:g} times real time"
    return (
        f"{world.source} with {count} blast{'' if count == 1 else 's'} on {address}, "
        f"{options.packets_hz:g} packets a second, {pace}"
    )


def served_document(answer: ServedAnswer) -> dict[str, Any]:
    """Return what `--json` prints."""
    return {"schema": 1} | asdict(answer)


def served_text(answer: ServedAnswer) -> str:
    """Return the same for a terminal."""
    lines = [f"{answer.packets:,} packets sent, {answer.late:,} of them late"]
    lines += [f"dropped {one.entity or one.peer}: {one.why}" for one in answer.dropped]
    return "\n".join(lines) + "\n"
