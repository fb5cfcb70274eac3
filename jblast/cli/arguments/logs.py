"""Pressure records named on a command line.

JAX is imported inside functions only, so that `--help` does not load it.
"""

import argparse
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.options import in_options, option_for

if TYPE_CHECKING:
    from jblast.observations.records.formats import Scaling
    from jblast.signals.picks import PickedFiles


def scaling_of(options: argparse.Namespace) -> "Scaling":
    """Return the recorders' scale from the options of the group `scale`."""
    from jblast.observations.records.formats import Scaling

    return Scaling(options.full_scale, options.sensitivity)


def picked(
    named: list[str],
    options: argparse.Namespace,
    *,
    keep_samples: bool,
    done: "Callable[[PickedFiles], object] | None" = None,
) -> "PickedFiles":
    """Return the picks of records, with options instead of arguments in messages.

    Args:
        named: Files and folders.
        options: Options of the group `records`.
        keep_samples: Whether picks store their samples, for figures.
        done: As for `pick_files`.

    Raises:
        InputError: Nothing can be read, or a record has no station.
    """
    from jblast.signals.picks import pick_files

    of = pick_files(
        named,
        positions=options.positions,
        scaling=scaling_of(options),
        high_pass_hz=options.high_pass,
        keep_samples=keep_samples,
        trigger=options.trigger,
        done=done,
    )
    # A log written by a command names options in its comments, not arguments of Python.
    comments = tuple(of.comments(option_for))
    rows = replace(of.log.observations, comments=comments)
    refused = tuple(map(in_options, of.found.refused))
    return of._replace(
        found=of.found._replace(refused=refused),
        log=of.log._replace(observations=rows),
    )


def fit_command(file: str | Path, scene: str | None = None) -> str:
    """Return the command that fits a log in a scene, or without one."""
    words = ["jblast", "fit", str(file), *(["--scene", scene] if scene else [])]
    return shlex.join(words)
