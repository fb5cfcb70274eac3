"""What the world has for a client, as messages."""

from typing import Any

import numpy as np

from jblast.scene import Scene
from jblast.waves.propagation.ambient import ambient, sound_speed_of
from jblast.world.remote.wire import messages
from jblast.world.server import (
    Announcement,
    Packet,
)


def packet_message(packet: Packet) -> Any:
    """Return a packet."""
    to = messages()
    message = to.Packet(number=packet.number, time_s=packet.time_s, last=packet.last)
    for announced in packet.announcements:
        message.announcements.append(_announcement(announced))
    for one in packet.perceived:
        message.perceived.add(shot=one.shot, sense=one.sense, time_s=one.time_s)
    for sense in ("force", "pressure", "sound"):
        part = getattr(packet, sense)
        if part is not None:
            _fill(getattr(message, sense), part.first, part.rate_hz, part.samples)
    return message


def air_message(scene: Scene) -> Any:
    """Return the air that waves go through."""
    to = messages()
    air = scene.air
    wind = to.Vector(east=float(air.wind_east), north=float(air.wind_north))
    return to.Air(
        pressure_pa=float(ambient(air)[1]),
        sound_speed_m_s=float(sound_speed_of(air)),
        wind_m_s=wind,
    )


def vector_message(values: Any) -> Any:
    """Return three numbers: east, north, up."""
    east, north, up = (float(x) for x in values)
    return messages().Vector(east=east, north=north, up=up)


def _announcement(announced: Announcement) -> Any:
    to = messages()
    charge = announced.charge
    message = to.Announcement(
        shot=charge.name,
        revision=announced.revision,
        time_s=float(charge.time_s),
        position_m=vector_message(charge.position_m),
        mass_kg=float(charge.mass_kg),
        pressure_mass_kg=announced.tnt_mass_kg[0],
        impulse_mass_kg=announced.tnt_mass_kg[1],
        burst=announced.burst,
        **announced.arrivals._asdict(),
    )
    if announced.pulse is not None:
        message.pulse.CopyFrom(to.Pulse(**announced.pulse._asdict()))
    if announced.force is not None:
        profile = announced.force
        rows = np.concatenate([profile.force_n, profile.moment_nm], axis=1)
        _fill(message.force, profile.first, profile.rate_hz, rows)
    for sense in ("pressure", "sound"):
        for record in getattr(announced, sense):
            part = getattr(message, sense).add()
            _fill(part, record.first, record.rate_hz, record.samples)
    return message


def _fill(message: Any, first: int, rate_hz: float, values: np.ndarray) -> None:
    message.first = max(first, 0)
    message.rate_hz = rate_hz
    if values.size:
        message.values.extend(values.ravel().tolist())
