"""Messages of MAVLink, held against those of its own generator."""

import struct

import pytest

from jblast.autopilot.mavlink.definitions import BY_NAME

EXTRA = {
    "HEARTBEAT": 50,
    "ATTITUDE": 39,
    "GLOBAL_POSITION_INT": 104,
    "MISSION_COUNT": 221,
    "MISSION_ITEM_INT": 38,
    "COMMAND_LONG": 152,
    "COMMAND_ACK": 143,
    "HIL_ACTUATOR_CONTROLS": 47,
    "HIL_SENSOR": 108,
    "HIL_GPS": 124,
    "HIL_STATE_QUATERNION": 4,
    "STATUSTEXT": 83,
}
"""CRC_EXTRA as MAVLink's generated headers print it."""


@pytest.mark.parametrize("name", EXTRA)
def test_definitions_are_those_of_the_generated_headers(name):
    assert BY_NAME[name].extra == EXTRA[name]


@pytest.mark.parametrize("name", BY_NAME)
def test_numbers_order_and_layout_are_those_of_pymavlink(name):
    other = pytest.importorskip("pymavlink.dialects.v20.common")
    theirs = getattr(other, f"MAVLink_{name.lower()}_message")
    ours = BY_NAME[name]
    names = [field for field, _ in ours.fields]
    assert (ours.number, ours.extra) == (theirs.id, theirs.crc_extra)
    # later extensions are theirs alone
    assert names == theirs.ordered_fieldnames[: len(names)]
    assert ours.layout.size <= struct.calcsize(theirs.unpacker.format)
