"""Servers of `jblast serve` over MAVLink, for an autopilot or a ground station.

Each runs until it is interrupted (SIGINT, SIGTERM) or its time is over, and returns a
summary of the flight.
"""

import argparse
import contextlib
import dataclasses
import signal
from collections.abc import Iterator
from types import FrameType
from typing import NamedTuple

from jblast.autopilot.ground_station import GroundStation
from jblast.autopilot.lockstep import (
    PERIOD_S,
    PLACE,
    Lockstep,
    fly_lockstep,
    programs,
    rotors_of,
    turns_of,
)
from jblast.autopilot.mavlink import Link, TelemetryLog, read_address
from jblast.autopilot.protocols import Missions
from jblast.cli.arguments.options import given
from jblast.files import refuse_existing
from jblast.progress_line import serve_line
from jblast.report.autopilot import (
    LockstepAnswer,
    WatchedAnswer,
    lockstep_answer,
    lockstep_line,
    watched_answer,
    watched_line,
)
from jblast.scene import Place, UncertainScene, VehicleSpec
from jblast.study.flights import checked_scene
from jblast.study.missions import (
    check_flown,
    flown_record,
    home_of,
    standing_record,
)
from jblast.study.running import scene_to_run
from jblast.vehicle import vehicle_of

AUTOPILOT_PORT, GROUND_PORT = {"tcp": 4560, "udp": 14560}, {"tcp": 5760, "udp": 14550}
"""Default ports, by convention of PX4's simulators and of ground stations."""


class ServedScene(NamedTuple):
    """The scene of a server.

    Attributes:
        uncertain: Scene with its sampled blasts.
        spec: Vehicle of the scene.
        place: Geographic position of the origin.
    """

    uncertain: UncertainScene
    spec: VehicleSpec
    place: Place


def served_autopilot(options: argparse.Namespace) -> LockstepAnswer:
    """Serve the scene's vehicle to an autopilot, and return the summary.

    Raises:
        InputError: The scene, the address or a file cannot be used.
    """
    kind = options.mavlink.partition(":")[0]
    address = read_address(options.mavlink, "mavlink", AUTOPILOT_PORT.get(kind, 0))
    if options.tlog:
        refuse_existing(options.tlog, force=options.force)
    scene = _scene(options)
    rotors = rotors_of(vehicle_of(scene.spec))
    drawn = scene.uncertain.scene
    turns = turns_of(drawn, scene.spec, scene.place, options.seed, options.scene)
    flight, files = Lockstep(), []
    with contextlib.ExitStack() as stack:
        # the port is bound before programs compile: a client may connect meanwhile
        link, log = Link(address, "mavlink"), None
        stack.callback(link.close)
        if options.tlog:  # after the port is bound, so that a failure leaves no file
            log = stack.enter_context(TelemetryLog(options.tlog))
            link.keep = log.keep
            files.append(options.tlog)
        made = programs(turns)
        serve_line(
            lockstep_line(
                scene.spec.model,
                options.scene,
                str(link.address),
                listens=address.kind == "tcp",
            )
        )

        def each() -> None:
            # Simulated time: stamps of the wall clock would depend on the speed of the
            # machine and of the autopilot.
            if log is not None:
                log.now_s = flight.turns * PERIOD_S

        stack.enter_context(_stopped_by_signal())
        unconnected, seconds = False, options.seconds
        try:
            # one second at a time, so that Ctrl-C is handled while waiting
            while address.kind == "tcp" and not link.accept(1.0):
                pass
        except KeyboardInterrupt:
            # A flight of 0 s, so that log and summary are complete also in this case.
            unconnected, seconds = True, 0.0
        fly_lockstep(
            made,
            link,
            rotors,
            flight=flight,
            seconds=seconds,
            each=each,
            **given(options, patience="patience_s"),
        )
        if unconnected:
            flight.ended = "interrupted before an autopilot connected"
        return lockstep_answer(
            flight,
            link,
            scene=options.scene,
            seed=options.seed,
            vehicle=scene.spec.model,
            files=files,
        )


def served_ground_station(options: argparse.Namespace) -> WatchedAnswer:
    """Serve the scene's vehicle to a ground station, and return the summary.

    Raises:
        InputError: The scene or the address cannot be used.
    """
    kind = options.ground_station.partition(":")[0]
    port = GROUND_PORT.get(kind, 0)
    address = read_address(options.ground_station, "ground_station", port)
    scene = _scene(options)
    uncertain, spec, place = scene
    link = Link(address, "ground_station")
    with contextlib.closing(link):

        def report_text(text: str) -> None:
            serve_line(text)
            station.report_text(text)

        missions = Missions(
            None if spec.mission is None else check_flown(uncertain),
            home_of(spec, place),
            lambda plan: check_flown(uncertain, plan),
            report_text,
        )
        station = GroundStation(
            link,
            standing_record(spec, place),
            missions,
            lambda plan: flown_record(uncertain, plan, options.seed),
            1.0 if options.speed is None else options.speed,
            hovers=float(spec.held[2]) > 0,
            report=serve_line,
        )
        serve_line(watched_line(spec.model, options.scene, str(link.address)))
        with _stopped_by_signal():
            watched = station.serve(options.seconds)
        return watched_answer(
            watched,
            link,
            scene=options.scene,
            seed=options.seed,
            vehicle=spec.model,
            items=len(missions.items),
        )


def _scene(options: argparse.Namespace) -> ServedScene:
    """Return the scene with its blasts sampled, and its vehicle."""
    drawn = scene_to_run(options.scene, seconds=options.seconds, seed=options.seed)
    place = PLACE if drawn.place is None else drawn.place
    whole = dataclasses.replace(drawn, place=place)
    return ServedScene(whole, checked_scene(whole, 1, False), place)


@contextlib.contextmanager
def _stopped_by_signal() -> Iterator[None]:
    """Make SIGTERM end a flight as Ctrl-C does."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = None
    with contextlib.suppress(ValueError):  # only the main thread may set a handler
        before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        # None also for a handler that was not set from Python and cannot be set from
        # it.
        if before is not None:
            signal.signal(signal.SIGTERM, before)
