"""A vehicle and a ground station on loopback: ours, and pymavlink's."""

import re
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jblast.autopilot import ground_station
from jblast.autopilot.ground_station import GroundStation
from jblast.autopilot.mavlink import Address, Link
from jblast.autopilot.protocols import Missions, item_fields
from jblast.errors import InputError
from jblast.missions import Plan, mission_of
from jblast.missions.plan import checked_item
from jblast.scene import Place
from tests.autopilot.ground_station.flights import HOME, eastward

PAGE = Path(__file__).parents[3] / "docs/howto/autopilot.md"
ITEMS = [
    checked_item("", 0, 22, 3, [0, 0, 0, None, 47.0, 8.0, 10.0]),
    checked_item("", 1, 16, 3, [2, 1, 0, None, 47.001, 8.001, 12.5]),
]


def flown(plan):
    """A flight of 1 s for each item of a valid plan; during the last one it lands."""
    mission_of(plan, place=Place(*HOME), position_m=np.zeros(3))
    count = len(plan.items)
    found = eastward(float(count))
    time_s, place = found.time_s, np.zeros((found.time_s.size, 3))
    place[:, 0] = 2 * np.minimum(time_s, count - 2)
    place[:, 2] = 10 * np.clip(count - 0.5 - time_s, 0, 1)
    return replace(
        found,
        position_m=place,
        set_point_m=place,
        armed=time_s < count - 0.2,
        item=np.minimum(np.arange(time_s.size) // 100, count - 1),
    )


def crashed(plan):
    """A flight that ends on the ground at its first item, with the motors on."""
    found = flown(plan)
    rows = found.time_s <= 1.0
    place = found.position_m * np.where(found.time_s < 0.9, 1, 0)[:, None]
    names = ("time_s", "velocity_m_s", "quaternion", "body_rate_rad_s", "controls")
    kept = {name: getattr(found, name)[rows] for name in names}
    none = np.zeros(rows.sum(), int)
    kept |= {"position_m": place[rows], "set_point_m": None, "item": none}
    return replace(found, **kept, armed=np.ones(none.size, bool))


def station(fly=None, speed=20.0, plan=None, report=None) -> GroundStation:
    """A vehicle that listens by TCP and flies east when it is told to."""
    link = Link(Address("tcp", "127.0.0.1", 0), "ground_station")
    missions = Missions(plan, Place(*HOME), lambda plan: None, lambda text: None)
    return GroundStation(
        link,
        eastward(0.02),
        missions,
        fly or (lambda plan: eastward()),
        speed,
        report=report or (lambda line: None),
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


def result_of(other, number, *params):
    """Send a command; return its result."""
    values = [*params, *[0] * (7 - len(params))]
    other.mav.command_long_send(1, 1, number, 0, *values)
    result = 5
    while result == 5:
        ack = other.recv_match(type="COMMAND_ACK", blocking=True, timeout=10)
        result = ack.result if ack.command == number else 5
    return result


def heartbeat(other, wanted):
    """Wait for a heartbeat with a mode and a state (armed or not)."""
    for _ in range(15):
        beat = other.recv_match(type="HEARTBEAT", blocking=True, timeout=10)
        if wanted == (beat.custom_mode >> 24, bool(beat.base_mode & 128)):
            return True
    return False


def test_a_long_hover_does_not_count_as_flight_time(client):
    _, other = client(fly=flown)
    loiter = checked_item("", 2, 17, 3, [0, 0, 0, None, 47.002, 8.001, 12.5])
    assert upload(other, [*ITEMS, loiter]) == 0
    assert result_of(other, 300) == 0
    reached = [
        other.recv_match(type="MISSION_ITEM_REACHED", blocking=True, timeout=10).seq
        for _ in range(3)
    ]
    assert reached == [0, 1, 2]
    # 10 s of the flight's clock, beyond the search for the present row.
    time.sleep(0.5)
    other.mav.mission_set_current_send(1, 1, 1)
    time.sleep(0.5)
    other.recv_match(type="COMMAND_ACK")  # reads what has come
    assert other.messages["MISSION_CURRENT"].seq == 1
    # a local frame, which has no latitude
    other.mav.command_int_send(1, 1, 1, 192, 0, 0, 0, 0, 0, 0, 10, 20, 5)
    ack = other.recv_match(type="COMMAND_ACK", blocking=True, timeout=10)
    assert (ack.command, ack.result) == (192, 2)
    assert result_of(other, 21) == 0
    place = other.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
    assert 3000 <= place.time_boot_ms <= 4000
    assert heartbeat(other, (3, False))


def test_a_landed_mission_starts_again_from_its_first_item(client):
    _, other = client(fly=flown)
    land = checked_item("", 2, 21, 3, [0, 0, 0, None, 47.001, 8.001, 0])
    pictures = checked_item("", 3, 2001, 2, [0] * 7)
    assert upload(other, [*ITEMS, land, pictures]) == 0
    assert result_of(other, 300) == 0
    assert heartbeat(other, (4, False))
    current = [
        other.recv_match(type="MISSION_CURRENT", blocking=True, timeout=10)
        for _ in range(5)
    ]
    assert {(now.seq, now.mission_state) for now in current[-4:]} == {(0, 5)}
    assert result_of(other, 400, 0) == 0
    places = [
        other.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10).lon
        for _ in range(3)
    ]
    # 2 s at 2 m/s towards east
    assert places == [pytest.approx(8e7 + 526, abs=1)] * 3


def test_a_crash_does_not_complete_the_mission(client):
    _, other = client(fly=crashed)
    upload(other, ITEMS)
    assert result_of(other, 300) == 0
    time.sleep(0.3)
    seen = [
        other.recv_match(
            type=["MISSION_ITEM_REACHED", "MISSION_CURRENT"], blocking=True
        )
        for _ in range(15)
    ]
    assert {one.get_type() for one in seen} == {"MISSION_CURRENT"}
    assert (seen[-1].seq, seen[-1].mission_state) == (0, 2)


def test_the_mode_after_a_take_off_is_hold_also_with_a_new_mission(client):
    _, other = client(fly=flown, speed=3.0)
    assert result_of(other, 176, 1, 4, 3) == 0
    assert result_of(other, 400, 1) == 0
    assert result_of(other, 22) == 0
    assert upload(other, ITEMS) == 0
    assert heartbeat(other, (3, True))


def test_a_request_out_of_range_does_not_end_the_service(client):
    _, other = client()
    # the number of a message, which has 16 bits in the answer
    assert result_of(other, 510, 70_000) == 2
    # SET_MODE, which has no answer, in a mode that a disarmed vehicle cannot have
    other.mav.set_mode_send(1, 1, 4 << 16 | 5 << 24)
    text = other.recv_match(type="STATUSTEXT", blocking=True, timeout=10).text
    assert text == "expected an armed vehicle, got a disarmed one"
    assert result_of(other, 31_000) == 3


def test_a_denied_arming_leaves_the_vehicle_disarmed(client):
    def fly(plan):
        raise InputError("no flight")

    _, other = client(fly=fly)
    assert result_of(other, 400, 1) == 2
    beats = [other.recv_match(type="HEARTBEAT", blocking=True) for _ in range(2)]
    assert not any(beat.base_mode & 128 for beat in beats)


def test_without_the_scenes_mission_arming_starts_the_position_controller(client):
    vehicle, other = client(plan=Plan(tuple(ITEMS)))
    assert heartbeat(other, (4, False))
    other.mav.mission_clear_all_send(1, 1)
    assert heartbeat(other, (3, False))
    assert result_of(other, 400, 1) == 0
    assert vehicle.watched.flights == 1


def test_the_page_lists_the_supported_commands():
    table = PAGE.read_text().partition("### Messages and commands")[2]
    listed = {int(number) for number in re.findall(r"\b(\d{2,3})\b", table)}
    known = {*ground_station.MODES, ground_station.ARM, ground_station.SET_MODE}
    known |= {ground_station.REPOSITION, ground_station.PAUSE_CONTINUE}
    known |= {ground_station.SET_ITEM, ground_station.GET_HOME, ground_station.REQUEST}
    known |= {ground_station.GET_INTERVAL, ground_station.SET_INTERVAL}
    known |= {ground_station.CAPABILITIES_REQUEST}
    assert known <= listed
