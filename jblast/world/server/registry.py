"""Entities of a world, schedule of its blasts, and times of packets.

Packet k covers the time from k/rate to (k + 1)/rate of the world's clock. Rates are
exact decimal fractions (`1/Fraction("0.1")` is ten), so times do not drift, and each
sample belongs to exactly one packet at any pair of rates.
"""

import bisect
import functools
import math
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, shown
from jblast.scene import Charge
from jblast.scene.keys import VEHICLE_MODELS
from jblast.vehicle import named
from jblast.world.drawn import DrawnWorld

PAST_S = 60.0
"""Age up to which a blast is announced to a new client.

In this time its wave travels 20 km; later waves are inaudible for the charges here.
"""
MAX_ANNOUNCED = 10_000
"""Maximum number of blasts added to those of the scene; declared, bounds memory."""
MASS_KG = (1e-6, 1e7)
"""Range of the mass of an added blast; the largest accidents were below 1e7 kg."""
FARTHEST_M = 1e6
"""Largest coordinate of an added blast; its sound would travel for an hour."""
TNT_DENSITY_KG_M3 = 1630.0
"""Density of cast TNT. Within its sphere of explosive a charge has no blast wave."""
T = TypeVar("T")
CAPACITY = 256
"""Maximum number of packets waiting for one entity: 2.56 s at 100 Hz; declared.

A longer queue would hide a slow client, whose data is then old.
"""
RATES_HZ = (1.0, 1000.0)
"""Range of packets per second: above, messages cost more than their samples."""
MOST_ENTITIES = 10_000
"""Maximum number of simultaneous entities; declared."""
MAX_DROPPED = 1000
"""Number of disconnected entities that are stored, the latest ones; bounds memory."""
SENSES = ("flash", "ground", "pressure", "sound", "force")
"""Senses of an entity; the last three have samples."""
SAMPLED = {"pressure", "sound"}
SAMPLES_HZ = (100.0, 192_000.0)
"""Range of samples per second of pressure and sound, up to common audio hardware."""
LONGEST_NAME = 64
"""Maximum number of characters of a name; declared."""
MAX_KNOTS = 4096
"""Maximum number of positions of a path; declared, bounds compile time and memory."""
Numbers = Sequence[float | int] | Float[np.ndarray, "..."]
"""Array-like of floats."""


class BlastSchedule:
    """The blasts of a world by time, including blasts added by clients.

    Attributes:
        lead_s: Lead of an announcement before its blast [s].
        added: Blasts added by clients, in the order of their addition.
    """

    def __init__(self, world: DrawnWorld, lead_s: float):
        """Begin with the sampled blasts and those of the scene.

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
        self.added: list[Charge] = []

    @property
    def charges(self) -> tuple[Charge, ...]:
        """All blasts, sorted by time."""
        return tuple(self._charges)

    def announced(self, after_s: float, until_s: float) -> tuple[Charge, ...]:
        """Return the blasts announced after a time and until another [s]."""
        first = bisect.bisect_right(self._times, after_s + self.lead_s)
        last = bisect.bisect_right(self._times, until_s + self.lead_s)
        return tuple(self._charges[first:last])

    def announce(
        self,
        charge: Charge,
        now_s: float,
        entities: Iterable["Entity"] = (),
    ) -> None:
        """Add a future blast.

        Args:
            charge: Charge with a new name and a time at least the lead after `now_s`.
            now_s: Time of the world's clock; in lockstep 0, the beginning of the world
                [s].
            entities: Entities that must be outside the charge.

        Raises:
            InputError: It is too early, its mass or position is out of range, or its
                name is taken or empty.
            WorldFull: There are too many.
        """
        where = f"blast {shown(charge.name)}"
        when = float(charge.time_s)
        if not charge.name:
            raise InputError("blast name: expected a name, got an empty one")
        if charge.name in self._names:
            raise InputError(f"{where}: expected a new name, got that of another blast")
        mass, far = float(charge.mass_kg), max(map(abs, map(float, charge.position_m)))
        if not MASS_KG[0] <= mass <= MASS_KG[1]:
            raise InputError(
                f"{where} mass_kg: expected {MASS_KG[0]:g} to {MASS_KG[1]:g} kg, got "
                f"{mass:g}"
            )
        if not far <= FARTHEST_M:
            raise InputError(
                f"{where} position_m: expected coordinates of at most {FARTHEST_M:g} "
                f"m, got {far:g} m"
            )
        check_outside(charge, entities)
        # Strictly later, so that each entity that starts now has the whole lead.
        if not now_s + self.lead_s < when < math.inf:
            raise InputError(
                f"{where} time_s: expected one after {now_s + self.lead_s:g} s (now "
                f"{now_s:g} s plus the lead of {self.lead_s:g} s), got {when:g} s"
            )
        if len(self.added) >= MAX_ANNOUNCED:
            raise WorldFull(
                f"{where}: expected at most {MAX_ANNOUNCED:,} announced blasts, got "
                "one more"
            )
        # The list stays sorted for the bisection in `announced`; blasts at equal times
        # keep their order.
        place = bisect.bisect_right(self._times, when)
        self._times.insert(place, when)
        self._charges.insert(place, charge)
        self._names.add(charge.name)
        self.added.append(charge)


def check_outside(charge: Charge, entities: Iterable["Entity"]) -> None:
    """Reject a charge with an entity inside the sphere of its explosive.

    Args:
        charge: The charge.
        entities: Entities at their positions, or on their paths.

    Raises:
        InputError: An entity is inside.
    """
    sphere = 3.0 * float(charge.mass_kg) / (4.0 * math.pi * TNT_DENSITY_KG_M3)
    radius, center = sphere ** (1 / 3), np.array([float(x) for x in charge.position_m])
    for entity in entities:
        knots = entity.position_m[None] if entity.path is None else entity.path[1]
        # The nearest point of each segment of the path.
        legs = np.diff(knots, axis=0, append=knots[-1:])
        square = np.maximum((legs**2).sum(1), np.finfo(float).tiny)
        share = np.clip(((center - knots) * legs).sum(1) / square, 0.0, 1.0)
        nearest_m = np.linalg.norm(knots + share[:, None] * legs - center, axis=1).min()
        if not nearest_m > radius:
            raise InputError(
                f"blast {shown(charge.name)} position_m: expected a position more than "
                f"{radius:.2g} m (the radius of the charge) from each entity, got "
                f"{nearest_m:.2g} m from {shown(entity.name)}"
            )


class BufferFull(Exception):
    """A packet buffer is full, because its client is too slow."""


class PacketBuffer(Generic[T]):
    """Ring buffer of packets; `write` raises when it is full.

    No packet is overwritten, because the loss would go unnoticed. The caller decides
    how to treat a slow client.
    """

    def __init__(self, capacity: int = CAPACITY):
        """Create an empty buffer.

        Raises:
            ValueError: The capacity is below one packet.
        """
        if capacity < 1:
            raise ValueError(f"capacity: expected at least 1 packet, got {capacity}")
        self._places: list[T | None] = [None] * capacity
        self._first = 0
        self.waiting = 0

    @property
    def capacity(self) -> int:
        """Maximum number of packets."""
        return len(self._places)

    def write(self, packet: T) -> None:
        """Append a packet.

        Raises:
            BufferFull: The buffer is full and unchanged.
        """
        if self.waiting == self.capacity:
            raise BufferFull
        self._places[(self._first + self.waiting) % self.capacity] = packet
        self.waiting += 1

    def read(self) -> Iterator[T]:
        """Yield and remove the waiting packets, oldest first."""
        while self.waiting:
            packet = self._places[self._first]
            self._places[self._first] = None  # release the packet's memory
            self._first = (self._first + 1) % self.capacity
            self.waiting -= 1
            assert packet is not None
            yield packet


class PacketTimes(NamedTuple):
    """Exact times of packets.

    Attributes:
        rate: Packets per second.
    """

    rate: Fraction

    def start_s(self, number: int) -> float:
        """Return the beginning of a packet [s]."""
        # Python's quotient of integers is correctly rounded, so no error accumulates.
        return number * self.rate.denominator / self.rate.numerator

    def samples(self, number: int, rate_hz: float) -> tuple[int, int]:
        """Return the first samples of a packet and of the next one.

        Args:
            number: Number of the packet.
            rate_hz: Samples per second.
        """
        part, whole = _samples_each(rate_hz, self.rate)
        return -(-number * part // whole), -(-(number + 1) * part // whole)

    def at(self, time_s: float) -> int:
        """Return the number of the first packet that begins at a time or after [-]."""
        # In fractions, because a float product may round up to the next packet.
        return math.ceil(Fraction(time_s) * self.rate)


@functools.cache
def _samples_each(rate_hz: float, rate: Fraction) -> tuple[int, int]:
    """Return the samples per packet as numerator and denominator."""
    each = exact(rate_hz) / rate
    return each.numerator, each.denominator


def exact(rate_hz: float) -> Fraction:
    """Return a rate as the decimal fraction it was written as: 0.1 is 1/10."""
    return Fraction(repr(float(rate_hz)))


def packet_times(packets_hz: float) -> PacketTimes:
    """Return the packet times of a rate.

    Raises:
        InputError: The rate is out of range.
    """
    if not RATES_HZ[0] <= packets_hz <= RATES_HZ[1]:
        raise InputError(
            f"{argument('packets_hz')}: expected {RATES_HZ[0]:g} to {RATES_HZ[1]:g} "
            f"packets per second, got {packets_hz:g}"
        )
    return PacketTimes(exact(packets_hz))


class Lockstep(NamedTuple):
    """Clock that advances for each entity with its requests for packets.

    The content of a packet depends on its number only, not on computing times.
    """


class ScaledRealTime:
    """Clock that follows the wall clock for all entities, from the first client on.

    Attributes:
        speed: World time per real time [-].
    """

    def __init__(self, speed: float, now: Callable[[], float] = time.monotonic):
        """Create a clock at 0 that does not run yet.

        Args:
            speed: World time per real time [-].
            now: A monotonic clock [s].
        """
        self.speed = speed
        self._now = now
        self._began: float | None = None

    def begin(self) -> None:
        """Start the clock, unless it runs already."""
        if self._began is None:
            self._began = self._now()

    def world_s(self) -> float:
        """Return the time of the world's clock [s]."""
        return 0.0 if self._began is None else (self._now() - self._began) * self.speed

    def wait_s(self, world_s: float) -> float:
        """Return the real time until a time of the world [s]; at least 0."""
        return max((world_s - self.world_s()) / self.speed, 0.0)


Clock = Lockstep | ScaledRealTime


class NameTaken(InputError):
    """An entity of this name exists already."""


class WorldFull(InputError):
    """The maximum number of entities is reached."""


class NotRegistered(InputError):
    """No entity has this name and ticket."""


class Entity(NamedTuple):
    """A participant of a world.

    Attributes:
        name: Unique name.
        senses: Subset of `SENSES`.
        position_m: Position, or initial position: east, north, up [m].
        path: Times [s] and positions [m], linear between and at rest before and after;
            None: at rest, or reported by the client.
        vehicle: Vehicle model for the force; "" without one.
        samples_hz: Sampling rate of pressure and sound [Hz].
    """

    name: str
    senses: tuple[str, ...]
    position_m: Float[np.ndarray, "3"]
    path: tuple[Float[np.ndarray, " knot"], Float[np.ndarray, "knot 3"]] | None = None
    vehicle: str = ""
    samples_hz: float = 8000.0


class Registered(NamedTuple):
    """A registered entity with its ticket.

    Attributes:
        entity: The entity.
        ticket: Secret token that authenticates the entity's client.
    """

    entity: Entity
    ticket: str


class Dropped(NamedTuple):
    """A disconnected client.

    Attributes:
        name: Name of the entity; "" if unknown.
        peer: Network address of the client.
        why: Reason.
    """

    name: str
    peer: str
    why: str


class Registry:
    """Entities by name.

    Attributes:
        dropped: Disconnected clients, the latest last.
        dropped_count: Total number of disconnected clients.
    """

    def __init__(self, most: int = MOST_ENTITIES):
        """Create an empty registry of at most `most` entities."""
        self._most = most
        self._by_name: dict[str, Registered] = {}
        self.dropped: deque[Dropped] = deque(maxlen=MAX_DROPPED)
        self.dropped_count = 0

    def __len__(self) -> int:
        return len(self._by_name)

    def __contains__(self, name: str) -> bool:
        return name in self._by_name

    def register(self, entity: Entity) -> Registered:
        """Add an entity.

        Raises:
            NameTaken: Another entity has its name.
            WorldFull: The maximum number of entities is reached.
        """
        if entity.name in self._by_name:
            raise NameTaken(
                f"entity {shown(entity.name)}: expected another name, got that of a "
                "registered entity"
            )
        if len(self) >= self._most:
            raise WorldFull(f"expected at most {self._most:,} entities, got one more")
        # 64 random bits cannot be guessed within the lifetime of a server.
        registered = Registered(entity, secrets.token_hex(8))
        self._by_name[entity.name] = registered
        return registered

    def of(self, name: str, ticket: str) -> Entity:
        """Return the entity of a name and ticket.

        Raises:
            NotRegistered: The name is unknown or the ticket differs.
        """
        found = self._by_name.get(name)
        # A comparison in constant time, which does not reveal a ticket by its duration.
        if found is None or not secrets.compare_digest(
            found.ticket.encode(), ticket.encode()
        ):
            raise NotRegistered(
                f"entity {shown(name)}: expected a registered entity and its ticket, "
                f"got {'no such entity' if found is None else 'another ticket'}"
            )
        return found.entity

    def entities(self) -> Iterator[Entity]:
        """Yield the registered entities."""
        return (registered.entity for registered in self._by_name.values())

    def leave(self, name: str) -> None:
        """Remove an entity; its name becomes available again."""
        self._by_name.pop(name, None)

    def drop(self, name: str, peer: str, why: str) -> Dropped:
        """Remove an entity and store the reason."""
        self.leave(name)
        gone = Dropped(name, peer, why)
        self.dropped.append(gone)
        self.dropped_count += 1
        return gone


class Motion(NamedTuple):
    """Reported motion of an entity.

    Attributes:
        time_s: Time on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: East, north, up [m/s].
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
    """Return an entity after checking its properties.

    Args:
        name: Printable, at most `LONGEST_NAME` characters.
        senses: Subset of `SENSES`, at least one.
        position_m: East, north, up [m]; alternatively `path`.
        path: Ascending times [s] and positions [m].
        vehicle: Vehicle model; required for the sense "force".
        samples_hz: Sampling rate of pressure and sound; None: 8000 Hz.

    Raises:
        InputError: A property is invalid.
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
        raise InputError(
            f"{where} senses: expected some of {', '.join(SENSES)}, got none"
        )
    if (position_m is None) == (path is None):
        came = "neither" if path is None else "both"
        raise InputError(f"{where}: expected either a position or a path, got {came}")
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
            f"{where} vehicle: expected one of {', '.join(VEHICLE_MODELS)} for the "
            "sense force, got none"
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
    """Return the motion of an entity after checking its numbers.

    Args:
        time_s: Time on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: East, north, up [m/s].
        quaternion: Body to world, scalar last, of any length but 0.
        body_rate_rad_s: Body axes [rad/s].

    Raises:
        InputError: A number is not finite, or a vector has another length.
    """
    turn = numbers("motion quaternion", quaternion, 4)
    if not (length := float(np.linalg.norm(turn))) > 0:
        raise InputError("motion quaternion: expected a positive length, got zeros")
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
    """Return an array of `count` finite numbers.

    Raises:
        InputError: The count differs or a number is not finite.
    """
    found = np.asarray(values, float)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InputError(
            f"{where}: expected {count} finite numbers, got {shown(list(values))}"
        )
    return found


def above_ground(where: str, values: Numbers) -> np.ndarray:
    """Return a position on or above the ground, east, north, up [m].

    Raises:
        InputError: It is not a position, or below the ground.
    """
    place = numbers(where, values, 3)
    if place[2] < 0:
        raise InputError(
            f"{where}: expected a position on or above the ground, got up = "
            f"{place[2]:g} m"
        )
    return place


def _path(
    where: str,
    times: Numbers,
    places: Sequence[Numbers] | Float[np.ndarray, "knot 3"],
) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions of a path."""
    if not 1 <= len(times) == len(places) <= MAX_KNOTS:
        raise InputError(
            f"{where} path: expected 1 to {MAX_KNOTS} times and as many positions, got "
            f"{len(times)} and {len(places)}"
        )
    when = numbers(f"{where} path time_s", times, len(times))
    falls = np.flatnonzero(np.diff(when) <= 0)
    if falls.size:
        before, after = when[falls[0]], when[falls[0] + 1]
        raise InputError(
            f"{where} path time_s: expected ascending times, got {after:g} s after "
            f"{before:g} s"
        )
    place = [above_ground(f"{where} path position_m", place) for place in places]
    return when, np.stack(place)
