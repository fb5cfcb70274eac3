"""Picks of files and folders of pressure records, as rows of a log.

`pick_files` finds the records, reads the table of stations, picks every blast and
makes the rows of a log: what `jblast pick` does, with the same defaults.
"""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from jblast.errors import InputError, argument
from jblast.observations import Observations
from jblast.observations.records.formats import Scaling, record_files
from jblast.observations.records.stations import read_stations
from jblast.progress import Progress, reported
from jblast.results import Note
from jblast.signals.picks.gathered import Gathered, gathered
from jblast.signals.picks.pick_log import PickLog, log_of

MAX_NAMED_FILES = 20
"""Files that the comments of a log name, so that its first line stays readable."""


class PickedFiles(NamedTuple):
    """Picks of files of samples, and the log of their readings.

    Attributes:
        found: The picks.
        log: Their rows.
        files: The records.
        left_out: Other files of the folders.
        named: Files and folders as given by the caller.
        scaling: Scale of the recorders.
        high_pass_hz: Corner of their first-order high-pass [Hz].
    """

    found: Gathered
    log: PickLog
    files: tuple[Path, ...]
    left_out: tuple[Path, ...]
    named: tuple[str, ...]
    scaling: Scaling
    high_pass_hz: float | None

    def comments(self, words: Callable[[str], str] = str) -> list[str]:
        """Return the comment lines of the log: files and settings.

        Args:
            words: Other names of the settings, as those of options.
        """
        names = ", ".join(file.name for file in self.files[:MAX_NAMED_FILES])
        others = len(self.files) - MAX_NAMED_FILES
        more = f" and {others} more" if others > 0 else ""
        settings = (
            ("full_scale_pa", self.scaling.full_scale_pa, "Pa"),
            ("sensitivity", self.scaling.sensitivity, "Pa a volt or count"),
            ("high_pass_hz", self.high_pass_hz, "Hz"),
        )
        return [
            f"jblast pick of {names}{more}",
            *(f"{words(k)} {x:g} {u}" for k, x, u in settings if x is not None),
        ]

    def observations(self) -> Observations:
        """Return the rows, named after the records, for a fit.

        Raises:
            InputError: A file cannot be read, or there is no row.
        """
        if self.found.refused:
            raise refusal_of(self.found.refused)
        if not len(self.log.observations):
            what = "only poor picks" if self.found.picks else "nothing found"
            raise InputError(
                f"{', '.join(self.named)}: expected records of a blast, got {what} in "
                f"{self.found.channels} of them"
            )
        name = Path(self.named[0]).resolve().name
        return replace(self.log.observations, source=name)


@reported("pick_files")
def pick_files(
    records: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    positions: str | os.PathLike[str] | None = None,
    scaling: Scaling | None = None,
    high_pass_hz: float | None = None,
    keep_samples: bool = True,
    trigger: bool = False,
    done: Callable[[PickedFiles], object] | None = None,
    progress: Progress = False,
) -> PickedFiles:
    """Pick the blasts of files and folders of pressure records.

    Args:
        records: Files of any format of `observations.records.formats`, or folders.
        positions: Table of stations (`observations.records.stations`). Without it the
            rows have no positions.
        scaling: Scale of the recorders, where files do not state it.
        high_pass_hz: Corner of their first-order high-pass [Hz].
        keep_samples: True to keep the samples in the picks, for figures.
        trigger: True if the times of all files count from a common trigger, whatever
            their times of day.
        done: Function that is called every ten seconds with the picks so far, as to
            write them: a later error or signal then loses none.
        progress: As for `jblast.fit`.

    Returns:
        Picks and the rows of a log; `jblast.fit` accepts them. Files that cannot be
        read are listed in `found.refused`.

    Raises:
        InputError: No file can be read, or a record has no station.

    Example:
        `jblast.pick_files("records/", positions="stations.csv").log.observations`
    """
    one = isinstance(records, str | os.PathLike)
    named = [records] if one else list(records)
    scaling = scaling or Scaling()
    understood: list[Note] = []
    table = None if positions is None else os.fspath(positions)
    stations = None if table is None else read_stations(table, understood)
    files, left_out = record_files(named, table)

    def with_log(found: Gathered) -> PickedFiles:
        rows = log_of(found, stations)
        names = tuple(os.fspath(one) for one in named)
        of = PickedFiles(found, rows, files, left_out, names, scaling, high_pass_hz)
        log = replace(
            rows.observations,
            comments=tuple(of.comments()),
            understood=tuple(understood),
        )
        return of._replace(log=rows._replace(observations=log))

    def so_far(found: Gathered) -> None:
        # of some files the log may have contradictions that others resolve
        with suppress(InputError):
            assert done is not None
            done(with_log(found))

    found = gathered(
        files,
        scaling,
        high_pass_hz=high_pass_hz,
        keep_samples=keep_samples,
        stations=stations,
        trigger=trigger,
        done=None if done is None else so_far,
    )
    if found.refused and not found.channels:
        raise refusal_of(found.refused)
    return with_log(found)


def refusal_of(refused: Sequence[InputError]) -> InputError:
    """Return the error of one cause, or one error for several."""
    if len(refused) == 1:
        return refused[0]
    messages = "; ".join(error.worded(argument) for error in refused)
    return InputError(f"files cannot be read for {len(refused)} causes: {messages}")
