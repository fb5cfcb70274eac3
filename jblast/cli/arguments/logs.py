"""Which logs a fit is of: one, several, the shots of one, or one event's recordings."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jblast.cli.arguments.paths import writing
from jblast.errors import InputError
from jblast.files import write_text
from jblast.inference.fitting.result import Fit
from jblast.observations import Observations, read
from jblast.observations.grouping import by_shot, one_event
from jblast.observations.table import SAMPLES
from jblast.parameter_table import CLOCK_OFFSET
from jblast.progress import each
from jblast.report.provenance import Provenance, provenance_of
from jblast.scene import UncertainScene, freed

WALK = "walk"
"""Folder within `--out` in which a walk is kept."""

Logs = dict[str, Observations | InputError]


def logs_of(
    files: Sequence[str],
    uncertain: UncertainScene,
    reader: Callable[[str], Observations] = read,
    *,
    together: bool,
) -> tuple[Logs, UncertainScene]:
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
    made: Provenance, logs: Iterable[str], files: Sequence[str]
) -> dict[str, Provenance]:
    """Return what the answer of each log is made of: its own file among all.

    Args:
        made: What all are made of.
        logs: Names of logs, as `logs_of` gives them.
        files: What they were read from, if not from all together.
    """
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


def made_with_samples(made: Provenance, log: Observations | InputError) -> Provenance:
    """Return what an answer is made of, with the files of samples that its log names.

    Args:
        made: Without them.
        log: The log; one that could not be read names none.
    """
    if isinstance(log, InputError):
        return made
    files = [
        Path(log.source).parent / name
        for quantity, name in zip(log.quantity, log.records(), strict=True)
        if quantity == SAMPLES
    ]
    return replace(made, logs=(*made.logs, *provenance_of(files).logs))


def write_answers(
    answers: dict[str, Fit | InputError],
    directory: Path,
    made: Mapping[str, Provenance],
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
