"""Links of MAVLink: addresses, ports that are taken, peers that go, logs."""

import gc
import socket
import struct

import numpy as np
import pytest

from jblast.autopilot.mavlink import (
    Link,
    LinkLost,
    dialect,
    message,
    read_address,
)
from jblast.errors import InputError

tools = pytest.importorskip("pymavlink.mavutil")
READ = {
    "tcp": ("tcp", "127.0.0.1:4560"),
    "udp:localhost:99": ("udp", "127.0.0.1:99"),
    "tcp:127.0.0.2": ("tcp", "127.0.0.2:4560"),
}
REFUSED = {
    "tcp:0.0.0.0:4560": r"mavlink: expected a loopback address, .* no authentication",
    "serial:127.0.0.1:1": r"mavlink: expected tcp:HOST:PORT or udp:HOST:PORT, got",
    "tcp:[::1]:7": r"mavlink: expected tcp:HOST:PORT or udp:HOST:PORT, got",
    f"tcp:127.0.0.1:{'9' * 5000}": r"mavlink: expected tcp:HOST:PORT or udp",
    "udp:127.0.0.1:70000": "mavlink: expected a port of 0 to 65535, got 70000",
}


@pytest.mark.parametrize("text", READ)
def test_addresses_are_read(text):
    assert read_address(text, "mavlink", {"tcp": 4560, "udp": 14560}) == READ[text]


@pytest.mark.parametrize("text", REFUSED)
def test_addresses_that_cannot_be_are_refused(text):
    with pytest.raises(InputError, match=REFUSED[text]):
        read_address(text, "mavlink", {"tcp": 4560, "udp": 14560})


@pytest.fixture
def link():
    link = Link("tcp", "127.0.0.1:0", "mavlink", (1, 51))
    yield link
    link.close()


def peer_of(link: Link):
    """Connect pymavlink's end of a link."""
    return tools.mavlink_connection(link.address, source_system=9, dialect="common")


# pymavlink leaves the socket that it could not bind to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_port_that_is_taken_is_refused(link):
    with pytest.raises(InputError, match=f"got {link.address}, which is in use"):
        Link("tcp", link.address.removeprefix("tcp:"), "mavlink", (1, 1))
    gc.collect()


def test_messages_go_both_ways_and_all_are_logged(link, tmp_path):
    file = tmp_path / "a.tlog"
    link.keep(str(file))
    with peer_of(link) as peer:
        assert link.connected
        link.now_s = 1.5
        link.send(message("HEARTBEAT", type=2), message("PING", seq=7))
        first, second = (peer.recv_match(blocking=True, timeout=5) for _ in range(2))
        peer.mav.command_ack_send(400, 0)
        heard = link.receive(5.0)
        assert heard is not None
    assert (first.type, second.seq, heard.command) == (2, 7, 400)
    assert (heard.get_srcSystem(), second.get_seq(), link.lost) == (9, 1, 0)
    link.close()
    (stamp,) = struct.unpack_from(">Q", file.read_bytes())
    assert stamp == 1_500_000
    log = tools.mavlink_connection(str(file), dialect="common")
    kinds = [log.recv_match().get_type() for _ in range(3)]
    assert kinds == ["HEARTBEAT", "PING", "COMMAND_ACK"]
    log.close()


def test_missing_and_damaged_messages_are_counted(link):
    with peer_of(link) as peer:
        frames = [message("HEARTBEAT", type=n).pack(peer.mav) for n in range(3)]
        coder = dialect().MAVLink(None, 9, 1)
        sent = []
        for n in range(5):
            coder.seq = n
            sent.append(message("HEARTBEAT", type=n).pack(coder))
        broken = bytearray(frames[0])
        broken[12] ^= 1
        peer.port.sendall(b"noise" + bytes(broken) + sent[0] + sent[3] + sent[4])
        heard = [link.receive(5.0) for _ in range(3)]
    assert [one.type for one in heard if one] == [0, 3, 4]
    assert (link.lost, link.damaged > 0) == (2, True)


def test_a_heartbeat_comes_while_the_server_is_busy(link):
    with peer_of(link) as peer, link.beating(message("HEARTBEAT", type=2)):
        assert peer.recv_match(type="HEARTBEAT", blocking=True, timeout=5) is not None


def test_a_peer_that_hangs_up_is_lost(link):
    peer_of(link).close()
    with pytest.raises(LinkLost, match="the autopilot has disconnected"):
        link.receive(5.0)


def test_over_udp_the_owner_of_the_port_is_the_peer_and_is_lost():
    other = tools.mavlink_connection("udpin:127.0.0.1:0", dialect="common")
    port = other.port.getsockname()[1]
    link = Link("udp", f"127.0.0.1:{port}", "mavlink", (1, 51))
    link.send(message("HEARTBEAT"))
    assert other.recv_match(blocking=True, timeout=5) is not None
    other.mav.ping_send(0, 5, 0, 0)
    heard = link.receive(5.0)
    assert heard is not None
    assert heard.seq == 5
    other.close()
    link.send(message("HEARTBEAT"))
    with pytest.raises(LinkLost):
        link.receive(5.0)
    link.close()


def test_over_udp_nobody_there_is_no_error_before_anybody_was():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(("127.0.0.1", 0))
        port = gone.getsockname()[1]
    link = Link("udp", f"127.0.0.1:{port}", "mavlink", (1, 51))
    for _ in range(3):
        link.send(message("HEARTBEAT"))
        assert link.receive(0.01) is None
    link.close()


def test_a_file_that_cannot_be_written_is_named(link, tmp_path):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        link.keep(str(tmp_path / "none" / "a.tlog"))


def test_fields_that_a_message_leaves_out_are_zeros():
    controls = message("HIL_ACTUATOR_CONTROLS", mode=129)
    np.testing.assert_array_equal(controls.controls, [0.0] * 16)
    assert message("STATUSTEXT", text="é").text == "?"
