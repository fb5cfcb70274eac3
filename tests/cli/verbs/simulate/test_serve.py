"""jblast serve: what it refuses from a shell, and one flight end to end."""

import json
import socket
import threading

import pytest

from tests.cli.cli_files import says, table

WORLD = "[world]\ncount = 2\n"
SCENE = """
[charge]
mass_kg = 1.0
position_m = [30, 0, 0]
time_s = 1000.0
[vehicle]
model = "iris"
position_m = [0, 0, 0]
"""
REFUSED = table("""
--listen 0.0.0.0:1 => --listen: expected a loopback
--listen 127.0.0.1 => --listen: expected HOST:PORT
--rate 1001 => --rate: expected 1 to 1000
--rate 0.5 => --rate: expected 1 to 1000
--rate 0 => --rate: expected a positive number
--speed -1 => --speed: expected a positive number
--lead nan => --lead: expected a finite number
--mavlink tcp:0.0.0.0:4560 => --mavlink: expected a loopback address
--mavlink com:1 => --mavlink: expected tcp:HOST:PORT or udp
--mavlink ANY --listen 127.0.0.1:0 => --listen: expected no such option with a server
--mavlink ANY --rate 9 => --rate: expected no such option with a server over --mavlink
--mavlink ANY --lead 1 => --lead: expected no such option with a server over --mavlink
--mavlink ANY --speed 2 => --speed: expected no such option with a server
--ground-station ANY --rate 9 => --rate: expected no such option with a server over --gr
--ground-station ANY --patience 1 => --patience: expected no such option with a server
--ground-station ANY --tlog a.tlog => --tlog: expected no such option with a server
--tlog a.tlog => --tlog: expected no such option with
--mavlink ANY --ground-station => --ground-station: expected no such
--ground-station udp:10.0.0.1:14550 => --ground-station: expected a loopback address
""")


@pytest.mark.parametrize(("words", "said"), REFUSED)
def test_what_cannot_be_served_is_one_message(jblast, words, said):
    if not {"--listen", "--mavlink", "--ground-station", "--tlog"} & {*words.split()}:
        words += " --listen 127.0.0.1:0"
    words = words.replace("ANY", "tcp:127.0.0.1:0").split()
    text = SCENE if "--mavlink" in words or "--ground-station" in words else WORLD
    says(jblast.refused("serve", jblast.file("scene.toml", text), *words), said)


def test_a_port_that_is_taken_is_one_message(jblast):
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"127.0.0.1:{other.getsockname()[1]}"
        words = ["serve", jblast.file("world.toml", WORLD), "--listen", address]
        err = jblast.refused(*words)
    assert f"--listen: expected a free port of this machine, got {address}" in err


def answering(port: int, turns: int, kinds: list[str]) -> None:
    """Arm, let the rotors turn, answer so many turns and hang up."""
    tools = pytest.importorskip("pymavlink.mavutil")
    address = f"tcp:127.0.0.1:{port}"
    with tools.mavlink_connection(
        address, source_system=1, dialect="common", retries=60
    ) as link:
        while turns:
            came = link.recv_match(blocking=True, timeout=60)
            kinds.append(came.get_type())
            if kinds[-1] == "HIL_SENSOR":
                turns -= 1
                controls = [0.9] * 4 + [0.0] * 12
                link.mav.hil_actuator_controls_send(came.time_usec, controls, 129, 1)


@pytest.mark.slow
def test_a_flight_that_is_cut_off_keeps_its_log(jblast, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    kinds: list[str] = []
    other = threading.Thread(target=answering, args=(port, 250, kinds))
    other.start()
    logs = ["--tlog", str(tmp_path / "a.tlog")]
    scene = jblast.file("scene.toml", SCENE)
    words = ["--mavlink", f"tcp:127.0.0.1:{port}", "--seconds", "5", "--json"]
    code, out, _ = jblast("serve", scene, *words, *logs)
    other.join()
    # after the lines that pymavlink prints while it waits for the server
    told = json.loads(out[out.index("{") :])
    assert code == 4
    # while the step of the vehicle compiles
    assert kinds[0] == "HEARTBEAT"
    assert (told["turns"], told["flown"]) == (250, 250)
    assert told["ended"] == "the autopilot has disconnected"
    # four rotors at 0.9 of their speed carry 2.2 times the weight of an Iris
    assert told["position_m"][2] > 1.0
    assert (tmp_path / "a.tlog").stat().st_size > 250 * 150
