"""Entities of a world, schedule of its blasts, and times of packets.

Packet k covers the time from k/rate to (k + 1)/rate of the world's clock. Rates are
exact decimal fractions (`1/Fraction("0.1")` is ten), so times do not drift, and each
sample belongs to exactly one packet at any pair of rates.
"""

import bisect
import functools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, nearest, require, shown
from jblast.scene import Charge
from jblast.scene.charge import EXPLOSIVES
from jblast.scene.keys import VEHICLE_MODELS
from jblast.types import ArrayLike, Module, field
from jblast.vehicle import named
from jblast.world.drawn import DrawnWorld

MAX_ADDED = 10_000
"""Maximum number of blasts added to those of the scene; declared, bounds memory."""
MASS_KG = (1e-6, 1e7)
"""Range of the mass of an added blast; the largest accidents were below 1e7 kg."""
FARTHEST_M = 1e6
"""Largest coordinate of an added blast; its sound would travel for an hour."""
TNT_DENSITY_KG_M3 = 1630.0
"""Density of cast TNT. Within its sphere of explosive a charge has no blast wave."""
RATES_HZ = (1.0, 1000.0)
"""Range of packets per second: above, messages cost more than their samples."""
SENSES = ("flash", "ground", "pressure", "sound", "force")
"""Senses of an entity; the last three have samples."""
SAMPLES_HZ = (100.0, 192_000.0)
"""Range of samples per second of pressure and sound, up to common audio hardware."""
LONGEST_NAME = 64
"""Maximum number of characters of a name; declared."""
MAX_KNOTS = 4096
"""Maximum number of positions of a path; declared, bounds compile time and memory."""


class Refused(InputError):
    """A request that is refused for another reason than an invalid value.

    Attributes:
        status: Name of its gRPC status.
    """

    def __init__(self, message: str, status: str):
        super().__init__(message)
        self.status = status


def _numbers(count: int, where: str) -> Callable[[Any], np.ndarray]:
    """Return a converter to an array of `count` finite numbers."""

    def converted(values: ArrayLike) -> np.ndarray:
        found = np.asarray(values, float)
        right = found.shape == (count,) and np.isfinite(found).all()
        require(right, where, f"{count} finite numbers", shown(found.tolist()))
        return found

    return converted


def _above_ground(where: str) -> Callable[[Any], np.ndarray]:
    """Return a converter to a position on or above the ground: east, north, up [m]."""

    def converted(values: ArrayLike) -> np.ndarray:
        place = _numbers(3, where)(values)
        expected = "a position on or above the ground"
        require(place[2] >= 0, where, expected, f"up = {place[2]:g} m")
        return place

    return converted


class Knot(Module):
    """A position of an entity.

    Attributes:
        position_m: East, north, up [m], on or above the ground.
        time_s: Time on the common clock [s].
    """

    position_m: Float[np.ndarray, "3"] = field(
        converter=_above_ground("entity position_m"), default=()
    )
    time_s: float = field(converter=float, default=0.0)


def _path(knots: Iterable[Knot]) -> tuple[Knot, ...]:
    return tuple(knots)


def _senses(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(names)


class Entity(Module):
    """A participant of a world; its constructor checks its properties.

    Attributes:
        name: Unique name, printable, at most `LONGEST_NAME` characters.
        senses: Subset of `SENSES`, at least one.
        path: Positions in order of time, linear between and at rest before and after.
            An entity with one position may report its motion.
        vehicle: Vehicle model, required for the sense "force"; "" without one.
        samples_hz: Sampling rate of pressure and sound [Hz].

    Raises:
        InputError: A property is invalid.
    """

    name: str = field(static=True)
    senses: tuple[str, ...] = field(static=True, converter=_senses, default=())
    path: tuple[Knot, ...] = field(converter=_path, default=())
    vehicle: str = field(static=True, default="")
    samples_hz: float = field(static=True, converter=float, default=8000.0)

    def __check_init__(self) -> None:
        printable = 0 < len(self.name) <= LONGEST_NAME and self.name.isprintable()
        expected = f"1 to {LONGEST_NAME} printable characters"
        require(printable, "entity name", expected, shown(self.name))
        where, some = f"entity {shown(self.name)}", f"some of {', '.join(SENSES)}"
        for sense in self.senses:
            guess = f"{shown(sense)}{nearest(sense, SENSES)}"
            require(sense in SENSES, f"{where} senses", some, guess)
        require(self.senses, f"{where} senses", some, "none")
        times, expected = self.times_s, f"1 to {MAX_KNOTS} positions"
        require(1 <= len(times) <= MAX_KNOTS, f"{where} path", expected, len(times))
        ascends = np.isfinite(times).all() and (np.diff(times) > 0).all()
        require(ascends, f"{where} path time_s", "ascending times", times.tolist())
        low, high = SAMPLES_HZ
        right = low <= self.samples_hz <= high
        expected = f"{low:g} to {high:,.0f} Hz"
        require(right, f"{where} samples_hz", expected, f"{self.samples_hz:g}")
        models = f"one of {', '.join(VEHICLE_MODELS)} for the sense force"
        has_body = self.vehicle or "force" not in self.senses
        require(has_body, f"{where} vehicle", models, "none")
        if self.vehicle:
            named(self.vehicle)

    @property
    def start_m(self) -> Float[np.ndarray, "3"]:
        """First position [m]."""
        return self.path[0].position_m

    @property
    def times_s(self) -> Float[np.ndarray, " knot"]:
        """Times of its path [s]."""
        return np.array([knot.time_s for knot in self.path])

    @property
    def places_m(self) -> Float[np.ndarray, "knot 3"]:
        """Positions of its path [m]."""
        return np.stack([knot.position_m for knot in self.path])


class Motion(Module):
    """Reported motion of an entity.

    Attributes:
        time_s: Time on the common clock [s].
        position_m: East, north, up [m].
        velocity_m_s: East, north, up [m/s].
        quaternion: Body to world, scalar last, of any length but 0.
        body_rate_rad_s: Body axes [rad/s].

    Raises:
        InputError: A number is not finite, or a vector has another length.
    """

    time_s: float = field(converter=float)
    position_m: Float[np.ndarray, "3"] = field(
        converter=_numbers(3, "motion position_m"), default=()
    )
    velocity_m_s: Float[np.ndarray, "3"] = field(
        converter=_numbers(3, "motion velocity_m_s"), default=(0.0, 0.0, 0.0)
    )
    quaternion: Float[np.ndarray, "4"] = field(
        converter=_numbers(4, "motion quaternion"), default=(0.0, 0.0, 0.0, 1.0)
    )
    body_rate_rad_s: Float[np.ndarray, "3"] = field(
        converter=_numbers(3, "motion body_rate_rad_s"), default=(0.0, 0.0, 0.0)
    )

    def __check_init__(self) -> None:
        finite = math.isfinite(self.time_s)
        require(finite, "motion time_s", "a finite number", str(self.time_s))
        turned = self.quaternion.any()
        require(turned, "motion quaternion", "a positive length", "zeros")


class NewBlast(Module):
    """A blast that a client adds.

    Attributes:
        shot: Its name.
        time_s: Time of the detonation [s].
        position_m: East, north, up [m], on or above the ground.
        mass_kg: Mass of the explosive [kg].
        explosive: Name of the explosive.
    """

    shot: str = field(static=True)
    time_s: float = field(converter=float)
    position_m: Float[np.ndarray, "3"] = field(
        converter=_above_ground("blast position_m"), default=()
    )
    mass_kg: float = field(converter=float, default=0.0)
    explosive: str = field(static=True, default="TNT")

    def __check_init__(self) -> None:
        where = f"blast {shown(self.shot)}"
        require(self.shot, "blast name", "a name", "an empty one")
        low, high = MASS_KG
        expected = f"{low:g} to {high:g} kg"
        right = low <= self.mass_kg <= high
        require(right, f"{where} mass_kg", expected, f"{self.mass_kg:g}")
        far = np.abs(self.position_m).max()
        expected = f"coordinates of at most {FARTHEST_M:g} m"
        require(far <= FARTHEST_M, f"{where} position_m", expected, f"{far:g} m")
        known, expected = self.explosive in EXPLOSIVES, ", ".join(EXPLOSIVES)
        got = shown(self.explosive)
        require(known, f"{where} explosive", f"one of {expected}", got)

    @property
    def charge(self) -> Charge:
        """Its charge."""
        place = tuple(self.position_m.tolist())
        return Charge(
            self.mass_kg, place, self.time_s, explosive=self.explosive, name=self.shot
        )

    def check_outside(self, entity: Entity) -> None:
        """Reject it if an entity, or its path, is inside the sphere of the explosive.

        Raises:
            InputError: The entity is inside.
        """
        radius = (3.0 * self.mass_kg / (4.0 * math.pi * TNT_DENSITY_KG_M3)) ** (1 / 3)
        # The nearest point of each segment of the path.
        knots = entity.places_m
        legs = np.diff(knots, axis=0, append=knots[-1:])
        square = np.maximum((legs**2).sum(1), np.finfo(float).tiny)
        share = np.clip(((self.position_m - knots) * legs).sum(1) / square, 0.0, 1.0)
        apart = knots + share[:, None] * legs - self.position_m
        nearest_m = np.linalg.norm(apart, axis=1).min()
        require(
            nearest_m > radius,
            f"blast {shown(self.shot)} position_m",
            f"a position more than {radius:.2g} m (the radius of the charge) from each "
            "entity",
            f"{nearest_m:.2g} m from {shown(entity.name)}",
        )


class BlastSchedule:
    """The blasts of a world by time, including blasts added by clients.

    Attributes:
        charges: All blasts, sorted by time.
        lead_s: Lead of an announcement before its blast [s].
        added: Names of the blasts added by clients.
    """

    def __init__(self, world: DrawnWorld, lead_s: float):
        """Begin with the sampled blasts and those of the scene.

        Args:
            world: The world.
            lead_s: Lead of an announcement before its blast [s].
        """
        self.lead_s = lead_s
        self.charges: Sequence[Charge] = world.charges
        # Comparisons of arrays would take half of the time of a packet.
        self._times = [float(charge.time_s) for charge in self.charges]
        self.added: set[str] = set()

    def between(self, after_s: float, until_s: float) -> Iterator[Charge]:
        """Yield the blasts after a time and until another [s]."""
        first = bisect.bisect_right(self._times, after_s)
        last = bisect.bisect_right(self._times, until_s)
        return iter(self.charges[first:last])

    def announce(
        self, blast: NewBlast, now_s: float, entities: Iterable[Entity] = ()
    ) -> None:
        """Add a future blast.

        Args:
            blast: Blast with a new name and a time more than the lead after `now_s`.
            now_s: Time of the world's clock; in lockstep 0, the beginning of the world
                [s].
            entities: Entities that must be outside the charge.

        Raises:
            InputError: It is too early, an entity is inside, or its name is taken.
            Refused: There are too many.
        """
        where = f"blast {shown(blast.shot)}"
        taken = any(charge.name == blast.shot for charge in self.charges)
        require(not taken, where, "a new name", "that of another blast")
        for entity in entities:
            blast.check_outside(entity)
        # Strictly later, so that each entity that starts now has the whole lead.
        require(
            now_s + self.lead_s < blast.time_s < math.inf,
            f"{where} time_s",
            f"one after {now_s + self.lead_s:g} s (now {now_s:g} s plus the lead of "
            f"{self.lead_s:g} s)",
            f"{blast.time_s:g} s",
        )
        if len(self.added) >= MAX_ADDED:
            full = f"{where}: expected at most {MAX_ADDED:,} added blasts, got one more"
            raise Refused(full, "RESOURCE_EXHAUSTED")
        # Blasts at equal times keep their order.
        place = bisect.bisect_right(self._times, blast.time_s)
        self._times.insert(place, blast.time_s)
        self.charges = (*self.charges[:place], blast.charge, *self.charges[place:])
        self.added.add(blast.shot)


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
    return (exact(rate_hz) / rate).as_integer_ratio()


def exact(rate_hz: float) -> Fraction:
    """Return a rate as the decimal fraction it was written as: 0.1 is 1/10."""
    return Fraction(repr(float(rate_hz)))


def packet_times(packets_hz: float) -> PacketTimes:
    """Return the packet times of a rate.

    Raises:
        InputError: The rate is out of range.
    """
    low, high = RATES_HZ
    expected = f"{low:g} to {high:g} packets per second"
    right = low <= packets_hz <= high
    require(right, argument("packets_hz"), expected, f"{packets_hz:g}")
    return PacketTimes(exact(packets_hz))
