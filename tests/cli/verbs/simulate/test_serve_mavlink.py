"""jblast serve --mavlink: what it refuses from a shell, and one flight end to end."""

import json
import socket
import threading
import time

import pytest

from jblast.autopilot.mavlink import Receiver, Sender

SCENE = """
[charge]
mass_kg = 1.0
position_m = [30, 0, 0]
time_s = 1000.0
[vehicle]
model = "iris"
position_m = [0, 0, 0]
"""
ANY = ["--mavlink", "tcp:127.0.0.1:0"]
REFUSED = {
    "another's address": (
        ["--mavlink", "tcp:0.0.0.0:4560"],
        "--mavlink: expected a loopback address",
    ),
    "no address": (["--mavlink", "com:1"], "--mavlink: expected tcp:HOST:PORT or udp"),
    **{
        f"{option} with {server}": (
            [f"--{server}", "tcp:127.0.0.1:0", f"--{option}", value],
            f"--{option}: expected no such option with a server over --{server}",
        )
        for server, options in {
            "mavlink": {
                "listen": "127.0.0.1:0",
                "rate": "9",
                "lead": "1",
                "speed": "2",
            },
            "ground-station": {"rate": "9", "patience": "1", "tlog": "a.tlog"},
        }.items()
        for option, value in options.items()
    },
    "a log of gRPC": (["--tlog", "a.tlog"], "--tlog: expected no such option with"),
    "both": ([*ANY, "--ground-station"], "expected --ground-station or"),
    "others' station": (
        ["--ground-station", "udp:10.0.0.1:14550"],
        "--ground-station: expected a loopback address",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_served_is_one_message(jblast, name):
    words, message = REFUSED[name]
    err = jblast.refused("serve", jblast.file("scene.toml", SCENE), *words)
    assert message in err
    assert err.count("\n") == 1


def connected(port: int) -> socket.socket:
    """Connect as soon as somebody listens, within a minute."""
    for _ in range(300):
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=60.0)
        except ConnectionRefusedError:
            time.sleep(0.2)
    raise TimeoutError


def answering(port: int, turns: int) -> None:
    """Arm, let the rotors turn, answer so many turns and hang up."""
    receiver, sender = Receiver(), Sender(1, 1)
    with connected(port) as link:
        while turns and (data := link.recv(65536)):
            for message in receiver.feed(data):
                if message.name == "HIL_SENSOR" and turns:
                    turns -= 1
                    stamp = message.values["time_usec"]
                    answer = {"time_usec": stamp, "mode": 129, "flags": 1}
                    answer["controls"] = [0.9] * 4 + [0.0] * 12
                    link.sendall(sender.pack("HIL_ACTUATOR_CONTROLS", **answer))


@pytest.mark.slow
def test_a_flight_that_is_cut_off_keeps_its_log(jblast, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    other = threading.Thread(target=answering, args=(port, 250))
    other.start()
    logs = ["--tlog", str(tmp_path / "a.tlog")]
    scene = jblast.file("scene.toml", SCENE)
    words = ["--mavlink", f"tcp:127.0.0.1:{port}", "--seconds", "5", "--json"]
    code, out, _ = jblast("serve", scene, *words, *logs)
    other.join()
    told = json.loads(out)
    assert code == 4
    assert (told["turns"], told["flown"]) == (250, 250)
    assert told["ended"] == "the autopilot has disconnected"
    # four rotors at 0.9 of their speed carry 2.2 times the weight of an Iris
    assert told["position_m"][2] > 1.0
    assert (tmp_path / "a.tlog").stat().st_size > 250 * 150
