"""Provenance of a report: command, date, versions, and files by their SHA-256."""

import functools
import hashlib
import platform
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import jblast
from jblast.observations.covariances import covariance_file


@dataclass(frozen=True)
class SourceFile:
    """An input file of an answer.

    Attributes:
        name: Its name without its folder, which a passed-on report should not show.
        sha256: SHA-256 of its bytes as they were read, in hexadecimal digits.
    """

    name: str
    sha256: str


@dataclass(frozen=True)
class Provenance:
    """Provenance of an answer.

    Attributes:
        command: The command; "" if it was called from Python.
        date: Start of the computation, UTC, ISO 8601.
        versions: Versions of jblast, jax and python.
        logs: The log with its covariances and files of samples, or its recordings;
            empty if it was made in memory.
        scene: The scene; null if none was read from a file.
        scene_text: Content of the scene's file; "" if there is none.
    """

    command: str
    date: str
    versions: Mapping[str, str]
    logs: tuple[SourceFile, ...]
    scene: SourceFile | None
    scene_text: str


def provenance_of(
    logs: Sequence[str | Path] = (),
    scene: str | Path = "",
    command: Sequence[str] = (),
) -> Provenance:
    """Return the provenance of an answer.

    Call it before a long computation, so that the hashes are those of the files read.

    Args:
        logs: The log's file or files, or the folder that contains them.
        scene: The scene's file; "" if there is none.
        command: The words of the command, the program first.
    """
    # text and hash date from before the computation: the file may change meanwhile
    try:
        known = bool(scene) and Path(scene).is_file()
        scene_bytes = Path(scene).read_bytes() if known else None
    except OSError:
        scene_bytes = None
    # by the resolved path: a file given twice, or with its folder, is listed once
    files = {
        file.resolve(): file for path in logs if path for file in _files(path)
    }.values()
    found = [_source(file) for file in files]
    return Provenance(
        command=shlex.join(command),
        # seconds: provenance needs no more, and files differ less
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        versions={
            "jblast": jblast.__version__,
            "jax": version("jax"),
            "python": platform.python_version(),
        },
        logs=tuple(file for file in found if file is not None),
        scene=None if scene_bytes is None else _source(Path(scene)),
        scene_text=""
        if scene_bytes is None
        else scene_bytes.decode("utf-8", "replace"),
    )


def provenance_lines(made: Provenance, kind: str = "Log") -> list[str]:
    """Return the provenance as sentences, without the text of the scene.

    Args:
        made: The provenance.
        kind: Kind of its files.
    """
    of = ", ".join(f"{name} {version}" for name, version in made.versions.items())
    lines = [f"Command: {made.command}"] if made.command else []
    lines.append(f"Made {made.date} by {of}.")
    if not made.logs:
        lines.append("The log was made in memory.")
    lines += [f"{kind}: {_words(file)}" for file in made.logs]
    return lines + ([f"Scene: {_words(made.scene)}"] if made.scene else [])


def _words(file: SourceFile) -> str:
    return f"{file.name}, SHA-256 {file.sha256}"


def _files(path: str | Path) -> list[Path]:
    """Return a log and its covariances, or the files of a folder, sorted by name."""
    try:
        path = Path(path)
        if path.is_dir():
            return sorted(path.iterdir())
        # a log and its covariances are read together: both decide the answer
        return [path, covariance_file(path)] if path.name else [path]
    # a source made in memory can be any text; a null byte raises ValueError
    except (OSError, ValueError):
        return []


def _source(path: Path) -> SourceFile | None:
    try:
        if not path.is_file():
            return None
        now = path.stat()
        return SourceFile(path.name, _sha256(path, now.st_size, now.st_mtime_ns))
    except OSError:
        return None


@functools.lru_cache
def _sha256(path: Path, size: int, changed_ns: int) -> str:
    """Return the SHA-256 of a file, computed again only if size or time changes."""
    del size, changed_ns
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
