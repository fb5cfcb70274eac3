"""Write an HTML page for a run of `jblast world`.

The page is one self-contained file: the blasts, a table of the readings of each blast,
all recordings on one time axis, a map, and the recovery of the vehicle. With --fit the
readings of each blast are fitted separately, with [world] as the prior, and the answers
are printed next to the truth.
"""

import argparse
import sys

from jblast.cli.arguments.options import add_force, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import refuse_existing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "folder", metavar="RUN", type=path, help="folder written by `jblast world`"
    )
    verb.inputs.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file of the run (default: the path in run.json)",
    )
    verb.model.add_argument(
        "--fit",
        action="store_true",
        help="fit of each blast's readings: answers next to the truth, and 90 %% "
        "ellipses on the map; fits.json in RUN has the whole answers",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="PAGE.html",
        type=path,
        help="page (default: report.html in RUN, overwritten)",
    )
    add_force(verb, "an existing --out")


def run(options: argparse.Namespace) -> int:
    """Read, perhaps fit, draw, write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    shares = {"starting": 3.0} | ({"fitting": 9.0} if options.fit else {})
    begin = stages(shares | {"drawing": 3.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.world_page import answers_text, write_page

    if options.out:
        refuse_existing(options.out, force=options.force)
    out, answers = write_page(
        options.folder, options.scene, fit=options.fit, out=options.out, begin=begin
    )
    sys.stdout.write(f"{answers_text(answers)}Written: {out}\n")
    # a note is a fit that failed or is not reliable
    return 4 if any(answer.note for answer in answers) else 0
