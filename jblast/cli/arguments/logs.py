"""Options for pressure records, and output files of a fit.

With `--positions` the files of a fit are records of samples, which are picked first.
JAX is imported inside functions only, so that `--help` does not load it.
"""

import argparse
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jblast.cli.arguments.numbers import positive
from jblast.cli.arguments.options import in_options, option_for, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import write_text, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jblast.inference.fitting.fit import Fit
    from jblast.observations import Observations
    from jblast.observations.records.formats import Scaling
    from jblast.report.picks import PicksAnswer
    from jblast.report.provenance import Provenance
    from jblast.signals.picks import PickedFiles


def each_made(
    made: "Provenance", logs: Iterable[str], files: Sequence[str]
) -> "dict[str, Provenance]":
    """Return the provenance of the answer of each log, with its own file only.

    Args:
        made: Provenance of all logs together.
        logs: Names of logs, as `fit_input` returns them.
        files: Files of the logs; empty if all files form one set of records.
    """
    from jblast.inference.fitting.fit_input import log_names
    from jblast.report.provenance import provenance_of

    # Picked records form one log, so that every answer depends on all files.
    if not files:
        return dict.fromkeys(logs, made)
    own = {
        name: replace(made, logs=provenance_of([file]).logs)
        for name, file in zip(log_names(files), files, strict=True)
    }
    return {
        log: of
        for log in logs
        for name, of in own.items()
        # `fit_input` names a shot of one of several files FILE: SHOT.
        if log == name or log.startswith(f"{name}: ")
    }


def made_with_samples(
    made: "Provenance", log: "Observations | InputError"
) -> "Provenance":
    """Return a provenance with the files of samples to which a log refers.

    Args:
        made: Provenance without these files.
        log: Log; an error in its place adds no files.
    """
    from jblast.observations.table import SAMPLES
    from jblast.report.provenance import provenance_of

    if isinstance(log, InputError):
        return made
    # A row of samples names its file relative to the folder of the log.
    files = [
        Path(log.source).parent / name
        for quantity, name in zip(log.quantity, log.records(), strict=True)
        if quantity == SAMPLES
    ]
    return replace(made, logs=(*made.logs, *provenance_of(files).logs))


def write_answers(
    answers: "dict[str, Fit | InputError]",
    directory: Path,
    made: "Mapping[str, Provenance]",
    picks: Sequence[Any] | None = None,
) -> None:
    """Write fits.json and answers.csv.

    Args:
        answers: Fit or error, by log.
        directory: Output directory, made if it does not exist.
        made: Provenance, by log.
        picks: Picks of the logs, if they come from records.

    Raises:
        InputError: The directory is not writable.
    """
    from jblast.report.fit.document import fits_answer
    from jblast.report.fit.terminal import answers_csv

    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        # fits.json has the whole answers; answers.csv is a tidy table for spreadsheets.
        text = fits_answer(answers, made, picks).to_json()
        write_text(directory / "fits.json", text)
        write_text(directory / "answers.csv", answers_csv(answers))


def add_records(verb: VerbParser) -> None:
    """Add the options that `picked` reads."""
    verb.inputs.add_argument(
        "--positions",
        metavar="STATIONS.csv",
        type=path,
        help="sensor positions of pressure records: columns sensor (stem of a file's "
        "name, or stem.channel, by name or number; or a channel's name that no other "
        "has), east_m, north_m, up_m or lat_deg, lon_deg, alt_m, and optionally clock "
        "and start_utc (time of the first sample); or KML, GeoJSON or StationXML",
    )
    verb.advanced.add_argument(
        "--trigger",
        action="store_true",
        help="times of all files count from a common trigger, whatever their times of "
        "day (default: times of day where files state them)",
    )
    add_scale(verb)


def add_scale(verb: VerbParser) -> None:
    """Add the options that describe recorders: `scaling_of`, and `--high-pass`."""
    verb.inputs.add_argument(
        "--full-scale",
        metavar="PA",
        type=positive,
        help="pressure of a sample of 1 in WAV or FLAC [Pa] (default: unknown, such "
        "records give times only)",
    )
    verb.inputs.add_argument(
        "--sensitivity",
        metavar="PA",
        type=positive,
        help="pressure per volt of records in volts, or per count of miniSEED and SAC "
        "[Pa]",
    )
    verb.advanced.add_argument(
        "--high-pass",
        metavar="HZ",
        type=positive,
        help="corner frequency of the recorders' first-order high-pass [Hz], whose "
        "effect on duration and impulse is corrected (default: none)",
    )


def scaling_of(options: argparse.Namespace) -> "Scaling":
    """Return the recorders' scale from the options of `add_scale`."""
    from jblast.observations.records.formats import Scaling

    return Scaling(options.full_scale, options.sensitivity)


def picked(
    named: list[str], options: argparse.Namespace, *, keep_samples: bool
) -> "PickedFiles":
    """Return the picks of records, with options instead of arguments in messages.

    Args:
        named: Files and folders.
        options: Options of `add_records`.
        keep_samples: Whether picks store their samples, for figures.

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
    )
    # A log written by a command names options in its comments, not arguments of Python.
    comments = tuple(of.comments(option_for))
    rows = replace(of.log.observations, comments=comments)
    refused = tuple(map(in_options, of.found.refused))
    return of._replace(
        found=of.found._replace(refused=refused),
        log=of.log._replace(observations=rows),
    )


class FromRecords(NamedTuple):
    """Picked records of a fit.

    Attributes:
        picked: Picks and their log.
        text: Picks as printed.
    """

    picked: "PickedFiles"
    text: str

    def figure(self) -> "Figure":
        """Return the figure of the records."""
        from jblast.report.pick_figures import records_figure

        found = self.picked.found
        return records_figure(found.named(), found.picks)

    def answer(self) -> "PicksAnswer":
        """Return the answer of `jblast pick`."""
        from jblast.report.picks import picks_answer

        return picks_answer(self.picked.found, self.picked.log)

    def write(self, directory: Path) -> None:
        """Write log and document into a folder of a report.

        Raises:
            InputError: The folder is not writable.
        """
        from jblast.observations import write

        with writing(directory):
            directory.mkdir(parents=True, exist_ok=True)
            write(directory / "picks.csv", self.picked.observations())
            write_text(directory / "picks.json", self.answer().to_json())


def fit_command(file: str | Path, scene: str | None = None) -> str:
    """Return the command that fits a log in a scene, or without one."""
    words = ["jblast", "fit", str(file), *(["--scene", scene] if scene else [])]
    return shlex.join(words)


def from_records(options: argparse.Namespace) -> FromRecords | None:
    """Return the picked records of a fit; None without `--positions`.

    Raises:
        InputError: A record cannot be read.
    """
    if options.positions is None:
        return None
    from jblast.report.picks import picks_text

    named = options.observations
    # Samples of hours of records fill memory; only the figure of a report needs them.
    of = picked(named, options, keep_samples=options.out is not None)
    text = picks_text(of.found, of.log, tuple(path.name for path in of.left_out))
    if of.found.refused and of.found.picks and not options.json:
        # the refused records end the command with an error: print the others before
        sys.stdout.write(text)
    return FromRecords(of, text)
