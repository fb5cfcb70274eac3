"""What clients send, as the world knows it; what cannot be used is refused by name."""

from typing import Any

from jblast.errors import InputError, shown
from jblast.parameter_table import PARAMETERS
from jblast.scene import Charge
from jblast.scene.explosives import EXPLOSIVES
from jblast.world.remote.wire import PROTOCOL, messages
from jblast.world.server.entity import (
    SENSES,
    Entity,
    Motion,
    above_ground,
    checked_entity,
    checked_motion,
)

MOST_BYTES = 2**20
"""Of one message of a client."""


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
