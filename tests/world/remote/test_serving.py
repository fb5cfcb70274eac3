"""Over the network comes what there is in one process; nobody harms another."""

import socket
import time

import grpc
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.world.remote import Options, connect, serving
from jblast.world.remote.messages import (
    DESCRIPTION,
    MOST_BYTES,
    PROTOCOL,
    SERVICE,
    messages,
    packet_message,
)
from jblast.world.server import (
    checked_entity,
    packets_of,
)
from jblast.world.server.playback import Packet, Slice
from tests.tools.describe_messages import described
from tests.world.server.served import ENDS_S, HERE, LEAD_S, playback, stager, world

OPTIONS = Options(address="127.0.0.1:0", lead_s=LEAD_S, ends_s=ENDS_S)
ALL = ["flash", "ground", "pressure", "sound", "force"]


@pytest.fixture(scope="module")
def said():
    return []


@pytest.fixture(scope="module")
def server(said):
    with serving(world(), OPTIONS, said.append) as server:
        yield server


@pytest.fixture
def client(server):
    with connect(server.address) as client:
        yield client


def until(condition):
    """Wait for what another thread does; the test fails if it never does."""
    for _ in range(1000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("never came")


def watched(client, name, **options):
    """Return all packets of a plain entity: how others fare."""
    stream = client.stream(client.register(name, ["flash"], position_m=HERE, **options))
    packets = list(stream.packets(ahead=20))
    stream.close()
    return packets


def test_the_kept_description_is_that_of_the_proto():
    assert DESCRIPTION.read_bytes() == described()


def test_packets_are_those_of_one_process_to_the_last_bit(client):
    """Doubles travel as they are."""
    entity = checked_entity("e", ALL, position_m=HERE, vehicle="hummingbird")
    ticket = client.register("e", ALL, position_m=HERE, vehicle="hummingbird")
    stream = client.stream(ticket)
    there = list(stream.packets())
    stream.close()
    here = list(packets_of(playback(entity), stager()))
    assert len(there) == len(here) == 200
    for one, other in zip(there, here, strict=True):
        assert one[:2] == other[:2]
        assert one.last == other.last
        for sense in ("force", "pressure", "sound"):
            a, b = getattr(one, sense), getattr(other, sense)
            assert (a.first, a.rate_hz) == (b.first, b.rate_hz)
            np.testing.assert_array_equal(a.samples, b.samples)
        assert [p[::2] + p[3:] for p in one.perceived] == [
            p[::2] + p[3:] for p in other.perceived
        ]
        for a, b in zip(one.announcements, other.announcements, strict=True):
            assert a.arrivals == b.arrivals
            assert a.pulse == b.pulse
            assert (a.burst, a.tnt_mass_kg) == (b.burst, b.tnt_mass_kg)
            assert a.charge.name == b.charge.name
            assert float(a.charge.time_s) == float(b.charge.time_s)
            assert a.force is not None
            assert b.force is not None
            np.testing.assert_array_equal(a.force.force_n, b.force.force_n)
            for x, y in zip(a.sound, b.sound, strict=True):
                np.testing.assert_array_equal(x.samples, y.samples)


def test_two_of_one_name_and_a_name_that_is_free_again(client, said):
    stream = client.stream(client.register("twin", ["flash"], position_m=HERE))
    with pytest.raises(InputError, match=r"another name.*ALREADY_EXISTS"):
        client.register("twin", ["flash"], position_m=HERE)
    stream.close()
    assert len(watched(client, "twin")) == 200


def test_a_blast_is_accepted_however_far_another_client_is(server, said):
    """One at its own place is refused, and ends nobody's stream."""
    with serving(world(), OPTIONS, said.append) as fresh, connect(fresh.address) as one:
        fast = one.stream(one.register("fast", ["flash"], position_m=HERE))
        fast.ask(150)
        packets = [fast.next() for _ in range(150)]
        assert packets[-1] is not None
        assert packets[-1].number == 149
        slow = one.stream(one.register("slow", ["flash"], position_m=[0.0, 50.0, 1.0]))
        with pytest.raises(InputError, match=r"got 0 m from 'fast'.*INVALID_ARGUMENT"):
            one.announce("at it", 1.9, HERE, 2.0)
        with pytest.raises(InputError, match=r"mass_kg: expected 1e-06"):
            one.announce("absurd", 1.9, [0.0, 9.0, 0.0], 1e30)
        with pytest.warns(UserWarning, match="entities past this time .*: fast"):
            one.announce("more", 1.0, [0.0, 9.0, 0.0], 2.0, "C4")
        one.announce("inside", 1.9, [90.0, 0.0, 1.0], 2.0)
        into = one.stream(one.register("into", ["flash"], position_m=[90.0, 0.0, 1.0]))
        said.clear()
        for stream, count in ((fast, 50), (slow, 200), (into, 200)):
            packets = list(stream.packets(ahead=20))
            assert len(packets) == count
            shots = {told.charge.name for p in packets for told in p.announcements}
            assert ("more" in shots) == (stream is not fast)
            stream.close()
    assert [line for line in said if "was not sent to 'into'" in line]
    assert not [line for line in said if "dropped" in line]


def test_a_record_that_begins_before_the_clock_is_cut_not_shifted():
    early = Slice(-3, 100.0, np.arange(5.0))
    sent = packet_message(Packet(0, 0.0, pressure=early)).pressure
    assert (sent.first, list(sent.values)) == (0, [3.0, 4.0])


def call(server, method, data):
    """Send bytes; return the status and what is said, or the answer."""
    with grpc.insecure_channel(server.address) as channel:
        try:
            return channel.unary_unary(f"/{SERVICE}/{method}")(data, timeout=10)
        except grpc.RpcError as error:
            return error.code().name, error.details()


def registration(**values):
    to = messages()
    usual = {"protocol": PROTOCOL, "name": "x", "senses": [1]}
    place = to.Vector(east=1.0)
    return to.Registration(position_m=place, **(usual | values))


REFUSED = {
    "garbage": (
        "Register",
        b"\xff" * 40,
        "INVALID_ARGUMENT",
        "40 bytes that cannot be decoded",
    ),
    "a large message": (
        "Register",
        b"\0" * (MOST_BYTES + 1),
        "RESOURCE_EXHAUSTED",
        "at most 1,048,576 bytes",
    ),
    "another protocol": (
        "Register",
        registration(protocol=2).SerializeToString(),
        "FAILED_PRECONDITION",
        "expected version 1, got 2",
    ),
    "no protocol": ("Describe", b"", "FAILED_PRECONDITION", "got 0"),
    "a rate out of range": (
        "Register",
        registration(senses=[3], samples_hz=1e9).SerializeToString(),
        "INVALID_ARGUMENT",
        "samples_hz: expected 100 to 192,000",
    ),
    "no such sense": (
        "Register",
        registration(senses=[77]).SerializeToString(),
        "INVALID_ARGUMENT",
        "sense 77",
    ),
    "after the end": (
        "Register",
        registration(first_packet=10**12).SerializeToString(),
        "INVALID_ARGUMENT",
        "before the end of the world",
    ),
    "no such method": ("Registr", b"", "UNIMPLEMENTED", ""),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_answered_has_a_status_and_a_reason(server, name):
    method, data, status, message = REFUSED[name]
    code, details = call(server, method, data)
    assert code == status
    assert message in details


def test_who_is_slow_dies_or_sends_garbage_is_named_and_harms_nobody(server, said):
    said.clear()
    with connect(server.address) as good:
        stream = good.stream(good.register("good", ["flash"], position_m=HERE))
        stream.ask(100)
        first = [stream.next() for _ in range(100)]
        dies = connect(server.address)
        dead = dies.stream(dies.register("dies", ["flash"], position_m=HERE))
        dead.ask(5)
        assert dead.next() is not None
        dies.close()
        to = messages()
        answer = to.Registered.FromString(
            call(server, "Register", registration(name="garbage").SerializeToString())
        )
        hello = to.Ask(name="garbage", ticket=answer.ticket).SerializeToString()
        with grpc.insecure_channel(server.address) as channel:
            asks = iter([hello, b"\xff" * 10])
            with pytest.raises(grpc.RpcError, match="10 bytes that cannot be decoded"):
                list(channel.stream_stream(f"/{SERVICE}/Stream")(asks))
        with socket.create_connection(server.address.split(":")) as other:
            other.sendall(b"GET / HTTP/1.1\r\n\r\n")
        until(lambda: len(said) == 2)
        assert sum("'dies'" in line and "went away" in line for line in said) == 1
        assert sum("'garbage'" in line and "bytes" in line for line in said) == 1
        stream.ask(100)
        rest = [stream.next() for _ in range(100)]
        assert [p and p.number for p in first + rest] == list(range(200))
        stream.close()
        assert len(server.table.registry) == 0


def test_who_keeps_the_server_waiting_is_dropped():
    said = []
    patient = Options(address="127.0.0.1:0", patience_s=0.2)
    with serving(world(), patient, said.append) as server:
        with connect(server.address) as client:
            stream = client.stream(client.register("idle", ["flash"], position_m=HERE))
            with pytest.raises(InputError, match=r"waiting for 0.2 s \(DEADLINE"):
                stream.next()
        call(server, "Register", registration(name="silent").SerializeToString())
        until(lambda: len(said) == 2)
    assert "'idle'" in said[0]
    assert "'silent'" in said[1]
    assert "opened no stream" in said[1]


def test_in_real_time_the_last_packet_ends_the_stream():
    fast = Options(address="127.0.0.1:0", lead_s=LEAD_S, speed=5.0, ends_s=ENDS_S)
    with serving(world(), fast) as server, connect(server.address) as one:
        stream = one.stream(one.register("a", ["flash"], position_m=HERE))
        numbers = []
        while (packet := stream.next()) is not None:
            numbers.append(packet.number)
        assert numbers == list(range(stream.ticket.first_packet, 200))
        until(lambda: len(server.table.registry) == 0)


def test_a_server_that_stops_says_so_to_who_streams_and_drops_nobody(capfd):
    said = []
    with serving(world(), OPTIONS, said.append) as server:
        client = connect(server.address)
        stream = client.stream(client.register("a", ["flash"], position_m=HERE))
        stream.ask(3)
        assert stream.next() is not None
    # gRPC may cut the call before the words are through, and then has its own
    words = r"(the server stops|Cancelling all calls) \(UNAVAILABLE\)"
    with pytest.raises(InputError, match=words):
        list(iter(stream.next, None))
    client.close()
    assert said == []
    assert capfd.readouterr().err == ""


def test_a_port_that_is_taken_is_said(server):
    taken = Options(address=server.address)
    with (
        pytest.raises(InputError, match="expected a free port"),
        serving(world(), taken),
    ):
        pass


ADDRESSES = {
    "everybody": ("0.0.0.0:1234", "expected a loopback address"),
    "a name": ("example:1234", "expected a loopback address"),
    "no port": ("127.0.0.1", "HOST:PORT"),
    "no host": (":1234", "HOST:PORT"),
    "a port of 5000 digits": ("127.0.0.1:" + "9" * 5000, "HOST:PORT"),
    "a large port": ("127.0.0.1:65536", "0 to 65535"),
}


@pytest.mark.parametrize("name", ADDRESSES)
def test_an_address_that_cannot_be_used_is_refused(name):
    address, message = ADDRESSES[name]
    options = Options(address=address)
    with pytest.raises(InputError, match=message), serving(world(), options):
        pass
