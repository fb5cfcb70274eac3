"""Fly a scene's vehicle through its blasts, hovering or on a mission.

The flight begins at time 0 of the scene, over level ground at height 0, in the scene's
wind. A blast arrives at its charge's time_s plus the travel time to the vehicle. By
default two position controllers fly side by side, with and without integral action;
--controllers selects others. A crash is a result: the exit code is 0.

If the scene's [vehicle] has a mission, a plan of QGroundControl, the vehicle flies it
from the ground until it has landed and is disarmed.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive, seed, vector
from jblast.cli.arguments.options import (
    add_force,
    add_json,
    given,
    names_between_commas,
    path,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import refuse_existing, save_text

if TYPE_CHECKING:
    from jblast.results import Document
    from jblast.study.flight_results import Flights
    from jblast.study.missions import MissionFlight

Answer = tuple["Document", str, Callable[[str, Path], list[str]]]


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with a [vehicle]: model, position_m, and optionally "
        "velocity_m_s, control or mission; parameters with a prior are sampled",
    )
    verb.inputs.add_argument(
        "--profile",
        metavar="FILE.csv",
        type=path,
        help="impulses of blasts from another program, in place of the laws; the "
        "charge gives their position and time",
    )
    verb.model.add_argument(
        "--vehicles",
        metavar="N",
        type=int,
        default=1,
        help="number of scenes sampled from the priors (default: 1)",
    )
    verb.model.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="duration of the flight [s] (default: until 5 s after the last blast's "
        "arrival; of a mission until it is disarmed); required without a blast and "
        "mission",
    )
    verb.model.add_argument(
        "--controllers",
        metavar="NAME,...",
        help="controllers that fly through the same blasts: hold (SE(3), as in the "
        "scene), with_integral, without_integral, cascade (as in PX4) "
        "(default: with_integral,without_integral)",
    )
    verb.model.add_argument(
        "--estimator",
        choices=("ekf",),
        help="state estimator, fed by simulated instruments, with the effect of each "
        "blast on the estimate; steps of 0.004 s (default: true state)",
    )
    verb.advanced.add_argument(
        "--step",
        type=positive,
        metavar="S",
        help="time step of the integrator [s] (default: 0.0005; of a mission 0.004)",
    )
    verb.advanced.add_argument(
        "--backend",
        metavar="auto|jax|warp",
        help="backend; warp:cpu and warp:cuda:0 name a device (default: auto)",
    )
    verb.advanced.add_argument(
        "--tolerance",
        type=positive,
        metavar="M",
        help="path error at which the vehicle counts as recovered [m] (default: 0.05; "
        "of a mission 0.2)",
    )
    verb.advanced.add_argument(
        "--profile-moments-about",
        type=vector,
        metavar="X,Y,Z",
        help="vector from the reference point of the profile's moments to the "
        "vehicle's centre of mass, body axes [m] (default: 0,0,0; moments whose lever "
        "arm is longer than 3 times that of the farthest rotor are then rejected)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of the priors (default: 0)"
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="folder for fly.json, flight.csv, loads.png and error.png; for "
        "several vehicles flights.csv, distribution.png and with --controllers "
        "controllers.png; for a mission fly.json, flight.csv, map.png, mission.png and "
        "mission.kml",
    )
    verb.outputs.add_argument(
        "--plan-out",
        metavar="FILE",
        type=path,
        help="copy of the mission's plan, in QGroundControl's format",
    )
    add_json(verb)
    add_force(verb, "existing output files")


def run(options: argparse.Namespace) -> int:
    """Fly, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.missions.plan import check_mission
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "flying": 8.0, "writing": 1.0})
    begin("starting")
    check_mission(options.scene)  # fails here, before JAX starts
    # a single flight is serial: more devices would only cost start time
    start_jax(all_cores=options.vehicles > 1)
    from jblast.report.fit.files import check_directory

    if options.out:
        check_directory(options.out, options.force, "the flight")
    from jblast.study.missions import MissionFlight
    from jblast.study.running import fly_scene, has_mission, scene_to_run

    uncertain = scene_to_run(options.scene, seconds=options.seconds, seed=options.seed)
    # Before the flight, which may take minutes with many vehicles.
    check_plan_out(options, has_mission=has_mission(uncertain))
    begin("flying")
    flown = fly_scene(
        uncertain,
        vehicles=options.vehicles,
        controllers=None
        if options.controllers is None
        else tuple(names_between_commas(options.controllers)),
        seconds=options.seconds,
        step_s=options.step,
        tolerance_m=options.tolerance,
        profile=options.profile,
        profile_moments_about=options.profile_moments_about,
        seed=options.seed,
        **given(options, backend="backend", estimator="estimator"),
    )
    answer, words, write = (
        _mission(options, flown)
        if isinstance(flown, MissionFlight)
        else _flights(options, flown)
    )
    begin("writing")
    text = answer.to_json()
    written = write(text, Path(options.out)) if options.out else []
    sys.stdout.write(text if options.json else words)
    if written and not options.json:
        sys.stdout.write(f"\nWritten to {options.out}: {', '.join(written)}\n")
    return 0


def _flights(options: argparse.Namespace, flights: "Flights") -> Answer:
    """Return document, text and the function that writes files, for flights."""
    from jblast.report.flight_files import write_flights
    from jblast.report.flights import flights_answer, flights_text

    answer = flights_answer(flights, scene=options.scene, seed=options.seed)
    return (
        answer,
        flights_text(flights),
        lambda text, directory: write_flights(flights, text, directory),
    )


def _mission(options: argparse.Namespace, flight: "MissionFlight") -> Answer:
    """Return document, text and the function that writes files, for a mission."""
    from jblast.missions.plan import plan_text
    from jblast.report.flight_files import write_mission
    from jblast.report.missions import mission_answer, mission_text

    if options.plan_out:
        save_text(plan_text(flight.mission.plan, options.plan_out), options.plan_out)
    answer = mission_answer(flight, scene=options.scene, seed=options.seed)
    return (
        answer,
        mission_text(flight),
        lambda text, directory: write_mission(flight, text, directory),
    )


def check_plan_out(options: argparse.Namespace, *, has_mission: bool) -> None:
    """Check before the flight that `--plan-out` can be written.

    Raises:
        InputError: The scene has no mission, or the file exists or has no known format.
    """
    if not options.plan_out:
        return
    # Without a mission there is no plan to copy, and the file would be missing
    # silently.
    if not has_mission:
        raise InputError(
            "--plan-out: expected a scene whose [vehicle] has a mission, got one "
            "without a mission"
        )
    from jblast.missions.plan import check_form

    refuse_existing(options.plan_out, force=options.force)
    check_form(options.plan_out)
