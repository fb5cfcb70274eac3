"""Frames of MAVLink: there and back, cut up, damaged, missing, of another version."""

import pytest
from pymavlink.dialects.v20 import common

from jblast.autopilot.mavlink import Receiver, Sender
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


def test_behind_a_frame_that_breaks_off_the_next_are_found():
    receiver = Receiver()
    sent = frame()[:30] + frame(time_usec=8000) + frame(time_usec=12_000)
    found = [message.values["time_usec"] for message in receiver.feed(sent)]
    assert (receiver.damaged, found) == (1, [8000, 12_000])


def test_a_message_of_another_dialect_is_counted_and_passed_over():
    other = bytearray(frame())
    other[7:10] = (60_000).to_bytes(3, "little")
    (message,) = Receiver().feed(bytes(other))
    assert (message.name, message.values, message.system) == ("", {}, 1)


def test_missing_messages_are_counted_by_their_sender():
    sender, receiver = Sender(1, 1), Receiver()
    sent = [sender.pack("HEARTBEAT") for _ in range(300)]
    list(receiver.feed(b"".join(sent[:10] + sent[13:])))
    assert receiver.lost == 3


def test_a_signed_frame_is_read_and_its_signature_passed_over():
    plain = frame()
    theirs = common.MAVLink(None, srcSystem=1, srcComponent=51)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = bytes(32), True
    signed = theirs.hil_sensor_encode(
        4000, 1.5, 0, -9.75, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 7167
    ).pack(theirs)
    one, two = Receiver().feed(signed + plain)
    assert one.values == two.values
    assert one.frame == signed


def test_version_1_is_refused_by_name():
    heartbeat = common.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)
    first = heartbeat.pack(common.MAVLink(None, 1, 1), force_mavlink1=True)
    assert first[0] == 0xFE
    with pytest.raises(InputError, match=r"expected messages of MAVLink 2, got .* 1 "):
        list(Receiver().feed(first))


def test_what_does_not_fit_is_refused():
    with pytest.raises(InputError, match=r"message 'HEARTBEET': .* did you mean HEART"):
        Sender(1, 1).pack("HEARTBEET")
    with pytest.raises(InputError, match="HEARTBEAT typ: no such field"):
        Sender(1, 1).pack("HEARTBEAT", typ=1)
    with pytest.raises(InputError, match="HEARTBEAT: expected numbers that fit"):
        Sender(1, 1).pack("HEARTBEAT", type=256)
    with pytest.raises(InputError, match="ATTITUDE: expected numbers that fit"):
        Sender(1, 1).pack("ATTITUDE", roll=1e39)
    with pytest.raises(InputError, match="CONTROLS: expected numbers that fit"):
        Sender(1, 1).pack("HIL_ACTUATOR_CONTROLS", controls=[0.0])
