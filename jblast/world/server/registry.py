"""The entities of a world by name, and the times of packets.

Packet k covers the time from k/rate to (k + 1)/rate of the world's clock. Rates are
used as they are written (`1/Fraction("0.1")` is ten), so no time drifts, and a sample
belongs to one packet whatever the two rates.
"""

import bisect
import functools
import math
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, shown
from jblast.scene import Charge
from jblast.scene.reader.tables import VEHICLE_MODELS
from jblast.vehicle import named
from jblast.world.drawn import DrawnWorld

PAST_S = 60.0
"""A blast is announced to a new client up to this time after it: its wave may still be
on its way, for 20 km."""
MOST_ANNOUNCED = 10_000
"""Blasts that are announced beside those of the scene, at most."""
T = TypeVar("T")
CAPACITY = 256
"""Packets that wait for one entity, at most: 2.56 s at 100 Hz."""
RATES_HZ = (1.0, 1000.0)
"""Least and most packets a second."""
MOST_ENTITIES = 10_000
"""Registered at once; declared."""
REMEMBERED = 1000
"""Of those who were dropped so many are remembered, the latest."""
SENSES = ("flash", "ground", "pressure", "sound", "force")
"""What an entity may sense; payloads are made of the last three."""
SAMPLED = {"pressure", "sound"}
SAMPLES_HZ = (100.0, 192_000.0)
"""Least and most samples a second of who senses pressure or sound."""
LONGEST_NAME = 64
"""Characters of a name; declared."""
MOST_KNOTS = 4096
"""Places of a path, at most."""
Numbers = Sequence[float | int] | Float[np.ndarray, "..."]
"""Some in a row, as callers have them."""


class BlastSchedule:
    """The blasts of a world by time; more may be announced ahead of time.

    Attributes:
        lead_s: Lead of an announcement before its blast [s].
    """

    def __init__(self, world: DrawnWorld, lead_s: float):
        """Begin with what was drawn and what the scene gives.

        Args:
            world: The world.
            lead_s: Lead of an announcement before its blast [s].

        Raises:
            InputError: The lead is negative or not finite.
        """
        if not 0 <= lead_s < math.inf:
            raise InputError(
                f"{argument('lead_s')}: expected 0 s or more, got {lead_s:g} s"
            )
        self.lead_s = lead_s
        self._charges = list(world.charges)
        self._times = [float(charge.time_s) for charge in self._charges]
        self._names = {charge.name for charge in self._charges}
        self._announced = 0

    @property
    def charges(self) -> tuple[Charge, ...]:
        """All of them, in order of time."""
        return tuple(self._charges)

    def announced(self, after_s: float, until_s: float) -> tuple[Charge, ...]:
        """Return the blasts announced after a time and until another [s]."""
        first = bisect.bisect_right(self._times, after_s + self.lead_s)
        last = bisect.bisect_right(self._times, until_s + self.lead_s)
        return tuple(self._charges[first:last])

    def announce(self, charge: Charge, now_s: float) -> None:
        """Add a blast that is yet to come.

        Args:
            charge: Its name is new, its time is the lead after now, or later.
            now_s: How far the foremost entity has come [s].

        Raises:
            InputError: It comes too soon, its name is taken or empty, or there are too
                many.
        """
        where = f"blast {shown(charge.name)}"
        when = float(charge.time_s)
        if not charge.name:
            raise InputError("blast name: expected one, got none")
        if charge.name in self._names:
            raise InputError(f"{where}: expected a new name, got that of another blast")
        if not now_s + self.lead_s < when < math.inf:
            raise InputError(
                f"{where} time_s: expected one after {now_s + self.lead_s:g} s, as it "
                f"is {now_s:g} s and blasts are told {self.lead_s:g} s ahead; got "
                f"{when:g}"
            )
        if self._announced >= MOST_ANNOUNCED:
            raise InputError(
                f"{where}: expected at most {MOST_ANNOUNCED:,} announced blasts, got "
                "more"
            )
        place = bisect.bisect_right(self._times, when)
        self._times.insert(place, when)
        self._charges.insert(place, charge)
        self._names.add(charge.name)
        self._announced += 1


class BufferFull(Exception):
    """There is no room for another packet: who takes them is too slow."""


class PacketBuffer(Generic[T]):
    """A ring of fixed size; when it is full, nothing is lost: `write` raises.

    No packet is overwritten, because the loss would remain unnoticed. The caller
    decides how to treat a slow client.
    """

    def __init__(self, capacity: int = CAPACITY):
        """Make an empty ring.

        Raises:
            ValueError: It would hold nothing.
        """
        if capacity < 1:
            raise ValueError(f"capacity must be one packet or more, got {capacity}")
        self._places: list[T | None] = [None] * capacity
        self._first = 0
        self.waiting = 0

    @property
    def capacity(self) -> int:
        """How many packets fit in."""
        return len(self._places)

    def write(self, packet: T) -> None:
        """Append a packet.

        Raises:
            BufferFull: There is no room; nothing changes.
        """
        if self.waiting == self.capacity:
            raise BufferFull
        self._places[(self._first + self.waiting) % self.capacity] = packet
        self.waiting += 1

    def read(self) -> Iterator[T]:
        """Take what waits, the oldest first."""
        while self.waiting:
            packet = self._places[self._first]
            self._places[self._first] = None  # let go of
            self._first = (self._first + 1) % self.capacity
            self.waiting -= 1
            assert packet is not None
            yield packet


class PacketTimes(NamedTuple):
    """How many packets a second, exactly.

    Attributes:
        rate: Packets a second.
    """

    rate: Fraction

    def start_s(self, number: int) -> float:
        """Return when a packet begins [s]."""
        # of whole numbers Python's quotient is the float nearest to it
        return number * self.rate.denominator / self.rate.numerator

    def samples(self, number: int, rate_hz: float) -> tuple[int, int]:
        """Return the first sample that begins within a packet, and that of the next.

        Args:
            number: Of the packet.
            rate_hz: Samples a second.
        """
        part, whole = _samples_each(rate_hz, self.rate)
        return -(-number * part // whole), -(-(number + 1) * part // whole)

    def at(self, time_s: float) -> int:
        """Return the number of the first packet that begins at a time or after [-]."""
        return math.ceil(Fraction(time_s) * self.rate)


@functools.cache
def _samples_each(rate_hz: float, rate: Fraction) -> tuple[int, int]:
    """Return the samples of a packet as a fraction of whole numbers."""
    each = exact(rate_hz) / rate
    return each.numerator, each.denominator


def exact(rate_hz: float) -> Fraction:
    """Return a rate as it is written: 0.1 is a tenth, not the float nearest to it."""
    return Fraction(repr(float(rate_hz)))


def packet_times(packets_hz: float) -> PacketTimes:
    """Return the packets of a rate.

    Raises:
        InputError: It is out of range.
    """
    if not RATES_HZ[0] <= packets_hz <= RATES_HZ[1]:
        raise InputError(
            f"{argument('packets_hz')}: expected {RATES_HZ[0]:g} to {RATES_HZ[1]:g} "
            f"packets a second, got {packets_hz:g}"
        )
    return PacketTimes(exact(packets_hz))


class Lockstep(NamedTuple):
    """Time goes on for each entity as it asks for packets, as fast as that may be.

    What a packet holds depends on its number, and not on how long anything took.
    """


class ScaledRealTime:
    """Time goes on by the wall clock, the same for all, once somebody has come.

    Attributes:
        speed: Seconds of the world a second.
    """

    def __init__(self, speed: float, now: Callable[[], float] = time.monotonic):
        """Stand at 0.

        Args:
            speed: Seconds of the world a second.
            now: A clock that does not jump.
        """
        self.speed = speed
        self._now = now
        self._began: float | None = None

    def begin(self) -> None:
        """Go, unless it goes already."""
        if self._began is None:
            self._began = self._now()

    def world_s(self) -> float:
        """Return the time of the world's clock [s]."""
        return 0.0 if self._began is None else (self._now() - self._began) * self.speed

    def wait_s(self, world_s: float) -> float:
        """Return how long until the world's clock says so; not below 0 [s]."""
        return max((world_s - self.world_s()) / self.speed, 0.0)


Clock = Lockstep | ScaledRealTime


class NameTaken(InputError):
    """There is an entity of this name already."""


class WorldFull(InputError):
    """There are as many entities as fit."""


class NotRegistered(InputError):
    """Nobody of this name and ticket takes part."""


class Entity(NamedTuple):
    """One who takes part.

    Attributes:
        name: Unique among entities.
        senses: Some of `SENSES`.
        position_m: Where it stands, or starts: east, north, up [m].
        path: Times [s] and places [m] that it will be at, straight between and at rest
            before and after; None: it stands, or reports how it moves.
        vehicle: Model that feels the force; "" without one.
        samples_hz: Of pressure and sound [Hz].
    """

    name: str
    senses: tuple[str, ...]
    position_m: Float[np.ndarray, "3"]
    path: tuple[Float[np.ndarray, " knot"], Float[np.ndarray, "knot 3"]] | None = None
    vehicle: str = ""
    samples_hz: float = 8000.0


class Registered(NamedTuple):
    """An entity and what it shows that it is the one that registered.

    Attributes:
        entity: The entity.
        ticket: A secret word that only this entity received.
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


class Motion(NamedTuple):
    """Motion of an entity, as it reports it.

    Attributes:
        time_s: When, on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: Likewise [m/s].
        quaternion: Body to world, scalar last.
        body_rate_rad_s: Body axes [rad/s].
    """

    time_s: float
    position_m: Float[np.ndarray, "3"]
    velocity_m_s: Float[np.ndarray, "3"]
    quaternion: Float[np.ndarray, "4"]
    body_rate_rad_s: Float[np.ndarray, "3"]


def checked_entity(
    name: str,
    senses: Sequence[str],
    *,
    position_m: Numbers | None = None,
    path: tuple[Numbers, Sequence[Numbers] | Float[np.ndarray, "knot 3"]] | None = None,
    vehicle: str = "",
    samples_hz: float | int | None = None,
) -> Entity:
    """Return an entity, looked at before it is let in.

    Args:
        name: Printable, at most `LONGEST_NAME` characters.
        senses: Some of `SENSES`, at least one.
        position_m: East, north, up [m]; or
        path: times [s] that rise and the places [m] at them.
        vehicle: Model that feels the force; needed by who senses it.
        samples_hz: Of pressure and sound; None: 8000 Hz.

    Raises:
        InputError: Any of these cannot be used.
    """
    where = f"entity {shown(name)}"
    if not (0 < len(name) <= LONGEST_NAME and name.isprintable()):
        raise InputError(
            f"entity name: expected 1 to {LONGEST_NAME} printable characters, got "
            f"{shown(name)}"
        )
    for sense in senses:
        if sense not in SENSES:
            raise InputError(
                f"{where} senses: expected some of {', '.join(SENSES)}, got "
                f"{shown(sense)}{nearest(sense, SENSES)}"
            )
    if not senses:
        raise InputError(f"{where} senses: expected some of {', '.join(SENSES)}")
    if (position_m is None) == (path is None):
        came = "neither" if path is None else "both"
        raise InputError(f"{where}: expected either a place or a path, got {came}")
    track = None if path is None else _path(where, *path)
    if track is not None:
        position_m = track[1][0]
    rate = 8000.0 if samples_hz is None else float(samples_hz)
    if SAMPLED & set(senses) and not SAMPLES_HZ[0] <= rate <= SAMPLES_HZ[1]:
        raise InputError(
            f"{where} samples_hz: expected {SAMPLES_HZ[0]:g} to {SAMPLES_HZ[1]:,.0f} "
            f"Hz, got {rate:g}"
        )
    if "force" in senses and not vehicle:
        raise InputError(
            f"{where} vehicle: expected the model that feels the force, one of "
            f"{', '.join(VEHICLE_MODELS)}; got none"
        )
    if vehicle:
        named(vehicle)
    return Entity(
        name,
        tuple(sense for sense in SENSES if sense in senses),
        above_ground(f"{where} position_m", () if position_m is None else position_m),
        track,
        vehicle,
        rate,
    )


def checked_motion(
    time_s: float | int,
    position_m: Numbers,
    velocity_m_s: Numbers = (0.0, 0.0, 0.0),
    quaternion: Numbers = (0.0, 0.0, 0.0, 1.0),
    body_rate_rad_s: Numbers = (0.0, 0.0, 0.0),
) -> Motion:
    """Return what an entity reports of its motion, looked at.

    Args:
        time_s: When, on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: Likewise [m/s].
        quaternion: Body to world, scalar last, of any length but 0.
        body_rate_rad_s: Body axes [rad/s].

    Raises:
        InputError: One of them is no number, or of another length.
    """
    turn = numbers("motion quaternion", quaternion, 4)
    if not (length := float(np.linalg.norm(turn))) > 0:
        raise InputError("motion quaternion: expected one of a length, got zeros")
    if not math.isfinite(time_s):
        raise InputError(f"motion time_s: expected a finite number, got {time_s}")
    return Motion(
        float(time_s),
        numbers("motion position_m", position_m, 3),
        numbers("motion velocity_m_s", velocity_m_s, 3),
        turn / length,
        numbers("motion body_rate_rad_s", body_rate_rad_s, 3),
    )


def numbers(where: str, values: Numbers, count: int) -> np.ndarray:
    """Return so many finite numbers as an array.

    Raises:
        InputError: They are not.
    """
    found = np.asarray(values, float)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InputError(
            f"{where}: expected {count} finite numbers, got {shown(list(values))}"
        )
    return found


def above_ground(where: str, values: Numbers) -> np.ndarray:
    """Return a place on the ground or above it, east, north, up [m].

    Raises:
        InputError: It is none.
    """
    place = numbers(where, values, 3)
    if place[2] < 0:
        raise InputError(
            f"{where}: expected a place on the ground or above it, got "
            f"{place[2]:g} m up"
        )
    return place


def _path(
    where: str,
    times: Numbers,
    places: Sequence[Numbers] | Float[np.ndarray, "knot 3"],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the knots of a path."""
    if not 1 <= len(times) == len(places) <= MOST_KNOTS:
        raise InputError(
            f"{where} path: expected 1 to {MOST_KNOTS} times and as many places, got "
            f"{len(times)} and {len(places)}"
        )
    when = numbers(f"{where} path time_s", times, len(times))
    if (np.diff(when) <= 0).any():
        raise InputError(f"{where} path time_s: expected rising times, got others")
    place = [above_ground(f"{where} path position_m", place) for place in places]
    return when, np.stack(place)
