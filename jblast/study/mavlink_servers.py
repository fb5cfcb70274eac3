"""Servers of a scene's vehicle over MAVLink, for an autopilot or a ground station.

Each runs until it is interrupted (SIGINT, SIGTERM) or its time is over.
"""

import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from jblast.autopilot import ground_station
from jblast.autopilot.ground_station import (
    MODE_HOLD,
    Craft,
    GroundStation,
    heartbeat,
)
from jblast.autopilot.lockstep import (
    COMPONENT,
    HEARTBEAT,
    MOTOR_WORDS,
    PLACE,
    SYSTEM,
    Lockstep,
    compiled,
    flight_of,
    fly_lockstep,
    messages_of,
    rotors_of,
    turns_of,
)
from jblast.autopilot.mavlink import Link, ending, message, read_address
from jblast.missions.plan import read_plan
from jblast.observations.places import Frame
from jblast.results import Document, filled
from jblast.scene import Place, UncertainScene, VehicleSpec
from jblast.study.flight_results import burst_remarks
from jblast.study.flights import checked_scene, drawn_scenes, scene_to_run
from jblast.vehicle import blast_load, hold_of, vehicle_of

PORTS = {
    "mavlink": {"tcp": 4560, "udp": 14560},
    "ground_station": {"tcp": 5760, "udp": 14550},
}
"""Default ports, by convention of PX4's simulators and of ground stations."""
WAIT_S = 0.05
"""Interval of the checks for a client."""


@dataclass(frozen=True)
class MavlinkAnswer(Document):
    """Result of a connection over MAVLink.

    Attributes:
        scene: The scene's file.
        seed: Seed of all random draws.
        vehicle: The vehicle.
        address: Address of the connection.
        lost: Number of missing messages, by the sender's count.
        damaged: Number of messages with a wrong checksum.
        ended: Reason for the end.
    """

    scene: str
    seed: int
    vehicle: str
    address: str
    lost: int
    damaged: int
    ended: str


@dataclass(frozen=True)
class LockstepAnswer(MavlinkAnswer):
    """Result of a flight with an autopilot in lockstep.

    Attributes:
        turns: Number of steps, 250 per second.
        flown: Number of steps since the autopilot armed.
        seconds: Time of flight.
        late: Number of ignored answers, which came for an earlier step.
        position_m: Final position of the vehicle: east, north, up.
        files: Files that were written.
    """

    turns: int
    flown: int
    seconds: float
    late: int
    position_m: tuple[float, float, float]
    files: tuple[str, ...]


@dataclass(frozen=True)
class WatchedAnswer(MavlinkAnswer):
    """Result of serving a ground station.

    Attributes:
        flights: Number of flights.
        items: Number of mission items at the end.
    """

    flights: int
    items: int


def serve_autopilot(
    scene: str | os.PathLike[str],
    address: str = "tcp",
    *,
    seconds: float | None = None,
    patience_s: float = 60.0,
    log: str | None = None,
    seed: int = 0,
    report: Callable[[str], object] = lambda line: None,
) -> LockstepAnswer:
    """Let an autopilot fly a scene's vehicle in lockstep, as in PX4's simulators.

    Args:
        scene: Scene file with a vehicle.
        address: "tcp:HOST:PORT", where it listens, or "udp:HOST:PORT", where it sends
            first; host and port may be absent.
        seconds: Duration of the flight; None: no end.
        patience_s: Timeout of an answer.
        log: New file of all messages; None: none.
        seed: Seed of all random draws.
        report: Called with a line when an autopilot can connect.

    Raises:
        InputError: The scene, the address or the log cannot be used.
    """
    flight = Lockstep()
    # the port is bound before programs compile: a client may connect meanwhile
    with _served(
        scene, address, "mavlink", (SYSTEM, COMPONENT), seconds, seed
    ) as served:
        uncertain, spec, place, link, known = served
        turns = turns_of(uncertain.scene, spec, place, seed, str(scene))
        if log:
            # after the port is bound, so that a failure leaves no file
            link.keep(log)
        waits = "waits for" if link.address.startswith("tcp") else "connects to"
        report(
            f"{spec.model} in {scene} {waits} an autopilot on {link.address}: 250 "
            f"samples a second in lockstep, motors {MOTOR_WORDS}"
        )
        with ending(flight):
            with link.beating(message("HEARTBEAT", **HEARTBEAT)):
                turn, carried = compiled(turns)
                while not link.connected:
                    time.sleep(WAIT_S)
            fly_lockstep(
                turn,
                carried,
                link,
                rotors_of(vehicle_of(spec)),
                partial(messages_of, turns.suite, Frame(*place)),
                flight=flight,
                seconds=seconds,
                patience_s=patience_s,
            )
    return filled(
        LockstepAnswer,
        flight,
        link,
        known,
        position_m=flight.position_m or tuple(map(float, spec.position)),
        files=(log,) if log else (),
    )


def serve_ground_station(
    scene: str | os.PathLike[str],
    address: str = "udp",
    *,
    seconds: float | None = None,
    speed: float = 1.0,
    seed: int = 0,
    report: Callable[[str], object] = lambda line: None,
) -> WatchedAnswer:
    """Let a ground station display and fly a scene's vehicle.

    Args:
        scene: Scene file with a vehicle.
        address: "udp:HOST:PORT", where it sends first, or "tcp:HOST:PORT", where it
            listens; host and port may be absent.
        seconds: Duration; None: no end.
        speed: Flight time per wall-clock time [-].
        seed: Seed of all random draws.
        report: Called with a line when a station can connect, and about each flight.

    Raises:
        InputError: The scene or the address cannot be used.
    """
    who = ground_station.SYSTEM, ground_station.COMPONENT
    with _served(scene, address, "ground_station", who, seconds, seed) as served:
        uncertain, spec, place, link, known = served
        first = heartbeat(armed=False, mode=MODE_HOLD)
        with link.beating(message("HEARTBEAT", **first)):
            drawn = drawn_scenes(uncertain, 1, seed)
            for note in burst_remarks(drawn, spec):
                report(note)
            hold = hold_of(
                replace(spec, mission=None), integral=spec.integral is not False
            )
            target = np.asarray(spec.held)
            station = GroundStation(
                link,
                Craft(*flight_of(drawn, spec, blast_load(drawn), str(scene)), hold),
                place,
                None if spec.mission is None else read_plan(spec.mission),
                target_m=target if target[2] > 0 else None,
                speed=speed,
                report=report,
            )
            station.compile()
        report(
            f"{spec.model} in {scene} on {link.address}, for a ground station to arm"
        )
        station.serve(seconds)
    items = len(station.missions.items)
    return filled(WatchedAnswer, station, link, known, items=items)


@contextlib.contextmanager
def _served(
    scene: str | os.PathLike[str],
    address: str,
    name: str,
    who: tuple[int, int],
    seconds: float | None,
    seed: int,
) -> Iterator[tuple[UncertainScene, VehicleSpec, Place, Link, dict[str, object]]]:
    """Yield a scene, its vehicle and place, a link, and entries of the document."""
    kind, where = read_address(address, name, PORTS[name])
    drawn = scene_to_run(scene, seconds=seconds, seed=seed)
    place = PLACE if drawn.place is None else drawn.place
    whole = replace(drawn, place=place)
    spec = checked_scene(whole, 1, False)
    closing = contextlib.closing(Link(kind, where, name, who))
    with closing as link, _stopped_by_signal():
        known: dict[str, object] = {
            "scene": str(scene),
            "seed": seed,
            "vehicle": spec.model,
        }
        known["address"] = link.address
        yield whole, spec, place, link, known


@contextlib.contextmanager
def _stopped_by_signal() -> Iterator[None]:
    """Make SIGTERM end a flight as Ctrl-C does."""
    before = None
    with contextlib.suppress(ValueError):  # only the main thread may set a handler
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        # None also for a handler that was not set from Python
        if before is not None:
            signal.signal(signal.SIGTERM, before)
