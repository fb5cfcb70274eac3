"""The messages of MAVLink that are spoken here: numbers, fields, in their order.

From `common.xml` of MAVLink (mavlink.io/en/messages/common.html). Fields are written
as there: type and name; those behind a bar are extensions, which old senders leave out.
"""

import struct
from typing import NamedTuple

from jblast.autopilot.mavlink.checksum import checksum

_FORMATS = {
    "uint8_t": "B",
    "int8_t": "b",
    "char": "c",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "float": "f",
    "uint64_t": "Q",
}
_TARGET = "uint8_t target_system, uint8_t target_component"
_KIND = "| uint8_t mission_type"
_PARAMS = ", ".join(f"float param{n}" for n in range(1, 8))
_MESSAGES = {
    ("HEARTBEAT", 0): "uint8_t type, uint8_t autopilot, uint8_t base_mode, "
    "uint32_t custom_mode, uint8_t system_status, uint8_t mavlink_version",
    ("ATTITUDE", 30): "uint32_t time_boot_ms, float roll, float pitch, float yaw, "
    "float rollspeed, float pitchspeed, float yawspeed",
    ("GLOBAL_POSITION_INT", 33): "uint32_t time_boot_ms, int32_t lat, int32_t lon, "
    "int32_t alt, int32_t relative_alt, int16_t vx, int16_t vy, int16_t vz, "
    "uint16_t hdg",
    ("MISSION_REQUEST", 40): f"{_TARGET}, uint16_t seq {_KIND}",
    ("MISSION_CURRENT", 42): "uint16_t seq",
    ("MISSION_REQUEST_LIST", 43): f"{_TARGET} {_KIND}",
    ("MISSION_COUNT", 44): f"{_TARGET}, uint16_t count {_KIND}",
    ("MISSION_CLEAR_ALL", 45): f"{_TARGET} {_KIND}",
    ("MISSION_ITEM_REACHED", 46): "uint16_t seq",
    ("MISSION_ACK", 47): f"{_TARGET}, uint8_t type {_KIND}",
    ("MISSION_REQUEST_INT", 51): f"{_TARGET}, uint16_t seq {_KIND}",
    ("MISSION_ITEM_INT", 73): f"{_TARGET}, uint16_t seq, uint8_t frame, "
    "uint16_t command, uint8_t current, uint8_t autocontinue, float param1, "
    f"float param2, float param3, float param4, int32_t x, int32_t y, float z {_KIND}",
    ("COMMAND_LONG", 76): f"{_TARGET}, uint16_t command, uint8_t confirmation, "
    f"{_PARAMS}",
    ("COMMAND_ACK", 77): "uint16_t command, uint8_t result | uint8_t progress, "
    "int32_t result_param2, uint8_t target_system, uint8_t target_component",
    ("HIL_ACTUATOR_CONTROLS", 93): "uint64_t time_usec, float[16] controls, "
    "uint8_t mode, uint64_t flags",
    ("HIL_SENSOR", 107): "uint64_t time_usec, float xacc, float yacc, float zacc, "
    "float xgyro, float ygyro, float zgyro, float xmag, float ymag, float zmag, "
    "float abs_pressure, float diff_pressure, float pressure_alt, float temperature, "
    "uint32_t fields_updated | uint8_t id",
    ("HIL_GPS", 113): "uint64_t time_usec, uint8_t fix_type, int32_t lat, int32_t lon, "
    "int32_t alt, uint16_t eph, uint16_t epv, uint16_t vel, int16_t vn, int16_t ve, "
    "int16_t vd, uint16_t cog, uint8_t satellites_visible | uint8_t id, uint16_t yaw",
    ("HIL_STATE_QUATERNION", 115): "uint64_t time_usec, float[4] attitude_quaternion, "
    "float rollspeed, float pitchspeed, float yawspeed, int32_t lat, int32_t lon, "
    "int32_t alt, int16_t vx, int16_t vy, int16_t vz, uint16_t ind_airspeed, "
    "uint16_t true_airspeed, int16_t xacc, int16_t yacc, int16_t zacc",
    ("STATUSTEXT", 253): "uint8_t severity, char[50] text",
}


class Definition(NamedTuple):
    """A message.

    Attributes:
        name: As `common.xml` has it.
        number: On the wire.
        fields: Names, in the order of the wire, and how many numbers each has; 0: one
            that is no array.
        layout: Of its bytes, extensions too.
        extra: Byte of the checksum that tells one definition from another.
    """

    name: str
    number: int
    fields: tuple[tuple[str, int], ...]
    layout: struct.Struct
    extra: int


def _field(text: str) -> tuple[str, str, int]:
    """Return type, name and count of a field."""
    kind, name = text.split()
    kind, bracket, count = kind.partition("[")
    return kind, name, int(count.removesuffix("]")) if bracket else 0


def _definition(name: str, number: int, text: str) -> Definition:
    """Put a message's fields into the order of the wire: the widest come first."""
    main, _, extensions = text.partition("|")
    fields = [_field(part) for part in main.split(",")]
    fields.sort(key=lambda field: -struct.calcsize("<" + _FORMATS[field[0]]))
    said = bytearray(f"{name} ", "ascii")
    for kind, field, count in fields:
        said += f"{kind} {field} ".encode()
        said += bytes([count] if count else [])
    crc = checksum(bytes(said))
    fields += [_field(part) for part in extensions.split(",") if part.strip()]
    layout = "<"
    for kind, _, count in fields:
        layout += f"{count}s" if kind == "char" else f"{count or 1}{_FORMATS[kind]}"
    return Definition(
        name,
        number,
        tuple((field, 0 if kind == "char" else n) for kind, field, n in fields),
        struct.Struct(layout),
        (crc & 0xFF) ^ (crc >> 8),
    )


BY_NAME = {
    name: _definition(name, number, text) for (name, number), text in _MESSAGES.items()
}
BY_NUMBER = {one.number: one for one in BY_NAME.values()}
