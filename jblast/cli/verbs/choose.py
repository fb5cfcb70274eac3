"""Name the cheapest method that is good enough for a scene, and say why."""

import argparse
import sys

from jblast.cli.arguments.options import DOUBTFUL, path


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="charge, air and sensors; a number with a prior counts over its 90 %% "
        "interval",
    )
    verb.add_argument(
        "--quantity",
        required=True,
        metavar="QUANTITY",
        help="what the sensors are to measure, as air_arrival_s",
    )
    verb.add_argument(
        "--tolerance",
        type=float,
        metavar="SHARE",
        help="largest relative error allowed, as 0.01 (default: a third of the "
        "smallest sigma that the sensors state)",
    )
    verb.add_argument("--json", action="store_true", help="print the answer as JSON")


def run(asked: argparse.Namespace) -> int:
    """Choose, print, and return the exit code: 4 where no method will do."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "choosing": 1.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.fidelity import choose
    from jblast.report.choice import choice_answer, choice_text
    from jblast.scene import read_scene

    begin("choosing")
    choice = choose(read_scene(asked.scene), asked.quantity, asked.tolerance)
    if asked.json:
        sys.stdout.write(choice_answer(choice).to_json())
    else:
        sys.stdout.write(choice_text(choice))
    return 0 if choice.met else DOUBTFUL
