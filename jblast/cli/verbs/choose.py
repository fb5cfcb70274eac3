"""Choose the cheapest method that is accurate enough for a scene, with the reason.

Exit code 4: no method is accurate enough.
"""

import argparse
import sys

from jblast.cli.arguments.options import DOUBTFUL, add_json, path
from jblast.cli.arguments.verb_parser import VerbParser


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with charge, air and sensors; a parameter with a prior counts "
        "over its 90 %% interval",
    )
    verb.inputs.add_argument(
        "--quantity",
        required=True,
        metavar="QUANTITY",
        help="quantity that the sensors measure, such as air_arrival_s",
    )
    verb.model.add_argument(
        "--tolerance",
        type=float,
        metavar="SHARE",
        help="largest accepted relative error, such as 0.01 (default: a third of the "
        "smallest sigma of the sensors)",
    )
    add_json(verb)


def run(options: argparse.Namespace) -> int:
    """Choose, print and return the exit code: 4 if no method is accurate enough."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "choosing": 1.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.fidelity import choose
    from jblast.report.choice import choice_answer, choice_text
    from jblast.scene import read_scene

    begin("choosing")
    # Errors and costs are read from measured tables, so that no method is timed here.
    choice = choose(read_scene(options.scene), options.quantity, options.tolerance)
    if options.json:
        sys.stdout.write(choice_answer(choice).to_json())
    else:
        sys.stdout.write(choice_text(choice))
    return 0 if choice.met else DOUBTFUL
