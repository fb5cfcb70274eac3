"""Output files of a film: frames, video, events and contact sheet.

Frames are written block by block, and only those of the contact sheet are stored.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument
from jblast.files import refuse_existing, replacing, writing
from jblast.progress import counted, stages
from jblast.results import ABSENT, AMONG
from jblast.sensors.camera.files.event_files import Written, write_events
from jblast.sensors.camera.files.images import srgb_bytes, write_values
from jblast.sensors.camera.files.video import check_video, video_writer
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.pixel import NoiseModel
from jblast.sensors.camera.scene_events import film_events

Mode = Literal["rgb", "events", "both"]
SHOWN_HZ, SCREEN_HZ = 30.0, 60.0
"""Frame rate of the video of a camera that is faster than a screen [1/s], and the frame
rate that every screen shows."""
ACROSS, DOWN = 4, 3
"""Frames of a contact sheet."""
FRAME_PX, GAP_PX, FONT_PX = 320, 12, 16
"""Largest width of a frame on it, space between frames, and size of the labels [px].
Small frames are enlarged at most twice."""


@dataclass(frozen=True)
class FilmEvents:
    """The events of a film.

    Attributes:
        threshold: Contrast thresholds of events, brighter and darker (change of the
            logarithm of light).
        noise: Whether the camera's noise is included.
        written: Numbers of events.
        stamps: Computation of their times.
        stamp_error_s: Bound of the error of 99 % of the times.
    """

    threshold: tuple[float, float]
    noise: Literal["on", "off"]
    written: Written = field(metadata=AMONG)
    stamps: Literal["interpolated"]
    stamp_error_s: float


@dataclass(frozen=True)
class FilmFiles:
    """Paths of a film's files.

    Attributes:
        frames: Directory of the frames; absent with `--mode events`.
        events: File of the events; absent with `--mode rgb`.
        video: The video; absent without `--video`.
        contact_sheet: Some of the frames on one page.
    """

    frames: str | None = field(metadata=ABSENT)
    events: str | None = field(metadata=ABSENT)
    video: str | None = field(metadata=ABSENT)
    contact_sheet: str


class WrittenFilm(NamedTuple):
    """A film that was written.

    Attributes:
        files: Paths of its files.
        video_fps: Frame rate of the video [1/s]; None for no video.
        found: Its events; None without them.
    """

    files: FilmFiles
    video_fps: float | None
    found: FilmEvents | None


def write_film(
    film: Film,
    out: str | os.PathLike[str],
    *,
    mode: Mode = "both",
    events_format: str = "h5",
    video: str | os.PathLike[str] | None = None,
    video_fps: float | None = None,
    noise: bool = True,
    seed: int = 0,
    force: bool = False,
    read: Sequence[str | None] = (),
    begin: Callable[[str], object] | None = None,
) -> WrittenFilm:
    """Write frames, video, events and contact sheet of a film, block by block.

    Args:
        film: The film.
        out: Directory of the files.
        mode: Whether frames ("rgb"), events or both are written.
        events_format: "h5", "npz", "raw" or "aedat4".
        video: File of the video, if requested.
        video_fps: Frame rate of the video [1/s]; default: that of the camera, or 30 if
            it is above 60.
        noise: Whether the camera's noise is included.
        seed: Seed of the noise.
        force: Whether files may be replaced.
        read: Input files and directories of the frames; None entries are ignored.
        begin: Called with the name of each stage; default: progress is reported.

    Raises:
        InputError: The film cannot be rendered, or a file cannot be written.
    """
    lasts = {"filming": 9.0, "finding events": 9.0, "drawing the sheet": 0.5}
    begin = begin or stages(lasts)
    _check_video(mode, video, video_fps)
    files = film_files(out, mode=mode, events_format=events_format, video=video)
    if video is not None and video_fps is None:
        video_fps = float(film.camera.frames_hz)
        video_fps = SHOWN_HZ if video_fps > SCREEN_HZ else video_fps
    # renders a frame first, so that an error comes before any file is removed
    film.shot(film.times[:1])
    begin("filming")
    found = None
    bursts = [float(charge.time_s) for charge in film.scene.charges]
    shown = sheet_frames(film.times, bursts)
    with writing(out):
        clear_film(files, force=force, read=read)
        frames = _write_frames(film, files, shown, video_fps)
        if files.events is not None:
            begin("finding events")
            found = _write_events(film, files.events, noise, seed)
        begin("drawing the sheet")
        since = {float(film.times[n]) - min(bursts): frames[n] for n in shown}
        write_contact_sheet(files.contact_sheet, since)
    return WrittenFilm(files, video_fps, found)


def _check_video(mode: Mode, video, video_fps: float | None) -> None:
    if video is None:
        if video_fps is not None:
            raise InputError(
                f"{argument('video_fps')}: expected {argument('video')} with it, got "
                "none"
            )
        return
    if mode == "events":
        raise InputError(
            f"{argument('video')}: expected {argument('mode')} rgb or both, got events"
        )
    check_video(os.fspath(video))


def film_files(
    out: str | os.PathLike[str],
    *,
    mode: Mode = "both",
    events_format: str = "h5",
    video: str | os.PathLike[str] | None = None,
) -> FilmFiles:
    """Return the paths of the files of a film; arguments as of `write_film`."""
    return FilmFiles(
        frames=None if mode == "events" else os.path.join(out, "frames"),
        events=None if mode == "rgb" else os.path.join(out, f"events.{events_format}"),
        video=None if video is None else os.fspath(video),
        contact_sheet=os.path.join(out, "contact_sheet.png"),
    )


def clear_film(
    files: FilmFiles, *, force: bool, read: Sequence[str | None] = ()
) -> None:
    """Create the directory, and remove files of an earlier run that will be written.

    Args:
        files: The files to be written.
        force: Whether existing files may be replaced.
        read: Input files and directories of the frames; None entries are ignored.

    Raises:
        InputError: It contains such files and `force` is not set, they are inputs, or
            it is not a directory.
    """
    out = Path(files.contact_sheet).parent
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: expected a directory, got a file")
    own = [Path(file) for file in (files.contact_sheet, files.events) if file]
    if files.frames is not None:
        own += sorted(Path(files.frames).glob("*.png"))
    whole = [*own, *([] if files.video is None else [Path(files.video)])]
    for file in whole:
        refuse_existing(file, force=force)
    sources = [Path(source).resolve() for source in read if source is not None]
    for file in filter(Path.exists, whole):
        place = file.resolve()
        folders = (place.parent, out.resolve()) if file in own else ()
        if any(s in (place, *folders) for s in sources):
            raise InputError(
                f"{file}: expected another {argument('out')}; this file is an input of "
                "the frames, and would be overwritten"
            )
    for file in own:
        file.unlink(missing_ok=True)
    Path(files.frames or out).mkdir(parents=True, exist_ok=True)


def _write_frames(
    film: Film, files: FilmFiles, shown: Sequence[int], video_fps: float | None
) -> dict[int, np.ndarray]:
    """Write frames and video; return the shown frames by number.

    Without frames only the shown ones are rendered.
    """
    if files.frames is None:
        still = film.gain * film.instants(film.times[shown])
        return dict(zip(shown, still, strict=True))
    folder, count = Path(files.frames), len(film.times)
    through = counted(count, "frames")
    kept: dict[int, np.ndarray] = {}
    with ExitStack() as stack:
        add: Callable[[np.ndarray], None] = lambda values: None  # noqa: E731
        if files.video is not None and video_fps is not None:
            size = film.camera.width, film.camera.height
            add = stack.enter_context(video_writer(files.video, *size, video_fps))
        pool = stack.enter_context(ThreadPoolExecutor(os.cpu_count()))
        written: list[Future[np.ndarray]] = []
        for which, frames in film.frames():
            # the pool writes one block while the next one is rendered
            for frame in written:
                add(frame.result())
            paths = [folder / frame_name(n, count) for n in range(count)[which]]
            written = [*map(partial(pool.submit, _saved), paths, frames)]
            inside = {n for n in shown if which.start <= n < which.stop}
            kept |= {n: frames[n - which.start] for n in inside}
            through(which.start)
        for frame in written:
            add(frame.result())
        through(count)
    return kept


def frame_name(number: int, count: int) -> str:
    """Return the file name of a frame of `count`."""
    return f"{number:0{max(4, len(str(count - 1)))}}.png"


def _saved(path: Path, frame: np.ndarray) -> np.ndarray:
    """Write a frame of linear light; return its sRGB values of 8 bits."""
    values = srgb_bytes(frame)
    write_values(path, values)
    return values


def _write_events(film: Film, path: str, noise: bool, seed: int) -> FilmEvents:
    """Write the events, with times from frame 0 on; return their numbers."""
    camera = film.camera
    start, stop = float(film.times[0]), float(film.times[-1])
    through = counted(max(1, math.ceil(1e3 * (stop - start))), "milliseconds of events")
    brighter, darker = (float(step) for step in camera.threshold)
    events = film_events(
        film,
        noise=NoiseModel() if noise else None,
        key=jax.random.key(seed),
        seen=lambda time: through(1e3 * (time - start)),
    )
    events = (replace(some, time=some.time - start) for some in events)
    size = camera.width, camera.height
    return FilmEvents(
        threshold=(brighter, darker),
        noise="on" if noise else "off",
        written=write_events(path, events, *size, duration_s=stop - start),
        stamps="interpolated",
        stamp_error_s=film.stamp_error_s(noise=noise),
    )


def sheet_frames(
    times: Float[np.ndarray, " frame"], bursts: Sequence[float]
) -> list[int]:
    """Return the numbers of the frames to show.

    These are the first frame, and frames whose times since the first visible burst
    increase by equal factors: a fireball grows fast at first, then slowly.
    """
    most, last = ACROSS * DOWN, len(times) - 1
    after = [b for b in bursts if times[0] <= b <= times[last]]
    first = int(np.searchsorted(times, min(after, default=times[0]), side="right"))
    left = last - first + 1
    if left < most:
        return sorted({0, *range(first, last + 1)})
    steps = np.geomspace(1.0, left, most - 1)
    # neighbours that round to one frame move up to the next free one
    steps = np.maximum(np.rint(steps), np.arange(1, most)).astype(int)
    return sorted({0, *(first - 1 + steps).tolist()})[:most]


def write_contact_sheet(path: str | Path, frames: Mapping[float, np.ndarray]) -> None:
    """Write frames in rows, each above its time.

    Args:
        path: Output file; an existing one is replaced.
        frames: Frames of one size, of linear light (full scale 1) or sRGB bytes, by
            time since the first burst [s].
    """
    from PIL import Image, ImageDraw, ImageFont

    height, width = next(iter(frames.values())).shape[:2]
    across = min(FRAME_PX, 2 * width)
    size = across, max(1, round(height * across / width))
    columns = min(ACROSS, len(frames))
    cell = across + GAP_PX, size[1] + GAP_PX + FONT_PX + 6
    rows = math.ceil(len(frames) / columns)
    whole = columns * cell[0] + GAP_PX, rows * cell[1] + GAP_PX
    sheet = Image.new("RGB", whole, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_PX)
    for k, (time, frame) in enumerate(frames.items()):
        x, y = GAP_PX + k % columns * cell[0], GAP_PX + k // columns * cell[1]
        values = frame if frame.dtype == np.uint8 else srgb_bytes(frame)
        picture = Image.fromarray(values).resize(size, Image.Resampling.LANCZOS)
        sheet.paste(picture, (x, y))
        draw.text((x, y + size[1] + 3), _label(time), fill="#222222", font=font)
    with replacing(path) as temporary:
        sheet.save(temporary, format="PNG")


def _label(time: float) -> str:
    """Return a time with three digits and its unit: "1.5 ms"."""
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "\N{MICRO SIGN}s")):
        if abs(time) >= size:
            return f"{time / size:.3g} {unit}"
    return f"{1e6 * time:.3g} \N{MICRO SIGN}s" if time else "0"
