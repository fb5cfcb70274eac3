"""A ground station: missions and commands, by pymavlink."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.autopilot import ground_station
from jblast.autopilot.ground_station import BLOCK, Craft, GroundStation
from jblast.autopilot.lockstep import PERIOD_S, flight_of
from jblast.autopilot.mavlink import Link
from jblast.autopilot.protocols import item_fields
from jblast.missions import Plan
from jblast.missions.plan import checked_item
from jblast.scene import Charge, Place, Scene, VehicleSpec
from jblast.vehicle import State, blast_load, hold_of, simulate

HOME = Place(47.0, 8.0, 500.0)


@eqx.filter_jit
def glided(guidance, now, state):
    def turn(carried, _):
        now, state = carried
        aim, now = guidance(state, now, jnp.asarray(PERIOD_S))
        up = jnp.maximum(aim.position_m, jnp.array([-jnp.inf, -jnp.inf, 0.0]))
        falls = jnp.where(aim.position_m[2] < 0, 0.0, aim.velocity_m_s)
        moved = State(up, falls, state.quaternion, *[0 * up, state.rotor_speed_rad_s])
        return (now, moved), None

    return jax.lax.scan(turn, (now, state), None, length=BLOCK)[0]


class Gliding(Craft):
    def _move(self):
        integral, now = self._memory
        now, self.state = jax.tree.map(
            np.asarray, glided(self._control.guidance, now, self.state)
        )
        self._memory = integral, now


def craft_at(*position: float, kind: type[Craft] = Gliding) -> Craft:
    spec = VehicleSpec("iris", position=jnp.array(position))
    scene = Scene(Charge(1.0, time_s=1000.0), vehicle=spec)
    steps, start = flight_of(scene, spec, blast_load(scene))
    return kind(steps, start, hold_of(spec, integral=True))


def station_of(
    link: Link, plan=None, speed=20.0, kind: type[Craft] = Gliding, **options
) -> GroundStation:
    """A station whose vehicle stands at home."""
    craft = craft_at(0, 0, 0, kind=kind)
    return GroundStation(link, craft, HOME, plan, speed=speed, **options)


@contextmanager
def served(kind: str, where: str, **options) -> Iterator[GroundStation]:
    """Serve a vehicle; the end of the client ends the service."""
    link = Link(kind, where, "ground_station", (1, 1))
    station = station_of(link, **options)
    station.compile()
    other = threading.Thread(target=station.serve, args=(60.0,))
    other.start()
    try:
        yield station
    finally:
        other.join()
        link.close()
    assert station.ended


PAGE = Path(__file__).parents[2] / "docs/howto/autopilot.md"
ITEMS = [
    checked_item("", 0, 22, 3, [0, 0, 0, None, 47.0, 8.0, 10.0]),
    checked_item("", 1, 16, 3, [0, 0, 0, None, 47.0002, 8.0, 10.0]),
    checked_item("", 2, 16, 3, [0, 0, 0, None, 47.0002, 8.0003, 10.0]),
]
LANDING = checked_item("", 3, 21, 3, [0, 0, 0, None, 47.0002, 8.0003, 0])


@pytest.fixture
def client():
    """Serve a station in a thread; return it and pymavlink's end of the link."""
    tools = pytest.importorskip("pymavlink.mavutil")
    open_ones = []

    def connect(**options):
        context = served("tcp", "127.0.0.1:0", **options)
        vehicle = context.__enter__()
        address = vehicle._link.address
        other = tools.mavlink_connection(address, dialect="common", source_system=255)
        open_ones.append((context, other))
        assert other.wait_heartbeat(timeout=10) is not None
        return vehicle, other

    yield connect
    for context, other in open_ones:
        other.close()
        context.__exit__(None, None, None)


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
    for _ in range(300):
        beat = other.recv_match(type="HEARTBEAT", blocking=True, timeout=10)
        if wanted == (beat.custom_mode >> 24, bool(beat.base_mode & 128)):
            return True
    return False


@pytest.mark.slow
def test_a_mission_flies_lands_and_starts_again_from_its_first_item(client):
    vehicle, other = client()
    pictures = checked_item("", 4, 2001, 2, [0] * 7)
    assert upload(other, [*ITEMS, LANDING, pictures]) == 0
    assert result_of(other, 300) == 0
    seen = []
    while not seen or seen[-1] < 4:
        seen.append(
            other.recv_match(type="MISSION_ITEM_REACHED", blocking=True, timeout=10).seq
        )
    assert seen == [0, 1, 2, 3, 4]
    assert heartbeat(other, (4, False))
    current = [
        other.recv_match(type="MISSION_CURRENT", blocking=True, timeout=10)
        for _ in range(5)
    ]
    assert {(now.seq, now.mission_state) for now in current[-4:]} == {(0, 5)}
    assert result_of(other, 400, 0) == 0
    # After a landing it stays where it is, until it is armed again.
    place = other.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
    assert (place.lat, place.alt) == (470_002_000, 500_000)
    assert vehicle.flights == 1


@pytest.mark.slow
def test_a_command_in_flight_stops_it_at_the_stopping_distance(client):
    vehicle, other = client(speed=4.0)
    upload(other, ITEMS)
    assert result_of(other, 300) == 0
    craft, set_points = vehicle._craft, []
    while craft.set_point()[1][1] < 4.99:  # cruise, towards north
        other.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
    advance = craft.advance

    def watched():
        advance()
        set_points.append(craft.set_point()[0])

    craft.advance = watched
    assert result_of(other, 17) == 0
    assert heartbeat(other, (3, True))
    while not craft.over:
        other.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
    path = np.array(set_points)
    # 5 m/s for 0.1 s at most, and v^2 / 2 a from the command on
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.51
    assert path[-1][1] - path[0][1] == pytest.approx(5.0**2 / 4, abs=0.51)
    np.testing.assert_allclose(path[:, [0, 2]], [[0, 10]] * len(path), atol=1e-3)
    assert result_of(other, 400, 0) == 2  # no disarming in flight
    assert result_of(other, 193, 1) == 0  # continues the mission
    reached = other.recv_match(type="MISSION_ITEM_REACHED", blocking=True, timeout=10)
    assert reached.seq == 1
    vehicle._speed = 40.0  # it returns from far and lands slowly
    assert result_of(other, 20) == 0
    assert heartbeat(other, (5, True))
    assert heartbeat(other, (3, False))
    np.testing.assert_allclose(craft.state.position_m, 0, atol=1e-3)


def test_the_mode_after_a_take_off_is_hold_also_with_a_new_mission(client):
    _, other = client()
    assert result_of(other, 176, 1, 4, 3) == 0
    assert result_of(other, 400, 1) == 0
    assert result_of(other, 22) == 0
    assert upload(other, ITEMS) == 0
    assert heartbeat(other, (3, True))


def test_what_is_not_possible_is_denied_and_does_not_end_the_service(client):
    _, other = client()
    other.mav.command_long_send(1, 1, 300, 0, 0, 0, 0, 0, 0, 0, 0)
    text = other.recv_match(type="STATUSTEXT", blocking=True, timeout=10).text
    assert text == "mission: expected an uploaded one, got none"
    beats = [other.recv_match(type="HEARTBEAT", blocking=True) for _ in range(2)]
    assert not any(beat.base_mode & 128 for beat in beats)
    # the number of no message
    assert result_of(other, 511, 70_000) == 3
    # SET_MODE, which has no answer, in a mode that a disarmed vehicle cannot have
    other.mav.set_mode_send(1, 1, 4 << 16 | 5 << 24)
    text = other.recv_match(type="STATUSTEXT", blocking=True, timeout=10).text
    assert text == "expected an armed vehicle, got a disarmed one"
    assert result_of(other, 31_000) == 3


def test_without_the_scenes_mission_arming_flies_to_the_target(client):
    vehicle, other = client(plan=Plan(tuple(ITEMS)), target_m=np.array([5.0, 0, 10]))
    assert heartbeat(other, (4, False))
    other.mav.mission_clear_all_send(1, 1)
    assert heartbeat(other, (3, False))
    assert result_of(other, 400, 1) == 0
    while not vehicle._craft.over:
        other.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
    np.testing.assert_allclose(vehicle._craft.state.position_m, [5, 0, 10], atol=1e-3)
    assert vehicle.flights == 1


@pytest.mark.slow
def test_a_flight_in_blocks_is_that_of_a_mission():
    link = Link("tcp", "127.0.0.1:0", "ground_station", (1, 1))
    station = station_of(link, kind=Craft)
    mission = station.check(Plan((*ITEMS[:2], LANDING)))
    craft = station._craft
    craft.follow(mission)
    path = [np.zeros(3)]
    for _ in range(150):
        craft.advance()
        path.append(np.asarray(craft.state.position_m))
    flight = craft._simulator
    whole = simulate(
        flight.vehicle,
        craft._start,
        duration_s=15.0,
        step_s=PERIOD_S,
        store_every=ground_station.BLOCK,
        control=craft._control,
        wind=flight.wind,
        loads=flight.loads,
        ground_up_m=0.0,
        backend="jax",
    )
    # two programs round differently
    np.testing.assert_allclose(path, whole.position_m, rtol=0, atol=1e-9)
    assert path[-1][1] > 10.0
    link.close()


def test_the_page_lists_the_supported_commands():
    table = PAGE.read_text().partition("### Messages and commands")[2]
    listed = {int(number) for number in re.findall(r"\b(\d{2,3})\b", table)}
    link = Link("tcp", "127.0.0.1:0", "ground_station", (1, 1))
    assert set(station_of(link).commands) <= listed
    link.close()
