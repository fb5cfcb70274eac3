"""Frames of MAVLink: there and back, cut up, damaged, missing, of another version."""

import pytest

from jblast.autopilot.mavlink.wire import Receiver, Sender
from jblast.errors import InputError

VALUES = {"time_usec": 4000, "xacc": 1.5, "zacc": -9.75, "fields_updated": 7167}


def frame(**values) -> bytes:
    return Sender(1, 51).pack("HIL_SENSOR", **VALUES | values)


def test_what_is_packed_comes_back():
    (message,) = Receiver().feed(frame())
    assert (message.name, message.system, message.component) == ("HIL_SENSOR", 1, 51)
    assert message.values | VALUES == message.values
    assert message.frame == frame()


def test_arrays_and_texts_come_back():
    sender = Sender(1, 1)
    controls = [0.5, 0.25, *[0.0] * 14]
    sent = sender.pack("HIL_ACTUATOR_CONTROLS", controls=controls, mode=129, flags=1)
    sent += sender.pack("STATUSTEXT", severity=4, text="who is there")
    asked, said = Receiver().feed(sent)
    assert asked.values["controls"] == controls
    assert said.values["text"] == "who is there"


def test_it_does_not_matter_where_the_stream_is_cut():
    stream = b"".join(Sender(1, 1).pack("HEARTBEAT", type=n) for n in range(1, 6))
    receiver = Receiver()
    found = [m for n in range(len(stream)) for m in receiver.feed(stream[n : n + 1])]
    assert [message.values["type"] for message in found] == [1, 2, 3, 4, 5]


def test_a_damaged_frame_is_counted_and_the_next_is_found():
    first, second = bytearray(frame()), frame(time_usec=8000)
    first[15] ^= 1
    receiver = Receiver()
    (message,) = receiver.feed(b"noise" + bytes(first) + second)
    assert (receiver.damaged, message.values["time_usec"]) == (1, 8000)


def test_missing_messages_are_counted_by_their_sender():
    sender, receiver = Sender(1, 1), Receiver()
    sent = [sender.pack("HEARTBEAT") for _ in range(300)]
    list(receiver.feed(b"".join(sent[:10] + sent[13:])))
    assert receiver.lost == 3


def test_a_signed_frame_is_read_and_its_signature_passed_over():
    plain = frame()
    # pymavlink's own frame of this message, signed with a key of zeros, has the
    # same payload; the flag is part of the checksum
    other = pytest.importorskip("pymavlink.dialects.v20.common")
    theirs = other.MAVLink(None, srcSystem=1, srcComponent=51)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = bytes(32), True
    signed = theirs.hil_sensor_encode(
        4000, 1.5, 0, -9.75, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7167
    ).pack(theirs)
    one, two = Receiver().feed(signed + plain)
    assert one.values == two.values


def test_pymavlink_reads_what_is_packed_here():
    other = pytest.importorskip("pymavlink.dialects.v20.common")
    (message,) = other.MAVLink(None).parse_buffer(frame())
    said = message.to_dict()
    assert {name: said[name] for name in VALUES} == VALUES


def test_version_1_is_refused_by_name():
    # HEARTBEAT of MAVLink 1: FE, length 9, sequence, system, component, number 0
    body = bytes([9, 0, 1, 1, 0, *[0] * 4, 2, 12, 0, 3, 3])
    from jblast.autopilot.mavlink.checksum import checksum

    crc = checksum(body + bytes([50])).to_bytes(2, "little")
    with pytest.raises(InputError, match=r"expected messages of MAVLink 2, got .* 1 "):
        list(Receiver().feed(b"\xfe" + body + crc))


def test_what_does_not_fit_is_refused():
    with pytest.raises(InputError, match=r"message 'HEARTBEET': .* did you mean HEART"):
        Sender(1, 1).pack("HEARTBEET")
    with pytest.raises(InputError, match="HEARTBEAT typ: no such field"):
        Sender(1, 1).pack("HEARTBEAT", typ=1)
    with pytest.raises(InputError, match="HEARTBEAT: expected numbers that fit"):
        Sender(1, 1).pack("HEARTBEAT", type=256)
