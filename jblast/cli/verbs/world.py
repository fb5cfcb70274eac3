"""Draw a world of random blasts, and write down what every sense perceives of it.

The scene's [world] says how many blasts there are, when, where and how big. The vehicle
flies through them, sensors record them, microphones and gauges write samples, the
camera films them; who is mounted on the vehicle rides along. All times are on the one
clock of the scene, which begins at 0; each sensor's own file and its readings are by
that sensor's clock. What is written: blasts.csv (the truth), perceived.csv,
observations.csv (for `jblast fit`), flight.csv, sound/, camera/ and run.json.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import add_live, check_live, path, show_live


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there, with [world]; numbers with a prior are drawn",
    )
    verb.add_argument(
        "--out", metavar="RUN", required=True, type=path, help="directory to write to"
    )
    verb.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="how long it lasts [s] (default: until 5 s after the last wave has come, "
        "with no vehicle half a second)",
    )
    verb.add_argument(
        "--seed", type=seed, default=0, help="of all that is drawn (default: 0)"
    )
    add_live(verb)
    verb.add_argument(
        "--preset",
        choices=("thesis-as-printed", "thesis-as-coded"),
        help="blasts act as Parab's thesis prints it, or as its plugins compute it, "
        "not as blasts do; a scene that says otherwise is refused",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what --out holds of these files"
    )


def run(asked: argparse.Namespace) -> int:
    """Draw, fly, record, film, write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "flying": 6.0, "listening": 4.0, "filming": 9.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.world import world_answer, world_text
    from jblast.report.world_files import run_world

    check_live(asked)
    came = run_world(
        asked.scene,
        asked.out,
        seconds=asked.seconds,
        seed=asked.seed,
        preset=asked.preset,
        force=asked.force,
        command=asked.words,
        begin=begin,
    )
    if asked.json:
        sys.stdout.write(world_answer(came).to_json())
    else:
        sys.stdout.write(world_text(came))
        sys.stdout.write(f"\nWritten: {asked.out}\n")
    del begin  # nothing is being waited for any more
    show_live(asked, Path(asked.out))
    return 0
