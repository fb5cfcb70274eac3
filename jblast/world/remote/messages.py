"""Messages between server and client, and the rejection of invalid ones.

Messages are made from `blasts.binpb`, protoc's description of `blasts.proto`, in
protobuf's own stable format. `python -m tests.tools.describe_messages` writes it again,
and a test compares the two. Python code that protoc generates works with one release of
protobuf only. The description works with any, and grpcio-tools is not needed at run
time.
"""

import functools
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from jblast.errors import InputError, needed, shown
from jblast.parameters import PARAMETERS
from jblast.scene import Charge, Scene
from jblast.scene.charge import EXPLOSIVES
from jblast.waves.propagation import ambient, sound_speed_of
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
from jblast.world.server.registry import (
    SENSES,
    Entity,
    Motion,
    above_ground,
    checked_entity,
    checked_motion,
)

MOST_BYTES = 2**20
"""Of one message of a client."""
PROTOCOL = 1
"""Goes up by one where an old client would misunderstand."""
PROTO = Path(__file__).with_name("blasts.proto")
DESCRIPTION = PROTO.with_suffix(".binpb")
SERVICE = "jblast.v1.Blasts"
METHODS = {
    "Describe": ("DescribeRequest", "World"),
    "Register": ("Registration", "Registered"),
    "Stream": ("Ask", "Packet"),
    "Announce": ("NewBlast", "Announced"),
    "Leave": ("LeaveRequest", "Left"),
}
"""Names of a method's messages; `Stream` streams both ways, the others neither."""


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
        tuple(_announced(announced) for announced in message.announcements),
        tuple(Perceived(p.shot, "", p.sense, p.time_s) for p in message.perceived),
        last=message.last,
        **parts,
    )


def _announced(message: Any) -> Announcement:
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
        AirPulse(*(getattr(message.pulse, name) for name in AirPulse._fields))
        if message.HasField("pulse")
        else None,
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


def _record_of(message: Any) -> Record:
    """Return the samples of one blast that a message holds."""
    return Record(message.first, message.rate_hz, np.array(message.values))


def _profile_of(message: Any) -> ForceProfile:
    """Return the force of one blast that a message holds."""
    rows = np.array(message.values).reshape(-1, 6)
    return ForceProfile(message.first, message.rate_hz, rows[:, :3], rows[:, 3:])


class OtherProtocol(InputError):
    """The client speaks another version of the protocol."""


class TooLarge(InputError):
    """A message has more bytes than are taken."""


class Garbage(InputError):
    """A message cannot be read at all."""


def parsed(kind: str, data: bytes) -> Any:
    """Return a message of a kind.

    Raises:
        TooLarge: It has more than `MOST_BYTES`.
        Garbage: It is none.
    """
    if len(data) > MOST_BYTES:
        raise TooLarge(
            f"message {kind}: expected at most {MOST_BYTES:,} bytes, got {len(data):,}"
        )
    from google.protobuf.message import DecodeError

    try:
        return getattr(messages(), kind).FromString(data)
    except DecodeError:
        raise Garbage(
            f"expected a message {kind} of blasts.proto, got {len(data):,} bytes that "
            "are none"
        ) from None


def check_protocol(version: int) -> None:
    """Refuse a client of another version.

    Raises:
        OtherProtocol: It is.
    """
    if version != PROTOCOL:
        raise OtherProtocol(
            f"protocol: expected version {PROTOCOL}, got {version}; the client is made "
            "for another jblast"
        )


def entity_of(registration: Any) -> Entity:
    """Return who registers.

    Raises:
        OtherProtocol: Of another version.
        InputError: As in `checked_entity`.
    """
    check_protocol(registration.protocol)
    senses = [
        SENSES[sense - 1] if 1 <= sense <= len(SENSES) else f"sense {sense}"
        for sense in registration.senses
    ]
    path = None
    if registration.path:
        path = (
            [knot.time_s for knot in registration.path],
            [vector(knot.position_m) for knot in registration.path],
        )
    place = registration.position_m if registration.HasField("position_m") else None
    return checked_entity(
        registration.name,
        senses,
        position_m=None if place is None else vector(place),
        path=path,
        vehicle=registration.vehicle,
        samples_hz=registration.samples_hz or None,
    )


def motion_of(message: Any) -> Motion:
    """Return what a client reports of its motion.

    Raises:
        InputError: As in `checked_motion`.
    """
    turn = (0.0, 0.0, 0.0, 1.0)
    if message.HasField("quaternion"):
        q = message.quaternion
        turn = (q.x, q.y, q.z, q.w)
    return checked_motion(
        message.time_s,
        vector(message.position_m),
        vector(message.velocity_m_s),
        turn,
        vector(message.body_rate_rad_s),
    )


def charge_of(message: Any) -> Charge:
    """Return a blast that a client announces.

    Raises:
        OtherProtocol: Of another version.
        InputError: A number cannot be used, or the explosive is not known.
    """
    check_protocol(message.protocol)
    where = f"blast {shown(message.shot)}"
    bounds = PARAMETERS["charge_mass_kg"].bounds
    if not bounds.allows(message.mass_kg):
        raise InputError(
            f"{where} mass_kg: expected what is {bounds.words()}, got "
            f"{message.mass_kg:g}"
        )
    explosive = message.explosive or "TNT"
    if explosive not in EXPLOSIVES:
        raise InputError(
            f"{where} explosive: expected one of {', '.join(EXPLOSIVES)}, got "
            f"{shown(explosive)}"
        )
    place = above_ground(f"{where} position_m", vector(message.position_m))
    return Charge(
        message.mass_kg,
        tuple(place.tolist()),
        message.time_s,
        explosive=explosive,
        name=message.shot,
    )


def vector(message: Any) -> tuple[float, float, float]:
    """Return the numbers of a vector; of one that is absent, zeros."""
    return message.east, message.north, message.up


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


def grpc() -> Any:
    """Import gRPC.

    Raises:
        InputError: It is not installed.
    """
    needed("google.protobuf", "serve", "jblast serve", "worlds are served")
    needed("grpc.aio", "serve", "jblast serve", "worlds are served")
    import grpc

    return grpc


@functools.cache
def messages() -> Any:
    """Return the classes of messages, by name.

    Raises:
        InputError: protobuf is not installed.
    """
    needed("google.protobuf", "serve", "jblast serve", "worlds are served")
    with warnings.catch_warnings():  # of its own age
        warnings.simplefilter("ignore", DeprecationWarning)
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    described = descriptor_pb2.FileDescriptorSet.FromString(DESCRIPTION.read_bytes())
    (file,) = described.file
    pool.Add(file)
    return SimpleNamespace(
        **{
            message.name: message_factory.GetMessageClass(
                pool.FindMessageTypeByName(f"{file.package}.{message.name}")
            )
            for message in file.message_type
        }
    )
