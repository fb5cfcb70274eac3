"""What `jblast render` writes: frames as they come, events, and the contact sheet."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

import jax
import numpy as np

from jblast.cli.arguments.paths import refuse_existing
from jblast.errors import InputError
from jblast.progress import counted
from jblast.report.film.answer import FilmFiles
from jblast.report.film.contact_sheet import (
    sheet_frames,
    time_label,
    write_contact_sheet,
)
from jblast.sensors.camera.events.exact.fireball import render_events
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.events.noise import NoiseModel
from jblast.sensors.camera.events.noisy import noisy_stream
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.files.events import Written, write_events
from jblast.sensors.camera.files.png import write_png
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.instants import (
    LIGHT_ERROR,
    STAMP_ERROR,
    Block,
    first_instants,
    subdivided,
)

FRAMES, EVENTS, SHEET = "frames", "events.h5", "contact_sheet.png"
SOLVED = 1e-6
"""Times in the file are whole microseconds [s]."""


class Stamps(NamedTuple):
    """How good the times of events are.

    Attributes:
        error_s: Bound [s]; of all if they are solved for, else of 99 in 100, of a real
            camera by trial (`instants.LIGHT_ERROR`).
        how: In two words.
    """

    error_s: float
    how: Literal["solved for", "interpolated"]


def is_solvable(film: Film) -> bool:
    """Return whether a film's light is the law's fireball before what stands still."""
    still = not isinstance(film.background, tuple)
    return film.views is None and film.supersample == 1 and still


def cleared(
    out: Path, mode: str, *, force: bool, read: Sequence[str | None] = ()
) -> None:
    """Make the directory, without what an earlier run left of the files to come.

    Args:
        out: The directory.
        mode: "rgb", "events" or "both".
        force: Whether such files may be replaced.
        read: Files and directories that the frames are made from; None if there are
            none.

    Raises:
        InputError: It holds such files and `force` is not set, they are read from, or
            it is no directory.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: expected a directory, got a file")
    wanted = [out / SHEET]
    if mode != "rgb":
        wanted.append(out / EVENTS)
    if mode != "events":
        wanted += sorted((out / FRAMES).glob("*.png"))
    for file in wanted:
        refuse_existing(file, force=force)
    sources = [Path(source).resolve() for source in read if source is not None]
    for file in filter(Path.exists, wanted):
        whole = file.resolve()
        if any(s in (whole, whole.parent, out.resolve()) for s in sources):
            raise InputError(
                f"{file}: expected another --out, as the frames are made from what is "
                "here, and it would be overwritten"
            )
    for file in wanted:
        file.unlink(missing_ok=True)
    (out / FRAMES if mode != "events" else out).mkdir(parents=True, exist_ok=True)


@dataclass
class FilmWriter:
    """A film on its way into a directory.

    Attributes:
        film: What is filmed.
        out: The directory.
        mode: "rgb", "events" or "both".
        shown: Frames kept for the contact sheet, by number.
    """

    film: Film
    out: Path
    mode: str
    shown: dict[int, np.ndarray] = field(default_factory=dict)

    def write_frames(self) -> None:
        """Write the frames; or look only at those of the contact sheet."""
        film = self.film
        times, digits = film.times, max(4, len(str(len(film.times) - 1)))
        wanted = sheet_frames(times, [float(c.time_s) for c in film.scene.charges])
        if self.mode == "events":
            few = sorted(wanted)
            images = film.some(few)
            self.shown |= dict(zip(few, images, strict=True))
            return
        through = counted(len(times), "frames")
        for which, frames in film.frames():
            numbers = range(which.start, which.stop)
            for number, frame in zip(numbers, frames, strict=True):
                write_png(self.out / FRAMES / f"{number:0{digits}}.png", frame)
                if number in wanted:
                    self.shown[number] = frame
            through(which.stop)

    def write_events(self, noise: bool, seed: int) -> tuple[Written, Stamps]:
        """Write the events; and say how good their times are.

        They are solved for where the light is a function of time that we know and the
        camera is ideal; else the light between two of many instants is interpolated.
        """
        film, camera = self.film, self.film.camera
        stamps = Stamps(SOLVED, "solved for")
        if noise or not is_solvable(film):
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
        path, size = self.out / EVENTS, (camera.width, camera.height)
        written = write_events(path, events, *size, duration_s=stop - start)
        return written, stamps

    def _instants(self, threshold: float, light_error: float) -> Iterator[Block]:
        """Return times from frame 0 on and grey light, and tell how far it is."""
        start, stop = float(self.film.times[0]), float(self.film.times[-1])
        total = max(1, math.ceil(1e3 * (stop - start)))
        through = counted(total, "milliseconds of events")
        for times, light in subdivided(self.film, threshold, light_error=light_error):
            yield times - start, light
            through(1e3 * (times[-1] - start))

    def _solved(self) -> Events:
        """Return the events of an ideal camera, at their times from frame 0 on."""
        film = self.film
        assert not isinstance(film.background, tuple)
        events = render_events(
            film.scene,
            film.camera,
            first_instants(film),
            background=film.background,
            tolerance=0.1 * SOLVED,
        )
        return replace(events, time=events.time - film.times[0])

    def write_sheet(self) -> None:
        """Write the contact sheet of the frames that were kept."""
        first = min(float(charge.time_s) for charge in self.film.scene.charges)
        numbers = sorted(self.shown)
        labels = [time_label(float(self.film.times[n]) - first) for n in numbers]
        write_contact_sheet(self.out / SHEET, [self.shown[n] for n in numbers], labels)

    def files(self) -> FilmFiles:
        """Return what is written where."""
        return FilmFiles(
            frames=None if self.mode == "events" else str(self.out / FRAMES),
            events=None if self.mode == "rgb" else str(self.out / EVENTS),
            contact_sheet=str(self.out / SHEET),
        )
