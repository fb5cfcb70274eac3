"""What a blast is for an entity, computed once and ahead of time.

One blast for one entity at a time, by programs that are the same for all: of the load,
of the arrivals, of each sense that samples. Where who moves meets a wave follows from
its path, or from what it reported last: straight on from there.
"""

from dataclasses import replace

import numpy as np

from jblast.scene import Charge, Scene, Sensor, VehicleSpec
from jblast.sensors import Track, heard, record_laws
from jblast.vehicle import blast_load, named
from jblast.world.arrivals import arrivals_of
from jblast.world.drawn import DrawnWorld
from jblast.world.server.entity import Entity, Motion
from jblast.world.server.force_profiles import force_profile, state_met
from jblast.world.server.payload import (
    AirPulse,
    Announcement,
    BlastArrivals,
)
from jblast.world.server.sound_records import records_of

STRAIGHT_S = 30.0
"""How long one who reports its motion is taken to go straight on."""
NAME = "entity"
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


class Stager:
    """Makes what entities are told of blasts.

    Attributes:
        scene: What there is besides blasts and entities; its laws are said.
    """

    def __init__(self, world: DrawnWorld):
        """Take the air, the ground and the laws of a world."""
        self.scene = replace(
            world.scene, sensors=(), camera=None, clocks=(), vehicle=None, ambient=None
        )
        self._laws = dict(self.scene.law) | record_laws(self.scene, ground=True)

    def stage(
        self,
        entity: Entity,
        charge: Charge,
        motion: Motion | None = None,
        revision: int = 0,
    ) -> Announcement:
        """Return what an entity is to be told of a blast.

        Args:
            entity: Who is told.
            charge: The blast.
            motion: What it reported last; None: nothing.
            revision: How often it was told before.

        Raises:
            InputError: It is at the charge, or as fast as sound.
        """
        place = standpoint(entity, motion)
        scene = self._alone(charge)
        arrivals = self._arrivals(scene, place)
        pulse = self._pulse(scene, place)
        met = _motion_at(place, arrivals.air_s)
        if motion is not None:
            met = met._replace(
                quaternion=motion.quaternion, body_rate_rad_s=motion.body_rate_rad_s
            )
        # of its vehicle the load asks the place alone
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
        return replace(self.scene, charge=replace(charge, name=""), others=())

    def _arrivals(self, scene: Scene, place: np.ndarray | Track) -> BlastArrivals:
        tracks = {NAME: place} if isinstance(place, Track) else {}
        start = place.position[0] if isinstance(place, Track) else place
        asked = replace(scene, sensors=(Sensor(NAME, np.asarray(start)),))
        times = arrivals_of(asked, tracks).times_s
        flash, ground, air = (
            float(times[wave][0, 0])
            for wave in ("flash_time_s", "ground_arrival_s", "air_arrival_s")
        )
        return BlastArrivals(flash, ground, air)

    def _pulse(self, scene: Scene, place: np.ndarray | Track) -> AirPulse | None:
        waves = heard(scene, place, self._laws)
        pulse = next(wave.pulse for wave in waves if wave.kind == "air")
        if not np.isfinite(float(pulse.arrival_time)):
            return None
        return AirPulse(*(float(number) for number in pulse))


def standpoint(entity: Entity, motion: Motion | None) -> np.ndarray | Track:
    """Return where an entity is over time, as far as is known.

    Args:
        entity: Its path goes before what it reports.
        motion: What it reported last; None: nothing.
    """
    if entity.path is not None:
        return _padded(*entity.path)
    if motion is None:
        return entity.position_m
    place = np.maximum(motion.position_m, [-np.inf, -np.inf, 0.0])
    lasts = STRAIGHT_S
    if (sinks := -motion.velocity_m_s[2]) * lasts > place[2]:  # it lands before
        lasts = max(place[2] / sinks, 1e-3)
    later = place + lasts * motion.velocity_m_s
    time = motion.time_s + np.array([0.0, lasts])
    return Track(time, np.stack([place, np.maximum(later, [-np.inf, -np.inf, 0.0])]))


def _padded(time: np.ndarray, place: np.ndarray) -> Track:
    """Return a track of a power of two of knots: who stands on goes on standing."""
    missing = max(2 ** (len(time) - 1).bit_length(), 2) - len(time)
    after = time[-1] + 1.0 + np.arange(missing)
    return Track(
        np.concatenate([time, after]),
        np.concatenate([place, np.repeat(place[-1:], missing, axis=0)]),
    )


def _motion_at(place: np.ndarray | Track, time_s: float) -> Motion:
    """Return where and how fast one is at a time, level."""
    if not isinstance(place, Track):
        return Motion(time_s, place, np.zeros(3), LEVEL, np.zeros(3))
    time, knots = np.asarray(place.time), np.asarray(place.position)
    here = np.stack([np.interp(time_s, time, axis) for axis in knots.T])
    if not time[0] <= time_s < time[-1]:
        return Motion(time_s, here, np.zeros(3), LEVEL, np.zeros(3))
    n = int(np.searchsorted(time, time_s, side="right")) - 1
    speed = (knots[n + 1] - knots[n]) / (time[n + 1] - time[n])
    return Motion(time_s, here, speed, LEVEL, np.zeros(3))
