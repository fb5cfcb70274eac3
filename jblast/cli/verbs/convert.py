"""Write a log in our own columns and units, and what was done to it in comments."""

import argparse
import sys

from jblast.cli.arguments.options import add_reading, path, reading_asked
from jblast.files import refuse_existing, writing


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "observations",
        metavar="LOG",
        type=path,
        help="the log: text with commas, semicolons or tabs, .xlsx, .ods or .parquet",
    )
    verb.add_argument(
        "--out", metavar="LOG.csv", type=path, help="file to write (else printed)"
    )
    add_reading(verb)
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Write the log and return the exit code."""
    from jblast.observations.log_io import log_text, read, write
    from jblast.report.understood import conversion_comments, conversion_text

    if asked.out:
        refuse_existing(asked.out, force=asked.force)
    log = read(asked.observations, **reading_asked(asked))
    comments = conversion_comments(log)
    if not asked.out:
        sys.stdout.write(log_text(log, comments))
        return 0
    with writing(asked.out):
        write(asked.out, log, comments=comments)
    sys.stdout.write(conversion_text(log, asked.out))
    return 0
