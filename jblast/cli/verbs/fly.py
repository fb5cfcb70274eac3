"""Fly a scene's vehicle through its blasts, holding its place or on a mission.

The flight begins at 0 on the scene's clock, over level ground at height 0, in the
scene's wind; a blast comes at its charge's time_s and the way to the vehicle. Position
hold with integral action and without it are flown side by side, or the --controllers
that are named. A crash is an answer: the exit code is 0.

Where the scene's [vehicle] names a mission, a plan of QGroundControl, that is flown:
from the ground, unattended, until the vehicle has landed and is disarmed.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive, seed, vector
from jblast.cli.arguments.options import given, path
from jblast.errors import InputError
from jblast.files import refuse_existing, save_text

if TYPE_CHECKING:
    from jblast.autopilot.logs import FlightRecord
    from jblast.results import Document
    from jblast.scene import Place
    from jblast.study.flight_results import Flights
    from jblast.study.missions import MissionFlight

Answer = tuple["Document", str, Callable[[str, Path], list[str]]]


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there, with a [vehicle]: its model, position_m, and if wanted "
        "velocity_m_s and control, or its mission; numbers with a prior are drawn",
    )
    verb.add_argument(
        "--vehicles",
        metavar="N",
        type=int,
        default=1,
        help="draw so many scenes from the priors and tell the distribution (default: "
        "1)",
    )
    verb.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="how long to fly [s] (default: until 5 s after the last blast's arrival; "
        "of a mission until it is disarmed)",
    )
    verb.add_argument(
        "--step",
        type=positive,
        metavar="S",
        help="step of the integrator [s] (default: 0.0005; of a mission 0.004)",
    )
    verb.add_argument(
        "--integrator",
        choices=("rk4", "euler"),
        help="euler is semi-implicit (default: rk4)",
    )
    verb.add_argument(
        "--backend",
        metavar="auto|jax|warp",
        help="what calculates it; warp:cpu and warp:cuda:0 name a device (default: "
        "auto)",
    )
    verb.add_argument(
        "--estimator",
        choices=("ekf",),
        help="fly by what the vehicle's instruments say, filtered, and tell what each "
        "blast does to the estimate; steps of 0.004 s (default: by the truth)",
    )
    verb.add_argument(
        "--tolerance",
        type=positive,
        metavar="M",
        help="path error within which it has recovered [m] (default: 0.05; of a "
        "mission 0.2)",
    )
    verb.add_argument(
        "--profile",
        metavar="FILE.csv",
        type=path,
        help="impulses of blasts calculated elsewhere, in place of the laws; the "
        "charge tells place and time",
    )
    verb.add_argument(
        "--profile-moments-about",
        type=vector,
        metavar="X,Y,Z",
        help="from the point the profile's moments are about to the vehicle's centre "
        "of mass, body axes [m] (default: they are about that, and refused where their "
        "lever is longer than 3 times from there to the farthest rotor)",
    )
    verb.add_argument(
        "--controllers",
        metavar="NAME,...",
        help="who holds the vehicle, each flown through the same blasts: hold (SE(3), "
        "as the scene has it), with_integral, without_integral, cascade (as PX4's), "
        "observer (SE(3) with a disturbance observer) (default: "
        "with_integral,without_integral)",
    )
    verb.add_argument("--seed", type=seed, default=0, help="of the priors (default: 0)")
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="also write fly.json and flight.csv, path.png, loads.png, error.png, or "
        "of several vehicles flights.csv, distribution.png and with --controllers "
        "controllers.png, or of a mission fly.json, flight.csv, map.png, mission.png "
        "and mission.kml",
    )
    verb.add_argument(
        "--plan-out",
        metavar="FILE",
        type=path,
        help="write the mission's plan back: .plan as QGroundControl's, .waypoints as "
        "QGC WPL 110",
    )
    add_logs(verb)
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what --out holds of these files"
    )


def run(asked: argparse.Namespace) -> int:
    """Fly, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "flying": 8.0, "writing": 1.0})
    begin("starting")
    start_jax(all_cores=asked.vehicles > 1)
    from jblast.report.fit.files import check_directory

    if asked.out:
        check_directory(asked.out, asked.force, "the flight")
    check_logs(asked)
    from jblast.study.missions import MissionFlight
    from jblast.study.scene_flights import fly_scene, has_mission, scene_to_fly

    uncertain = scene_to_fly(asked.scene, seconds=asked.seconds, seed=asked.seed)
    check_plan_out(asked, has_mission=has_mission(uncertain))
    begin("flying")
    flown = fly_scene(
        uncertain,
        vehicles=asked.vehicles,
        controllers=None
        if asked.controllers is None
        else tuple(
            word.strip() for word in asked.controllers.split(",") if word.strip()
        ),
        seconds=asked.seconds,
        step_s=asked.step,
        tolerance_m=asked.tolerance,
        profile=asked.profile,
        profile_moments_about=asked.profile_moments_about,
        seed=asked.seed,
        **given(
            asked, integrator="integrator", backend="backend", estimator="estimator"
        ),
    )
    answer, words, write = (
        _mission(asked, flown)
        if isinstance(flown, MissionFlight)
        else _flights(asked, flown, uncertain.place)
    )
    begin("writing")
    text = answer.to_json()
    written = write(text, Path(asked.out)) if asked.out else []
    sys.stdout.write(text if asked.json else words)
    if written and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    return 0


def _flights(
    asked: argparse.Namespace, flights: "Flights", place: "Place | None"
) -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.autopilot.lockstep import PLACE
    from jblast.report.flight_files import write_flights
    from jblast.report.flights import flights_answer, flights_text
    from jblast.study.missions import hold_record

    if asked.tlog or asked.ulog:
        place = PLACE if place is None else place
        write_logs(asked, hold_record(flights, place), has_mission=False)
    answer = flights_answer(flights, scene=asked.scene, seed=asked.seed)
    return (
        answer,
        flights_text(flights),
        lambda text, directory: write_flights(flights, text, directory),
    )


def _mission(asked: argparse.Namespace, flight: "MissionFlight") -> Answer:
    """Return the document, the text, and the function that writes files."""
    from jblast.missions.plan import plan_text
    from jblast.report.flight_files import write_mission
    from jblast.report.missions import mission_answer, mission_text
    from jblast.study.missions import mission_record

    if asked.tlog or asked.ulog:
        write_logs(asked, mission_record(flight), has_mission=True)
    if asked.plan_out:
        save_text(plan_text(flight.mission.plan, asked.plan_out), asked.plan_out)
    answer = mission_answer(flight, scene=asked.scene, seed=asked.seed)
    return (
        answer,
        mission_text(flight),
        lambda text, directory: write_mission(flight, text, directory),
    )


def check_plan_out(asked: argparse.Namespace, *, has_mission: bool) -> None:
    """Refuse to write a plan where there is none, or a file that may not be written.

    Raises:
        InputError: As said.
    """
    if not asked.plan_out:
        return
    if not has_mission:
        raise InputError(
            "--plan-out: expected a scene whose [vehicle] has a mission, got one that "
            "holds its place"
        )
    from jblast.missions.plan import check_form

    refuse_existing(asked.plan_out, force=asked.force)
    check_form(asked.plan_out)


def add_logs(verb: argparse.ArgumentParser) -> None:
    """Add the options."""
    verb.add_argument(
        "--tlog",
        metavar="FILE",
        type=path,
        help="also write the flight's telemetry, as a ground station keeps it",
    )
    verb.add_argument(
        "--ulog",
        metavar="FILE",
        type=path,
        help="also write the flight as a log of PX4",
    )


def check_logs(asked: argparse.Namespace) -> None:
    """Refuse logs that cannot be.

    Raises:
        InputError: Several vehicles are flown, or a file is there already.
    """
    for option, file in (("--tlog", asked.tlog), ("--ulog", asked.ulog)):
        if file and asked.vehicles != 1:
            raise InputError(
                f"{option}: expected one vehicle, whose log it is, got {asked.vehicles}"
            )
        if file:
            refuse_existing(file, force=asked.force)


def write_logs(
    asked: argparse.Namespace, record: "FlightRecord", *, has_mission: bool
) -> None:
    """Write the logs that are asked for."""
    from jblast.autopilot.ground_station import telemetry_log
    from jblast.autopilot.logs import flight_ulog
    from jblast.files import write_bytes

    if asked.tlog:
        write_bytes(asked.tlog, telemetry_log(record, has_mission=has_mission))
    if asked.ulog:
        write_bytes(asked.ulog, flight_ulog(record))
