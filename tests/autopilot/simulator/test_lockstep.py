"""Flights in lockstep: with whom they go on, and what ends them, log and all."""

import threading
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.autopilot.lockstep import (
    FIX,
    PERIOD_S,
    SENSOR,
    STATE,
    Lockstep,
    Programs,
    Rotors,
    fly_lockstep,
    programs,
    rotors_of,
    turns_of,
)
from jblast.autopilot.mavlink import Address, Link, LinkLost, Receiver, Sender
from jblast.errors import InputError
from jblast.scene import Charge, Place, Scene, VehicleSpec
from jblast.vehicle import hold_of, simulate, vehicle_of
from tests.tools.mock_autopilot import Mock, RoundedHold, fly_mock

ROTORS = Rotors(np.arange(4), 100.0)
TOLD = len(SENSOR) + len(FIX) + len(STATE) + 1


def nothing_moves() -> Programs:
    """Turns of a vehicle whose state counts them."""

    def told(n: int) -> Any:
        numbers = np.zeros(TOLD + 17)
        numbers[len(SENSOR) + len(FIX)] = 1.0
        numbers[-17:] = n
        return n, numbers

    def after(n: Any, turn: int, world: int, goes: bool, speeds: Any) -> Any:
        return told(n + bool(goes))

    return Programs(lambda: told(0), after)


class Scripted(Link):
    """A link whose other end answers by a script; "gone" hangs up, None is silent."""

    def __init__(self, script):
        self.script, self.sent, self.waiting = list(script), 0, []
        self.sender = Sender(1, 1)

    def send(self, *frames):
        stamp = [m for m in Receiver().feed(b"".join(frames))][-1].values["time_usec"]
        self.sent += 1
        answer = self.script.pop(0) if self.script else None
        if answer == "gone":
            raise LinkLost("the connection was closed")
        for said in answer if isinstance(answer, list) else [answer]:
            if said is not None:
                values = {"time_usec": stamp, "mode": 129, "flags": 1} | said
                self.waiting.append(self.sender.pack("HIL_ACTUATOR_CONTROLS", **values))

    def receive(self, timeout_s):
        if not self.waiting:
            return None
        return next(Receiver().feed(self.waiting.pop(0)))


def flown(script, **options) -> tuple[Lockstep, Scripted]:
    link = Scripted(script)
    flight = Lockstep()
    fly_lockstep(
        nothing_moves(), link, ROTORS, flight=flight, patience_s=0.05, **options
    )
    return flight, link


def test_each_turn_is_answered_and_flown():
    flight, _ = flown([{}] * 5, seconds=5 * PERIOD_S)
    assert (flight.turns, flight.flown, flight.late) == (5, 5, 0)
    assert flight.ended == "the time is over"
    assert [row.state[0] for row in flight.rows] == [0, 1, 2, 3, 4, 5]


def test_before_it_is_armed_the_vehicle_and_its_clock_stand():
    flight, _ = flown([None, None, {"mode": 1}, {}, {}, "gone"])
    assert (flight.turns, flight.flown) == (5, 2)
    assert [row.time_s for row in flight.rows] == [0.0, PERIOD_S, 2 * PERIOD_S]


def test_disarmed_in_flight_its_rotors_stand():
    half = {"controls": [0.5] * 16}
    flight, _ = flown([half, half | {"mode": 1}, "gone"])
    asked = [row.command_rad_s[0] for row in flight.rows]
    assert asked == [50.0, 0.0, 0.0]


def test_an_answer_to_an_earlier_turn_is_passed_over_and_counted():
    flight, _ = flown([{}, [{"time_usec": 4000}, {}], "gone"])
    assert (flight.late, flight.flown) == (1, 2)


ENDS = {
    "hung up": (["gone"], "the connection was closed"),
    "silent": ([None], "no answer came within 0.05 s"),
    "early": ([{"time_usec": 10**9}], "controls for 1000000000 us: messages out of"),
    "not in lockstep": ([{"flags": 0}], "expected an autopilot in lockstep, bit 0"),
}


@pytest.mark.parametrize("name", ENDS)
def test_what_ends_a_flight_is_said_and_its_rows_are_kept(name):
    script, message = ENDS[name]
    flight, _ = flown([{}, {}, *script], seconds=1.0)
    assert message in flight.ended
    assert len(flight.rows) == flight.flown + 1 == 3


def in_lockstep(scene: Scene, spec: VehicleSpec, count: int):
    """Fly a scene with the mock over loopback; and the same hold without a network."""
    turns, vehicle = turns_of(scene, spec, Place(47.0, 8.0, 300.0), 3), vehicle_of(spec)
    rotors, hold = rotors_of(vehicle), hold_of(spec, integral=True)
    made = programs(turns)
    rounded = RoundedHold(hold.ready(vehicle), turns.origin, rotors.of_motor)
    mock = Mock(rounded, vehicle)
    link = Link(Address("tcp", "127.0.0.1", 0), "mavlink")
    where = (link.address.host, link.address.port)
    other = threading.Thread(target=fly_mock, args=(where, mock, count))
    other.start()
    while not link.accept(1.0):
        pass
    flight = fly_lockstep(
        made, link, rotors, flight=Lockstep(), seconds=count * PERIOD_S
    )
    link.close()
    other.join()
    alone = simulate(
        vehicle,
        turns.flight.state,
        duration_s=count * PERIOD_S,
        step_s=PERIOD_S,
        control=RoundedHold(hold, turns.origin, rotors.of_motor),
        wind=turns.flight.wind,
        loads=turns.flight.loads,
        ground_up_m=0.0,
    )
    path = np.array([row.state[:3] for row in flight.rows])
    return flight, link, path, np.asarray(alone.position_m)


@pytest.mark.slow
def test_through_a_blast_the_path_is_that_of_the_same_hold_without_a_network():
    spec = VehicleSpec("iris", position=jnp.array([8.0, 0.0, 10.0]))
    scene = Scene(Charge(10.0, time_s=0.2), vehicle=spec)
    flight, link, path, alone = in_lockstep(scene, spec, 500)
    assert (flight.flown, flight.late, link.receiver.lost) == (500, 0, 0)
    assert np.linalg.norm(path - path[0], axis=1).max() > 0.03
    np.testing.assert_allclose(path, alone, rtol=0, atol=1e-6)


def test_a_vehicle_below_ground_is_refused():
    spec = VehicleSpec("iris", position=jnp.array([0.0, 0.0, -1.0]))
    with pytest.raises(InputError, match="expected a vehicle that is not below ground"):
        turns_of(Scene(Charge(1.0), vehicle=spec), spec, None, 0)


@pytest.mark.slow
def test_at_rest_on_the_ground_its_instruments_say_so():
    spec = VehicleSpec("iris", position=jnp.zeros(3))
    turns = turns_of(Scene(Charge(1.0), vehicle=spec), spec, None, 0)
    _, numbers = jax.jit(lambda: turns.reported(turns.start(), *[jnp.asarray(0)] * 2))()
    said = dict(zip(SENSOR, np.asarray(numbers), strict=False))
    # one sample, calibrated: 0.1 m/s2 is four standard deviations
    assert said["zacc"] == pytest.approx(-9.81, abs=0.12)
    assert said["abs_pressure"] == pytest.approx(1013.25, abs=0.06)
    assert said["pressure_alt"] == pytest.approx(0.0, abs=0.5)
    assert said["fields_updated"] == 0b1101111111111
    state = dict(
        zip(STATE, np.asarray(numbers)[len(SENSOR) + len(FIX) :], strict=False)
    )
    assert (state["lat"], state["lon"], state["alt"]) == (473977420, 85455940, 0)
