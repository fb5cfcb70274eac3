"""What a server sends, as `world.server` has it in one process."""

from typing import Any

import numpy as np

from jblast.scene import Charge
from jblast.world.perceived import Perceived
from jblast.world.server import (
    AirPulse,
    Announcement,
    BlastArrivals,
    ForceProfile,
    Packet,
    Record,
    Slice,
)


def packet_of(message: Any) -> Packet:
    """Return a packet as the world has it."""
    parts = {
        sense: _slice_of(getattr(message, sense), columns)
        for sense, columns in (("force", 6), ("pressure", 1), ("sound", 1))
        if message.HasField(sense)
    }
    return Packet(
        message.number,
        message.time_s,
        tuple(_announcement(announced) for announced in message.announcements),
        tuple(Perceived(p.shot, "", p.sense, p.time_s) for p in message.perceived),
        last=message.last,
        **parts,
    )


def _announcement(message: Any) -> Announcement:
    place = message.position_m
    charge = Charge(
        message.mass_kg,
        (place.east, place.north, place.up),
        message.time_s,
        name=message.shot,
    )
    return Announcement(
        charge,
        message.revision,
        BlastArrivals(message.flash_s, message.ground_s, message.air_s),
        _pulse_of(message.pulse) if message.HasField("pulse") else None,
        message.burst,
        (message.pressure_mass_kg, message.impulse_mass_kg),
        _profile_of(message.force) if message.HasField("force") else None,
        tuple(_record_of(part) for part in message.pressure),
        tuple(_record_of(part) for part in message.sound),
    )


def _slice_of(message: Any, columns: int = 1) -> Slice:
    """Return samples that a message holds, a row each."""
    values = np.array(message.values)
    shape = (-1,) if columns == 1 else (-1, columns)
    return Slice(message.first, message.rate_hz, values.reshape(shape))


def _pulse_of(message: Any) -> AirPulse:
    """Return the air shock that a message holds."""
    return AirPulse(*(getattr(message, name) for name in AirPulse._fields))


def _record_of(message: Any) -> Record:
    """Return the samples of one blast that a message holds."""
    return Record(message.first, message.rate_hz, np.array(message.values))


def _profile_of(message: Any) -> ForceProfile:
    """Return the force of one blast that a message holds."""
    rows = np.array(message.values).reshape(-1, 6)
    return ForceProfile(message.first, message.rate_hz, rows[:, :3], rows[:, 3:])
