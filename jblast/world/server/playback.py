"""What comes to one entity, packet by packet: what was staged, played back.

A blast is told in the first packet that begins within the lead before it. To one who
reports its motion it is told anew before a wave comes, by what it reported last: in
one of the `AHEAD` packets before. Until then it could come nearer no faster than sound,
so none comes unsaid. The wave that comes is that which was told last.
"""

from collections.abc import Callable, Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from jblast.scene import Charge
from jblast.waves.propagation.ambient import sound_speed_of
from jblast.world.perceived import Perceived
from jblast.world.server.blast_schedule import PAST_S, BlastSchedule
from jblast.world.server.clock import PacketTimes
from jblast.world.server.entity import Entity, Motion
from jblast.world.server.force_profiles import STEPS_HZ
from jblast.world.server.payload import Announcement, Packet, Slice
from jblast.world.server.staging import Stager

AHEAD = 2
"""Packets before a wave comes in which the last word on it is told."""
WAVES = ("flash_s", "ground_s", "air_s")


class Wanted(NamedTuple):
    """A blast that an entity is to be told of, arguments of `Stager.stage`.

    Attributes:
        entity: Who is told.
        charge: The blast.
        motion: What it reported last, or None.
        revision: How often it was told before.
    """

    entity: Entity
    charge: Charge
    motion: Motion | None
    revision: int


class _Live:
    """A blast that was told and is not over."""

    def __init__(self, announced: Announcement, motion: Motion | None):
        self.newest = announced
        self.motion = motion
        self.settled: set[str] = {"flash_s"}


class Playback:
    """The packets of one entity; `wanted` and `next` in turn.

    Attributes:
        entity: Who is told.
        number: Of the next packet.
    """

    def __init__(
        self,
        entity: Entity,
        schedule: BlastSchedule,
        times: PacketTimes,
        stager: Stager,
        *,
        first: int = 0,
        until_s: float = np.inf,
    ):
        """Begin before the first packet.

        Args:
            entity: Who is told.
            schedule: Which blasts there will be.
            times: When packets are.
            stager: Of the same world; asked here for its air alone.
            first: Number of the first packet.
            until_s: When the world ends: the packet that holds this is the last [s].
        """
        self.entity = entity
        self.number = first
        self._schedule, self._times = schedule, times
        self._until_s = until_s
        self._ahead_s = AHEAD / float(times.rate)
        self._sound_m_s = float(sound_speed_of(stager.scene.air))
        self._announced_s = times.start_s(first) - schedule.lead_s - PAST_S
        self._live: dict[str, _Live] = {}
        self._motion: Motion | None = None

    @property
    def time_s(self) -> float:
        """When the next packet begins [s]."""
        return self._times.start_s(self.number)

    @property
    def waiting(self) -> int:
        """How many blasts were told and are not over."""
        return len(self._live)

    def report(self, motion: Motion) -> None:
        """Take note of how the entity moves; what has a path keeps to it."""
        self._motion = motion

    def soon(self, ahead_s: float) -> list[Wanted]:
        """Return blasts that will be told for the first time within a while.

        Args:
            ahead_s: After the next packet begins [s].
        """
        charges = self._schedule.announced(self._announced_s, self.time_s + ahead_s)
        return [Wanted(self.entity, charge, self._motion, 0) for charge in charges]

    def wanted(self) -> list[Wanted]:
        """Return what has to be staged for the next packet."""
        uncertain = [x.newest for x in self._live.values() if self._uncertain(x)]
        anew = [
            Wanted(self.entity, one.charge, self._motion, one.revision + 1)
            for one in uncertain
        ]
        return anew + self.soon(0.0)

    def next(self, staged: list[Announcement]) -> Packet:
        """Return the next packet.

        Args:
            staged: What `wanted` asked for.
        """
        start, end = self.time_s, self._times.start_s(self.number + 1)
        announced = []
        for new in staged:
            name = new.charge.name
            known = self._live.get(name)
            if known is not None:
                new = _with_past(new, known.newest, start)
            elif new.last_s() < start:
                continue  # over before it could be told
            live = _Live(new, self._motion)
            live.settled |= {
                wave
                for wave in WAVES
                if getattr(new.arrivals, wave) - start <= self._ahead_s
            }
            self._live[name] = live
            announced.append(new)
        self._announced_s = max(self._announced_s, start)
        packet = Packet(
            self.number,
            start,
            tuple(announced),
            tuple(self._perceived(start, end)),
            self._forces(),
            self._samples("pressure"),
            self._samples("sound"),
            end >= self._until_s,
        )
        over = [name for name, live in self._live.items() if live.newest.last_s() < end]
        for name in over:
            del self._live[name]
        self.number += 1
        return packet

    def _uncertain(self, live: _Live) -> bool:
        """Whether a wave may come before it is told once more where the entity is."""
        if self._motion is None or self.entity.path is not None:
            return False
        if live.motion is self._motion:
            return False
        here = self._motion.position_m
        then = self.entity.position_m
        if live.motion is not None:
            since = self._motion.time_s - live.motion.time_s
            then = live.motion.position_m + since * live.motion.velocity_m_s
        early = float(np.linalg.norm(here - then)) / self._sound_m_s
        limit = self.time_s + early + self._ahead_s
        return any(
            self.time_s <= getattr(live.newest.arrivals, wave) <= limit
            for wave in WAVES
            if wave not in live.settled
        )

    def _perceived(self, start: float, end: float) -> list[Perceived]:
        """Return what senses have first within a packet, in order of time."""
        found: list[Perceived] = []
        for name, live in self._live.items():
            flash, ground, air = live.newest.arrivals
            of_senses = {
                "flash": [(flash, "flash")],
                "ground": [(ground, "ground motion")],
                "pressure": [(air, "pressure")],
                "sound": [(ground, "ground sound"), (air, "sound")],
                "force": [(air, "force")],
            }
            for sense in self.entity.senses:
                found += [
                    Perceived(name, self.entity.name, word, time)
                    for time, word in of_senses[sense]
                    if start <= time < end
                ]
        return sorted(found, key=lambda one: (one.time_s, one.sense))

    def _forces(self) -> Slice | None:
        if "force" not in self.entity.senses:
            return None
        profiles = [
            (live.newest.force.first, live.newest.force)
            for live in self._live.values()
            if live.newest.force is not None
        ]
        rows = [
            (first, np.concatenate([profile.force_n, profile.moment_nm], axis=1))
            for first, profile in profiles
        ]
        return self._slice(rows, STEPS_HZ, (6,))

    def _samples(self, sense: str) -> Slice | None:
        if sense not in self.entity.senses:
            return None
        records = chain.from_iterable(
            getattr(live.newest, sense) for live in self._live.values()
        )
        rows = [(record.first, record.samples) for record in records]
        return self._slice(rows, self.entity.samples_hz, ())

    def _slice(
        self, rows: list[tuple[int, np.ndarray]], rate_hz: float, shape: tuple[int, ...]
    ) -> Slice:
        """Return the sum of what is sampled within the next packet; empty: silence."""
        first, last = self._times.samples(self.number, rate_hz)
        total: np.ndarray | None = None
        for begin, samples in rows:
            low, high = max(begin, first), min(begin + len(samples), last)
            if low >= high:
                continue
            if total is None:
                total = np.zeros((last - first, *shape))
            total[low - first : high - first] += samples[low - begin : high - begin]
        return Slice(first, rate_hz, np.zeros((0, *shape)) if total is None else total)


def packets_of(playback: Playback, stager: Stager) -> Iterator[Packet]:
    """Yield the packets of an entity in this process, to the end of the world."""
    stage: Callable[..., Announcement] = stager.stage
    while True:
        packet = playback.next([stage(*wanted) for wanted in playback.wanted()])
        yield packet
        if packet.last:
            return


def _with_past(new: Announcement, known: Announcement, now_s: float) -> Announcement:
    """Leave the arrivals that were as they were."""
    was = {
        wave: time for wave, time in known.arrivals._asdict().items() if time < now_s
    }
    return new._replace(arrivals=new.arrivals._replace(**was))
