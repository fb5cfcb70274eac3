"""The servers of `jblast serve` over MAVLink: for an autopilot, or a ground station.

Each runs until it is interrupted (SIGINT, SIGTERM) or its time is over, and returns a
summary of the flight.
"""

import argparse
import contextlib
import dataclasses
import math
import signal
from collections.abc import Iterator
from types import FrameType
from typing import NamedTuple

from jblast.autopilot.ground_station import GroundStation, Missions
from jblast.autopilot.lockstep import (
    PERIOD_S,
    PLACE,
    Lockstep,
    fly_lockstep,
    lockstep_record,
    programs,
    rotors_of,
    turns_of,
)
from jblast.autopilot.logs import TelemetryLog, flight_ulog
from jblast.autopilot.mavlink import Link, read_address
from jblast.cli.progress_line import serve_line
from jblast.files import refuse_existing, write_bytes
from jblast.report.autopilot import (
    LockstepAnswer,
    WatchedAnswer,
    lockstep_answer,
    lockstep_line,
    watched_answer,
    watched_line,
)
from jblast.scene import Place, UncertainScene, VehicleSpec, read_scene_or_world
from jblast.study.flights import checked_scene
from jblast.study.missions import (
    check_flown,
    flown_record,
    home_of,
    standing_record,
)
from jblast.vehicle import vehicle_of
from jblast.world import draw_world

AUTOPILOT_PORT, GROUND_PORT = {"tcp": 4560, "udp": 14560}, {"tcp": 5760, "udp": 14550}
"""The usual ones: of PX4's simulators, and of ground stations."""


class Asked(NamedTuple):
    """The scene that is served.

    Attributes:
        uncertain: With its random blasts drawn.
        spec: Its vehicle.
        place: Where its origin lies.
    """

    uncertain: UncertainScene
    spec: VehicleSpec
    place: Place


def served_autopilot(asked: argparse.Namespace) -> LockstepAnswer:
    """Let an autopilot fly the scene's vehicle.

    Raises:
        InputError: The scene, the address or a file cannot be used.
    """
    kind = asked.mavlink.partition(":")[0]
    address = read_address(asked.mavlink, "mavlink", AUTOPILOT_PORT.get(kind, 0))
    for file in (asked.tlog, asked.ulog):
        if file:
            refuse_existing(file, force=asked.force)
    scene = _scene(asked)
    rotors = rotors_of(vehicle_of(scene.spec))
    drawn = scene.uncertain.scene
    turns = turns_of(drawn, scene.spec, scene.place, asked.seed, asked.scene)
    flight, files = Lockstep(), []
    with contextlib.ExitStack() as stack:
        link, log = Link(address, "mavlink"), None
        stack.callback(link.close)
        if asked.tlog:  # where the port is taken there is no log either
            log = stack.enter_context(TelemetryLog(asked.tlog))
            link.keep = log.keep
            files.append(asked.tlog)
        made = programs(turns)
        serve_line(
            lockstep_line(
                scene.spec.model,
                asked.scene,
                str(link.address),
                listens=address.kind == "tcp",
            )
        )

        def each() -> None:
            if log is not None:
                log.now_s = flight.turns * PERIOD_S

        stack.enter_context(_stopped_by_signal())
        nobody, seconds = False, asked.seconds
        try:
            while address.kind == "tcp" and not link.accept(1.0):
                pass
        except KeyboardInterrupt:
            nobody, seconds = True, 0.0
        fly_lockstep(
            made,
            link,
            rotors,
            flight=flight,
            seconds=seconds,
            patience_s=asked.patience,
            each=each,
        )
        if nobody:
            flight.ended = "interrupted before an autopilot came"
        if asked.ulog:
            record = lockstep_record(flight, rotors, scene.place)
            write_bytes(asked.ulog, flight_ulog(record))
            files.append(asked.ulog)
        return lockstep_answer(
            flight,
            link,
            scene=asked.scene,
            seed=asked.seed,
            vehicle=scene.spec.model,
            files=files,
        )


def served_ground_station(asked: argparse.Namespace) -> WatchedAnswer:
    """Show the scene's vehicle to a ground station.

    Raises:
        InputError: The scene or the address cannot be used.
    """
    kind = asked.ground_station.partition(":")[0]
    port = GROUND_PORT.get(kind, 0)
    address = read_address(asked.ground_station, "ground_station", port)
    scene = _scene(asked)
    uncertain, spec, place = scene
    link = Link(address, "ground_station")
    with contextlib.closing(link):
        said: list[GroundStation] = []
        missions = Missions(
            None if spec.mission is None else check_flown(uncertain),
            home_of(spec, place),
            lambda plan: check_flown(uncertain, plan),
            lambda text: [serve_line(text), *(one.report_text(text) for one in said)],
        )
        station = GroundStation(
            link,
            standing_record(spec, place),
            missions,
            lambda plan: flown_record(uncertain, plan, asked.seed),
            1.0 if asked.speed is None else asked.speed,
        )
        said.append(station)
        serve_line(watched_line(spec.model, asked.scene, str(link.address)))
        with _stopped_by_signal():
            watched = station.serve(asked.seconds)
        return watched_answer(
            watched,
            link,
            scene=asked.scene,
            seed=asked.seed,
            vehicle=spec.model,
            items=len(missions.items),
        )


def _scene(asked: argparse.Namespace) -> Asked:
    """Return the scene with its random blasts drawn, and its vehicle."""
    uncertain, world = read_scene_or_world(asked.scene)
    until = math.inf if asked.seconds is None else asked.seconds
    drawn = draw_world(uncertain, world, asked.seed, until_s=until)
    place = PLACE if uncertain.place is None else uncertain.place
    whole = dataclasses.replace(uncertain, scene=drawn.scene, beliefs={}, place=place)
    return Asked(whole, checked_scene(whole, 1, False), place)


@contextlib.contextmanager
def _stopped_by_signal() -> Iterator[None]:
    """Let SIGTERM end a flight as Ctrl-C does."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = None
    with contextlib.suppress(ValueError):  # in another thread than the first
        before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)
