"""jblast serve: what it refuses from a shell, before anybody could come."""

import socket

import pytest

WORLD = "[world]\ncount = 2\n"

REFUSED = {
    "another's address": (["--listen", "0.0.0.0:1"], "--listen: expected a loopback"),
    "no port": (["--listen", "127.0.0.1"], "--listen: expected HOST:PORT"),
    "a rate too high": (["--rate", "1001"], "--rate: expected 1 to 1000"),
    "a rate too low": (["--rate", "0.5"], "--rate: expected 1 to 1000"),
    "a rate of nothing": (["--rate", "0"], "--rate: expected a positive number"),
    "no speed": (["--speed", "-1"], "--speed: expected a positive number"),
    "no lead": (["--lead", "nan"], "--lead: expected a finite number"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_served_is_one_message(jblast, name):
    words, message = REFUSED[name]
    if "--listen" not in words:
        words = [*words, "--listen", "127.0.0.1:0"]
    err = jblast.refused("serve", jblast.file("world.toml", WORLD), *words)
    assert message in err
    assert err.count("\n") == 1


def test_a_port_that_is_taken_is_one_message(jblast):
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"127.0.0.1:{other.getsockname()[1]}"
        words = ["serve", jblast.file("world.toml", WORLD), "--listen", address]
        err = jblast.refused(*words)
    assert f"--listen: expected a free port of this machine, got {address}" in err
