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
errors, at the same times. Samples between the waves of a blast and below `SILENCE_PA`
are not stored.

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
from jblast.errors import require
from jblast.kept_programs import kept
from jblast.scene import Charge, Instrument, Scene, Sensor, VehicleSpec
from jblast.sensors import Track, Wave, record_laws, recording, waves
from jblast.sensors.noise import BLOCK
from jblast.sensors.waves_met import IN_AIR, IN_GROUND
from jblast.vehicle import BlastLoad, State, Vehicle, blast_load, named, rotor_speeds
from jblast.vehicle.from_scene import image_of
from jblast.vehicle.loads.blast_wave import Blast
from jblast.waves.propagation import TAIL_S, ambient, sound_speed_of
from jblast.waves.pulse import GroundPulse
from jblast.world.drawn import DrawnWorld
from jblast.world.perceived import Perceived, arrivals_of
from jblast.world.serve.entities import BlastSchedule, Entity, Motion, PacketTimes

PAST_S = 60.0
"""Age up to which a blast is announced to a new client.

In this time its wave travels 20 km; later waves are inaudible for the charges here.
"""
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
SILENCE_PA = 1e-9
"""Pressure below which samples at both ends of an interval are dropped.

86 dB below the threshold of hearing (20 uPa).
"""
GROUND_TIME_CONSTANTS = 50.0
"""Duration of a ground pulse in time constants: there u^2 exp(-u) is 5e-19."""
KINDS = {"pressure": "pressure", "sound": "microphone"}
STEPS_HZ = 2000.0
"""Steps per second of a force: the default of a flight."""
MAX_STEPS = 2**14
"""Maximum number of steps of a force: 8 s, longer than any blast wave here."""
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
    pulse: AirPulse | None = None


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


def announced_load(
    announced: Collection[Announcement],
    air: Air,
    *,
    since_s: float = 0.0,
    room: int = 8,
) -> BlastLoad:
    """Return the load of announced blasts, for successive short flights.

    Args:
        announced: The blasts, in any order.
        air: Ambient air of the world.
        since_s: Beginning of the flight, where its own clock is 0 [s].
        room: Number of blasts; the load is padded with blasts that never happen, so
            that one program serves any number.

    Raises:
        InputError: There are more blasts than `room`.
    """
    expected = f"at most {room} simultaneous blasts"
    require(len(announced) <= room, "announced", expected, len(announced))
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
    blasts += [never] * (room - len(blasts))
    return BlastLoad(
        jax.tree.map(lambda *x: jnp.stack(x), *blasts, *map(image_of, blasts)),
        room,
        air.pressure_pa,
        air.sound_speed_m_s,
        jnp.asarray(air.wind_m_s),
    )


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
    motion: Motion | None = None
    revision: int = 0


class Staged(NamedTuple):
    """A blast computed for an entity.

    Attributes:
        request: Blast, entity and its motion.
        announced: Its announcement.
        samples: Its samples by sense.
        settled: Waves that are not updated any more.
    """

    request: StagingRequest
    announced: Announcement
    samples: dict[str, tuple[Rows, ...]]
    settled: frozenset[str] = frozenset()


class Stager:
    """Computation of blasts for entities.

    Attributes:
        scene: Air and ground of the world, with its laws stated.
        air: Ambient air.
    """

    def __init__(self, world: DrawnWorld):
        """Take the air, the ground and the laws of a world."""
        self.scene = replace(
            world.scene, sensors=(), camera=None, clocks=(), vehicle=None, ambient=None
        )
        air = self.scene.air
        self.air = Air(
            float(ambient(air)[1]),
            float(sound_speed_of(air)),
            np.array([float(air.wind_east), float(air.wind_north), 0.0]),
        )
        self._laws = dict(self.scene.law) | record_laws(self.scene)

    def stage(self, request: StagingRequest) -> Staged:
        """Return announcement and samples of a blast for an entity.

        Raises:
            InputError: The entity is at the charge, or as fast as sound.
        """
        entity, charge, motion, revision = request
        place = standpoint(entity, motion)
        scene = replace(self.scene, charges=(replace(charge, name=""),))
        arrivals = self._arrivals(scene, place)
        pulse = self._pulse(scene, place)
        here, velocity = _met_at(place, arrivals[2])
        # The load depends only on the position of the vehicle, so any model will do.
        # A blast load needs a vehicle position to select its curve set.
        spec = VehicleSpec(entity.vehicle or "hummingbird", here)
        load = blast_load(replace(scene, vehicle=spec))
        samples = {
            sense: records_of(scene, place, sense, entity.samples_hz, self._laws)
            for sense in KINDS
            if sense in entity.senses
        }
        if "force" in entity.senses and pulse is not None:
            # The attitude is the reported one; without a report, level.
            met = replace(
                motion or Motion(0.0, here), position_m=here, velocity_m_s=velocity
            )
            vehicle = named(entity.vehicle)
            samples["force"] = (force_rows(load, vehicle, state_met(vehicle, met)),)
        ends = [time for time in arrivals if math.isfinite(time)]
        ends += [
            (rows.first + len(rows.values)) / rows.rate_hz
            for records in samples.values()
            for rows in records
        ]
        blast = load.blasts
        announced = Announcement(
            charge.name,
            revision,
            float(charge.time_s),
            np.array([float(x) for x in charge.position_m]),
            float(charge.mass_kg),
            float(blast.mass_kg[0]),
            float(blast.impulse_mass_kg[0]),
            "free-air" if blast.free_air[0] > 0 else "surface",
            *arrivals,
            max(ends, default=-math.inf),
            pulse,
        )
        return Staged(request, announced, samples)

    def _arrivals(
        self, scene: Scene, place: np.ndarray | Track
    ) -> tuple[float, float, float]:
        """Return the arrival times of flash, ground wave and air shock [s]."""
        tracks = {NAME: place} if isinstance(place, Track) else {}
        start = place.position[0] if isinstance(place, Track) else place
        observed = replace(scene, sensors=(Sensor(NAME, np.asarray(start)),))
        times = arrivals_of(observed, tracks).times_s
        flash, ground, air = (
            float(times[wave][0, 0])
            for wave in ("flash_time_s", "ground_arrival_s", "air_arrival_s")
        )
        return flash, ground, air

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
        motion: Last report of the entity's motion.
        live: Announced blasts that are not over, by name.
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
        self.motion: Motion | None = None
        self.live: dict[str, Staged] = {}
        self._schedule, self._times = schedule, times
        self._until_s = until_s
        self._ahead_s = UPDATE_PACKETS / float(times.rate)
        self._sound_m_s = stager.air.sound_speed_m_s
        self._staged: set[str] = set()

    @property
    def time_s(self) -> float:
        """Beginning of the next packet [s]."""
        return self._times.start_s(self.number)

    def soon(self, ahead_s: float) -> list[StagingRequest]:
        """Return the blasts announced for the first time within the next interval.

        Args:
            ahead_s: Length of the interval from the beginning of the next packet [s].
        """
        now = self.time_s
        until = now + ahead_s + self._schedule.lead_s
        return [
            StagingRequest(self.entity, charge, self.motion)
            for charge in self._schedule.between(now - PAST_S, until)
            if charge.name not in self._staged
        ]

    def wanted(self) -> list[StagingRequest]:
        """Return the blasts to stage for the next packet: updates, then new ones."""
        updates = [
            StagingRequest(
                self.entity,
                one.request.charge,
                self.motion,
                one.announced.revision + 1,
            )
            for one in self.live.values()
            if self._uncertain(one)
        ]
        new = self.soon(0.0)
        # Blasts added while these are staged belong to the packet after.
        self._staged |= {one.charge.name for one in new}
        return updates + new

    def next(self, staged: Iterable[Staged]) -> Packet:
        """Return the next packet.

        Args:
            staged: The blasts that `wanted` returned.
        """
        start, end = self.time_s, self._times.start_s(self.number + 1)
        announced = []
        for one in staged:
            new, known = one.announced, self.live.get(one.announced.shot)
            if known is not None:
                # Past arrivals have been sent: an update must not move them.
                past = {wave: getattr(known.announced, wave) for wave in WAVES}
                past = {wave: time for wave, time in past.items() if time < start}
                new = new._replace(**past)
            # A client that joins late does not receive blasts whose effects have ended.
            elif new.ends_s < start:
                continue
            # Waves about to arrive are final: later reports must not move an arrival
            # that has been sent.
            near = [x for x in WAVES if getattr(new, x) - start <= self._ahead_s]
            self.live[new.shot] = one._replace(
                announced=new, settled=frozenset(["flash_s", *near])
            )
            announced.append(new)
        packet = Packet(
            self.number,
            start,
            tuple(announced),
            tuple(self._perceived(start, end)),
            **{x: self._rows(x) for x in COLUMNS if x in self.entity.senses},
            last=end >= self._until_s,
        )
        self.live = {
            name: one for name, one in self.live.items() if one.announced.ends_s >= end
        }
        self.number += 1
        return packet

    def _uncertain(self, live: Staged) -> bool:
        """Return whether a wave may arrive so soon that an update is due."""
        was = live.request.motion
        if self.motion is None or len(self.entity.path) > 1 or was is self.motion:
            return False
        then = self.entity.start_m
        if was is not None:
            then = was.position_m + (self.motion.time_s - was.time_s) * was.velocity_m_s
        # Distance from the extrapolated position: the wave may arrive earlier by at
        # most this time.
        off_m = float(np.linalg.norm(self.motion.position_m - then))
        limit = self.time_s + off_m / self._sound_m_s + self._ahead_s
        return any(
            self.time_s <= getattr(live.announced, wave) <= limit
            for wave in WAVES
            if wave not in live.settled
        )

    def _perceived(self, start: float, end: float) -> list[Perceived]:
        """Return the perceptions within a packet, sorted by time."""
        found: list[Perceived] = []
        for shot, one in self.live.items():
            flash, ground, air = (getattr(one.announced, wave) for wave in WAVES)
            of_senses = {
                "flash": [(flash, "flash")],
                "ground": [(ground, "ground motion")],
                "pressure": [(air, "pressure")],
                "sound": [(ground, "ground sound"), (air, "sound")],
                "force": [(air, "force")],
            }
            found += [
                Perceived(shot, self.entity.name, word, time)
                for sense in self.entity.senses
                for time, word in of_senses[sense]
                if start <= time < end
            ]
        return sorted(found, key=lambda one: (one.time_s, one.sense))

    def _rows(self, sense: str) -> Rows:
        """Return the summed samples within the next packet; empty without any."""
        rate_hz = STEPS_HZ if sense == "force" else self.entity.samples_hz
        # Exact integers, so consecutive packets share no sample and skip none.
        first, last = self._times.samples(self.number, rate_hz)
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


def packets_of(playback: Playback, stager: Stager) -> Iterator[Packet]:
    """Yield the packets of an entity in this process, to the end of the world."""
    last = False
    while not last:
        packet = playback.next([stager.stage(one) for one in playback.wanted()])
        yield packet
        last = packet.last


def standpoint(entity: Entity, motion: Motion | None) -> np.ndarray | Track:
    """Return the position of an entity, or its path over time.

    Args:
        entity: The entity; its own path has priority over reports.
        motion: Last report; None without one.
    """
    if len(entity.path) > 1:
        return _padded(entity.times_s, entity.places_m)
    if motion is None:
        return entity.start_m
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


def _met_at(
    place: np.ndarray | Track, time_s: float
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return position and velocity at a time."""
    if not isinstance(place, Track):
        return place, np.zeros(3)
    time, knots = np.asarray(place.time), np.asarray(place.position)
    here = np.stack([np.interp(time_s, time, axis) for axis in knots.T])
    if not time[0] <= time_s < time[-1]:
        return here, np.zeros(3)
    # The speed of the segment after a knot, which is the one that the wave meets.
    n = int(np.searchsorted(time, time_s, side="right")) - 1
    return here, (knots[n + 1] - knots[n]) / (time[n + 1] - time[n])


def records_of(
    scene: Scene,
    place: np.ndarray | Track,
    sense: str,
    rate_hz: float,
    laws: dict[str, str],
) -> tuple[Rows, ...]:
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
            found.append(Rows(first + begin, rate_hz, samples[begin:end].copy()))
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
    begins, ends = (float(x) for x in _passing(load, vehicle, state))
    first = math.floor(begins * STEPS_HZ)
    last = math.ceil(ends * STEPS_HZ) + 1
    steps = min(last - first, MAX_STEPS)
    # Powers of two from 256 on: a few compiled programs serve all durations.
    size = max(2 ** math.ceil(math.log2(steps)), 256)
    edges = np.arange(first, first + size + 1) / STEPS_HZ
    rows = np.asarray(_means(load, vehicle, state, jnp.asarray(edges)))
    # A copy, so that the padding is freed.
    return Rows(first, STEPS_HZ, rows[:steps].copy())


@kept
def _passing(
    load: BlastLoad, vehicle: Vehicle, state: State
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return beginning and end of a blast's force, reflection included."""
    begins, ends = load.span_s(state.position_m, vehicle)
    return jnp.min(begins), jnp.max(jnp.where(jnp.isposinf(ends), -jnp.inf, ends))


@kept
def _means(
    load: BlastLoad, vehicle: Vehicle, state: State, edges: Float[Array, " edge"]
) -> Float[Array, "step 6"]:
    """Return mean force and moment over each step, for the state at the arrival."""

    def mean(start: Float[Array, ""], end: Float[Array, ""]) -> Float[Array, "6"]:
        given = load.impulse(start, end, state, vehicle)
        return jnp.concatenate(given) / (end - start)

    return jax.vmap(mean)(edges[:-1], edges[1:])
