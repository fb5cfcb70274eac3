"""What `jblast render` writes: frames as they come, events, and the contact sheet."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jax
import numpy as np

from jblast.cli.files import refuse_existing
from jblast.errors import InputError
from jblast.progress import counted
from jblast.report.contact_sheet import sheet_frames, time_label, write_contact_sheet
from jblast.sensors.camera.event_files import Written, write_events
from jblast.sensors.camera.event_stream import stream_events
from jblast.sensors.camera.film import Film, Frames
from jblast.sensors.camera.grey_composite import luminance
from jblast.sensors.camera.imperfections import Imperfections
from jblast.sensors.camera.png_files import write_png
from jblast.sensors.camera.real_events import real_stream

FRAMES, EVENTS, SHEET = "frames", "events.h5", "contact_sheet.png"


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
class Recording:
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

    def blocks(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Write the frames of each block, then give its times and grey light.

        Times count from frame 0.
        """
        times = self.film.times
        digits = max(4, len(str(len(times) - 1)))
        wanted = sheet_frames(times, [float(c.time) for c in self.film.scene.charges])
        through = counted(len(times), "frames")
        for which, frames, sensed in self._seen():
            numbers = range(which.start, which.stop)
            for number, frame in zip(numbers, frames, strict=True):
                if self.mode != "events":
                    write_png(self.out / FRAMES / f"{number:0{digits}}.png", frame)
                if number in wanted:
                    self.shown[number] = frame
            yield times[which] - times[0], luminance(sensed)
            through(which.stop)

    def _seen(self) -> Iterator[tuple[slice, Frames, Frames]]:
        """Return blocks: which frames, what is to be looked at, what makes events."""
        film = self.film
        if self.mode == "events":
            film = film.at_instants()
        if self.mode != "both" or float(film.camera.exposure_s) == 0.0:
            for which, frames in film.frames():
                yield which, frames, frames
            return
        pairs = zip(film.frames(), film.at_instants().frames(), strict=True)
        for (which, frames), (_, sensed) in pairs:
            yield which, frames, sensed

    def write_events(self, noise: bool, seed: int) -> Written:
        """Write the events, and the frames on the way."""
        camera = self.film.camera
        shape = camera.height, camera.width
        brighter, darker = (float(step) for step in camera.threshold)
        steps = brighter, darker
        if noise:
            key = jax.random.key(seed)
            events = real_stream(key, self.blocks(), shape, steps, Imperfections())
        else:
            events = stream_events(self.blocks(), steps)
        times = self.film.times
        return write_events(
            self.out / EVENTS,
            events,
            camera.width,
            camera.height,
            duration_s=float(times[-1] - times[0]),
        )

    def write_sheet(self) -> None:
        """Write the contact sheet of the frames that were kept."""
        first = min(float(charge.time) for charge in self.film.scene.charges)
        numbers = sorted(self.shown)
        labels = [time_label(float(self.film.times[n]) - first) for n in numbers]
        write_contact_sheet(self.out / SHEET, [self.shown[n] for n in numbers], labels)

    def files(self) -> dict[str, str]:
        """Return what is written where."""
        frames = {} if self.mode == "events" else {"frames": self.out / FRAMES}
        events = {} if self.mode == "rgb" else {"events": self.out / EVENTS}
        written = {**frames, **events, "contact_sheet": self.out / SHEET}
        return {name: str(path) for name, path in written.items()}
