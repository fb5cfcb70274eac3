"""The part of the Gazebo example that needs no ROS, as the page shows it."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jblast.world.serve import Entity, Knot, Motion, Options, serving
from tests.world.serve.served import ENDS_S, LEAD_S, playback, step, world

PAGE = Path(__file__).parents[3] / "docs" / "howto" / "ros.md"
PLACE = [5.0, 0.0, 3.0]
ACROSS = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
"""Rolled by a right angle to the right: the body's up is the world's south."""
STILL = [0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def link():
    (shown, *_) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
    names: dict[str, Any] = {}
    exec(shown, names)
    return names["BlastLink"]


@pytest.fixture(scope="module")
def alone():
    """Impulse and angular impulse of each packet of one process; the latter, body."""
    entity = Entity("e", ["force"], [Knot(PLACE)], vehicle="iris")
    played, found = playback(entity), []
    for number in range(round(ENDS_S * 100)):
        played.motion = Motion((number // 2 + 1) / 50, PLACE, STILL, ACROSS)
        packet = step(played)
        assert packet.force is not None
        found.append(packet.force.values.sum(0) / packet.force.rate_hz)
        assert packet.last == (number + 1 == round(ENDS_S * 100))
    return np.array(found)


def test_the_client_of_the_page_receives_the_impulses_of_one_process(link, alone):
    """Reports at 50 Hz, of two packets each."""
    options = Options(address="127.0.0.1:0", lead_s=LEAD_S, ends_s=ENDS_S)
    with serving(world(), options, print) as server:
        client = link(server.address, "x3", "iris", PLACE)
        rows = [
            client.advance(number / 50, PLACE, STILL, ACROSS, STILL)
            for number in range(round(ENDS_S * 50) + 2)
        ]
        assert client.ended
        client.close()
    impulse, turn = (np.array(column) for column in zip(*rows, strict=True))
    pairs = alone.reshape(-1, 2, 6).sum(1)
    assert np.abs(pairs[:, :3]).max() > 1e-3
    assert np.abs(pairs[:, 3:]).max() > 1e-6
    # nothing before the first packet ends, and nothing after the last
    assert not impulse[[0, -1]].any()
    np.testing.assert_allclose(impulse[1:-1], pairs[:, :3], rtol=0, atol=1e-12)
    forward, left, up = pairs[:, 3:].T
    np.testing.assert_allclose(
        turn[1:-1], np.stack([forward, -up, left], 1), rtol=0, atol=1e-12
    )
