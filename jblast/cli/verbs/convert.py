"""Convert a log to the columns and units of jblast, with the changes in comments."""

import argparse
import sys

from jblast.cli.arguments.options import add_force, add_reading, path, reading_options
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import refuse_existing, writing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "observations",
        metavar="LOG",
        type=path,
        help="log: text with commas, semicolons or tabs, .xlsx, .ods or .parquet",
    )
    add_reading(verb)
    verb.outputs.add_argument(
        "--out",
        metavar="LOG.csv",
        type=path,
        help="converted log (default: standard output)",
    )
    add_force(verb, "an existing --out")


def run(options: argparse.Namespace) -> int:
    """Write the log and return the exit code."""
    from jblast.observations.log_io import log_text, read, write
    from jblast.report.messages import conversion_comments, sentences_of

    if options.out:
        refuse_existing(options.out, force=options.force)
    # Without `start_jax`, as a conversion compiles nothing.
    log = read(options.observations, **reading_options(options))
    comments = conversion_comments(log)
    # Without --out stdout has the log alone, so that it can be piped into a file.
    if not options.out:
        sys.stdout.write(log_text(log, comments))
        return 0
    with writing(options.out):
        write(options.out, log, comments=comments)
    rows = "1 measurement" if len(log) == 1 else f"{len(log):,} measurements"
    done = sentences_of(log.understood) or ["no conversion was necessary"]
    sys.stdout.write("\n".join((f"wrote {options.out}: {rows}", *done)) + "\n")
    return 0
