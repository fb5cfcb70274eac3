"""Options of records, and output files of a fit.

With `--positions` the files of a fit are records of samples, which are picked first.
JAX is imported inside functions only: --help does not wait for it.
"""

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jblast.cli.arguments.numbers import positive
from jblast.cli.arguments.options import in_options, option_for, path
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

WALK = "walk"
"""Folder within `--out` in which a walk is kept."""


def each_made(
    made: "Provenance", logs: Iterable[str], files: Sequence[str]
) -> "dict[str, Provenance]":
    """Return what the answer of each log is made of: its own file among all.

    Args:
        made: What all are made of.
        logs: Names of logs, as `fit_input` returns them.
        files: What they were read from, if not from all together.
    """
    from jblast.inference.fitting.fit_input import log_names
    from jblast.report.provenance import provenance_of

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
        if log == name or log.startswith(f"{name}: ")
    }


def made_with_samples(
    made: "Provenance", log: "Observations | InputError"
) -> "Provenance":
    """Return what an answer is made of, with the files of samples that its log names.

    Args:
        made: Without them.
        log: The log; one that could not be read names none.
    """
    from jblast.observations.table import SAMPLES
    from jblast.report.provenance import provenance_of

    if isinstance(log, InputError):
        return made
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
        answers: By log.
        directory: Where to; made if it is not there.
        made: What each was made of.
        picks: What the logs were picked from, if they were.

    Raises:
        InputError: The directory cannot be written to.
    """
    from jblast.report.fit.document import fits_answer
    from jblast.report.fit.terminal import answers_csv

    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        text = fits_answer(answers, made, picks).to_json()
        write_text(directory / "fits.json", text)
        write_text(directory / "answers.csv", answers_csv(answers))


def only_a_walk(directory: Path) -> bool:
    """Return whether a directory holds an earlier walk and nothing else."""
    return directory.is_dir() and [p.name for p in directory.iterdir()] == [WALK]


def add_records(verb: argparse.ArgumentParser) -> None:
    """Let a verb take the options that `picked` heeds."""
    verb.add_argument(
        "--positions",
        metavar="STATIONS.csv",
        type=path,
        help="where the sensors stood: sensor (stem of a file's name, or stem.channel, "
        "from 1), east_m, north_m, up_m or lat_deg, lon_deg, alt_m, perhaps clock, and "
        "start_utc, when the first sample of a file was that does not say so",
    )
    add_scale(verb)


def add_scale(verb: argparse.ArgumentParser) -> None:
    """Let a verb take what is said of recorders: `scaling_of`, and `high_pass`."""
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


def scaling_of(asked: argparse.Namespace) -> "Scaling":
    """Return what was said of the recorders' scale."""
    from jblast.observations.records.formats import Scaling

    return Scaling(asked.full_scale, asked.sensitivity)


def picked(
    named: list[str], asked: argparse.Namespace, *, keep_samples: bool
) -> "PickedFiles":
    """Pick the named records, their messages in words of the command line.

    Args:
        named: Files and folders.
        asked: The options of `add_records`.
        keep_samples: Whether picks keep their samples, for figures.

    Raises:
        InputError: Nothing can be read, or a record has no station.
    """
    from jblast.signals.picks import pick_files

    of = pick_files(
        named,
        positions=asked.positions,
        scaling=scaling_of(asked),
        high_pass_hz=asked.high_pass,
        keep_samples=keep_samples,
    )
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
        picked: The picks, and their log.
        text: The picks in words.
    """

    picked: "PickedFiles"
    text: str

    def figure(self) -> "Figure":
        """Draw the records."""
        from jblast.report.pick_figures import records_figure

        found = self.picked.found
        return records_figure(found.named(), found.picks)

    def answer(self) -> "PicksAnswer":
        """Return what `jblast pick` would print."""
        from jblast.report.picks import picks_answer

        return picks_answer(self.picked.found, self.picked.log)

    def write(self, directory: Path) -> None:
        """Write log and document into a folder of a report.

        Raises:
            InputError: It cannot be written.
        """
        from jblast.observations import write

        with writing(directory):
            directory.mkdir(parents=True, exist_ok=True)
            write(directory / "picks.csv", self.picked.observations())
            write_text(directory / "picks.json", self.answer().to_json())


def from_records(asked: argparse.Namespace) -> FromRecords | None:
    """Return the picked records of a fit; None for a fit of logs, without positions.

    Raises:
        InputError: A record cannot be read.
    """
    if asked.positions is None:
        return None
    from jblast.report.picks import picks_text

    named = asked.observations
    of = picked(named, asked, keep_samples=asked.out is not None)
    text = picks_text(of.found, of.log, tuple(path.name for path in of.left_out))
    if of.found.refused and of.found.picks and not asked.json:
        sys.stdout.write(text)  # of the others
    return FromRecords(of, text)
