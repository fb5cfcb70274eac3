"""The answers of `jblast render` and `jblast events`."""

from dataclasses import dataclass, field
from typing import Literal

from jblast.results import ABSENT, AMONG, Document
from jblast.sensors.camera.files.event_files import Written

Switch = Literal["on", "off"]


@dataclass(frozen=True)
class FilmEvents:
    """The events of a film.

    Attributes:
        threshold: Contrast thresholds of events, brighter and darker (change of the
            logarithm of light).
        noise: Whether the camera's noise is included.
        written: Numbers of events.
        stamps: Computation of their times.
        stamp_error_s: Bound of the times' error; if interpolated, of 99 % of them.
    """

    threshold: tuple[float, float]
    noise: Switch
    written: Written = field(metadata=AMONG)
    stamps: Literal["solved for", "interpolated"]
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


@dataclass(frozen=True)
class FilmAnswer(Document):
    """The answer of `jblast render`.

    Attributes:
        scene: The scene's file.
        mode: Kind of the output.
        frames: Number of frames.
        width: Width of a frame [px].
        height: Height of a frame [px].
        fps: Frames per second.
        video_fps: Frames per second of the video; absent without `--video`.
        start_s: Time of the first frame, on the scene's clock.
        duration_s: Time from the first frame to the last.
        seed: Seed of noise and priors.
        found: Its events; None with `--mode rgb`.
        lifted_m: Height above the ground of pictures of a surface burst; absent if
            they stand on the ground, or if there are none.
        files: Paths of the files.
    """

    scene: str
    mode: Literal["rgb", "events", "both"]
    frames: int
    width: int
    height: int
    fps: float
    video_fps: float | None = field(metadata=ABSENT)
    start_s: float
    duration_s: float
    seed: int
    found: FilmEvents | None = field(metadata=AMONG)
    lifted_m: float | None = field(metadata=ABSENT)
    files: FilmFiles


def film_text(answer: FilmAnswer) -> str:
    """Return size, accuracy and paths of a film, for the terminal."""
    summary = (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} "
        f"pixels at {answer.fps:g} Hz from {answer.start_s:g} s"
    )
    if found := answer.found:
        summary += (
            f": {_counts(found.written)}; times {found.stamps}, "
            f"error below {1e6 * found.stamp_error_s:g} us"
        )
        if found.stamps != "solved for":
            summary += " for 99 % of them"
    if answer.lifted_m is not None:
        summary += (
            ".\nWarning: the pictures show a burst on the ground, but this burst is "
            "higher than half its fireball's radius;\nthey are drawn at a height of "
            f"{answer.lifted_m:.3g} m"
        )
    files = answer.files
    where = (files.frames, files.events, _video(answer), files.contact_sheet)
    return "\n".join([summary, *filter(None, where), ""])


def _counts(written: Written) -> str:
    return (
        f"{written.events:,} events, {written.brighter:,} brighter and "
        f"{written.darker:,} darker"
    )


def _video(answer: FilmAnswer) -> str | None:
    """Return the path of the video, and its speed relative to the blast."""
    if answer.video_fps is None:
        return None
    slower = answer.fps / answer.video_fps
    # below half a per cent the ratio prints as 1, to three digits
    if abs(slower - 1) < 5e-3:
        pace = "in real time"
    elif slower > 1:
        pace = f"{slower:.3g} times slower than real time"
    else:
        pace = f"{1 / slower:.3g} times faster than real time"
    return f"{answer.files.video} ({answer.video_fps:g} Hz, {pace})"


def dark_film(share: float, darkest: float) -> str:
    """Return the warning on pixels below the least light that gives events."""
    return (
        f"{100 * share:.2g} % of the pixel values are darker than {darkest:.3g} of "
        "full scale; changes below that level give no events (--darkest sets it)"
    )


@dataclass(frozen=True)
class EventsAnswer(Document):
    """The answer of `jblast events`.

    Attributes:
        frames: Number of frames that were read.
        width: Width of a frame [px].
        height: Height of a frame [px].
        fps: Frames per second.
        duration_s: Time from the first frame to the last.
        threshold: Contrast thresholds of events, brighter and darker (change of the
            logarithm of light).
        srgb: Whether grey values were read as sRGB.
        noise: Whether the camera's noise is included.
        seed: Seed of the noise; null without noise.
        written: Numbers of events.
        bits: Bit depth of the frames; null for floats.
        darkest: Linear light, as a fraction of full scale, below which changes give no
            events.
        below_darkest: Share of the pixel values that are darker than that.
        warnings: Limitations, as sentences.
        out: File of the events.
    """

    frames: int
    width: int
    height: int
    fps: float
    duration_s: float
    threshold: tuple[float, float]
    srgb: bool
    noise: Switch
    seed: int | None
    written: Written = field(metadata=AMONG)
    bits: int | None
    darkest: float
    below_darkest: float
    warnings: tuple[str, ...]
    out: str


def events_text(answer: EventsAnswer) -> str:
    """Return the number of events and their file, for the terminal."""
    return (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} pixels "
        f"over {answer.duration_s:g} s: {_counts(answer.written)}\n"
        f"{answer.out}\n"
    )
