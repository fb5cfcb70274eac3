"""Through a real client: the packets of one process, and clients that harm nobody."""

import math
import socket
import time
from typing import Any

import grpc
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.world.serve import (
    Entity,
    Knot,
    Motion,
    NewBlast,
    Options,
    connect,
    packets_of,
    serving,
)
from jblast.world.serve.client import Client
from jblast.world.serve.messages import (
    DESCRIPTION,
    MOST_BYTES,
    SERVICE,
    Request,
    encoded,
    messages,
)
from tests.tools.describe_messages import described
from tests.world.serve.served import (
    ENDS_S,
    HERE,
    LEAD_S,
    REGION,
    playback,
    world,
)

OPTIONS = Options(address="127.0.0.1:0", lead_s=LEAD_S, ends_s=ENDS_S)
ALL = ["flash", "ground", "pressure", "sound", "force"]
STREAM = f"/{SERVICE}/Stream"


@pytest.fixture(scope="module")
def lines():
    return []


@pytest.fixture(scope="module")
def server(lines):
    with serving(world(), OPTIONS, lines.append) as server:
        yield server


@pytest.fixture
def client(server):
    with connect(server.address) as client:
        yield client


def observer(name, place=HERE):
    return Entity(name, ["flash"], [Knot(place)])


def numbers(stream, count):
    """Return the numbers of the next packets; -1 for none."""
    packets = [stream.next() for _ in range(count)]
    return [-1 if packet is None else packet.number for packet in packets]


def until(condition):
    """Wait for an effect of another thread; the test fails without it."""
    for _ in range(1000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("never came")


def sent(server, *data):
    """Send the messages of a stream as bytes; return status and reason."""
    with grpc.insecure_channel(server.address) as channel:
        try:
            list(channel.stream_stream(STREAM)(iter(data), timeout=20))
        except grpc.RpcError as error:
            return error.code().name, error.details() or ""
    return "OK", ""


def test_the_kept_description_is_that_of_the_proto():
    assert DESCRIPTION.read_bytes() == described()


def test_packets_are_those_of_one_process_to_the_last_bit(client):
    """Also a second time: the same seed gives the same bytes."""
    entity = Entity("e", ALL, [Knot(HERE)], vehicle="hummingbird")
    here = list(packets_of(playback(entity)))
    for _ in range(2):
        stream = client.stream(entity)
        there = list(stream.packets())
        stream.close()
        assert len(there) == len(here) == 200
        for one, other in zip(there, here, strict=True):
            np.testing.assert_equal(one, other)


def test_a_path_and_a_motion_arrive_as_they_were_sent(client):
    """Reports of a straight flight give the arrivals of the path known in advance."""
    speed, start = np.array([25.0, 0.0, 0.0]), np.array([60.0, 0.0, 5.0])
    known = Entity(
        "k", ["pressure"], [Knot(start), Knot(start + ENDS_S * speed, ENDS_S)]
    )
    stream = client.stream(known)
    expected = {p.shot: p.time_s for x in stream.packets(20) for p in x.perceived}
    stream.close()
    stream, found = client.stream(Entity("r", ["pressure"], [Knot(start)])), {}
    for number in range(200):
        now = number / 100
        # any positive length of a quaternion is valid
        stream.ask(1, Motion(now, start + now * speed, speed, [0, 0, 0, 2.0]))
        packet = stream.next()
        assert packet is not None
        found |= {one.shot: one.time_s for one in packet.perceived}
    stream.close()
    assert set(found) == set(expected) == set(world().shots)
    for shot, at_s in expected.items():
        assert found[shot] == pytest.approx(at_s, abs=1e-9)


def test_a_name_is_taken_until_its_stream_ends(client, server):
    stream = client.stream(observer("twin"))
    until(lambda: server.streams)
    twin = client.stream(observer("twin"))
    with pytest.raises(InputError, match=r"another name.*ALREADY_EXISTS"):
        twin.next()
    stream.close()
    until(lambda: not server.streams)
    again = client.stream(observer("twin"), first_packet=150)
    assert [packet.number for packet in again.packets(20)] == list(range(150, 200))
    again.close()


def test_fifty_streams_each_have_all_packets(client):
    streams = [client.stream(observer(f"s{number}")) for number in range(50)]
    for stream in streams:
        stream.ask(200)
    for stream in streams:
        assert numbers(stream, 201) == [*range(200), -1]


INVALID: tuple[tuple[Any, str], ...] = (
    (("a", 0.5, [0.0, 9.0, 0.0], 2.0), "expected one after 0.5 s"),
    (("a", math.inf, [0.0, 9.0, 0.0], 2.0), "time_s: expected"),
    (("1", 1.9, [0.0, 9.0, 0.0], 2.0), "expected a new name"),
    (("a", 1.9, [0.0, 9.0, 0.0], 1e30), r"mass_kg: expected 1e-06 to 1e\+07 kg"),
    (("a", 1.9, [0.0, 0.0, -1.0], 2.0), "position_m: expected a position"),
    (("a", 1.9, [0.0, 0.0], 2.0), "position_m: expected 3 finite numbers"),
    (("a", 1.9, HERE, 2.0, "TNR"), "explosive: expected one of TNT"),
)


def test_a_blast_is_accepted_however_far_another_client_is(lines):
    """One at an entity's place is not sent to it, and ends nobody's stream."""
    with (
        serving(world(), OPTIONS, lines.append) as fresh,
        connect(fresh.address) as one,
    ):
        fast = one.stream(observer("fast"))
        fast.ask(150)
        assert numbers(fast, 150) == list(range(150))
        slow, into = (
            one.stream(observer(name, place))
            for name, place in (("slow", [0.0, 50.0, 1.0]), ("into", [90.0, 0.0, 1.0]))
        )
        slow.ask(1)
        assert numbers(slow, 1) == [0]
        for blast, reason in INVALID:
            with pytest.raises(InputError, match=rf"{reason}.*INVALID_ARGUMENT"):
                one.announce(NewBlast(*blast))
        told = one.announce(NewBlast("more", 1.0, [0.0, 9.0, 0.0], 2.0, "C4"))
        assert told.now_s == 1.5
        one.announce(NewBlast("inside", 1.9, [90.0, 0.0, 1.0], 2.0))
        lines.clear()
        for stream, count in ((fast, 50), (slow, 199), (into, 200)):
            packets = list(stream.packets(ahead=20))
            assert len(packets) == count
            shots = {new.shot for p in packets for new in p.announcements}
            assert ("more" in shots) == (stream is not fast)
            assert ("inside" in shots) == (stream is not into)
            stream.close()
    assert [line for line in lines if "was not sent to 'into'" in line]
    assert not [line for line in lines if "dropped" in line]


def entity(**values):
    """Return the bytes of a first message, with values that may be invalid."""
    to = messages()
    usual = {"name": "x", "senses": ["flash"], "path": [to.Knot(position_m=HERE)]}
    return to.Request(entity=to.Entity(**(usual | values))).SerializeToString()


def knots(*times):
    return [messages().Knot(position_m=HERE, time_s=time_s) for time_s in times]


FAR = encoded("Request", Request(observer("x"), first_packet=10**12))
REFUSED = {
    "garbage": (b"\xff" * 40, "40 bytes that cannot be decoded"),
    "no entity": (b"", "entity: expected an entity in the first message only"),
    "no name": (entity(name=""), "name: expected 1 to 64"),
    "a control character": (entity(name="a\n"), "printable"),
    "an unknown sense": (entity(senses=["sond"]), "did you mean sound"),
    "no place": (entity(path=[]), "path: expected 1 to 4096 positions, got 0"),
    "half a place": (
        entity(path=[messages().Knot(position_m=[1.0])]),
        "3 finite numbers",
    ),
    "underground": (
        entity(path=[messages().Knot(position_m=[0, 0, -1])]),
        "up = -1 m",
    ),
    "falling times": (entity(path=knots(1.0, 0.0)), "ascending times, got [1.0, 0.0]"),
    "a rate too high": (entity(samples_hz=1e9), "samples_hz: expected 100 to 192,000"),
    "no vehicle": (entity(senses=["force"]), "vehicle: expected one of"),
    "an unknown one": (entity(vehicle="iri"), "did you mean iris"),
    "after the end": (FAR, "before the end of the world"),
}


MOTIONS = {
    "no place": ({"time_s": 0.0}, "position_m: expected 3 finite numbers"),
    "no time": ({"time_s": math.nan, "position_m": HERE}, "time_s: expected a finite"),
    "no direction": (
        {"position_m": HERE, "quaternion": [0, 0, 0, 0]},
        "quaternion: expected a positive length",
    ),
}


def test_an_invalid_message_has_a_status_and_a_reason(server):
    """The first one, with an entity, and one with a motion."""
    to = messages()
    cases = [([data], reason) for data, reason in REFUSED.values()]
    for values, reason in MOTIONS.values():
        motion = to.Request(motion=to.Motion(**values)).SerializeToString()
        cases.append(([entity(), motion], reason))
    for data, reason in cases:
        code, details = sent(server, *data)
        assert code == "INVALID_ARGUMENT", reason
        assert reason in details


def test_messages_have_a_largest_size(server):
    code, details = sent(server, entity(), b"\0" * (MOST_BYTES + 1))
    assert code == "RESOURCE_EXHAUSTED"
    assert "1048576" in details


def test_a_bad_client_is_named_and_harms_nobody(server, lines):
    with connect(server.address) as good:
        stream = good.stream(observer("good"))
        stream.ask(100)
        assert numbers(stream, 100) == list(range(100))
        lines.clear()
        dies = connect(server.address)
        dead = dies.stream(observer("dies"))
        dead.ask(5)
        assert dead.next() is not None
        dies.close()
        assert "10 bytes" in sent(server, entity(name="garbage"), b"\xff" * 10)[1]
        with socket.create_connection(server.address.split(":")) as other:
            other.sendall(b"GET / HTTP/1.1\r\n\r\n")
        until(lambda: len(lines) == 2)
        assert sum("'dies'" in line and "went away" in line for line in lines) == 1
        assert sum("'garbage'" in line and "bytes" in line for line in lines) == 1
        stream.ask(100)
        assert numbers(stream, 100) == list(range(100, 200))
        stream.close()
        until(lambda: not server.streams)


def test_a_client_that_requests_nothing_is_too_slow():
    lines = []
    patient = Options(address="127.0.0.1:0", patience_s=0.2)
    with (
        serving(world(), patient, lines.append) as server,
        connect(server.address) as client,
    ):
        stream = client.stream(observer("idle"))
        with pytest.raises(InputError, match=r"waiting for 0.2 s \(DEADLINE"):
            stream.next()
    (line,) = lines
    assert "'idle'" in line
    assert "too slow" in line


@pytest.mark.slow
def test_a_client_that_reads_too_slowly_in_real_time_is_told():
    """Sound of some megabytes fills gRPC's buffers; others have all packets."""
    lines = []
    often = {"count": 30, "gap_s": 0.0, "time_s": {"uniform": [0.2, 3.5]}}
    fast = Options("127.0.0.1:0", lead_s=LEAD_S, speed=2.0, ends_s=4.0, patience_s=0.3)
    narrow = [("grpc.http2.bdp_probe", 0), ("grpc.http2.lookahead_bytes", 65_536)]
    with (
        serving(world(world=often | REGION), fast, lines.append) as server,
        connect(server.address) as one,
        grpc.insecure_channel(server.address, narrow) as channel,
    ):
        loud = Entity("loud", ["sound"], [Knot(HERE)], samples_hz=192e3)
        unread, good = Client(channel).stream(loud), one.stream(observer("good"))
        found = [packet.number for packet in iter(good.next, None)]
        assert found == list(range(found[0], 400))
        (line,) = lines
        assert "'loud'" in line
        with pytest.raises(InputError, match=r"too slow: .* 0.3 s \(DEADLINE"):
            list(iter(unread.next, None))


def test_by_the_clock_packets_come_at_their_time_to_the_last_one():
    fast = Options(address="127.0.0.1:0", lead_s=LEAD_S, speed=4.0, ends_s=ENDS_S)
    with serving(world(), fast) as server, connect(server.address) as one:
        begun, stream = time.monotonic(), one.stream(observer("a"))
        left = one.stream(observer("b"))
        assert left.next() is not None
        left.close()
        until(lambda: "b" not in server.streams)
        found = [packet.number for packet in iter(stream.next, None)]
        # 2 s of the world last 0.5 s; on a busy machine only the lower bound is certain
        assert time.monotonic() - begun > 0.45
        assert found == list(range(found[0], 200))
        until(lambda: not server.streams)
        late = one.stream(observer("c"), first_packet=7)
        with pytest.raises(InputError, match="expected 0 in real time"):
            late.next()


def test_a_server_that_stops_says_so_and_drops_nobody(capfd):
    lines = []
    with serving(world(), OPTIONS, lines.append) as server:
        client = connect(server.address)
        stream = client.stream(observer("a"))
        stream.ask(3)
        assert stream.next() is not None
    with pytest.raises(InputError, match="UNAVAILABLE"):
        list(iter(stream.next, None))
    client.close()
    assert lines == []
    assert "Traceback" not in capfd.readouterr().err


OPTION_ERRORS: dict[str, tuple[dict[str, Any], str]] = {
    "everybody": ({"address": "0.0.0.0:1234"}, "expected a loopback address"),
    "no port": ({"address": "127.0.0.1"}, "HOST:PORT"),
    "a large port": ({"address": "127.0.0.1:65536"}, "0 to 65535"),
    "a low rate": ({"packets_hz": 0.5}, "packets_hz: expected 1 to 1000"),
    "no speed": ({"speed": 0.0}, "speed: expected a positive number"),
    "no lead": ({"lead_s": math.inf}, "lead_s: expected 0 s or more"),
}


@pytest.mark.parametrize("name", OPTION_ERRORS)
def test_an_invalid_option_is_refused(name):
    values, reason = OPTION_ERRORS[name]
    with pytest.raises(InputError, match=reason):
        Options(**values)
