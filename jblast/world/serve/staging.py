"""The packets of one entity, computed ahead of time.

One blast for one entity is computed at a time, by programs that are the same for all
blasts and entities: for the load, the arrivals, and each kind of sampled sensor. The
position of a moving entity at an arrival follows from its path or from its last report,
extrapolated linearly.

A blast is announced in the first packet that begins within the lead before it. A blast
that a client adds later is announced in the next packet, as to an entity that joins. An
entity that reports its motion receives updated announcements, computed from its last
report, in the packet of an arrival and the one before. As an entity is slower than
sound, no wave arrives unannounced, and an arriving wave is the one announced last.

Samples are those of `sensors.recording` for a microphone and a pressure gauge without
errors, at the same times. Each wave has its own record, cut below `SILENCE_PA`.

Force and moment are means over each step, from the impulses of `vehicle.blast_load`,
for a vehicle in its state at the arrival. The announced load (`announced_load`) also
includes the change of that state during the pulse, so a flight with it equals the
flight in one process.
"""

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.kept_programs import kept
from jblast.scene import Charge, Instrument, Scene, Sensor, VehicleSpec
from jblast.sensors import Track, recording, waves
from jblast.sensors.noise import BLOCK
from jblast.vehicle import BlastLoad, State, Vehicle, blast_load, named, rotor_speeds
from jblast.vehicle.from_scene import image_of, wind_of
from jblast.vehicle.loads.blast_wave import Blast
from jblast.waves.propagation import ambient, sound_speed_of
from jblast.waves.pulse import Pulse
from jblast.world.perceived import WAVES, Perceived, arrivals_of
from jblast.world.serve.entities import SENSES, Entity, Motion, ServedWorld

PAST_S = 60.0
"""Age up to which a blast is announced to a new client.

In this time its wave travels 20 km; later waves are inaudible for the charges here.
"""
EXTRAPOLATION_S = 30.0
"""Duration of the linear extrapolation of a reported motion [s]; declared.

Waves that arrive later are updated by later reports.
"""
NAME = "entity"
"""Name of each entity in a scene: with its own each would compile its own programs."""
SILENCE_PA = 1e-9
"""Pressure below which samples at both ends of a wave are dropped.

86 dB below the threshold of hearing (20 uPa).
"""
KINDS = {"pressure": "pressure", "sound": "microphone"}
"""Kind of sensor of each sense with samples of pressure."""
STEPS_HZ = 2000.0
"""Steps per second of a force: the default of a flight."""
ARRIVALS = ("flash_s", "ground_s", "air_s")
"""Arrivals of an announcement."""
COLUMNS: dict[str, tuple[int, ...]] = {"force": (6,), "pressure": (), "sound": ()}
"""Shape of a sample of each sampled sense."""


class Rows(NamedTuple):
    """Contiguous samples at a fixed rate.

    Attributes:
        first: Number of the first sample, counted from 0 at 0 s on the common clock.
        rate_hz: Samples per second.
        values: One row per sample: pressure, mean over the sampling interval [Pa]; or
            mean force, world axes [N], and moment about the centre of mass, body axes
            [N m]. Empty if all are zero.
    """

    first: int
    rate_hz: float
    values: Float[np.ndarray, "row ..."] = np.zeros(0)


class Announcement(NamedTuple):
    """A blast, announced to one entity before it happens.

    Attributes:
        shot: Name of the blast.
        revision: 0 at first; increased by one with each update.
        time_s: Time of the detonation [s].
        position_m: East, north, up [m].
        mass_kg: Mass of the explosive [kg].
        pressure_mass_kg: TNT mass of equal pressure [kg].
        impulse_mass_kg: TNT mass of equal impulse [kg].
        burst: Curve set of its load, "surface" or "free-air".
        flash_s: Arrival of the light at the entity, common clock [s]; infinite: never.
        ground_s: Arrival of the ground wave [s].
        air_s: Arrival of the air shock [s].
        ends_s: End of its last arrival and sample at the entity [s].
        pulse: Air shock at the entity; None: it never arrives.
    """

    shot: str
    revision: int
    time_s: float
    position_m: Float[np.ndarray, "3"]
    mass_kg: float
    pressure_mass_kg: float
    impulse_mass_kg: float
    burst: str
    flash_s: float
    ground_s: float
    air_s: float
    ends_s: float
    pulse: Pulse | None = None


class Air(NamedTuple):
    """Ambient air of a world.

    Attributes:
        pressure_pa: Ambient pressure.
        sound_speed_m_s: Speed of sound in still air.
        wind_m_s: East, north, up.
    """

    pressure_pa: float
    sound_speed_m_s: float
    wind_m_s: Float[np.ndarray, "3"]


class Packet(NamedTuple):
    """Announcements, perceptions and samples of an entity in one interval of time.

    Attributes:
        number: Number of the packet; packet 0 begins at 0 on the common clock.
        time_s: Beginning [s]; the packet ends where the next one begins.
        announcements: New or updated blasts.
        perceived: First perceptions within the packet.
        force: Force and moment, summed over all blasts.
        pressure: Pressure samples, summed over all blasts.
        sound: Sound samples, summed over all blasts.
        last: True if the world ends with this packet.
    """

    number: int
    time_s: float
    announcements: tuple[Announcement, ...] = ()
    perceived: tuple[Perceived, ...] = ()
    force: Rows | None = None
    pressure: Rows | None = None
    sound: Rows | None = None
    last: bool = False


def air_of(scene: Scene) -> Air:
    """Return the ambient air of a scene."""
    pressure, sound = ambient(scene.air)[1], sound_speed_of(scene.air)
    return Air(float(pressure), float(sound), np.asarray(wind_of(scene), float))


def announced_load(
    announced: Collection[Announcement], air: Air, *, since_s: float = 0.0
) -> BlastLoad:
    """Return the load of announced blasts, for successive short flights.

    Blasts that never happen are added up to a multiple of eight, so that few programs
    serve any number.

    Args:
        announced: The blasts, in any order.
        air: Ambient air of the world.
        since_s: Beginning of the flight, where its own clock is 0 [s].
    """
    blasts = [
        Blast(
            one.position_m,
            one.time_s - since_s,
            one.pressure_mass_kg,
            one.impulse_mass_kg,
            float(one.burst == "free-air"),
        )
        for one in announced
    ]
    never = Blast([1e3, 0.0, 0.0], math.inf, 1.0, 1.0, 1.0)
    blasts += [never] * (8 - len(blasts) % 8)
    return BlastLoad(
        jax.tree.map(lambda *x: jnp.stack(x), *blasts, *map(image_of, blasts)),
        len(blasts),
        air.pressure_pa,
        air.sound_speed_m_s,
        jnp.asarray(air.wind_m_s),
    )


class Staged(NamedTuple):
    """A blast computed for an entity.

    Attributes:
        charge: The blast.
        motion: Report of the entity that it was computed for, or None.
        announced: Its announcement.
        samples: Its samples by sense: of each wave, or the force.
    """

    charge: Charge
    motion: Motion | None
    announced: Announcement
    samples: dict[str, tuple[Rows, ...]]


def stage(
    world: ServedWorld, entity: Entity, charge: Charge, motion: Motion | None = None
) -> Staged:
    """Return announcement and samples of a blast for an entity.

    Args:
        world: Air, ground and laws.
        entity: Recipient.
        charge: The blast.
        motion: Last report of the entity, or None.

    Raises:
        InputError: The entity is at the charge, or as fast as sound.
    """
    place = standpoint(entity, motion)
    tracks = {NAME: place} if isinstance(place, Track) else {}
    start = np.asarray(place.position[0]) if isinstance(place, Track) else place
    scene = replace(
        world.scene,
        charges=(replace(charge, name=""),),
        sensors=(Sensor(NAME, start),),
    )
    arrivals = arrivals_of(scene, tracks)
    flash, ground, air = (float(arrivals.times_s[wave][0, 0]) for wave in WAVES)
    # The load depends only on the position of the vehicle, so any model will do.
    # A blast load needs a vehicle position to select its curve set.
    here = arrivals.places_m["air_arrival_s"][0, 0]
    spec = VehicleSpec(entity.vehicle or "hummingbird", here)
    load = blast_load(replace(scene, sensors=(), vehicle=spec))
    scene = replace(scene, sensors=())
    samples = {
        sense: records_of(scene, place, KINDS[sense], entity.samples_hz)
        for sense in KINDS
        if sense in entity.senses
    }
    never = math.isinf(air)
    if "force" in entity.senses and not never:
        # The attitude is the reported one; without a report, level.
        moves = np.zeros(3)
        if isinstance(place, Track):  # the leg after a knot, which the wave meets
            step_s = 1e-3
            after = place.at(jnp.asarray(air + np.array([0.0, step_s])))
            moves = np.diff(after, axis=0)[0] / step_s
        met = replace(motion or Motion(0.0, here), position_m=here, velocity_m_s=moves)
        vehicle = named(entity.vehicle)
        samples["force"] = (force_rows(load, vehicle, state_met(vehicle, met)),)
    (pulse,) = (wave.pulse for wave in waves(scene, place, ways=("air",)))
    ends = [time for time in (flash, ground, air) if math.isfinite(time)]
    ends += [
        (rows.first + len(rows.values)) / rows.rate_hz
        for records in samples.values()
        for rows in records
    ]
    blast = load.blasts
    announced = Announcement(
        charge.name,
        0,
        float(charge.time_s),
        np.array([float(x) for x in charge.position_m]),
        float(charge.mass_kg),
        float(blast.mass_kg[0]),
        float(blast.impulse_mass_kg[0]),
        "free-air" if blast.free_air[0] > 0 else "surface",
        flash,
        ground,
        air,
        max(ends, default=-math.inf),
        None if never else jax.tree.map(float, pulse),
    )
    return Staged(charge, motion, announced, samples)


class Playback:
    """The packets of one entity, by alternating calls of `wanted` and `next`.

    Attributes:
        entity: Recipient.
        world: Blasts and times of packets.
        number: Number of the next packet.
        motion: Last report of the entity's motion.
        live: Announced blasts that are not over, by name.
    """

    def __init__(self, entity: Entity, world: ServedWorld, first: int = 0):
        """Begin before the first packet.

        Args:
            entity: Recipient.
            world: Blasts and times of packets.
            first: Number of the first packet.
        """
        self.entity, self.number = entity, first
        self.motion: Motion | None = None
        self.live: dict[str, Staged] = {}
        self.world, self._staged = world, set[str]()
        self._sound_m_s = float(sound_speed_of(world.scene.air))

    @property
    def time_s(self) -> float:
        """Beginning of the next packet [s]."""
        return self.world.times.start_s(self.number)

    def soon(self, ahead_s: float) -> list[Charge]:
        """Return the blasts announced for the first time within the next interval.

        Args:
            ahead_s: Length of the interval from the beginning of the next packet [s].
        """
        now, world = self.time_s, self.world
        until = now + ahead_s + world.options.lead_s
        found = world.between(now - PAST_S, until)
        return [charge for charge in found if charge.name not in self._staged]

    def wanted(self) -> list[Charge]:
        """Return the blasts to stage for the next packet: updates, then new ones."""
        new = self.soon(0.0)
        # Blasts added while these are staged belong to the packet after.
        self._staged |= {charge.name for charge in new}
        return [one.charge for one in self.live.values() if self._uncertain(one)] + new

    def next(self, staged: Iterable[Staged]) -> Packet:
        """Return the next packet.

        Args:
            staged: The blasts that `wanted` returned.
        """
        start, end = self.time_s, self.world.times.start_s(self.number + 1)
        announced = []
        for one in staged:
            new, known = one.announced, self.live.get(one.charge.name)
            if known is not None:
                # Arrivals that were sent stay; others are not before this packet.
                of = {wave: getattr(known.announced, wave) for wave in ARRIVALS}
                for wave, time in of.items():
                    of[wave] = time if time < start else max(getattr(new, wave), start)
                new = new._replace(revision=known.announced.revision + 1, **of)
            # A client that joins late does not receive blasts whose effects have ended.
            elif new.ends_s < start:
                continue
            self.live[new.shot] = one._replace(announced=new)
            announced.append(new)
        packet = Packet(
            self.number,
            start,
            tuple(announced),
            tuple(self._perceived(start, end)),
            **{x: self._rows(x) for x in COLUMNS if x in self.entity.senses},
            last=end >= self.world.options.ends_s,
        )
        self.live = {
            name: one for name, one in self.live.items() if one.announced.ends_s >= end
        }
        self.number += 1
        return packet

    def _uncertain(self, live: Staged) -> bool:
        """Return whether a wave may arrive so soon that an update is due."""
        was, motion = live.motion, self.motion
        if motion is None or len(self.entity.path) > 1 or was is motion:
            return False
        then = self.entity.start_m
        if was is not None:
            then = was.position_m + (motion.time_s - was.time_s) * was.velocity_m_s
        # Distance from the extrapolated position: the wave may arrive earlier by at
        # most this time.
        early_s = float(np.linalg.norm(motion.position_m - then)) / self._sound_m_s
        limit = self.world.times.start_s(self.number + 2) + early_s
        # The light of a flash is not later or earlier by motion.
        comes = live.announced.ground_s, live.announced.air_s
        return any(self.time_s <= time < limit for time in comes)

    def _perceived(self, start: float, end: float) -> list[Perceived]:
        """Return the perceptions within a packet, sorted by time."""
        found = [
            Perceived(shot, self.entity.name, word, time)
            for shot, one in self.live.items()
            for sense in self.entity.senses
            for wave, word in SENSES[sense]
            if start <= (time := getattr(one.announced, wave)) < end
        ]
        return sorted(found, key=lambda one: (one.time_s, one.sense))

    def _rows(self, sense: str) -> Rows:
        """Return the summed samples within the next packet; empty without any."""
        rate_hz = STEPS_HZ if sense == "force" else self.entity.samples_hz
        # Exact integers, so consecutive packets share no sample and skip none.
        first, last = self.world.times.samples(self.number, rate_hz)
        # Most packets are silent, and an empty array keeps their messages small.
        total = np.zeros((0, *COLUMNS[sense]))
        for live in self.live.values():
            for begin, _, values in live.samples.get(sense, ()):
                low, high = max(begin, first), min(begin + len(values), last)
                if low < high:
                    if not total.size:
                        total = np.zeros((last - first, *COLUMNS[sense]))
                    part = values[low - begin : high - begin]
                    total[low - first : high - first] += part
        return Rows(first, rate_hz, total)


def packets_of(playback: Playback) -> Iterator[Packet]:
    """Yield the packets of an entity in this process, to the end of the world."""
    last = False
    while not last:
        of = playback.world, playback.entity
        staged = [stage(*of, one, playback.motion) for one in playback.wanted()]
        packet = playback.next(staged)
        yield packet
        last = packet.last


def standpoint(entity: Entity, motion: Motion | None) -> np.ndarray | Track:
    """Return the position of an entity, or its path over time.

    Args:
        entity: The entity; its own path has priority over reports.
        motion: Last report; None without one.
    """
    if len(entity.path) > 1:
        time, place = entity.times_s, entity.places_m
        # Programs are compiled per number of knots: powers of two give at most 12.
        rest = 2 ** (len(time) - 1).bit_length() - len(time)
        time = np.append(time, time[-1] + 1.0 + np.arange(rest))
        return Track(time, np.pad(place, ((0, rest), (0, 0)), mode="edge"))
    if motion is None:
        return entity.start_m
    place, lasts = (
        np.maximum(motion.position_m, [-np.inf, -np.inf, 0.0]),
        EXTRAPOLATION_S,
    )
    if (sinks := -motion.velocity_m_s[2]) * lasts > place[2]:  # it lands before
        # The extrapolation stops on the ground; 1 ms keeps the knots of the path
        # distinct.
        lasts = max(place[2] / sinks, 1e-3)
    places = np.stack([place, place + lasts * motion.velocity_m_s])
    places[:, 2] = np.maximum(places[:, 2], 0.0)
    return Track(motion.time_s + np.array([0.0, lasts]), places)


def records_of(
    scene: Scene, place: np.ndarray | Track, kind: str, rate_hz: float
) -> tuple[Rows, ...]:
    """Return the pressure records of one blast at a position, one of each wave.

    Args:
        scene: Scene with this blast only, with its laws stated.
        place: East, north, up [m], or a path.
        kind: Kind of sensor: "pressure", or "microphone" with ground sound and
            atmospheric absorption.
        rate_hz: Samples per second.
    """
    track = place if isinstance(place, Track) else None
    start = np.zeros(3) if isinstance(place, Track) else place
    sensor = Sensor("", start, kind=kind, instrument=Instrument(rate=rate_hz))
    recorder, found = recording(scene, sensor, jax.random.key(0), track=track), []
    for source in recorder.sources:
        begins, ends = source.span(rate_hz)
        if math.isinf(begins):
            continue
        first = math.floor(begins * rate_hz)
        # Record lengths are powers of two blocks, for few compiled programs.
        blocks = (ends * rate_hz - first) / BLOCK
        size = BLOCK * 2 ** max(math.ceil(math.log2(blocks)), 0)
        begin = jnp.asarray(first / rate_hz)
        alone = replace(recorder, sources=(source,), begin=begin)
        samples = np.asarray(alone.samples(size / rate_hz))
        # Silence at both ends is not sent. A copy, so that the padding is freed.
        loud = np.flatnonzero(np.abs(samples) >= SILENCE_PA)
        if loud.size:
            record = samples[loud[0] : loud[-1] + 1].copy()
            found.append(Rows(first + int(loud[0]), rate_hz, record))
    return tuple(found)


def state_met(vehicle: Vehicle, motion: Motion) -> State:
    """Return a vehicle's state for a motion, with the rotor speeds of hover."""
    zero = jnp.zeros(())
    weight = vehicle.mass_kg * FLIGHT_GRAVITY
    return State(
        position_m=jnp.asarray(motion.position_m),
        velocity_m_s=jnp.asarray(motion.velocity_m_s),
        quaternion=jnp.asarray(motion.quaternion / np.linalg.norm(motion.quaternion)),
        body_rate_rad_s=jnp.asarray(motion.body_rate_rad_s),
        rotor_speed_rad_s=rotor_speeds(vehicle, (weight, zero, zero, zero)),
    )


def force_rows(load: BlastLoad, vehicle: Vehicle, state: State) -> Rows:
    """Return force and moment of a blast on a vehicle.

    Args:
        load: Load of a single blast that happens.
        vehicle: The vehicle.
        state: State at the arrival.
    """
    begins, ends = (np.asarray(x) for x in _spans(load, vehicle, state))
    first = math.floor(begins.min() * STEPS_HZ)
    steps = math.ceil(ends[np.isfinite(ends)].max() * STEPS_HZ) + 1 - first
    # Powers of two from 256 on: a few compiled programs serve all durations.
    size = max(2 ** math.ceil(math.log2(steps)), 256)
    edges = np.arange(first, first + size + 1) / STEPS_HZ
    rows = np.asarray(_means(load, vehicle, state, jnp.asarray(edges)))
    # A copy, so that the padding is freed.
    return Rows(first, STEPS_HZ, rows[:steps].copy())


@kept
def _spans(
    load: BlastLoad, vehicle: Vehicle, state: State
) -> tuple[Float[Array, " wave"], Float[Array, " wave"]]:
    """Return beginning and end of the force of each wave."""
    return load.span_s(state.position_m, vehicle)


@kept
def _means(
    load: BlastLoad, vehicle: Vehicle, state: State, edges: Float[Array, " edge"]
) -> Float[Array, "step 6"]:
    """Return mean force and moment over each step, for the state at the arrival."""

    def mean(start: Float[Array, ""], end: Float[Array, ""]) -> Float[Array, "6"]:
        given = load.impulse(start, end, state, vehicle)
        return jnp.concatenate(given) / (end - start)

    return jax.vmap(mean)(edges[:-1], edges[1:])
