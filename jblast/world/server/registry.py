"""Who takes part in a world, by name; and who did until it was dropped."""

import secrets
from collections import deque
from typing import NamedTuple

from jblast.errors import InputError, shown
from jblast.world.server.entity import Entity

MOST_ENTITIES = 10_000
REMEMBERED = 1000
"""Of those who were dropped so many are remembered, the latest."""


class NameTaken(InputError):
    """There is an entity of this name already."""


class WorldFull(InputError):
    """There are as many entities as fit."""


class NotRegistered(InputError):
    """Nobody of this name and ticket takes part."""


class Registered(NamedTuple):
    """An entity and what it shows that it is the one that registered.

    Attributes:
        entity: The entity.
        ticket: A word that none but it was told.
    """

    entity: Entity
    ticket: str


class Dropped(NamedTuple):
    """One who was dropped.

    Attributes:
        name: Of the entity; "" if it had not said.
        peer: Where it spoke from.
        why: What it did.
    """

    name: str
    peer: str
    why: str


class Registry:
    """Entities by name.

    Attributes:
        dropped: Those who were dropped, the latest last.
        dropped_count: How many in all.
    """

    def __init__(self, most: int = MOST_ENTITIES):
        """Begin with nobody."""
        self._most = most
        self._by_name: dict[str, Registered] = {}
        self.dropped: deque[Dropped] = deque(maxlen=REMEMBERED)
        self.dropped_count = 0

    def __len__(self) -> int:
        return len(self._by_name)

    def __contains__(self, name: str) -> bool:
        return name in self._by_name

    def register(self, entity: Entity) -> Registered:
        """Let an entity take part.

        Raises:
            NameTaken: Another has its name.
            WorldFull: There is no room.
        """
        if entity.name in self._by_name:
            raise NameTaken(
                f"entity {shown(entity.name)}: expected another name, got that of one "
                "who takes part already"
            )
        if len(self) >= self._most:
            raise WorldFull(f"expected at most {self._most:,} entities, got one more")
        registered = Registered(entity, secrets.token_hex(8))
        self._by_name[entity.name] = registered
        return registered

    def of(self, name: str, ticket: str) -> Entity:
        """Return the entity that shows its ticket.

        Raises:
            NotRegistered: There is none.
        """
        found = self._by_name.get(name)
        if found is None or not secrets.compare_digest(
            found.ticket.encode(), ticket.encode()
        ):
            raise NotRegistered(
                f"entity {shown(name)}: expected one that takes part, and its ticket; "
                f"got {'no such' if found is None else 'another ticket'}"
            )
        return found.entity

    def leave(self, name: str) -> None:
        """Let go of an entity; its name is free again."""
        self._by_name.pop(name, None)

    def drop(self, name: str, peer: str, why: str) -> Dropped:
        """Let go of one who misbehaves, and remember it."""
        self.leave(name)
        gone = Dropped(name, peer, why)
        self.dropped.append(gone)
        self.dropped_count += 1
        return gone
