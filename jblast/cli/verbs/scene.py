"""Write a commented scene file for a log."""

import argparse
import sys

from jblast.cli.arguments.options import (
    add_force,
    add_reading,
    path,
    reading_options,
    reading_words,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import refuse_existing, save_text


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "observations",
        metavar="OBSERVATIONS.csv",
        type=path,
        help="log, whose sensors and quantities determine the free parameters",
    )
    add_reading(verb)
    verb.outputs.add_argument(
        "--out",
        metavar="SCENE.toml",
        type=path,
        help="scene file (default: standard output)",
    )
    add_force(verb, "an existing --out")


def run(options: argparse.Namespace) -> int:
    """Write the scene and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.observations import read, starter_scene

    if options.out:
        refuse_existing(options.out, force=options.force)
    text = starter_scene(read(options.observations, **reading_options(options)))
    if options.out:
        save_text(text, options.out)
        fit = f"jblast fit {options.observations} --scene {options.out}"
        # Options of reading are repeated, as the log itself is not changed.
        again = reading_words(options)
        sys.stdout.write(f"wrote {options.out}; edit it, then: {fit}{again}\n")
    else:
        sys.stdout.write(text)
    return 0
