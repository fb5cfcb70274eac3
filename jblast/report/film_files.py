"""Output files of a film: frames, video, events and contact sheet.

`film_outputs` checks the options and `cleared` prepares the directory. `FilmWriter`
writes frames block by block, and stores only those of the contact sheet. If the light
is a known function of time and the camera is ideal, the times of events are solved for;
otherwise they are interpolated between many instants (`Stamps`).
"""

import math
import os
from collections.abc import Callable, Iterator, Sequence
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
from jblast.report.figures import INK
from jblast.report.film import FilmEvents, FilmFiles
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.noise import NoiseModel, noisy_stream
from jblast.sensors.camera.events.scene import render_events
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.files.event_files import Written, write_events
from jblast.sensors.camera.files.images import srgb_bytes, write_values
from jblast.sensors.camera.files.recordings import MovingBackground
from jblast.sensors.camera.files.video import check_video, video_writer
from jblast.sensors.camera.film import (
    LIGHT_ERROR,
    STAMP_ERROR,
    Block,
    Film,
    first_instants,
    subdivided,
)
from jblast.sensors.camera.surroundings import Landscape

Mode = Literal["rgb", "events", "both"]
SHOWN_HZ = 30.0
"""Frame rate of the video [1/s], if the camera is faster than a screen."""
SCREEN_HZ = 60.0
"""Frame rate that every screen shows [1/s]."""
SOLVED = 1e-6
"""Error of solved times [s]: the file has whole microseconds."""


@dataclass(frozen=True)
class FilmOutputs:
    """The files of a film.

    Attributes:
        out: Their directory.
        mode: "rgb", "events" or "both".
        suffix: Suffix of the file of events, which sets its format.
        video: The video; None for no video.
        video_hz: Frame rate of the video [1/s].
    """

    out: Path
    mode: Mode
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
        """Return the paths of the files that are written."""
        return FilmFiles(
            frames=None if self.mode == "events" else str(self.frames),
            events=None if self.mode == "rgb" else str(self.events),
            video=None if self.video is None else str(self.video),
            contact_sheet=str(self.sheet),
        )


def film_outputs(
    out: str | os.PathLike[str],
    frames_hz: float,
    *,
    mode: Mode = "both",
    events_format: str = "h5",
    video: str | os.PathLike[str] | None = None,
    video_fps: float | None = None,
) -> FilmOutputs:
    """Return the files of a film.

    Args:
        out: Their directory.
        frames_hz: Frame rate of the camera [1/s].
        mode: Whether frames, events or both are written.
        events_format: "h5", "npz", "raw" or "aedat4".
        video: File of the video, if requested.
        video_fps: Frame rate of the video [1/s]; default: that of the camera, or 30 if
            it is above 60.

    Raises:
        InputError: A video cannot be written, or no frames are written for it.
    """
    if video is None and video_fps is not None:
        raise InputError(
            f"{argument('video_fps')}: expected {argument('video')} with it, got none"
        )
    if video is not None:
        if mode == "events":
            raise InputError(
                f"{argument('video')}: expected {argument('mode')} rgb or both, got "
                "events"
            )
        check_video(os.fspath(video))
    return FilmOutputs(
        out=Path(out),
        mode=mode,
        suffix=f".{events_format}",
        video=None if video is None else Path(video),
        video_hz=video_fps or (SHOWN_HZ if frames_hz > SCREEN_HZ else frames_hz),
    )


def cleared(
    outputs: FilmOutputs, *, force: bool, read: Sequence[str | None] = ()
) -> None:
    """Create the directory, and remove files of an earlier run that will be written.

    Args:
        outputs: The files to be written.
        force: Whether existing files may be replaced.
        read: Input files and directories of the frames; None entries are ignored.

    Raises:
        InputError: It contains such files and `force` is not set, they are inputs, or
            it is not a directory.
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
                f"{file}: expected another {argument('out')}; this file is an input of "
                "the frames, and would be overwritten"
            )
    for file in wanted:
        file.unlink(missing_ok=True)
    (outputs.frames if mode != "events" else out).mkdir(parents=True, exist_ok=True)


def write_film(
    film: Film,
    outputs: FilmOutputs,
    *,
    noise: bool = True,
    seed: int = 0,
    force: bool = False,
    read: Sequence[str | None] = (),
    begin: Callable[[str], object] | None = None,
) -> FilmEvents | None:
    """Write frames, video, events and contact sheet of a film, block by block.

    Args:
        film: The film.
        outputs: The files to be written.
        noise: Whether the camera's noise is included.
        seed: Seed of the noise.
        force: Whether files may be replaced.
        read: Input files and directories of the frames.
        begin: Called with the name of each stage; default: progress is reported.

    Returns:
        The events; None if none are written.

    Raises:
        InputError: The film cannot be rendered, or a file cannot be written.
    """
    lasts = {"filming": 9.0, "finding events": 9.0, "drawing the sheet": 0.5}
    begin = begin or stages(lasts)
    # renders the first block, so that an error comes before any file is removed
    next(film.frames())
    writer, found = FilmWriter(film, outputs), None
    begin("filming")
    with writing(outputs.out):
        cleared(outputs, force=force, read=read)
        writer.write_frames()
        if outputs.mode != "rgb":
            begin("finding events")
            written, stamps = writer.write_events(noise, seed)
            found = FilmEvents(
                threshold=tuple(film.camera.threshold.tolist()),
                noise="on" if noise else "off",
                written=written,
                stamps=stamps.how,
                stamp_error_s=stamps.error_s,
            )
        begin("drawing the sheet")
        writer.write_sheet()
    return found


class Stamps(NamedTuple):
    """Accuracy of the times of events.

    Attributes:
        error_s: Bound [s] for all solved times; for 99 % of interpolated times, found
            by trial for a real camera (`sensors.camera.film.LIGHT_ERROR`).
        how: Name of the computation.
    """

    error_s: float
    how: Literal["solved for", "interpolated"]


def saved(path: Path, frame: np.ndarray) -> np.ndarray:
    """Write a frame of linear light; return its sRGB values of 8 bits."""
    values = srgb_bytes(frame)
    write_values(path, values)
    return values


def finished(
    written: Sequence["Future[np.ndarray]"], add: Callable[[np.ndarray], None] | None
) -> None:
    """Wait for frames that are being written, and add them to a video."""
    for frame in written:
        values = frame.result()
        if add is not None:
            add(values)


@dataclass
class FilmWriter:
    """Writer of a film's files.

    Attributes:
        film: The film.
        outputs: The files to be written.
        shown: Frames stored for the contact sheet, by number.
    """

    film: Film
    outputs: FilmOutputs
    shown: dict[int, np.ndarray] = field(default_factory=dict)

    def write_frames(self) -> None:
        """Write the frames; without frames, render those of the contact sheet only."""
        film = self.film
        times, digits = film.times, max(4, len(str(len(film.times) - 1)))
        bursts = [float(charge.time_s) for charge in film.scene.charges]
        wanted = {*sheet_frames(times, bursts)}
        if self.outputs.mode == "events":
            few = sorted(wanted)
            images = film.some(few)
            self.shown |= dict(zip(few, images, strict=True))
            return
        through, video = counted(len(times), "frames"), self.outputs.video
        with ExitStack() as stack:
            add = None
            if video is not None:
                size = film.camera.width, film.camera.height
                writer = video_writer(video, *size, self.outputs.video_hz)
                add = stack.enter_context(writer)
            pool = stack.enter_context(ThreadPoolExecutor(os.cpu_count()))
            written: list[Future[np.ndarray]] = []
            for which, frames in film.frames():
                # the pool writes one block while the next one is rendered
                finished(written, add)
                numbers = range(which.start, which.stop)
                paths = [self.outputs.frames / f"{n:0{digits}}.png" for n in numbers]
                written = [*map(partial(pool.submit, saved), paths, frames)]
                for number in wanted.intersection(numbers):
                    self.shown[number] = frames[number - which.start]
                through(which.start)
            finished(written, add)
            through(len(times))

    def write_events(self, noise: bool, seed: int) -> tuple[Written, Stamps]:
        """Write the events; return their numbers and the accuracy of their times."""
        film, camera = self.film, self.film.camera
        stamps = Stamps(SOLVED, "solved for")
        # solvable: the law's fireball before a still background, one ray a pixel
        still = film.path is None and not isinstance(film.background, MovingBackground)
        solvable = film.views is None and film.supersample == 1 and still
        if noise or not solvable:
            shape = camera.height, camera.width
            brighter, darker = (float(step) for step in camera.threshold)
            steps = brighter, darker
            stamps = Stamps(STAMP_ERROR, "interpolated")
            light_error = LIGHT_ERROR * min(steps) if noise else math.inf
            blocks = self._instants(min(steps), light_error)
            if noise:
                key = jax.random.key(seed)
                events = noisy_stream(key, blocks, shape, steps, NoiseModel())
            else:
                events = stream_events(blocks, steps)
        else:
            events = [self._solved()]
        start, stop = float(film.times[0]), float(film.times[-1])
        path, size = self.outputs.events, (camera.width, camera.height)
        written = write_events(path, events, *size, duration_s=stop - start)
        return written, stamps

    def _instants(self, threshold: float, light_error: float) -> Iterator[Block]:
        """Yield times from frame 0 on with grey light, and report progress."""
        start, stop = float(self.film.times[0]), float(self.film.times[-1])
        total = max(1, math.ceil(1e3 * (stop - start)))
        through = counted(total, "milliseconds of events")
        for times, light in subdivided(self.film, threshold, light_error=light_error):
            yield times - start, light
            through(1e3 * (times[-1] - start))

    def _solved(self) -> Events:
        """Return the events of an ideal camera, at their times from frame 0 on."""
        film = self.film
        assert not isinstance(film.background, MovingBackground | Landscape)
        events = render_events(
            film.scene,
            film.camera,
            first_instants(film),
            background=film.background,
            depth=film.depth,
            appearance=film.appearance,
            tolerance=0.1 * SOLVED,
        )
        return replace(events, time=events.time - film.times[0])

    def write_sheet(self) -> None:
        """Write the contact sheet of the stored frames."""
        first = min(float(charge.time_s) for charge in self.film.scene.charges)
        numbers = sorted(self.shown)
        labels = [time_label(float(self.film.times[n]) - first) for n in numbers]
        write_contact_sheet(
            self.outputs.sheet, [self.shown[n] for n in numbers], labels
        )


COLUMNS = 4
ROWS = 3
WIDTH = 320
"""Width of a frame on the sheet [px]; frames are enlarged at most twice."""
GAP = 12
"""Space between frames [px]."""
FONT_SIZE = 16
"""Size of the labels [px]."""


def sheet_frames(
    times: Float[np.ndarray, " frame"], bursts: Sequence[float]
) -> list[int]:
    """Return the numbers of the frames to show.

    These are the first frame, and frames whose times since the first visible burst
    increase by equal factors: a fireball grows fast at first, then slowly.
    """
    most = COLUMNS * ROWS
    last = len(times) - 1
    after = [b for b in bursts if times[0] <= b <= times[last]]
    first = int(np.searchsorted(times, min(after, default=times[0]), side="right"))
    left = last - first + 1
    if left < most:
        later = np.arange(first, last + 1)
    else:
        steps = np.geomspace(1.0, left, most - 1)
        # neighbours that round to one frame move up to the next free one
        steps = np.maximum(np.rint(steps), np.arange(1, most))
        later = first - 1 + steps.astype(int)
    return sorted({0, *later.tolist()})[:most]


def write_contact_sheet(
    path: str | Path,
    frames: Sequence[np.ndarray],
    labels: Sequence[str],
) -> None:
    """Write frames of linear light, or of sRGB bytes, in rows, each above its label.

    Args:
        path: Output file; an existing one is replaced.
        frames: Frames of one size, full scale 1.
        labels: Label of each frame.
    """
    from PIL import Image, ImageDraw, ImageFont

    height, width = frames[0].shape[:2]
    across = min(WIDTH, 2 * width)
    size = across, max(1, round(height * across / width))
    columns = min(COLUMNS, len(frames))
    rows = math.ceil(len(frames) / columns)
    cell = across + GAP, size[1] + GAP + FONT_SIZE + 6
    sheet = Image.new("RGB", (columns * cell[0] + GAP, rows * cell[1] + GAP), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_SIZE)
    for k, (frame, label) in enumerate(zip(frames, labels, strict=True)):
        x, y = GAP + k % columns * cell[0], GAP + k // columns * cell[1]
        bytes_ = frame if frame.dtype == np.uint8 else srgb_bytes(frame)
        picture = Image.fromarray(bytes_)
        sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), (x, y))
        draw.text((x, y + size[1] + 3), label, fill=INK, font=font)
    with replacing(path) as temporary:
        sheet.save(temporary, format="PNG")


def time_label(time: float) -> str:
    """Return a time with three digits and its unit: "1.5 ms"."""
    size = abs(time)
    if size >= 1.0:
        return f"{time:.3g} s"
    if size >= 1e-3:
        return f"{1e3 * time:.3g} ms"
    return f"{1e6 * time:.3g} \N{MICRO SIGN}s" if size > 0 else "0"
