"""A video's file, opened by PyAV."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jblast.errors import InputError, needed

if TYPE_CHECKING:
    from av.error import FFmpegError

LOCAL = {"protocol_whitelist": "file"}
"""A playlist must not send us to other machines."""


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a video, and find the stream of its pictures.

    Raises:
        InputError: There is no such file; PyAV is not installed; FFmpeg makes nothing
            of it; or it holds no video.
    """
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; expected a video")
    av = needed("av", "video", path, "a video is read")
    try:
        container = av.open(str(path), options=LOCAL)
    except ffmpeg_error() as error:
        raise InputError(
            f"{path}: expected a whole video, which FFmpeg cannot make of it "
            f"({error.strerror})"
        ) from None
    with container:
        streams = [s for s in container.streams.video if not _is_cover(s)]
        if not streams:
            raise InputError(f"{path}: expected a video, got a file without pictures")
        streams[0].thread_type = "AUTO"
        yield container, streams[0]


def _is_cover(stream: Any) -> bool:
    """Return whether a stream is one picture that stands for the file."""
    from av.stream import Disposition

    return bool(stream.disposition & Disposition.attached_pic)


def ffmpeg_error() -> "type[FFmpegError]":
    """Return what PyAV raises; it is imported where it is used."""
    from av.error import FFmpegError

    return FFmpegError
