"""Convert a log to the columns and units of jblast, with the changes in comments.

example:
  jblast convert theirs.xlsx --out log.csv

input:
  LOG              path; log: text with commas, semicolons or tabs, .xlsx, .ods or
                   .parquet
  ...reading
output:
  --out LOG.csv    path; converted log (default: standard output)
  --force          permission to overwrite an existing --out
"""

import argparse
import sys

from jblast.cli.options import reading_options
from jblast.files import refuse_existing, writing


def run(options: argparse.Namespace) -> int:
    """Write the log and return the exit code."""
    from jblast.observations.log_io import log_text, read, write
    from jblast.report.messages import conversion_comments, sentences_of

    if options.out:
        refuse_existing(options.out, force=options.force)
    # Without `start_jax`, as a conversion compiles nothing.
    log = read(options.log, **reading_options(options))
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
