"""A world for tests of who takes part in it: a few blasts, near in time."""

import functools
from typing import Any

from jblast.scene.reader import world_from_document
from jblast.world import DrawnWorld, draw_world
from jblast.world.serve import BlastSchedule, Packet, Playback, Stager, packet_times

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
def stager() -> Stager:
    """Return what stages the blasts of the world."""
    return Stager(world())


def playback(entity: Any, **options: Any) -> Playback:
    """Return the packets of an entity, 100 a second."""
    usual: dict[str, Any] = {"until_s": ENDS_S} | options
    schedule = usual.pop("schedule", None) or BlastSchedule(world(), LEAD_S)
    return Playback(entity, schedule, packet_times(100.0), stager(), **usual)


def step(played: Playback) -> Packet:
    """Return the next packet, staged in this process."""
    return played.next([stager().stage(wanted) for wanted in played.wanted()])
