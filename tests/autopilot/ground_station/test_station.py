"""A vehicle and a ground station on loopback: ours, and pymavlink's."""

import threading

import numpy as np
import pytest

from jblast.autopilot.ground_station import GroundStation
from jblast.autopilot.mavlink import Address, Link
from jblast.autopilot.protocols import Missions, item_fields
from jblast.errors import InputError
from jblast.missions.plan import checked_item
from jblast.scene import Place
from tests.autopilot.logs.flights import HOME, eastward

ITEMS = [
    checked_item("", 0, 22, 3, [0, 0, 0, None, 47.0, 8.0, 10.0]),
    checked_item("", 1, 16, 3, [2, 1, 0, None, 47.001, 8.001, 12.5]),
]


def station(fly=None, speed=20.0) -> GroundStation:
    """A vehicle that listens by TCP and flies east when it is told to."""
    link = Link(Address("tcp", "127.0.0.1", 0), "ground_station")
    missions = Missions(None, Place(*HOME), lambda plan: None, lambda text: None)
    return GroundStation(
        link, eastward(0.02), missions, fly or (lambda plan: eastward()), speed
    )


@pytest.fixture
def client():
    """Serve a station in a thread; return it and pymavlink's end of the link."""
    tools = pytest.importorskip("pymavlink.mavutil")
    open_ones = []

    def connect(**options):
        vehicle = station(**options)
        served = threading.Thread(target=vehicle.serve, args=(30.0,))
        served.start()
        address = vehicle._link.address
        other = tools.mavlink_connection(
            f"tcp:{address.host}:{address.port}", dialect="common", source_system=255
        )
        open_ones.append((vehicle, served, other))
        assert other.wait_heartbeat(timeout=10) is not None
        return vehicle, other

    yield connect
    for vehicle, served, other in open_ones:
        other.close()
        served.join()
        vehicle._link.close()
        assert vehicle.watched.ended


def upload(other, items):
    """Upload as QGroundControl does: by MISSION_COUNT and one item after another."""
    other.mav.mission_count_send(1, 1, len(items))
    while True:
        asked = other.recv_match(
            type=["MISSION_REQUEST_INT", "MISSION_ACK"], blocking=True, timeout=10
        )
        if asked.get_type() == "MISSION_ACK":
            return asked.type
        f = item_fields(items[asked.seq], asked.seq)
        names = ("frame", "command", "current", "autocontinue", "param1", "param2")
        rest = ("param3", "param4", "x", "y", "z")
        values = [f[name] for name in (*names, *rest)]
        other.mav.mission_item_int_send(1, 1, asked.seq, *values)


def test_pymavlink_uploads_and_downloads_a_mission(client):
    vehicle, other = client()
    assert upload(other, ITEMS) == 0
    assert vehicle.missions.items == tuple(ITEMS)
    other.mav.mission_request_list_send(1, 1)
    count = other.recv_match(type="MISSION_COUNT", blocking=True, timeout=10).count
    back = []
    for n in range(count):
        other.mav.mission_request_int_send(1, 1, n)
        item = other.recv_match(type="MISSION_ITEM_INT", blocking=True, timeout=10)
        back.append((item.seq, item.command, item.x, item.y, item.z))
    assert back == [
        (0, 22, 470_000_000, 80_000_000, 10.0),
        (1, 16, 470_010_000, 80_010_000, 12.5),
    ]


def test_pymavlink_arms_it_and_sees_it_fly(client):
    vehicle, other = client()
    other.arducopter_arm()
    acks = [
        other.recv_match(type="COMMAND_ACK", blocking=True, timeout=10).result
        for _ in range(2)
    ]
    assert acks == [5, 0]
    places, angles = [], []
    for _ in range(400):
        told = other.recv_match(
            type=["GLOBAL_POSITION_INT", "ATTITUDE"], blocking=True, timeout=10
        )
        if told.get_type() == "ATTITUDE":
            angles.append(told.yaw)
            continue
        places.append((told.time_boot_ms, told.lon))
        if told.time_boot_ms == 4000:
            break
    assert places[-1] == (4000, pytest.approx(8e7 + 526, abs=1))
    assert np.all(np.diff([time for time, _ in places]) >= 0)
    np.testing.assert_allclose(angles, np.pi / 2, atol=1e-6)
    assert vehicle.watched.flights == 1


def test_what_cannot_be_flown_is_denied_and_said(client):
    def fly(plan):
        raise InputError("expected a vehicle on the ground")

    _, other = client(fly=fly)
    other.mav.command_long_send(1, 1, 300, 0, 0, 0, 0, 0, 0, 0, 0)
    text = other.recv_match(type="STATUSTEXT", blocking=True, timeout=10).text
    ack = other.recv_match(type="COMMAND_ACK", blocking=True, timeout=10)
    assert (text, ack.result) == ("expected a vehicle on the ground", 2)
    other.mav.command_long_send(1, 1, 31_000, 0, 0, 0, 0, 0, 0, 0, 0)
    assert other.recv_match(type="COMMAND_ACK", blocking=True, timeout=10).result == 3
