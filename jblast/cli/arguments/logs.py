"""The logs of a fit: read from log files, or picked from records of samples.

One file may hold one log or several shots; several files are separate logs, or
recordings of one event (`--one-event`). With `--positions` the files are records: they
are picked, and the picks are the rows of the log. JAX is imported inside functions
only: --help does not wait for it.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jblast.cli.arguments.numbers import positive
from jblast.cli.arguments.options import in_options, path, writing
from jblast.errors import InputError
from jblast.files import write_text
from jblast.parameters import CLOCK_OFFSET
from jblast.progress import each

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jblast.inference.fitting.fit import Fit
    from jblast.observations import Observations
    from jblast.observations.records.formats import RecordFiles, Scaling
    from jblast.observations.table import Understood
    from jblast.report.provenance import Provenance
    from jblast.scene import UncertainScene
    from jblast.signals.picks import Gathered, PickLog

    Logs = dict[str, Observations | InputError]

WALK = "walk"
"""Folder within `--out` in which a walk is kept."""


def logs_of(
    files: Sequence[str],
    uncertain: "UncertainScene",
    reader: "Callable[[str], Observations]",
    *,
    together: bool,
) -> "tuple[Logs, UncertainScene]":
    """Read the logs, and take them apart or put them together.

    A log of several shots is as many logs, unless the scene names its charges.

    Args:
        files: What to read.
        uncertain: The scene of all of them.
        reader: Reads one of them.
        together: Whether the files are recordings of one event.

    Returns:
        Logs by name, or why one cannot be read; and the scene, its clocks free where
        the recordings are of one event.

    Raises:
        InputError: The only log, or any of one event, cannot be read, or a file is a
            scene.
    """
    from jblast.observations.grouping import by_shot, one_event
    from jblast.scene import freed

    for file in files:
        if Path(file).suffix.lower() == ".toml":
            raise InputError(f"{file}: expected a log; a scene stands after --scene")
    if together:
        whole, clocks = one_event([reader(file) for file in each(files, "files")])
        free = [f"{CLOCK_OFFSET}.{clock}" for clock in clocks]
        return {whole.source: whole}, freed(uncertain, free)
    logs: Logs = {}
    for file, name in zip(each(files, "files"), _names(files), strict=True):
        try:
            log = reader(file)
        except InputError as error:
            if len(files) == 1:
                raise
            logs[name] = error
            continue
        shots = {} if uncertain.scene.others else by_shot(log)
        if len(shots) < 2:
            logs[name] = log
        else:
            logs |= {f"{name}: {shot or 'no shot'}": of for shot, of in shots.items()}
    return logs, uncertain


def each_made(
    made: "Provenance", logs: Iterable[str], files: Sequence[str]
) -> "dict[str, Provenance]":
    """Return what the answer of each log is made of: its own file among all.

    Args:
        made: What all are made of.
        logs: Names of logs, as `logs_of` gives them.
        files: What they were read from, if not from all together.
    """
    from jblast.report.provenance import provenance_of

    if not files:
        return dict.fromkeys(logs, made)
    own = {
        name: replace(made, logs=provenance_of([file]).logs)
        for name, file in zip(_names(files), files, strict=True)
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
    import json

    from jblast.report.fit.terminal import answers_csv, answers_document

    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        document = answers_document(answers, made, picks)
        text = json.dumps(document, indent=1, allow_nan=False)
        write_text(directory / "fits.json", text + "\n")
        write_text(directory / "answers.csv", answers_csv(answers))


def only_a_walk(directory: Path) -> bool:
    """Return whether a directory holds an earlier walk and nothing else."""
    return directory.is_dir() and [p.name for p in directory.iterdir()] == [WALK]


def _names(files: Sequence[str]) -> list[str]:
    """Name logs after their files, by the whole path where that is needed."""
    stems = [Path(file).stem for file in files]
    names = [
        stem if stems.count(stem) == 1 else file
        for stem, file in zip(stems, files, strict=True)
    ]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{name}: expected each log once, got it twice")
    return names


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
) -> "tuple[Gathered, PickLog, RecordFiles]":
    """Read and pick the records that are named, and make the rows of a log.

    Args:
        named: Files and folders.
        asked: What `add_records` added.
        keep_samples: Whether picks keep their samples, to be drawn.

    Raises:
        InputError: Nothing can be read, or a record has no station.
    """
    from jblast.observations.records.formats import record_files
    from jblast.observations.records.stations import read_stations
    from jblast.signals.picks import gathered, log_of

    read_as: list[Understood] = []
    stations = read_stations(asked.positions, read_as) if asked.positions else None
    found_files = record_files(named, asked.positions)
    found = gathered(
        found_files.files,
        scaling_of(asked),
        high_pass_hz=asked.high_pass,
        keep_samples=keep_samples,
        stations=stations,
    )
    found = found._replace(refused=tuple(map(in_options, found.refused)))
    if found.refused and not found.channels:
        raise refusal(found)
    log = log_of(found, stations, _provenance(found_files.files, asked))
    rows = replace(log.observations, understood=tuple(read_as))
    return found, log._replace(observations=rows), found_files


class FromRecords(NamedTuple):
    """A log that was picked, and what it was picked from.

    Attributes:
        log: The rows.
        found: The picks.
        text: What was picked, in words.
    """

    log: "PickLog"
    found: "Gathered"
    text: str

    def figure(self) -> "Figure":
        """Draw the records."""
        from jblast.report.pick_figures import records_figure

        return records_figure(self.found.named(), self.found.picks)

    def document(self) -> dict[str, Any]:
        """Return what `jblast pick --json` would print."""
        from jblast.report.picks import picks_document

        return picks_document(self.found, self.log)

    def write(self, directory: Path) -> None:
        """Write log and document into a folder of a report.

        Raises:
            InputError: It cannot be written.
        """
        import json

        from jblast.observations import write

        text = json.dumps(
            self.document(), indent=2, ensure_ascii=False, allow_nan=False
        )
        with writing(directory):
            directory.mkdir(parents=True, exist_ok=True)
            write(directory / "picks.csv", self.log.observations)
            write_text(directory / "picks.json", text + "\n")


def check_folders(named: list[str], asked: argparse.Namespace) -> None:
    """Refuse a folder of records without positions, before anything is started.

    Raises:
        InputError: As said.
    """
    folders = [name for name in named if Path(name).is_dir()]
    if folders and asked.positions is None:
        raise InputError(
            f"{folders[0]}: is a folder; of records it takes --positions STATIONS.csv "
            "beside it, where they stood"
        )


def from_records(named: list[str], asked: argparse.Namespace) -> FromRecords | None:
    """Return the log of records that a fit is asked of; None if it is asked of logs.

    It is asked of records where positions are given.

    Raises:
        InputError: A record cannot be read, or none holds a bang.
    """
    if asked.positions is None:
        return None
    from jblast.report.picks import picks_text

    found, log, files = picked(named, asked, keep_samples=asked.out is not None)
    text = picks_text(found, log, tuple(path.name for path in files.left_out))
    if found.refused:
        if found.picks and not asked.json:
            sys.stdout.write(text)  # of the others
        raise refusal(found)
    if not len(log.observations):
        what = "nothing found" if not found.picks else "only poor picks"
        raise InputError(
            f"{', '.join(named)}: expected records of a blast, got {what} in "
            f"{found.channels} of them"
        )
    name = Path(named[0]).resolve().name
    observations = replace(log.observations, source=name)
    return FromRecords(log._replace(observations=observations), found, text)


def scene_of_records(log: "Observations") -> "UncertainScene":
    """Return the default scene, with what the stations can tell free.

    What that is, is what a scene to start from would leave free (`starter_scene`).
    """
    import tomllib

    from jblast.observations import starter_scene
    from jblast.observations.grouping import by_shot
    from jblast.scene import Free, default_scene, freed
    from jblast.scene.reader.scene import scene_from_document

    one = max(by_shot(log).values(), key=len)
    alone = replace(one, shot=("",) * len(one))
    starter = scene_from_document(tomllib.loads(starter_scene(alone)), "starter scene")
    free = [
        name for name, belief in starter.beliefs.items() if isinstance(belief, Free)
    ]
    default = default_scene()
    return freed(default, [name for name in free if name not in default.beliefs])


def refusal(found: "Gathered") -> InputError:
    """Return the one error that says which files were refused, and why."""
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
