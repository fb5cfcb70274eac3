"""Write a commented scene file for a log.

example:
  jblast scene log.csv --out scene.toml

input:
  OBSERVATIONS.csv  path; log, whose sensors and quantities determine the free
                    parameters
  ...reading
output:
  --out SCENE.toml  path; scene file (default: standard output)
  --force           permission to overwrite an existing --out
"""

import argparse
import sys

from jblast.cli.options import reading_options, reading_words
from jblast.files import refuse_existing, save


def run(options: argparse.Namespace) -> int:
    """Write the scene and return the exit code."""
    if options.out:
        refuse_existing(options.out, force=options.force)
    from jblast.observations import read, starter_scene

    text = starter_scene(read(options.observations, **reading_options(options)))
    if options.out:
        save(options.out, text)
        fit = f"jblast fit {options.observations} --scene {options.out}"
        # Options of reading are repeated, as the log itself is not changed.
        again = reading_words(options)
        sys.stdout.write(f"wrote {options.out}; edit it, then: {fit}{again}\n")
    else:
        sys.stdout.write(text)
    return 0
