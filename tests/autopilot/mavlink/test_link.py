"""Links of MAVLink: addresses, ports that are taken, peers that go."""

import socket
import struct

import pytest

from jblast.autopilot.mavlink import (
    Address,
    Link,
    LinkLost,
    Receiver,
    Sender,
    TelemetryLog,
    read_address,
)
from jblast.errors import InputError

READ = {
    "tcp": Address("tcp", "127.0.0.1", 4560),
    "udp:localhost:99": Address("udp", "127.0.0.1", 99),
    "tcp:127.0.0.2": Address("tcp", "127.0.0.2", 4560),
    "tcp:[::1]:7": Address("tcp", "::1", 7),
}
REFUSED = {
    "tcp:0.0.0.0:4560": r"mavlink: expected a loopback address, .* no authentication",
    "tcp:example.org:1": "mavlink: expected a loopback address",
    "serial:127.0.0.1:1": r"mavlink: expected tcp:HOST:PORT or udp:HOST:PORT, got",
    "tcp:127.0.0.1:x": r"mavlink: expected tcp:HOST:PORT or udp:HOST:PORT, got",
    f"tcp:127.0.0.1:{'9' * 5000}": r"mavlink: expected tcp:HOST:PORT or udp",
    "udp:127.0.0.1:70000": "mavlink: expected a port of 0 to 65535, got 70000",
}


@pytest.mark.parametrize("text", READ)
def test_addresses_are_read(text):
    assert read_address(text, "mavlink", 4560) == READ[text]


@pytest.mark.parametrize("text", REFUSED)
def test_addresses_that_cannot_be_are_refused(text):
    with pytest.raises(InputError, match=REFUSED[text]):
        read_address(text, "mavlink", 4560)


def tcp() -> Link:
    return Link(Address("tcp", "127.0.0.1", 0), "mavlink")


def test_a_port_that_is_taken_is_refused():
    link = tcp()
    with pytest.raises(InputError, match=f"got {link.address}, which is in use"):
        Link(link.address, "mavlink")
    link.close()


def test_messages_go_both_ways_and_all_are_kept():
    kept: list[bytes] = []
    link = Link(Address("tcp", "127.0.0.1", 0), "mavlink", keep=kept.append)
    with socket.create_connection((link.address.host, link.address.port)) as peer:
        assert link.accept(5.0)
        sent = Sender(1, 1).pack("HEARTBEAT", type=2)
        link.send(sent)
        (heard,) = Receiver().feed(peer.recv(100))
        answer = Sender(255, 190).pack("COMMAND_ACK", command=400)
        peer.sendall(answer)
        message = link.receive(5.0)
        assert message is not None
    assert (heard.values["type"], message.values["command"]) == (2, 400)
    assert kept == [sent, answer]
    link.close()


def test_a_peer_that_hangs_up_is_lost():
    link = tcp()
    peer = socket.create_connection((link.address.host, link.address.port))
    link.accept(5.0)
    peer.close()
    with pytest.raises(LinkLost, match="the autopilot has disconnected"):
        link.receive(5.0)
    link.close()


def test_over_udp_who_answers_is_the_peer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        link = Link(Address("udp", *other.getsockname()), "mavlink")
        link.send(Sender(1, 1).pack("HEARTBEAT"))
        _, who = other.recvfrom(100)
        other.sendto(Sender(9, 1).pack("HEARTBEAT"), who)
        message = link.receive(5.0)
        assert message is not None
        assert message.system == 9
        link.close()


def test_over_udp_nobody_there_is_no_error_before_anybody_was():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        where = gone.getsockname()
    link = Link(Address("udp", *where), "mavlink")
    for _ in range(3):
        link.send(Sender(1, 1).pack("HEARTBEAT"))
        assert link.receive(0.01) is None
    link.close()


def rows(data: bytes) -> list[tuple[float, str, dict]]:
    """Time, name and values of each message."""
    found = []
    while data:
        (time,) = struct.unpack_from(">Q", data)
        size = 12 + data[9]
        (message,) = Receiver().feed(data[8 : 8 + size])
        found.append((time * 1e-6, message.name, message.values))
        data = data[8 + size :]
    return found


def test_what_was_written_before_the_end_is_there(tmp_path):
    file = tmp_path / "a.tlog"

    def flight() -> None:
        with TelemetryLog(file) as log:
            log.now_s = 1.5
            log.keep(Sender(1, 1).pack("HEARTBEAT", type=2))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        flight()
    ((time, name, values),) = rows(file.read_bytes())
    assert (time, name, values["type"]) == (1.5, "HEARTBEAT", 2)
    log = pytest.importorskip("pymavlink.mavutil").mavlink_connection(
        str(file), dialect="common"
    )
    assert log.recv_match().get_type() == "HEARTBEAT"
    log.close()


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        TelemetryLog(tmp_path / "none" / "a.tlog")
