"""Options as arguments of the library, and arguments of the library as options.

Functions of the library name their arguments in messages; `option_for` translates them.
JAX is imported inside functions only, so that `--help` does not load it.
"""

import argparse
import shlex
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.errors import InputError, argument
from jblast.files import refuse_existing

if TYPE_CHECKING:
    from jblast.observations.records.formats import Scaling
    from jblast.signals.picks import PickedFiles

FIGURES = (".png", ".svg", ".pdf")
"""Suffixes of figures."""
OTHERWISE = {
    "freed": "--free",
    "recorded": "RECORDED",
    "laws": "--law",
    "full_scale_pa": "--full-scale",
    "high_pass_hz": "--high-pass",
    "states": "--state",
    "inputs": "--input",
    "members": "--ensemble",
    "mass_kg": "--charge",
    "range_m": "--range",
    "rate_hz": "sampling rate",
    "address": "--listen",
    "packets_hz": "--rate",
    "lead_s": "--lead",
    "patience_s": "--patience",
    "ends_s": "--seconds",
    "recording": "RECORDING.wav",
    "false_alarms_per_hour": "--false-alarms",
    "moment_point_m": "moment_point_m (--profile-moments-about X,Y,Z)",
}
"""Options of Python arguments with another name."""


def refuse_unused(options: argparse.Namespace, names: Iterable[str], why: str) -> None:
    """Refuse options that an answer does not use.

    Args:
        options: Options; None or an empty list for one that is not given.
        names: Names of the unused options.
        why: What is expected instead.

    Raises:
        InputError: One of them is given.
    """
    for name in names:
        if (value := getattr(options, name)) is not None and value != []:
            raise InputError(f"{argument(name)}: expected {why}, got {value!r}")


def option_for(argument: str) -> str:
    """Return the option of a Python argument that a message names."""
    return OTHERWISE.get(argument, f"--{argument.replace('_', '-')}")


def in_options(error: InputError) -> InputError:
    """Return an error whose message names options instead of Python arguments."""
    return InputError(error.worded(option_for), row=error.row, line=error.line)


def given(options: argparse.Namespace, **arguments: str) -> dict[str, Any]:
    """Return the library arguments of the options that are given.

    Args:
        options: Options; None means that the library's default applies.
        arguments: Name of the library's argument, by option.
    """
    values = {name: getattr(options, option) for option, name in arguments.items()}
    return {name: value for name, value in values.items() if value is not None}


def check_figure(option: str, file: str, *, force: bool) -> None:
    """Check before the work that a figure can be written.

    Raises:
        InputError: The suffix is none of `FIGURES`, or the file exists.
    """
    if Path(file).suffix.lower() not in FIGURES:
        raise InputError(f"{option} {file}: expected a name in {', '.join(FIGURES)}")
    refuse_existing(file, force=force)


def reading_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of the group `reading` as arguments of `jblast.read`."""
    return {name: getattr(options, name) for name in ("date", "wide", "zone")}


def reading_words(options: argparse.Namespace) -> str:
    """Return the options of the group `reading` as text for another command line."""
    # The next command must read the log in the same way, or it finds other columns.
    flags = [" --wide"] if options.wide else []
    values = {name: getattr(options, name) for name in ("date", "zone")}
    return "".join([*flags, *(f" --{name} {v}" for name, v in values.items() if v)])


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
