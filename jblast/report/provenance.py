"""Provenance of a report: command, date, versions, and files by their SHA-256."""

import functools
import hashlib
import platform
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import jax

import jblast
from jblast.observations.covariances import covariance_file


@dataclass(frozen=True)
class SourceFile:
    """A file that went into an answer.

    Attributes:
        name: Its name, without its folder: others will read the report.
        sha256: Of its bytes as they were read, in hexadecimal digits.
    """

    name: str
    sha256: str


@dataclass(frozen=True)
class Provenance:
    """What an answer was made of.

    Attributes:
        command: What was typed; "" where it was called from Python.
        date: When it was begun, UTC, by ISO 8601.
        versions: Of jblast, jax and python.
        logs: The log with its covariances and files of samples, or the recordings that
            it was made of; none where it was made in memory.
        scene: The scene; null where none was read from a file.
        scene_text: Content of the scene's file; "" where there is none.
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
    """Return what an answer is made of; call it before a long fit, of files as read.

    Args:
        logs: The log's file, or files, or the folder that holds them.
        scene: The scene's file; "" where there is none.
        command: The words that were typed, the program first.
    """
    scene_bytes = _bytes(scene)
    # one that is named twice, or stands in a folder that is named, too, is told once
    files = {
        file.resolve(): file for path in logs if path for file in _files(path)
    }.values()
    found = [_source(file) for file in files]
    return Provenance(
        command=shlex.join(command),
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        versions={
            "jblast": jblast.__version__,
            "jax": jax.__version__,
            "python": platform.python_version(),
        },
        logs=tuple(file for file in found if file is not None),
        scene=None if scene_bytes is None else _source(Path(scene)),
        scene_text=""
        if scene_bytes is None
        else scene_bytes.decode("utf-8", "replace"),
    )


def provenance_lines(made: Provenance, what: str = "Log") -> list[str]:
    """Return it in words, but for the text of the scene.

    Args:
        made: The provenance.
        what: What its files are.
    """
    of = ", ".join(f"{name} {version}" for name, version in made.versions.items())
    lines = [f"Command: {made.command}"] if made.command else []
    lines.append(f"Made {made.date} by {of}.")
    if not made.logs:
        lines.append("The log was made in memory.")
    lines += [f"{what}: {_words(file)}" for file in made.logs]
    return lines + ([f"Scene: {_words(made.scene)}"] if made.scene else [])


def _words(file: SourceFile) -> str:
    return f"{file.name}, SHA-256 {file.sha256}"


def _files(path: str | Path) -> list[Path]:
    """Return a log and its covariances, or what a folder holds, by name."""
    try:
        path = Path(path)
        if path.is_dir():
            return sorted(path.iterdir())
        return [path, covariance_file(path)] if path.name else [path]
    except (OSError, ValueError):
        return []


def _bytes(path: str | Path) -> bytes | None:
    """Return what a file holds; None of what is no file that can be read again."""
    try:
        return Path(path).read_bytes() if path and Path(path).is_file() else None
    except OSError:
        return None


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
    """Return what a file is told by: read once, piece by piece, until it changes."""
    del size, changed_ns
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
