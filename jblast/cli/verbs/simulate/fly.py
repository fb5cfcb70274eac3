"""Fly a scene's vehicle through its blasts, holding its place.

The flight begins at 0 on the scene's clock, over level ground at height 0, in the
scene's wind; a blast comes at its charge's time_s and the way to the vehicle. Position
hold with integral action and without it are flown side by side. A crash is an answer:
the exit code is 0.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import positive, seed, vector
from jblast.cli.arguments.paths import path


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there, with a [vehicle]: its model, position_m, and if wanted "
        "velocity_m_s and control; numbers with a prior are drawn",
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
        help="how long to fly [s] (default: until 5 s after the last blast's arrival)",
    )
    verb.add_argument(
        "--step",
        type=positive,
        metavar="S",
        help="step of the integrator [s] (default: 0.0005)",
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
        "--tolerance",
        type=positive,
        metavar="M",
        help="path error within which it has recovered [m] (default: 0.05)",
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
    verb.add_argument("--seed", type=seed, default=0, help="of the priors (default: 0)")
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="also write fly.json and flight.csv, path.png, loads.png, error.png, or "
        "of several vehicles flights.csv, distribution.png",
    )
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
    import json

    from jblast.cli.arguments.flight_files import write_flights
    from jblast.report.fit.files import check_directory
    from jblast.report.flights.document import flights_answer
    from jblast.report.flights.text import flights_text
    from jblast.scene import read_scene
    from jblast.study.flights.fly import fly

    if asked.out:
        check_directory(asked.out, asked.force)
    options = _options(asked)
    begin("flying")
    flights = fly(
        read_scene(asked.scene), options, vehicles=asked.vehicles, seed=asked.seed
    )
    begin("writing")
    answer = flights_answer(flights, scene=asked.scene, seed=asked.seed)
    document = {"schema": 1} | answer.to_dict()
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    written = write_flights(flights, text, Path(asked.out)) if asked.out else []
    sys.stdout.write(text if asked.json else flights_text(flights))
    if written and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    return 0


def _options(asked: argparse.Namespace):
    """Return how to fly.

    Raises:
        InputError: A number cannot be used, or the profile is none.
    """
    from jblast.errors import InputError
    from jblast.study.flights.encounter import Profile
    from jblast.study.flights.records import TOLERANCE_M, Options
    from jblast.vehicle import STEP_S, read_custom_profile

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
        step_s=STEP_S if asked.step is None else asked.step,
        integrator=asked.integrator,
        backend=asked.backend,
        tolerance_m=TOLERANCE_M if asked.tolerance is None else asked.tolerance,
        profile=profile,
    )
