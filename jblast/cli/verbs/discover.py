"""Identify the equations of motion of a trajectory, with the uncertainty of each term.

Exit code 4: no law is found; the residual is larger than the noise, or cannot be
judged; the integrated equations do not reproduce the data; or nearly collinear terms
are exchangeable. Except in the last case, products of one more column are tried then.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import seed, share
from jblast.cli.arguments.options import (
    DOUBTFUL,
    add_force,
    add_json,
    given,
    names_between_commas,
    path,
    save_figure,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import check_out, save_text

FILES = ("discovery.json", "discovery.png")


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "trajectory",
        metavar="TRAJECTORY.csv",
        type=path,
        help="text with a header: time_s and numeric columns, one row a time; a "
        "column run numbers several runs",
    )
    verb.inputs.add_argument(
        "--state",
        metavar="COLUMN,...",
        default="",
        help="columns to find equations for (default: all but time_s and the inputs)",
    )
    verb.inputs.add_argument(
        "--input",
        metavar="COLUMN,...",
        default="",
        help="driving columns, such as a wind or a command, without errors (default: "
        "none)",
    )
    verb.inputs.add_argument(
        "--held",
        action="store_true",
        help="inputs that are constant until the next row, as commands are (default: "
        "linear between rows)",
    )
    verb.model.add_argument(
        "--degree",
        type=int,
        metavar="N",
        help="largest number of columns in a product (default: 2)",
    )
    verb.model.add_argument(
        "--drag",
        action="store_true",
        help="additional candidates |x| x for each column x",
    )
    verb.advanced.add_argument(
        "--threshold",
        type=share,
        metavar="SHARE",
        help="smallest contribution of a term, as a share of the derivative's root "
        "mean square (default: 0.05)",
    )
    verb.advanced.add_argument(
        "--ensemble",
        type=int,
        metavar="N",
        help="number of records with new noise, for the uncertainty of the terms, at "
        "least 19 (default: 100)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of the noise (default: 0)"
    )
    verb.outputs.add_argument(
        "--out", metavar="DIR", type=path, help=f"folder for {' and '.join(FILES)}"
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Find, write, print; return the exit code."""
    from jblast.discovery.law_search import check_search, discover_law

    # checked before the output folder is made
    check_search(**given(options, degree="degree", ensemble="members"))
    if options.out:
        check_out(Path(options.out), FILES, force=options.force)
    search = discover_law(
        options.trajectory,
        states=names_between_commas(options.state),
        inputs=names_between_commas(options.input),
        held=options.held,
        drag=options.drag,
        seed=options.seed,
        **given(options, degree="degree", threshold="threshold", ensemble="members"),
    )
    # Imported after the search, so that a wrong file is reported without this wait.
    from jblast.report.discovery import discovery_answer, discovery_text

    data, found, again, further = search[:4]
    answer = discovery_answer(
        found,
        again,
        further,
        rows=len(data.time_s),
        inputs=tuple(data.names[len(found.states) :]),
        threshold=search.threshold,
        members=search.members,
        seed=search.seed,
    )
    text = answer.to_json()
    if options.out:
        from jblast.report.discovery_figures import discovery_figure

        figure = discovery_figure(found, again, data.time_s, data.states)
        save_text(text, Path(options.out) / FILES[0])
        save_figure(figure, Path(options.out) / FILES[1])
    sys.stdout.write(text if options.json else discovery_text(found, again, further))
    if options.out and not options.json:
        sys.stdout.write(f"\nWritten to {options.out}: {', '.join(FILES)}\n")
    return 0 if search.certain else DOUBTFUL
