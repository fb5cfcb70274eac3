"""Simulate random blasts, and record them with all sensors of a scene.

The scene's [world] gives number, times, positions and masses of the blasts. The vehicle
flies through them, sensors record them, microphones and gauges write samples, and the
camera films them; mounted sensors move with the vehicle. Times are on the clock of the
scene, which begins at 0; only the file and the readings of a sensor are on its own
clock. Output: blasts.csv (the truth), perceived.csv, observations.csv (for `jblast
fit`), flight.csv, sound/, camera/ and run.json.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import (
    add_force,
    add_json,
    add_live,
    check_live,
    path,
    show_live,
)
from jblast.cli.arguments.verb_parser import VerbParser


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with a [world]; parameters with a prior are sampled",
    )
    verb.model.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="duration of the world [s] (default: until 5 s after the arrival of the "
        "last wave, without a vehicle 0.5 s)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of all random numbers (default: 0)"
    )
    verb.advanced.add_argument(
        "--preset",
        choices=("thesis-as-printed", "thesis-as-coded"),
        help="blast model of Parab's thesis as printed, or as its plugins compute it, "
        "for comparison; a scene that contradicts it is rejected (default: jblast's "
        "laws)",
    )
    verb.outputs.add_argument(
        "--out", metavar="RUN", required=True, type=path, help="folder for the run"
    )
    add_live(verb)
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Draw, fly, record, film, write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "flying": 6.0, "listening": 4.0, "filming": 9.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.world import world_answer, world_text
    from jblast.report.world_files import run_world

    # A run may take minutes: without a display it would be in vain.
    check_live(options)
    came = run_world(
        options.scene,
        options.out,
        seconds=options.seconds,
        seed=options.seed,
        preset=options.preset,
        force=options.force,
        # run.json has the command, so that the run can be repeated.
        command=options.words,
        begin=begin,
    )
    if options.json:
        sys.stdout.write(world_answer(came).to_json())
    else:
        sys.stdout.write(world_text(came))
        sys.stdout.write(f"\nWritten: {options.out}\n")
    del begin  # the work is done: no progress beside the window
    show_live(options, Path(options.out))
    return 0
