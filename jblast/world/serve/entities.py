"""Entities, options and blasts of a served world, and times of packets.

Packet k covers the time from k/rate to (k + 1)/rate of the world's clock. Rates are
exact decimal fractions (`1/Fraction("0.1")` is ten), so times do not drift, and each
sample belongs to exactly one packet at any pair of rates.
"""

import bisect
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.addresses import host_and_port
from jblast.errors import InputError, argument, nearest, require, shown
from jblast.scene import Charge, Scene
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
RATES_HZ = (1.0, 1000.0)
"""Range of packets per second: above, messages cost more than their samples."""
SENSES = {
    "flash": (("flash_s", "flash"),),
    "ground": (("ground_s", "ground motion"),),
    "pressure": (("air_s", "pressure"),),
    "sound": (("ground_s", "ground sound"), ("air_s", "sound")),
    "force": (("air_s", "force"),),
}
"""Perceptions by each sense of an entity: arrival and name; the last three senses have
samples."""
SAMPLES_HZ = (100.0, 192_000.0)
"""Range of samples per second of pressure and sound, up to common audio hardware."""
LONGEST_NAME = 64
"""Maximum number of characters of a name; declared."""
MAX_KNOTS = 4096
"""Maximum number of positions of a path; declared, bounds compile time and memory."""
ADDRESS = "127.0.0.1:50551"


class Refused(InputError):
    """A request that is refused for another reason than an invalid value.

    Attributes:
        status: Name of its gRPC status.
    """

    def __init__(self, message: str, status: str):
        super().__init__(message)
        self.status = status


def _numbers(where: str, count: int = 3) -> Callable[[Any], np.ndarray]:
    """Return a converter to an array of `count` finite numbers."""

    def converted(values: ArrayLike) -> np.ndarray:
        found = np.asarray(values, float)
        right = found.shape == (count,) and np.isfinite(found).all()
        require(right, where, f"{count} finite numbers", shown(found.tolist()))
        return found

    return converted


class Knot(Module):
    """A position of an entity.

    Attributes:
        position_m: East, north, up [m], on or above the ground.
        time_s: Time on the common clock [s].
    """

    position_m: Float[np.ndarray, "3"] = field(
        converter=_numbers("entity position_m"), default=()
    )
    time_s: float = field(converter=float, default=0.0)


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
    senses: tuple[str, ...] = field(static=True, converter=tuple, default=())
    path: tuple[Knot, ...] = field(converter=tuple, default=())
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
        lowest = min(knot.position_m[2] for knot in self.path)
        expected = "positions on or above the ground"
        require(lowest >= 0, f"{where} path", expected, f"up = {lowest:g} m")
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
        converter=_numbers("motion position_m"), default=()
    )
    velocity_m_s: Float[np.ndarray, "3"] = field(
        converter=_numbers("motion velocity_m_s"), default=(0.0, 0.0, 0.0)
    )
    quaternion: Float[np.ndarray, "4"] = field(
        converter=_numbers("motion quaternion", 4), default=(0.0, 0.0, 0.0, 1.0)
    )
    body_rate_rad_s: Float[np.ndarray, "3"] = field(
        converter=_numbers("motion body_rate_rad_s"), default=(0.0, 0.0, 0.0)
    )

    def __check_init__(self) -> None:
        finite = math.isfinite(self.time_s)
        require(finite, "motion time_s", "a finite number", str(self.time_s))
        turned = self.quaternion.any()
        require(turned, "motion quaternion", "a positive length", "zeros")


class NewBlast(NamedTuple):
    """A blast that a client adds.

    Attributes:
        shot: Its name.
        time_s: Time of the detonation [s].
        position_m: East, north, up [m], on or above the ground.
        mass_kg: Mass of the explosive [kg].
        explosive: Name of the explosive.
    """

    shot: str
    time_s: float
    position_m: Sequence[float] = ()
    mass_kg: float = 0.0
    explosive: str = "TNT"


@dataclass(frozen=True)
class Options:
    """Options of a served world.

    Attributes:
        address: HOST:PORT; port 0 selects a free port.
        packets_hz: Packets per second of the world's time.
        lead_s: Lead of the announcement before a blast [s].
        speed: World time per real time [-]; None: lockstep.
        ends_s: End of the world [s]; infinite: never.
        patience_s: Maximum time of each wait for a client [s].

    Raises:
        InputError: An option is invalid, or the address is not loopback.
    """

    address: str = ADDRESS
    packets_hz: float = 100.0
    lead_s: float = 5.0
    speed: float | None = None
    ends_s: float = math.inf
    patience_s: float = 60.0

    def __post_init__(self) -> None:
        host_and_port(self.address, argument("address"), "HOST:PORT")
        packet_times(self.packets_hz)
        finite = 0 <= self.lead_s < math.inf
        require(finite, argument("lead_s"), "0 s or more", f"{self.lead_s:g} s")
        for name in ("speed", "ends_s", "patience_s"):
            value = getattr(self, name)
            positive = value is None or value > 0
            require(positive, argument(name), "a positive number", f"{value}")


class ServedWorld:
    """The blasts of a world by time, including those added by clients.

    Attributes:
        scene: Air and ground, with their laws stated.
        options: Options of the server.
        times: Times of the packets.
        charges: All blasts, sorted by time.
        added: Names of the blasts added by clients.
    """

    def __init__(self, world: DrawnWorld, options: Options | None = None):
        """Begin with the sampled blasts and those of the scene."""
        bare = {"camera": None, "vehicle": None, "ambient": None}
        self.scene: Scene = replace(world.scene, sensors=(), clocks=(), **bare)
        self.options = options or Options()
        self.times = packet_times(self.options.packets_hz)
        self.charges: Sequence[Charge] = world.charges
        # Comparisons of arrays would take half of the time of a packet.
        self._times = [float(charge.time_s) for charge in self.charges]
        self.added: set[str] = set()

    def between(self, after_s: float, until_s: float) -> Sequence[Charge]:
        """Return the blasts after a time and until another [s]."""
        first = bisect.bisect_right(self._times, after_s)
        return self.charges[first : bisect.bisect_right(self._times, until_s)]

    def announce(self, blast: NewBlast, now_s: float) -> None:
        """Add a future blast.

        Args:
            blast: Blast with a new name and a time more than the lead after `now_s`.
            now_s: Time of the world's clock; in lockstep 0, the beginning of the world
                [s].

        Raises:
            InputError: It is too early, its name is taken, or a value is invalid.
            Refused: There are too many.
        """
        shot, time_s, place, mass_kg, explosive = blast
        where, (low, high) = f"blast {shown(shot)}", MASS_KG
        taken = {"", *(charge.name for charge in self.charges)}
        require(shot not in taken, where, "a new name", "none, or that of another")
        # Strictly later, so that each entity that starts now has the whole lead.
        earliest = now_s + self.options.lead_s
        expected = f"one after {earliest:g} s, the lead after now ({now_s:g} s)"
        later = earliest < time_s < math.inf
        require(later, f"{where} time_s", expected, f"{time_s:g} s")
        right = low <= mass_kg <= high
        require(right, f"{where} mass_kg", f"{low:g} to {high:g} kg", f"{mass_kg:g}")
        place = _numbers(f"{where} position_m")(place)
        right = place[2] >= 0 and np.abs(place).max() <= FARTHEST_M
        expected = f"a position above the ground, at most {FARTHEST_M:g} m from 0"
        require(right, f"{where} position_m", expected, place.tolist())
        known, expected = explosive in EXPLOSIVES, f"one of {', '.join(EXPLOSIVES)}"
        require(known, f"{where} explosive", expected, shown(explosive))
        if len(self.added) >= MAX_ADDED:
            full = f"{where}: expected at most {MAX_ADDED:,} added blasts, got one more"
            raise Refused(full, "RESOURCE_EXHAUSTED")
        place = tuple(place.tolist())
        charge = Charge(mass_kg, place, time_s, explosive=explosive, name=shot)
        # Blasts at equal times keep their order.
        number = bisect.bisect_right(self._times, time_s)
        self._times.insert(number, time_s)
        self.charges = (*self.charges[:number], charge, *self.charges[number:])
        self.added.add(shot)


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
