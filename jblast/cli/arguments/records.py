"""Records of samples that a command names, and what is said of their recorders."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive
from jblast.cli.arguments.paths import path

if TYPE_CHECKING:
    from jblast.errors import InputError
    from jblast.inference.records import Gathered, PickLog
    from jblast.observations.records.folders import RecordFiles


def add_records(verb: argparse.ArgumentParser) -> None:
    """Let a verb take the options that `picked` heeds."""
    verb.add_argument(
        "--positions",
        metavar="STATIONS.csv",
        type=path,
        help="where the sensors stood: sensor (stem of a file's name, or stem.channel, "
        "from 1), east_m, north_m, up_m or lat_deg, lon_deg, alt_m, perhaps clock",
    )
    verb.add_argument(
        "--full-scale",
        metavar="PA",
        type=positive,
        help="pascals that a sample of 1 in WAV or FLAC stands for; without it such "
        "records tell times alone",
    )
    verb.add_argument(
        "--sensitivity",
        metavar="PA",
        type=positive,
        help="pascals a volt of records in volts, or a count of miniSEED and SAC",
    )
    verb.add_argument(
        "--high-pass",
        metavar="HZ",
        type=positive,
        help="corner of the recorders' first-order high-pass: what it does to duration "
        "and impulse is undone",
    )


def picked(
    named: list[str], asked: argparse.Namespace, *, keep_samples: bool
) -> "tuple[Gathered, PickLog, RecordFiles]":
    """Read and pick the records that are named, and make the rows of a log.

    Args:
        named: Files and folders.
        asked: What `add_records` added.
        keep_samples: Whether picks keep their samples, to be drawn.

    Raises:
        InputError: Nothing can be read, or a record has no station.
    """
    from jblast.inference.records import gathered, log_of
    from jblast.observations.records.folders import record_files
    from jblast.observations.records.formats import Scaling
    from jblast.observations.records.stations import read_stations

    stations = read_stations(asked.positions) if asked.positions else None
    found_files = record_files(named, asked.positions)
    found = gathered(
        found_files.files,
        Scaling(asked.full_scale, asked.sensitivity),
        high_pass_hz=asked.high_pass,
        keep_samples=keep_samples,
    )
    if found.refused and not found.channels:
        raise refusal(found)
    log = log_of(found, stations, _provenance(found_files.files, asked))
    return found, log, found_files


def refusal(found: "Gathered") -> "InputError":
    """Return the one error that says which files were refused, and why."""
    from jblast.errors import InputError

    messages = [str(error) for error in found.refused]
    if len(messages) == 1:
        return found.refused[0]
    files = f"{len(messages)} files cannot be read"
    return InputError(f"{files}: {'; '.join(messages)}")


def _provenance(files: tuple[Path, ...], asked: argparse.Namespace) -> list[str]:
    """Return the comment lines of the log."""
    names = ", ".join(file.name for file in files[:20])
    more = f" and {len(files) - 20} more" if len(files) > 20 else ""
    lines = [f"jblast pick of {names}{more}"]
    for option, value, unit in (
        ("--full-scale", asked.full_scale, "Pa"),
        ("--sensitivity", asked.sensitivity, "Pa a volt or count"),
        ("--high-pass", asked.high_pass, "Hz"),
    ):
        if value is not None:
            lines.append(f"{option} {value:g} {unit}")
    return lines
