"""Write a commented starter scene for a log."""

import argparse
import sys

from jblast.cli.arguments.options import add_reading, path, reading_asked, reading_words
from jblast.files import refuse_existing, save_text


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "observations",
        metavar="OBSERVATIONS.csv",
        type=path,
        help="the log; its sensors and what they tell decide what is left free",
    )
    verb.add_argument(
        "--out",
        metavar="SCENE.toml",
        type=path,
        help="file to write (else printed)",
    )
    add_reading(verb)
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Write the scene and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.observations import read, starter_scene

    if asked.out:
        refuse_existing(asked.out, force=asked.force)
    text = starter_scene(read(asked.observations, **reading_asked(asked)))
    if asked.out:
        save_text(text, asked.out)
        fit = f"jblast fit {asked.observations} --scene {asked.out}"
        again = reading_words(asked)
        sys.stdout.write(f"wrote {asked.out}; edit it, then: {fit}{again}\n")
    else:
        sys.stdout.write(text)
    return 0
