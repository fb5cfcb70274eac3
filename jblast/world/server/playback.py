"""The packets of one entity, computed ahead of time.

One blast for one entity is computed at a time, by programs that are the same for all
blasts and entities: for the load, the arrivals, and each kind of sampled sensor. The
position of a moving entity at an arrival follows from its path or from its last report,
extrapolated linearly.

A blast is announced in the first packet that begins within the lead before it. A blast
that a client adds later is announced in the next packet, as to an entity that joins. An
entity that reports its motion receives an updated announcement, computed from its last
report, in one of the `UPDATE_PACKETS` packets before an arrival. As an entity is slower
than sound, no wave arrives unannounced, and an arriving wave is the one announced last.

Samples are those of `sensors.recording` for a microphone and a pressure gauge without
errors, at the same times. Samples between the waves of a blast
and below `SILENCE_PA` are not stored.

Force and moment of a force profile are means over each step, from the impulses of
`vehicle.blast_load`, for a vehicle in its state at the arrival. The announced load
(`announced_load`) also includes the change of that state during the pulse, so a flight
with it equals the flight in one process. A C++ client, which has no laws, uses the
force profiles.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.scene import Charge, Instrument, Scene, Sensor, VehicleSpec
from jblast.sensors import Track, Wave, record_laws, recording, waves
from jblast.sensors.noise import BLOCK
from jblast.sensors.waves_met import IN_AIR, IN_GROUND
from jblast.types import as_numbers
from jblast.vehicle import BlastLoad, State, Vehicle, blast_load, named, rotor_speeds
from jblast.vehicle.from_scene import images_of
from jblast.vehicle.loads.blast_wave import Blast, crossing_time
from jblast.waves.propagation import TAIL_S, sound_speed_of
from jblast.waves.pulse import GroundPulse
from jblast.world.drawn import DrawnWorld
from jblast.world.perceived import Perceived, arrivals_of
from jblast.world.server.registry import (
    PAST_S,
    BlastSchedule,
    Entity,
    Motion,
    PacketTimes,
)

UPDATE_PACKETS = 2
"""Number of packets before an arrival in which the announcement is updated.

Two, because staging takes part of one packet's time.
"""
WAVES = ("flash_s", "ground_s", "air_s")
EXTRAPOLATION_S = 30.0
"""Duration of the linear extrapolation of a reported motion [s]; declared.

Waves that arrive later are updated by later reports.
"""
NAME = "entity"
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
"""Default attitude: level, body x towards east."""
SILENCE_PA = 1e-9
"""Pressure below which samples at both ends of an interval are dropped.

86 dB below the threshold of hearing (20 uPa).
"""
GROUND_TIME_CONSTANTS = 50.0
"""Duration of a ground pulse in time constants: there u^2 exp(-u) is 5e-19."""
KINDS = {"pressure": "pressure", "sound": "microphone"}
STEPS_HZ = 2000.0
"""Steps per second of a force profile: the default of a flight."""
MAX_STEPS = 2**14
"""Maximum number of steps of a force profile: 8 s, longer than any blast wave here."""


class AirPulse(NamedTuple):
    """The air shock at an entity: `waves.pulse.Pulse` in floats.

    Attributes:
        arrival_s: Beginning of the pressure rise [s].
        peak_pa: Peak overpressure.
        rise_s: Time from zero to the peak.
        duration_s: Duration of the positive phase, rise included.
        decay: Friedlander's b behind the peak [-].
        suction_pa: Maximum underpressure.
        suction_s: Duration of the negative phase.
        hold_s: Duration of the peak.
    """

    arrival_s: float
    peak_pa: float
    rise_s: float
    duration_s: float
    decay: float
    suction_pa: float
    suction_s: float
    hold_s: float


class BlastArrivals(NamedTuple):
    """Arrival times of a blast at an entity, common clock [s]; infinite: never.

    Attributes:
        flash_s: Arrival of the light.
        ground_s: Arrival of the ground wave.
        air_s: Arrival of the air shock.
    """

    flash_s: float
    ground_s: float
    air_s: float


class ForceProfile(NamedTuple):
    """Force and moment of a blast on a vehicle in its state at the arrival.

    Step n begins at `n / rate_hz` on the common clock.

    Attributes:
        first: Number of the first step.
        rate_hz: Steps per second.
        force_n: Mean force over each step, world axes.
        moment_nm: Mean moment over each step about the centre of mass, body axes.
    """

    first: int
    rate_hz: float
    force_n: Float[np.ndarray, "step 3"]
    moment_nm: Float[np.ndarray, "step 3"]


class Record(NamedTuple):
    """Contiguous samples of a single blast.

    Attributes:
        first: Number of the first sample, counted from 0 on the common clock.
        rate_hz: Samples per second.
        samples: Mean over each sampling interval [Pa].
    """

    first: int
    rate_hz: float
    samples: Float[np.ndarray, " sample"]


class Announcement(NamedTuple):
    """A blast, announced to one entity before it happens.

    Attributes:
        charge: Charge, position and time; its name is the blast's.
        revision: 0 at first; increased by one with each update.
        arrivals: Arrival times at the entity.
        pulse: Air shock at the entity; None: it never arrives.
        burst: Curve set of its load, "surface" or "free-air".
        tnt_mass_kg: TNT masses of equal pressure and of equal impulse.
        force: Force profile, for the sense "force".
        pressure: Records, for the sense "pressure".
        sound: Records, for the sense "sound".
    """

    charge: Charge
    revision: int
    arrivals: BlastArrivals
    pulse: AirPulse | None
    burst: str
    tnt_mass_kg: tuple[float, float]
    force: ForceProfile | None = None
    pressure: tuple[Record, ...] = ()
    sound: tuple[Record, ...] = ()

    def last_s(self) -> float:
        """Return the end of its last arrival, force profile and record [s]."""
        ends = [time for time in self.arrivals if np.isfinite(time)]
        if self.force is not None:
            steps = self.force.first + len(self.force.force_n)
            ends.append(steps / self.force.rate_hz)
        ends += [
            (record.first + record.samples.size) / record.rate_hz
            for record in (*self.pressure, *self.sound)
        ]
        return max(ends, default=-np.inf)


def announced_load(
    announced: Sequence[Announcement],
    *,
    pressure_pa: float,
    sound_speed_m_s: float,
    wind_m_s: Sequence[float],
    since_s: float = 0.0,
    room: int = 4,
) -> BlastLoad:
    """Return the load of announced blasts, for successive short flights.

    Args:
        announced: The blasts, of both curve sets in any order.
        pressure_pa: Ambient pressure.
        sound_speed_m_s: Speed of sound in still air.
        wind_m_s: East, north, up.
        since_s: Beginning of the flight, where its own clock is 0 [s].
        room: Number of blasts per curve set; the load is padded with blasts that never
            happen, so that one program serves any number.

    Raises:
        InputError: There are more blasts than `room`.
    """
    blasts = []
    for burst in ("surface", "free-air"):
        of_burst = [one for one in announced if one.burst == burst]
        if len(of_burst) > room:
            raise InputError(
                f"expected at most {room} simultaneous blasts of burst {burst!r}, got "
                f"{len(of_burst)}"
            )
        blasts += [_blast(one, since_s) for one in of_burst]
        # Padding: a blast that never happens, far from any vehicle.
        never = Blast(
            jnp.array([1e3, 0.0, 0.0]),
            jnp.asarray(math.inf),
            jnp.ones(()),
            jnp.ones(()),
            burst,
        )
        blasts += [never] * (room - len(of_burst))
    return BlastLoad(
        tuple(blasts),
        pressure_pa,
        sound_speed_m_s,
        jnp.asarray(wind_m_s, float),
        images=images_of(blasts),
    )


def _blast(announced: Announcement, since_s: float) -> Blast:
    pressure_mass, impulse_mass = announced.tnt_mass_kg
    return Blast(
        position_m=jnp.stack(
            [jnp.asarray(x, float) for x in announced.charge.position_m]
        ),
        time_s=jnp.asarray(float(announced.charge.time_s) - since_s),
        mass_kg=jnp.asarray(pressure_mass),
        impulse_mass_kg=jnp.asarray(impulse_mass),
        burst=announced.burst,
    )


class PlayedForce(eqx.Module):
    """A pulse of precomputed forces, independent of the vehicle's motion.

    Attributes:
        rows: Force, world [N], and moment, body [N m], of each step.
        rate_hz: Steps per second; the first begins with the flight.
    """

    rows: Float[Array, "step 6"] = eqx.field(converter=as_numbers)
    rate_hz: Float[Array, ""] = eqx.field(converter=as_numbers)

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return impulse [N s] and angular impulse [N m s] between two times."""
        edges = jnp.arange(self.rows.shape[0] + 1, dtype=float) / self.rate_hz
        # The overlap of the interval with each step, exact for steps of any phase.
        until = jnp.clip(end_s, edges[:-1], edges[1:])
        since = jnp.clip(start_s, edges[:-1], edges[1:])
        given = (until - since) @ self.rows
        return given[:3], given[3:]


class Slice(NamedTuple):
    """Samples within a packet, summed over all blasts.

    Attributes:
        first: Number of the first sample, counted from 0 on the common clock.
        rate_hz: Samples per second.
        samples: One row per sample; empty if all are zero.
    """

    first: int
    rate_hz: float
    samples: Float[np.ndarray, "row ..."]


class Packet(NamedTuple):
    """Announcements, perceptions and samples of an entity in one interval of time.

    Attributes:
        number: Number of the packet; packet 0 begins at 0 on the common clock.
        time_s: Beginning [s]; the packet ends where the next one begins.
        announcements: New or updated blasts.
        perceived: First perceptions within the packet.
        force: Six numbers per step: force, world [N], and moment, body [N m].
        pressure: Pressure samples [Pa].
        sound: Sound samples [Pa].
        last: True if the world ends with this packet.
    """

    number: int
    time_s: float
    announcements: tuple[Announcement, ...] = ()
    perceived: tuple[Perceived, ...] = ()
    force: Slice | None = None
    pressure: Slice | None = None
    sound: Slice | None = None
    last: bool = False


def played_force(packet: Packet, packets_hz: float) -> PlayedForce:
    """Return the force of a packet, for a flight of the packet's length.

    Args:
        packet: Packet of an entity with the sense "force".
        packets_hz: Packets per second.
    """
    assert packet.force is not None, "the entity lacks the sense force"
    rate = packet.force.rate_hz
    rows = jnp.asarray(packet.force.samples)
    if not rows.size:
        rows = jnp.zeros((round(rate / packets_hz), 6))
    return PlayedForce(rows, jnp.asarray(rate))


class StagingRequest(NamedTuple):
    """A blast to announce to an entity: the arguments of `Stager.stage`.

    Attributes:
        entity: Recipient.
        charge: The blast.
        motion: Last report of the entity, or None.
        revision: Number of earlier announcements.
    """

    entity: Entity
    charge: Charge
    motion: Motion | None
    revision: int


class _Live:
    """An announced blast that is not over."""

    def __init__(self, announced: Announcement, motion: Motion | None):
        self.newest = announced
        self.motion = motion
        self.settled: set[str] = {"flash_s"}


class Stager:
    """Computation of announcements for entities.

    Attributes:
        scene: Air and ground of the world, with its laws stated.
    """

    def __init__(self, world: DrawnWorld):
        """Take the air, the ground and the laws of a world."""
        self.scene = replace(
            world.scene, sensors=(), camera=None, clocks=(), vehicle=None, ambient=None
        )
        self._laws = dict(self.scene.law) | record_laws(self.scene)

    def stage(
        self,
        entity: Entity,
        charge: Charge,
        motion: Motion | None = None,
        revision: int = 0,
    ) -> Announcement:
        """Return the announcement of a blast to an entity.

        Args:
            entity: Recipient.
            charge: The blast.
            motion: Last report; None without one.
            revision: Number of earlier announcements.

        Raises:
            InputError: The entity is at the charge, or as fast as sound.
        """
        place = standpoint(entity, motion)
        scene = self._alone(charge)
        arrivals = self._arrivals(scene, place)
        pulse = self._pulse(scene, place)
        met = _motion_at(place, arrivals.air_s)
        # The attitude matters for forces only, whose profile is for the reported
        # attitude.
        if motion is not None:
            met = met._replace(
                quaternion=motion.quaternion, body_rate_rad_s=motion.body_rate_rad_s
            )
        # The load depends only on the position of the vehicle, so any model will do.
        # A blast load needs a vehicle position to select its curve set.
        spec = VehicleSpec(entity.vehicle or "hummingbird", met.position_m)
        load = blast_load(replace(scene, vehicle=spec))
        force = None
        if "force" in entity.senses and pulse is not None:
            vehicle = named(entity.vehicle)
            force = force_profile(load, vehicle, state_met(vehicle, met))
        sampled = {
            sense: records_of(scene, place, sense, entity.samples_hz, self._laws)
            for sense in ("pressure", "sound")
            if sense in entity.senses
        }
        (blast,) = load.blasts
        masses = float(blast.mass_kg), float(blast.impulse_mass_kg)
        return Announcement(
            charge, revision, arrivals, pulse, blast.burst, masses, force, **sampled
        )

    def _alone(self, charge: Charge) -> Scene:
        return replace(self.scene, charges=(replace(charge, name=""),))

    def _arrivals(self, scene: Scene, place: np.ndarray | Track) -> BlastArrivals:
        tracks = {NAME: place} if isinstance(place, Track) else {}
        start = place.position[0] if isinstance(place, Track) else place
        observed = replace(scene, sensors=(Sensor(NAME, np.asarray(start)),))
        times = arrivals_of(observed, tracks).times_s
        flash, ground, air = (
            float(times[wave][0, 0])
            for wave in ("flash_time_s", "ground_arrival_s", "air_arrival_s")
        )
        return BlastArrivals(flash, ground, air)

    def _pulse(self, scene: Scene, place: np.ndarray | Track) -> AirPulse | None:
        pulse = waves(scene, place, self._laws, ("air",))[0].pulse
        if not np.isfinite(float(pulse.arrival_time)):
            return None
        return AirPulse(*(float(number) for number in pulse))


class Playback:
    """The packets of one entity, by alternating calls of `wanted` and `next`.

    Attributes:
        entity: Recipient.
        number: Number of the next packet.
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
            entity: Recipient.
            schedule: The blasts of the world.
            times: Times of the packets.
            stager: Stager of the same world; only its air is used here.
            first: Number of the first packet.
            until_s: End of the world [s]; the packet that contains it is the last.
        """
        self.entity = entity
        self.number = first
        self._schedule, self._times = schedule, times
        self._until_s = until_s
        self._ahead_s = UPDATE_PACKETS / float(times.rate)
        self._sound_m_s = float(sound_speed_of(stager.scene.air))
        self._announced_s = times.start_s(first) - schedule.lead_s - PAST_S
        # Numbers of added blasts: before the next packet, and before the one after it.
        self._added = self._added_next = len(schedule.added)
        self._live: dict[str, _Live] = {}
        self._motion: Motion | None = None

    @property
    def time_s(self) -> float:
        """Beginning of the next packet [s]."""
        return self._times.start_s(self.number)

    @property
    def waiting(self) -> int:
        """Number of announced blasts that are not over."""
        return len(self._live)

    def report(self, motion: Motion) -> None:
        """Store a report of the entity's motion; entities with a path ignore it."""
        self._motion = motion

    def soon(self, ahead_s: float) -> list[StagingRequest]:
        """Return the blasts announced for the first time within the next interval.

        Args:
            ahead_s: Length of the interval from the beginning of the next packet [s].
        """
        schedule, told_s = self._schedule, self._announced_s + self._schedule.lead_s
        charges = schedule.announced(self._announced_s, self.time_s + ahead_s)
        # Added after the packet that would have announced them.
        late = tuple(
            charge
            for charge in schedule.added[self._added :]
            if self.time_s - PAST_S <= float(charge.time_s) <= told_s
        )
        return [
            StagingRequest(self.entity, charge, self._motion, 0)
            for charge in late + charges
        ]

    def wanted(self) -> list[StagingRequest]:
        """Return the blasts to stage for the next packet: updates, then new ones."""
        uncertain = [x.newest for x in self._live.values() if self._uncertain(x)]
        updates = [
            StagingRequest(self.entity, one.charge, self._motion, one.revision + 1)
            for one in uncertain
        ]
        # Blasts added while these are staged belong to the packet after.
        self._added_next = len(self._schedule.added)
        return updates + self.soon(0.0)

    def next(self, staged: list[Announcement]) -> Packet:
        """Return the next packet.

        Args:
            staged: Announcements of the blasts that `wanted` returned.
        """
        start, end = self.time_s, self._times.start_s(self.number + 1)
        announced = []
        for new in staged:
            name = new.charge.name
            known = self._live.get(name)
            if known is not None:
                # Past arrivals have been sent: an update must not move them.
                was = known.newest.arrivals._asdict()
                past = {wave: time for wave, time in was.items() if time < start}
                new = new._replace(arrivals=new.arrivals._replace(**past))
            # A client that joins late does not receive blasts whose effects have ended.
            elif new.last_s() < start:
                continue  # over before its announcement
            live = _Live(new, self._motion)
            # Waves about to arrive are final: later reports must not move an arrival
            # that has been sent.
            live.settled |= {
                wave
                for wave in WAVES
                if getattr(new.arrivals, wave) - start <= self._ahead_s
            }
            self._live[name] = live
            announced.append(new)
        self._announced_s = max(self._announced_s, start)
        self._added = self._added_next
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
        """Return whether a wave may arrive so soon that an update is due."""
        if self._motion is None or self.entity.path is not None:
            return False
        if live.motion is self._motion:
            return False
        here = self._motion.position_m
        then = self.entity.position_m
        if live.motion is not None:
            since = self._motion.time_s - live.motion.time_s
            then = live.motion.position_m + since * live.motion.velocity_m_s
        # Distance from the extrapolated position: the wave may arrive earlier by at
        # most this time.
        early = float(np.linalg.norm(here - then)) / self._sound_m_s
        limit = self.time_s + early + self._ahead_s
        return any(
            self.time_s <= getattr(live.newest.arrivals, wave) <= limit
            for wave in WAVES
            if wave not in live.settled
        )

    def _perceived(self, start: float, end: float) -> list[Perceived]:
        """Return the perceptions within a packet, sorted by time."""
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
        """Return the summed samples within the next packet; empty without any."""
        # Exact integers, so consecutive packets share no sample and skip none.
        first, last = self._times.samples(self.number, rate_hz)
        total: np.ndarray | None = None
        for begin, samples in rows:
            low, high = max(begin, first), min(begin + len(samples), last)
            if low >= high:
                continue
            # Allocated only if some blast contributes: most packets are silent, and an
            # empty array keeps their messages small.
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


def standpoint(entity: Entity, motion: Motion | None) -> np.ndarray | Track:
    """Return the position of an entity, or its path over time.

    Args:
        entity: The entity; its own path has priority over reports.
        motion: Last report; None without one.
    """
    if entity.path is not None:
        return _padded(*entity.path)
    if motion is None:
        return entity.position_m
    place = np.maximum(motion.position_m, [-np.inf, -np.inf, 0.0])
    lasts = EXTRAPOLATION_S
    if (sinks := -motion.velocity_m_s[2]) * lasts > place[2]:  # it lands before
        # The extrapolation stops on the ground; 1 ms keeps the knots of the path
        # distinct.
        lasts = max(place[2] / sinks, 1e-3)
    later = place + lasts * motion.velocity_m_s
    time = motion.time_s + np.array([0.0, lasts])
    return Track(time, np.stack([place, np.maximum(later, [-np.inf, -np.inf, 0.0])]))


def _padded(time: np.ndarray, place: np.ndarray) -> Track:
    """Return a path padded to a power of two of knots, at rest at its end."""
    # Programs are compiled per number of knots: powers of two give at most 12.
    missing = max(2 ** (len(time) - 1).bit_length(), 2) - len(time)
    after = time[-1] + 1.0 + np.arange(missing)
    return Track(
        np.concatenate([time, after]),
        np.concatenate([place, np.repeat(place[-1:], missing, axis=0)]),
    )


def _motion_at(place: np.ndarray | Track, time_s: float) -> Motion:
    """Return position and velocity at a time, with level attitude."""
    if not isinstance(place, Track):
        return Motion(time_s, place, np.zeros(3), LEVEL, np.zeros(3))
    time, knots = np.asarray(place.time), np.asarray(place.position)
    here = np.stack([np.interp(time_s, time, axis) for axis in knots.T])
    if not time[0] <= time_s < time[-1]:
        return Motion(time_s, here, np.zeros(3), LEVEL, np.zeros(3))
    # The speed of the segment after a knot, which is the one that the wave meets.
    n = int(np.searchsorted(time, time_s, side="right")) - 1
    speed = (knots[n + 1] - knots[n]) / (time[n + 1] - time[n])
    return Motion(time_s, here, speed, LEVEL, np.zeros(3))


def records_of(
    scene: Scene,
    place: np.ndarray | Track,
    sense: str,
    rate_hz: float,
    laws: dict[str, str],
) -> tuple[Record, ...]:
    """Return the pressure records of one blast at a position, sorted by time.

    Args:
        scene: Scene with this blast only.
        place: East, north, up [m], or a path.
        sense: "pressure", or "sound" with ground sound and atmospheric absorption.
        rate_hz: Samples per second.
        laws: Laws by quantity.
    """
    track = place if isinstance(place, Track) else None
    start = place.position[0] if isinstance(place, Track) else place
    sensor = Sensor(
        "", np.asarray(start), kind=KINDS[sense], instrument=Instrument(rate=rate_hz)
    )
    is_sound = sense == "sound"
    met = waves(scene, place, laws, (*IN_AIR, *IN_GROUND) if is_sound else IN_AIR)
    found = []
    for first, last in _intervals(met, rate_hz, TAIL_S if is_sound else 0.0):
        # Record lengths are powers of two blocks, for few compiled programs.
        size = BLOCK * 2 ** math.ceil(math.log2(max((last - first) / BLOCK, 1.0)))
        start_s, key = first / rate_hz, jax.random.key(0)
        made = recording(scene, sensor, key, laws=laws, track=track, start_s=start_s)
        samples = np.asarray(made.samples(size / rate_hz))[: last - first]
        # Silence at both ends is not sent. A copy, so that the padding is freed.
        loud = np.flatnonzero(np.abs(samples) >= SILENCE_PA)
        if loud.size:
            begin, end = int(loud[0]), int(loud[-1]) + 1
            found.append(Record(first + begin, rate_hz, samples[begin:end].copy()))
    return tuple(found)


def _intervals(
    met: tuple[Wave, ...], rate_hz: float, tail_s: float
) -> list[tuple[int, int]]:
    """Return the intervals of samples with waves, as first and last + 1."""
    spans = sorted(
        (arrival, arrival + lasts + tail_s)
        for arrival, lasts in (_duration(wave) for wave in met)
        if math.isfinite(arrival)
    )
    found: list[tuple[int, int]] = []
    for begin, end in spans:
        first, last = math.floor(begin * rate_hz), math.ceil(end * rate_hz) + 1
        if found and first <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], last)
        else:
            found.append((first, last))
    return found


def _duration(wave: Wave) -> tuple[float, float]:
    """Return arrival and duration of a wave [s]."""
    pulse = wave.pulse
    if isinstance(pulse, GroundPulse):
        if not float(pulse.amplitude) > 0:
            return math.inf, 0.0
        return float(pulse.arrival_time), GROUND_TIME_CONSTANTS * float(
            pulse.time_constant
        )
    return float(pulse.arrival_time), float(pulse.lasts)


def state_met(vehicle: Vehicle, motion: Motion) -> State:
    """Return a vehicle's state for a motion, with the rotor speeds of hover."""
    zero = jnp.zeros(())
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return State(
        position_m=jnp.asarray(motion.position_m),
        velocity_m_s=jnp.asarray(motion.velocity_m_s),
        quaternion=jnp.asarray(motion.quaternion),
        body_rate_rad_s=jnp.asarray(motion.body_rate_rad_s),
        rotor_speed_rad_s=rotor_speeds(vehicle, (weight, zero, zero, zero)),
    )


def force_profile(load: BlastLoad, vehicle: Vehicle, state: State) -> ForceProfile:
    """Return force and moment of a blast on a vehicle.

    Args:
        load: Load of a single blast that happens.
        vehicle: The vehicle.
        state: State at the arrival.
    """
    begins, ends = (float(x) for x in _passing(load, vehicle, state))
    first = math.floor(begins * STEPS_HZ)
    last = math.ceil(ends * STEPS_HZ) + 1
    steps = min(last - first, MAX_STEPS)
    # Powers of two from 256 on: a few compiled programs serve all durations.
    size = max(2 ** math.ceil(math.log2(steps)), 256)
    edges = np.arange(first, first + size + 1) / STEPS_HZ
    force, moment = (
        np.asarray(x)[:steps] for x in _means(load, vehicle, state, jnp.asarray(edges))
    )
    return ForceProfile(first, STEPS_HZ, force.copy(), moment.copy())


@kept
def _passing(
    load: BlastLoad, vehicle: Vehicle, state: State
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return beginning and end of a blast's force, reflection included."""
    assert vehicle.body is not None, "models have one"
    body = vehicle.body

    def times(blast: Blast) -> tuple[Float[Array, ""], Float[Array, ""]]:
        wave, never = load.wave_of(blast, state.position_m), blast.never
        at_once = jnp.zeros_like(blast.time_s)
        came = load.front_time_s(blast, state.position_m, at_once)
        crossing = crossing_time(body, wave)
        # 5 % more than the wave's duration, as in `BlastLoad.quiet_until`.
        over = came + crossing + 1.05 * (wave.duration_s + wave.suction_s)
        begins = jnp.where(never, jnp.inf, came - crossing)
        return begins, jnp.where(never, -jnp.inf, over)

    begins, ends = (jnp.stack(x) for x in zip(*map(times, load.waves), strict=True))
    return jnp.min(begins), jnp.max(ends)


@kept
def _means(
    load: BlastLoad, vehicle: Vehicle, state: State, edges: Float[Array, " edge"]
) -> tuple[Float[Array, "step 3"], Float[Array, "step 3"]]:
    """Return mean force and moment over each step, for the state at the arrival."""

    def mean(
        start: Float[Array, ""], end: Float[Array, ""]
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        push, turn = load.impulse(start, end, state, vehicle)
        return push / (end - start), turn / (end - start)

    return jax.vmap(mean)(edges[:-1], edges[1:])
