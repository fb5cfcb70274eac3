"""What an entity is told: each blast ahead of time, and then packet by packet."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.scene import Charge
from jblast.world.perceived import Perceived


class BlastArrivals(NamedTuple):
    """When a blast comes to an entity, on the common clock [s]; infinite: never.

    Attributes:
        flash_s: Its light.
        ground_s: The wave through the ground.
        air_s: The air shock.
    """

    flash_s: float
    ground_s: float
    air_s: float


class AirPulse(NamedTuple):
    """The air shock at an entity, as `waves.waveform.pulse.Pulse` has it, in floats.

    Attributes:
        arrival_s: When pressure first departs from the still air's [s].
        peak_pa: Overpressure.
        rise_s: From zero to the peak.
        duration_s: Of the positive phase, rise included.
        decay: Friedlander's b behind the peak [-].
        suction_pa: Greatest underpressure.
        suction_s: Duration of the negative phase.
        hold_s: How long the peak lasts.
    """

    arrival_s: float
    peak_pa: float
    rise_s: float
    duration_s: float
    decay: float
    suction_pa: float
    suction_s: float
    hold_s: float


class ForceProfile(NamedTuple):
    """What a blast gives a vehicle, as it is when the front comes.

    Step n is from `first / rate_hz` on, counted in steps from 0 on the common clock.

    Attributes:
        first: Number of the first step.
        rate_hz: Steps a second.
        force_n: Mean over each step, world.
        moment_nm: Likewise, body axes, about the centre of mass.
    """

    first: int
    rate_hz: float
    force_n: Float[np.ndarray, "step 3"]
    moment_nm: Float[np.ndarray, "step 3"]


class Record(NamedTuple):
    """Samples in a row, of one blast alone.

    Attributes:
        first: Number of the first sample, counted from 0 on the common clock.
        rate_hz: Samples a second.
        samples: Mean over each sample [Pa].
    """

    first: int
    rate_hz: float
    samples: Float[np.ndarray, " sample"]


class Announcement(NamedTuple):
    """A blast, told to one entity before it happens.

    Attributes:
        charge: What explodes, where and when; its name is the blast's.
        revision: 0 at first; one more each time that it is told anew.
        arrivals: When it comes to the entity.
        pulse: The air shock there; None: it never comes.
        burst: By which curves its load is, "surface" or "free-air".
        tnt_mass_kg: Mass of TNT that makes the same pressure, and the same impulse.
        force: For who senses force.
        pressure: For who senses pressure.
        sound: For who senses sound.
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
        """Return when nothing of it is left to be played back [s]."""
        ends = [time for time in self.arrivals if np.isfinite(time)]
        if self.force is not None:
            steps = self.force.first + len(self.force.force_n)
            ends.append(steps / self.force.rate_hz)
        ends += [
            (record.first + record.samples.size) / record.rate_hz
            for record in (*self.pressure, *self.sound)
        ]
        return max(ends, default=-np.inf)


class Slice(NamedTuple):
    """What is sampled within a packet, all blasts together.

    Attributes:
        first: Number of the first sample, counted from 0 on the common clock.
        rate_hz: Samples a second.
        samples: A row each; empty: all zero.
    """

    first: int
    rate_hz: float
    samples: Float[np.ndarray, "row ..."]


class Packet(NamedTuple):
    """What comes to an entity within one packet's time.

    Attributes:
        number: Counted from 0 at 0 on the common clock.
        time_s: When it begins [s]; it ends as the next one begins.
        announcements: Blasts told for the first time, or anew.
        perceived: What each sense had first in this time.
        force: Six numbers a step: force, world [N], and moment, body [N m].
        pressure: In Pa.
        sound: In Pa.
        last: Whether the world ends with it.
    """

    number: int
    time_s: float
    announcements: tuple[Announcement, ...] = ()
    perceived: tuple[Perceived, ...] = ()
    force: Slice | None = None
    pressure: Slice | None = None
    sound: Slice | None = None
    last: bool = False
