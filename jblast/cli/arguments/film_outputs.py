"""What `jblast render` is asked to write, and where."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jblast.cli.arguments.paths import refuse_existing
from jblast.errors import InputError
from jblast.report.film import FilmFiles
from jblast.sensors.camera.files.video.write import check_video

SHOWN_HZ = 30.0
"""Frames of a video a second, where the camera has more than screens show."""

SCREEN_HZ = 60.0
"""Frames a second that any screen shows."""


@dataclass(frozen=True)
class FilmOutputs:
    """The files of a film.

    Attributes:
        out: Their directory.
        mode: "rgb", "events" or "both".
        suffix: Of the file of events: its format.
        video: The video; None if there is to be none.
        video_hz: Its frames a second.
    """

    out: Path
    mode: str
    suffix: str
    video: Path | None
    video_hz: float

    @property
    def frames(self) -> Path:
        """Directory of the frames."""
        return self.out / "frames"

    @property
    def events(self) -> Path:
        """File of the events."""
        return self.out / f"events{self.suffix}"

    @property
    def sheet(self) -> Path:
        """The contact sheet."""
        return self.out / "contact_sheet.png"

    def files(self) -> FilmFiles:
        """Return what is written where."""
        return FilmFiles(
            frames=None if self.mode == "events" else str(self.frames),
            events=None if self.mode == "rgb" else str(self.events),
            video=None if self.video is None else str(self.video),
            contact_sheet=str(self.sheet),
        )


def outputs_asked(asked: argparse.Namespace, frames_hz: float) -> FilmOutputs:
    """Return what a command line asks to be written.

    Args:
        asked: The options.
        frames_hz: Of the camera.

    Raises:
        InputError: A video cannot be written, or has no frames to be made of.
    """
    if asked.video is None and asked.video_fps is not None:
        raise InputError("--video-fps: expected --video with it, got none")
    if asked.video is not None:
        if asked.mode == "events":
            raise InputError("--video: expected --mode rgb or both, got events")
        check_video(asked.video)
    return FilmOutputs(
        out=Path(asked.out),
        mode=asked.mode,
        suffix=f".{asked.events_format}",
        video=None if asked.video is None else Path(asked.video),
        video_hz=asked.video_fps or (SHOWN_HZ if frames_hz > SCREEN_HZ else frames_hz),
    )


def cleared(
    outputs: FilmOutputs, *, force: bool, read: Sequence[str | None] = ()
) -> None:
    """Make the directory, without what an earlier run left of the files to come.

    Args:
        outputs: What is to come.
        force: Whether such files may be replaced.
        read: Files and directories that the frames are made from; None if there are
            none.

    Raises:
        InputError: It holds such files and `force` is not set, they are read from, or
            it is no directory.
    """
    out, mode = outputs.out, outputs.mode
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: expected a directory, got a file")
    wanted = [outputs.sheet]
    if mode != "rgb":
        wanted.append(outputs.events)
    if mode != "events":
        wanted += sorted(outputs.frames.glob("*.png"))
    whole = [*wanted, *([] if outputs.video is None else [outputs.video])]
    for file in whole:
        refuse_existing(file, force=force)
    sources = [Path(source).resolve() for source in read if source is not None]
    for file in filter(Path.exists, whole):
        place = file.resolve()
        folders = (place.parent, out.resolve()) if file in wanted else ()
        if any(s in (place, *folders) for s in sources):
            raise InputError(
                f"{file}: expected another --out, as the frames are made from what is "
                "here, and it would be overwritten"
            )
    for file in wanted:
        file.unlink(missing_ok=True)
    (outputs.frames if mode != "events" else out).mkdir(parents=True, exist_ok=True)
