"""The logs and the scene of a fit, from tables, files, folders and records.

One table may hold several shots, which are as many logs unless the scene names its
charges. Several files are separate logs, or recordings of one event. With a table of
stations the files are records of samples: they are picked, and the picks are the rows.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from jblast.errors import InputError, argument
from jblast.files import check_log_paths
from jblast.inference.laws import laws_named
from jblast.observations import Observations, read
from jblast.observations.grouping import by_shot, one_event as combined
from jblast.observations.records.formats import Scaling
from jblast.observations.table import RECORD_QUANTITIES, SAMPLES
from jblast.parameters import CLOCK_OFFSET
from jblast.progress import each
from jblast.scene import (
    UncertainScene,
    default_scene,
    freed as with_free,
    read_scene_or_world,
    scene_of,
    with_laws,
)

if TYPE_CHECKING:  # importing picks takes a second, which logs do not need
    from jblast.signals.picks import PickedFiles

Laws = str | Sequence[str] | Mapping[str, str]


class FitInput(NamedTuple):
    """Logs to fit in one scene.

    Attributes:
        logs: Logs by name; the error of a log that cannot be read.
        scene: The common scene, with its free clocks, parameters and laws.
    """

    logs: dict[str, Observations | InputError]
    scene: UncertainScene

    def readable(self) -> dict[str, Observations]:
        """Return the logs that were read."""
        return {k: v for k, v in self.logs.items() if isinstance(v, Observations)}

    def only(self) -> Observations:
        """Return the only log.

        Raises:
            InputError: There are several logs.
        """
        if len(self.logs) > 1:
            raise InputError(
                f"expected one log, got {len(self.logs)} ({', '.join(self.logs)}); "
                "fit each with jblast.fit_each, or give "
                f"{argument('one_event')} if the files are recordings of one event"
            )
        (log,) = self.readable().values()
        return log


def fit_input(
    log: Any,
    scene: UncertainScene | str | os.PathLike[str] | None = None,
    *,
    positions: str | os.PathLike[str] | None = None,
    one_event: bool = False,
    freed: Sequence[str] = (),
    laws: Laws = (),
    scaling: Scaling | None = None,
    high_pass_hz: float | None = None,
    wide: bool = False,
    date: str | None = None,
    zone: str | None = None,
) -> FitInput:
    """Read the logs and the scene of a fit.

    Args:
        log: As for `jblast.fit`; or logs by name.
        scene: As for `jblast.fit`.
        positions: As for `jblast.fit`.
        one_event: As for `jblast.fit`.
        freed: As for `jblast.fit`.
        laws: As for `jblast.fit`.
        scaling: As for `jblast.fit`.
        high_pass_hz: As for `jblast.fit`.
        wide: As for `jblast.read`.
        date: As for `jblast.read`.
        zone: As for `jblast.read`.

    Raises:
        InputError: The only log, or any of one event, cannot be read; a file is a
            scene, a record has no station, or a name means nothing.
    """
    uncertain = scene_named(scene)
    # records are picked here, so that everything below handles tables only
    if positions is not None:
        from jblast.signals.picks import pick_files

        log = pick_files(
            log,
            positions=positions,
            scaling=scaling,
            high_pass_hz=high_pass_hz,
            keep_samples=False,
        )
    logs: dict[str, Observations | InputError]
    if isinstance(log, Observations):
        logs = {log.source or "log": log}
    elif isinstance(log, Mapping):
        logs = dict(log)
        for name, one in logs.items():
            if not isinstance(one, Observations | InputError):
                raise InputError(
                    f"log[{name!r}]: expected observations, got {type(one).__name__}; "
                    "pass columns by name as pandas.DataFrame(log)"
                )
    elif _is_picked(log):
        rows = log.observations()
        if one_event:
            logs, uncertain = _combined([rows], uncertain)
        else:
            (name,) = log_names([rows.source])
            logs = _apart(rows, name, uncertain)
    else:
        sources = list(log) if isinstance(log, list | tuple) else [log]
        check_log_paths(filter(_is_path, sources))
        logs, uncertain = _read(
            sources,
            uncertain,
            one_event,
            wide=wide,
            date=date,
            zone=zone,
        )
    uncertain = with_free(uncertain, freed)
    readable = [one for one in logs.values() if isinstance(one, Observations)]
    # samples of a record have the laws of their four picked quantities
    if laws and readable:
        read_off = {quantity for one in readable for quantity in one.quantity}
        read_off |= set(RECORD_QUANTITIES) if SAMPLES in read_off else set()
        uncertain = with_laws(uncertain, laws_named(_words(laws), read_off))
    return FitInput(logs, uncertain)


def scene_named(
    scene: UncertainScene | str | os.PathLike[str] | None,
) -> UncertainScene:
    """Return the scene of a fit; of a world of random blasts, that of any of them."""
    if scene is None:
        return default_scene()
    if not isinstance(scene, str | os.PathLike):
        return scene_of(scene)
    uncertain, world = read_scene_or_world(scene)
    if world is None:
        return uncertain
    from jblast.world import scene_of_one_blast  # the import takes a second

    return scene_of_one_blast(uncertain, world)


def log_names(sources: Sequence[Any]) -> list[str]:
    """Return names of logs: the stems of their files, or whole paths of equal stems.

    Raises:
        InputError: A file is given twice.
    """
    paths = [
        os.fspath(source) if _is_path(source) else f"log {number}"
        for number, source in enumerate(sources, start=1)
    ]
    stems = [Path(path).stem for path in paths]
    # files of one name in several folders are common: a folder for each shot
    names = [
        stem if stems.count(stem) == 1 else path
        for stem, path in zip(stems, paths, strict=True)
    ]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{name}: expected each log once, got it twice")
    return names


def _read(
    sources: Sequence[Any], uncertain: UncertainScene, together: bool, **dialect: Any
) -> tuple[dict[str, Observations | InputError], UncertainScene]:
    """Read files; an error is stored for a file, unless it is the only one."""
    if together:
        recordings = [read(source, **dialect) for source in each(sources, "files")]
        return _combined(recordings, uncertain)
    logs: dict[str, Observations | InputError] = {}
    for source, name in zip(each(sources, "files"), log_names(sources), strict=True):
        try:
            log = read(source, **dialect)
        except InputError as error:
            # the error of the only file ends the command; of several files the others
            # are fitted
            if len(sources) == 1:
                raise
            logs[name] = error
        else:
            logs |= _apart(log, name, uncertain)
    return logs, uncertain


def _combined(
    logs: Sequence[Observations], uncertain: UncertainScene
) -> tuple[dict[str, Observations | InputError], UncertainScene]:
    """Return recordings of one event as one log, and their clocks free in its scene."""
    whole, clocks = combined(logs)
    free = [f"{CLOCK_OFFSET}.{clock}" for clock in clocks]
    return {whole.source: whole}, with_free(uncertain, free)


def _apart(
    log: Observations, name: str, uncertain: UncertainScene
) -> dict[str, Observations | InputError]:
    """Return one log for each shot, unless the scene names its charges."""
    # a scene with several charges fits all shots of a table together
    shots = {} if len(uncertain.scene.charges) > 1 else by_shot(log)
    if len(shots) < 2:
        return {name: log}
    return {f"{name}: {shot or 'no shot'}": one for shot, one in shots.items()}


def _words(laws: Laws) -> list[str]:
    """Return names of laws as words: QUANTITY=NAME, or NAME for all quantities."""
    if isinstance(laws, Mapping):
        return [f"{quantity}={name}" for quantity, name in laws.items()]
    return [laws] if isinstance(laws, str) else list(laws)


def _is_path(source: Any) -> bool:
    return isinstance(source, str | os.PathLike)


def _is_picked(source: Any) -> "TypeGuard[PickedFiles]":
    """Return True for a source picked from records, without importing picks."""
    # by an attribute: `isinstance` would need the import
    return isinstance(source, tuple) and hasattr(source, "found")
