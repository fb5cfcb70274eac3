"""Fly a scene's vehicle through its blasts, holding its place or on a mission.

The flight begins at 0 on the scene's clock, over level ground at height 0, in the
scene's wind; a blast comes at its charge's time_s and the way to the vehicle. Position
hold with integral action and without it are flown side by side, or the --controllers
that are named. A crash is an answer: the exit code is 0.

Where the scene's [vehicle] names a mission, a plan of QGroundControl, that is flown:
from the ground, unattended, until the vehicle has landed and is disarmed.
"""

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.cli.arguments.numbers import positive, seed, vector
from jblast.cli.arguments.options import path, refuse_existing, save_text
from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.autopilot.logs import FlightRecord
    from jblast.scene import UncertainScene
    from jblast.study.flight_results import Options

Answer = tuple[dict[str, Any], str, Callable[[str, Path], list[str]]]


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
        default="rk4",
        help="euler is semi-implicit (default: rk4)",
    )
    verb.add_argument(
        "--backend",
        metavar="auto|jax|warp",
        default="auto",
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
    uncertain = flown_scene(asked)
    vehicle = uncertain.scene.vehicle
    has_mission = vehicle is not None and vehicle.mission is not None
    begin("flying")
    flown = _mission if has_mission else _flights
    document, words, write = flown(asked, uncertain)
    begin("writing")
    import json

    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    written = write(text, Path(asked.out)) if asked.out else []
    sys.stdout.write(text if asked.json else words)
    if written and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    return 0


def _flights(asked: argparse.Namespace, uncertain: "UncertainScene") -> Answer:
    """Fly holding a place; return the document, the text, and who writes files."""
    from jblast.autopilot.lockstep import PLACE
    from jblast.cli.arguments.flight_files import write_flights
    from jblast.report.flights import flights_answer, flights_text
    from jblast.study.flight_results import TOLERANCE_M
    from jblast.study.flights import fly
    from jblast.study.missions import MISSION_STEP_S, hold_record
    from jblast.vehicle import STEP_S

    refuse_plan_out(asked)
    step = MISSION_STEP_S if asked.estimator else STEP_S
    flights = fly(
        uncertain,
        flight_options(asked, step_s=step, tolerance_m=TOLERANCE_M),
        vehicles=asked.vehicles,
        seed=asked.seed,
        controllers=named_in(asked.controllers),
    )
    if asked.tlog or asked.ulog:
        place = PLACE if uncertain.place is None else uncertain.place
        write_logs(asked, hold_record(flights, place), has_mission=False)
    answer = flights_answer(flights, scene=asked.scene, seed=asked.seed)
    return (
        {"schema": 1} | answer.to_dict(),
        flights_text(flights),
        lambda text, directory: write_flights(flights, text, directory),
    )


def _mission(asked: argparse.Namespace, uncertain: "UncertainScene") -> Answer:
    """Fly a mission; return the document, the text, and who writes files."""
    from jblast.cli.arguments.flight_files import write_mission
    from jblast.missions.plan import check_form, plan_text
    from jblast.report.missions import mission_answer, mission_text
    from jblast.study.missions import (
        MISSION_STEP_S,
        TOLERANCE_M,
        fly_mission,
        mission_record,
    )

    refuse_several(asked)
    if asked.plan_out:
        refuse_existing(asked.plan_out, force=asked.force)
        check_form(asked.plan_out)
    options = flight_options(asked, step_s=MISSION_STEP_S, tolerance_m=TOLERANCE_M)
    flight = fly_mission(uncertain, options, seed=asked.seed)
    if asked.tlog or asked.ulog:
        write_logs(asked, mission_record(flight), has_mission=True)
    if asked.plan_out:
        save_text(plan_text(flight.mission.plan, asked.plan_out), asked.plan_out)
    answer = mission_answer(flight, scene=asked.scene, seed=asked.seed)
    return (
        {"schema": 1} | answer.to_dict(),
        mission_text(flight),
        lambda text, directory: write_mission(flight, text, directory),
    )


def flown_scene(asked: argparse.Namespace) -> "UncertainScene":
    """Return the scene; random blasts are drawn where a mission goes through them.

    Raises:
        InputError: It is none, or a hold is to go through random blasts.
    """
    from jblast.scene import read_scene, read_scene_or_world

    uncertain, world = read_scene_or_world(asked.scene)
    if world is None:
        return uncertain
    vehicle = uncertain.scene.vehicle
    if vehicle is None or vehicle.mission is None:
        return read_scene(asked.scene)  # which says what is there instead
    from jblast.world import draw_world

    until = math.inf if asked.seconds is None else asked.seconds
    drawn = draw_world(uncertain, world, asked.seed, until_s=until)
    return replace(uncertain, scene=drawn.scene, beliefs={})


def flight_options(
    asked: argparse.Namespace, *, step_s: float, tolerance_m: float
) -> "Options":
    """Return how to fly.

    Args:
        asked: The options.
        step_s: Of the integrator, where nothing is said.
        tolerance_m: Of a recovery, likewise.

    Raises:
        InputError: A number cannot be used, or the profile is none.
    """
    from jblast.study.flight_results import Options, Profile
    from jblast.vehicle import read_custom_profile

    if asked.profile_moments_about and not asked.profile:
        raise InputError(
            "--profile-moments-about: expected a --profile whose moments they are, got "
            "none"
        )
    profile = None
    if asked.profile:
        about = asked.profile_moments_about
        profile = Profile(read_custom_profile(asked.profile), about)
    return Options(
        seconds=asked.seconds,
        step_s=step_s if asked.step is None else asked.step,
        integrator=asked.integrator,
        backend=asked.backend,
        tolerance_m=tolerance_m if asked.tolerance is None else asked.tolerance,
        profile=profile,
        estimator=asked.estimator or "",
    )


def named_in(words: str | None) -> tuple[str, ...] | None:
    """Return the controllers that are named, with commas between; None: none are."""
    if words is None:
        return None
    return tuple(word.strip() for word in words.split(",") if word.strip())


def refuse_plan_out(asked: argparse.Namespace) -> None:
    """Refuse to write a plan where there is none.

    Raises:
        InputError: It is asked for.
    """
    if asked.plan_out:
        raise InputError(
            "--plan-out: expected a scene whose [vehicle] has a mission, got one that "
            "holds its place"
        )


def refuse_several(asked: argparse.Namespace) -> None:
    """Refuse several vehicles, or controllers, on one mission.

    Raises:
        InputError: They are asked for.
    """
    if asked.controllers is not None:
        raise InputError(
            "--controllers: expected none on a mission, which is flown by its own, got "
            f"{asked.controllers}"
        )
    if asked.vehicles != 1:
        raise InputError(
            f"--vehicles: expected 1 on a mission, got {asked.vehicles}; several are "
            "flown from Python, by jblast.missions.MissionControl in an Each"
        )


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
