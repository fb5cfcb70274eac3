"""A world for tests of who takes part in it: a few blasts, near in time."""

import functools
from typing import Any

from jblast.scene.reader import world_from_document
from jblast.world import DrawnWorld, draw_world
from jblast.world.serve import Options, Packet, Playback, ServedWorld, packets_of

LEAD_S = 0.5
ENDS_S = 2.0
HERE = [30.0, 2.0, 1.5]
RANDOM = {"count": 2, "gap_s": 0.4, "time_s": {"uniform": [0.2, 1.4]}}
REGION = {"region_m": {"ring": [10, 20]}, "mass_kg": {"uniform": [5, 15]}}
WORLD = {"world": RANDOM | REGION}


def world(seed: int = 1, **tables: Any) -> DrawnWorld:
    """Return the world."""
    return draw_world(*world_from_document(WORLD | tables, "w.toml"), seed)


@functools.cache
def served(**options: Any) -> ServedWorld:
    """Return the world with 100 packets a second; nobody may add blasts to it."""
    usual: dict[str, Any] = {"lead_s": LEAD_S, "ends_s": ENDS_S}
    return ServedWorld(world(), Options(**(usual | options)))


def playback(entity: Any, first: int = 0) -> Playback:
    """Return the packets of an entity."""
    return Playback(entity, served(), first)


def step(played: Playback) -> Packet:
    """Return the next packet, staged in this process."""
    return next(packets_of(played))
